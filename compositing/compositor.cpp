#include "compositing/compositor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <utility>

#include "cluster/transport/communicator_wrappers.h"
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

/// A strategy that merges neighbours in rank, on ranks numbered from front to back.
template <typename Pixel, typename Schedule>
class BlenderOf final : public Blender<Pixel> {
 public:
  explicit BlenderOf(std::string_view name, Schedule schedule = {}) : name_(name), schedule_(std::move(schedule)) {}

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] bool fits(int ranks) const override {
    if constexpr (requires { schedule_.fits(ranks); }) {
      return schedule_.fits(ranks);
    } else {
      return ranks >= 1;
    }
  }
  [[nodiscard]] bool merges_in_place() const override { return false; }

  Composited blend(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                   std::span<const int> order, std::span<const int> shown_by) override {
    RenumberedCommunicator ordered(comm, order);
    std::vector<int> shown_at;
    for (const int rank : shown_by) {
      shown_at.push_back(static_cast<int>(std::ranges::find(order, rank) - order.begin()));
    }
    return schedule_.run(ordered, layer, tiles, shown_at);
  }

 private:
  std::string name_;
  Schedule schedule_;
};

/// Shared memory looks after the order itself: where ranks are does not change with it.
template <typename Pixel>
class BlenderInPlace final : public Blender<Pixel> {
 public:
  [[nodiscard]] std::string_view name() const override { return "shared-memory"; }
  [[nodiscard]] bool fits(int ranks) const override { return ranks >= 1; }
  [[nodiscard]] bool merges_in_place() const override { return true; }

  Composited blend(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                   std::span<const int> order, std::span<const int> shown_by) override {
    (void)RenumberedCommunicator(comm, order);  // refuses what is no order
    return schedule_.run(comm, layer, tiles, order, shown_by);
  }

 private:
  SharedMemorySchedule<Pixel> schedule_;
};

template <typename Pixel, typename Schedule>
std::unique_ptr<Blender<Pixel>> blender_of(std::string_view name, Schedule schedule = {}) {
  return std::make_unique<BlenderOf<Pixel, Schedule>>(name, std::move(schedule));
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

template <typename Pixel>
std::vector<std::unique_ptr<Blender<Pixel>>> all_blenders() {
  std::vector<std::unique_ptr<Blender<Pixel>>> all;
  all.push_back(blender_of<Pixel, SerialSchedule<Pixel>>("serial"));
  all.push_back(blender_of<Pixel, TreeSchedule<Pixel>>("tree"));
  all.push_back(blender_of<Pixel, BinarySwapSchedule<Pixel>>("binary-swap"));
  all.push_back(blender_of<Pixel, RadixKSchedule<Pixel>>("radix-k"));
  all.push_back(blender_of<Pixel, DirectSendSchedule<Pixel>>("direct-send"));
  all.push_back(std::make_unique<BlenderInPlace<Pixel>>());
  return all;
}

template <typename Pixel>
std::unique_ptr<Blender<Pixel>> make_blender(std::string_view name) {
  std::vector<std::string> choices;
  for (auto& blender : all_blenders<Pixel>()) {
    if (blender->name() == name) return std::move(blender);
    choices.emplace_back(blender->name());
  }
  constexpr std::string_view kGivenFactors = "radix-k:";
  if (name.starts_with(kGivenFactors)) {
    const std::string_view factors = name.substr(kGivenFactors.size());
    return blender_of<Pixel>(name, RadixKSchedule<Pixel>(parse_radix_factors(factors)));
  }
  const auto compositors = all_compositors();
  if (std::ranges::any_of(compositors, [&](const auto& compositor) { return compositor->name() == name; })) {
    throw Error(ExitCode::Usage,
                fmt::format("strategy '{}' is none of those that keep the order of the layers, as `over` needs", name),
                fmt::format("choices: {}", fmt::join(choices, ", ")));
  }
  throw Error(ExitCode::Usage, fmt::format("no compositing strategy is named '{}'", printable(name)),
              unknown_name_hint(printable(name), choices));
}

template std::vector<std::unique_ptr<Blender<Rgba8Premultiplied>>> all_blenders();
template std::vector<std::unique_ptr<Blender<RgbaPremultiplied>>> all_blenders();
template std::unique_ptr<Blender<Rgba8Premultiplied>> make_blender(std::string_view);
template std::unique_ptr<Blender<RgbaPremultiplied>> make_blender(std::string_view);

}  // namespace hpr
