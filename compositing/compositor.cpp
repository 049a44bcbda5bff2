#include "compositing/compositor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "compositing/strategies/strategy.h"
#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

std::span<const Strategy> all_strategies() {
#define HPR_CALL_STRATEGY(name) name##_strategy(),
  static const std::array all{HPR_STRATEGIES(HPR_CALL_STRATEGY)};
#undef HPR_CALL_STRATEGY
  return all;
}

/// What register_compositor was given: state of the program, as its list of strategies is.
std::vector<MakeCompositor>& registered() {
  static std::vector<MakeCompositor> all;
  return all;
}

/// The strategy whose name stands before a colon in `written_name`, if there is one that takes parameters; else null.
const Strategy* strategy_with_parameters(std::string_view written_name) {
  const std::size_t colon = written_name.find(':');
  if (colon == std::string_view::npos) return nullptr;
  for (const Strategy& strategy : all_strategies()) {
    if (strategy.takes_parameters && strategy.name == written_name.substr(0, colon)) return &strategy;
  }
  return nullptr;
}

template <typename Product>
std::vector<std::string> names_of(const std::vector<std::unique_ptr<Product>>& products) {
  std::vector<std::string> names;
  for (const auto& product : products) names.emplace_back(product->name());
  return names;
}

[[noreturn]] void refuse_unknown(std::string_view name, std::span<const std::string> choices) {
  throw Error(ExitCode::Usage, fmt::format("no compositing strategy is named '{}'", printable(name)),
              unknown_name_hint(printable(name), choices));
}

template <typename Pixel>
Strategy::Make<Blender<Pixel>> blender_maker(const Strategy& strategy) {
  if constexpr (std::is_same_v<Pixel, Rgba8Premultiplied>) {
    return strategy.make_rgba8_blender;
  } else {
    return strategy.make_rgba_blender;
  }
}

}  // namespace

void register_compositor(MakeCompositor make) {
  const auto added = make();
  const std::string name(added->name());
  if (name.empty() || name.find_first_of(",: ") != std::string::npos) {
    throw Error(ExitCode::BadInput, fmt::format("'{}' cannot be the name of a strategy", printable(name)),
                "take letters, digits and hyphens");
  }
  if (has_compositor(name)) {
    throw Error(ExitCode::BadInput, fmt::format("there is a strategy named '{}' already", printable(name)),
                "give it another name");
  }
  registered().push_back(std::move(make));
}

std::vector<std::unique_ptr<Compositor>> all_compositors() {
  std::vector<std::unique_ptr<Compositor>> all;
  for (const Strategy& strategy : all_strategies()) all.push_back(strategy.make_compositor(strategy.name));
  for (const MakeCompositor& make : registered()) all.push_back(make());
  return all;
}

bool has_compositor(std::string_view name) {
  return strategy_with_parameters(name) != nullptr ||
         std::ranges::any_of(all_compositors(), [&](const auto& compositor) { return compositor->name() == name; });
}

std::unique_ptr<Compositor> make_compositor(std::string_view name) {
  auto all = all_compositors();
  for (auto& compositor : all) {
    if (compositor->name() == name) return std::move(compositor);
  }
  if (const Strategy* const strategy = strategy_with_parameters(name)) return strategy->make_compositor(name);
  refuse_unknown(name, names_of(all));
}

std::string cheapest_compositor(const Costs& costs, const Load& load, bool collects, bool in_place) {
  std::string name;
  double least = 0.0;
  for (const auto& compositor : all_compositors()) {
    if (compositor->name() == "auto" || !compositor->fits(costs.ranks)) continue;
    if (compositor->merges_in_place() && !in_place) continue;
    const auto prediction = compositor->predict(costs, load);
    if (!prediction) continue;
    const double seconds = collects ? prediction->collected(costs, load) : prediction->composite;
    if (!name.empty() && seconds >= least) continue;
    name = compositor->name();
    least = seconds;
  }
  HPR_CHECK(!name.empty());
  return name;
}

template <typename Pixel>
std::vector<std::unique_ptr<Blender<Pixel>>> all_blenders() {
  std::vector<std::unique_ptr<Blender<Pixel>>> all;
  for (const Strategy& strategy : all_strategies()) {
    if (const auto make = blender_maker<Pixel>(strategy)) all.push_back(make(strategy.name));
  }
  return all;
}

template <typename Pixel>
std::unique_ptr<Blender<Pixel>> make_blender(std::string_view name) {
  auto all = all_blenders<Pixel>();
  for (auto& blender : all) {
    if (blender->name() == name) return std::move(blender);
  }
  const std::vector<std::string> choices = names_of(all);
  if (const Strategy* const strategy = strategy_with_parameters(name)) {
    if (const auto make = blender_maker<Pixel>(*strategy)) return make(name);
  }
  if (!has_compositor(name)) refuse_unknown(name, choices);
  throw Error(ExitCode::Usage,
              fmt::format("strategy '{}' is none of those that keep the order of the layers, as `over` needs", name),
              fmt::format("choices: {}", fmt::join(choices, ", ")));
}

template std::vector<std::unique_ptr<Blender<Rgba8Premultiplied>>> all_blenders();
template std::vector<std::unique_ptr<Blender<RgbaPremultiplied>>> all_blenders();
template std::unique_ptr<Blender<Rgba8Premultiplied>> make_blender(std::string_view);
template std::unique_ptr<Blender<RgbaPremultiplied>> make_blender(std::string_view);

}  // namespace hpr
