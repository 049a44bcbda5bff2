#include "compositing/compositor.h"

#include <fmt/format.h>

#include <string>

#include "compositing/strategies/auto.h"
#include "compositing/strategies/binary_swap.h"
#include "compositing/strategies/direct_send.h"
#include "compositing/strategies/mpi_reduce.h"
#include "compositing/strategies/radix_k.h"
#include "compositing/strategies/ring.h"
#include "compositing/strategies/serial.h"
#include "compositing/strategies/shared_memory.h"
#include "compositing/strategies/tree.h"
#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

/// What register_compositor was given: state of the program, as its list of strategies is.
std::vector<MakeCompositor>& registered() {
  static std::vector<MakeCompositor> all;
  return all;
}

}  // namespace

void register_compositor(MakeCompositor make) {
  const auto added = make();
  const std::string name(added->name());
  if (name.empty() || name.find_first_of(",: ") != std::string::npos) {
    throw Error(ExitCode::BadInput, fmt::format("'{}' cannot be the name of a strategy", printable(name)),
                "take letters, digits and hyphens");
  }
  for (const auto& compositor : all_compositors()) {
    if (compositor->name() != name) continue;
    throw Error(ExitCode::BadInput, fmt::format("there is a strategy named '{}' already", printable(name)));
  }
  registered().push_back(std::move(make));
}

std::vector<std::unique_ptr<Compositor>> all_compositors() {
  std::vector<std::unique_ptr<Compositor>> all;
  all.push_back(std::make_unique<Serial>());
  all.push_back(std::make_unique<Tree>());
  all.push_back(std::make_unique<BinarySwap>());
  all.push_back(std::make_unique<RadixK>());
  all.push_back(std::make_unique<DirectSend>());
  all.push_back(std::make_unique<Ring>());
  all.push_back(std::make_unique<SharedMemory>());
  all.push_back(std::make_unique<MpiReduce>());
  all.push_back(std::make_unique<Auto>());
  for (const MakeCompositor& make : registered()) all.push_back(make());
  return all;
}

std::unique_ptr<Compositor> make_compositor(std::string_view name) {
  std::vector<std::string> choices;
  for (auto& compositor : all_compositors()) {
    if (compositor->name() == name) return std::move(compositor);
    choices.emplace_back(compositor->name());
  }
  constexpr std::string_view kGivenFactors = "radix-k:";
  if (name.starts_with(kGivenFactors)) return std::make_unique<RadixK>(name.substr(kGivenFactors.size()));
  throw Error(ExitCode::Usage, fmt::format("no compositing strategy is named '{}'", printable(name)),
              unknown_name_hint(printable(name), choices));
}

}  // namespace hpr
