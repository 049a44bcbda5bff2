#include "engine/aov.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "core/error.h"
#include "core/text.h"
#include "image/image_io.h"
#include "rt/deferred_shader.h"
#include "rt/passes/pass_list.h"

namespace hpr {
namespace {

constexpr std::uint32_t kNothingSeen = 0xFFFFFFFFU;

Aov aov_of(Component component) {
  return static_cast<Aov>(static_cast<std::size_t>(Aov::Direct) + static_cast<std::size_t>(component));
}

std::vector<std::string> channels(Aov aov, std::string_view letters) {
  std::vector<std::string> names;
  for (const char letter : letters) names.push_back(fmt::format("{}.{}", name_of(aov), letter));
  return names;
}

}  // namespace

std::string_view name_of(Aov aov) {
  if (is_part(aov)) {
    return name_of(static_cast<Component>(static_cast<std::size_t>(aov) - static_cast<std::size_t>(Aov::Direct)));
  }
  constexpr std::array<std::string_view, 4> kFirst{"depth", "id", "normal", "albedo"};
  constexpr std::array<std::string_view, 3> kLast{"rank", "cost", "coverage"};
  if (aov < Aov::Direct) return kFirst.at(static_cast<std::size_t>(aov));
  return kLast.at(static_cast<std::size_t>(aov) - static_cast<std::size_t>(Aov::Rank));
}

std::vector<std::string_view> aov_names() {
  std::vector<std::string_view> names;
  names.reserve(kAovs);
  for (std::size_t i = 0; i < kAovs; ++i) names.push_back(name_of(static_cast<Aov>(i)));
  return names;
}

std::vector<Aov> parse_aovs(const std::string& list) {
  const std::vector<std::string_view> names = aov_names();
  std::vector<Aov> aovs;
  for (const std::string& name : split_words(list)) {
    const auto found = std::ranges::find(names, name);
    if (found == names.end()) {
      const std::vector<std::string> choices(names.begin(), names.end());
      throw Error(ExitCode::Usage, fmt::format("unknown AOV '{}'", printable(name)), unknown_name_hint(name, choices));
    }
    aovs.push_back(static_cast<Aov>(found - names.begin()));
  }
  std::ranges::sort(aovs);
  aovs.erase(std::unique(aovs.begin(), aovs.end()), aovs.end());
  return aovs;
}

AovLayers::AovLayers(const FrameLayout& layout, std::span<const Aov> wanted) {
  for (const Aov aov : wanted) {
    if (has_rgb(aov)) {
      rgb.emplace(aov, layout);
    } else if (!needs_keys(aov)) {
      single.emplace(aov, layout);
    }
  }
}

const TileLayer<float>* AovLayers::coverage() const {
  const auto found = single.find(Aov::Coverage);
  return found == single.end() ? nullptr : &found->second;
}

LightOutput AovLayers::output(TileLayer<Rgb>& radiance) {
  LightOutput out;
  out.radiance = &radiance;
  const auto find = [&](Aov aov) {
    const auto found = rgb.find(aov);
    return found == rgb.end() ? nullptr : &found->second;
  };
  for (std::size_t i = 0; i < kComponents; ++i) {
    out.components.at(i) = find(aov_of(static_cast<Component>(i)));
  }
  out.normal = find(Aov::Normal);
  out.albedo = find(Aov::Albedo);
  const auto find_single = [&](Aov aov) {
    const auto found = single.find(aov);
    return found == single.end() ? nullptr : &found->second;
  };
  out.cost = find_single(Aov::Cost);
  out.coverage = find_single(Aov::Coverage);
  return out;
}

ExrLayer to_exr(Aov aov, const Image<Rgb>& values) {
  ExrLayer layer{channels(aov, aov == Aov::Normal ? "XYZ" : "RGB"), {}, {}};
  layer.values.reserve(values.pixels().size() * 3);
  for (const Rgb& value : values.pixels()) layer.values.insert(layer.values.end(), {value.r, value.g, value.b});
  return layer;
}

ExrLayer to_exr(Aov aov, const Image<float>& values) {
  return {channels(aov, "X"), {values.pixels().begin(), values.pixels().end()}, {}};
}

ExrLayer to_exr(Aov aov, const Image<Key>& keys, const View& view) {
  HPR_CHECK(needs_keys(aov));
  ExrLayer layer{channels(aov, aov == Aov::Depth ? "Z" : "X"), {}, {}};
  for (const Key key : keys.pixels()) {
    if (aov == Aov::Id) {
      layer.integers.push_back(key == kNoKey ? kNothingSeen : key_surface(key));
    } else {
      layer.values.push_back(key == kNoKey
                                 ? std::numeric_limits<float>::infinity()
                                 : static_cast<float>(view_distance(view, static_cast<double>(key_depth(key)))));
    }
  }
  return layer;
}

}  // namespace hpr
