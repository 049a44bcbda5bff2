#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"
#include "rt/passes/pass_id.h"

namespace hpr {

struct ExrLayer;
struct LightOutput;
struct View;

/// Values of a pixel beside its color (arbitrary output variables). The parts of the light, the cost and the coverage
/// are means over the samples; the others are those of the first sample, as their mean would be neither surface's.
enum class Aov : std::uint8_t {
  Depth,   ///< depth.Z: metres along the view axis; infinite where nothing is seen
  Id,      ///< id.X: the surface id, an unsigned integer; 2^32 - 1 where nothing is seen
  Normal,  ///< normal.X, Y, Z: world, unit length
  Albedo,  ///< albedo.R, G, B: the base colour
  Direct,  ///< the first of kComponents parts of the radiance (Component), which add up to it but for rounding
  Rank = Direct + kComponents,  ///< rank.X: which rank lit the pixel
  Cost,                         ///< cost.X: rays traced for the pixel
  Coverage,                     ///< coverage.X: the fraction of the pixel that surfaces cover
};

inline constexpr std::size_t kAovs = static_cast<std::size_t>(Aov::Coverage) + 1;

[[nodiscard]] std::string_view name_of(Aov aov);
/// Every name, in the order of the enumeration.
[[nodiscard]] std::vector<std::string_view> aov_names();
/// "depth,id": throws Error (Usage) for unknown names, with the choices. Sorted, each once.
[[nodiscard]] std::vector<Aov> parse_aovs(const std::string& list);

/// Whether it is one of the parts that add up to the colour.
[[nodiscard]] constexpr bool is_part(Aov aov) {
  return aov >= Aov::Direct && aov < Aov::Rank;
}
/// Whether the shader fills a layer of three floats for it.
[[nodiscard]] constexpr bool has_rgb(Aov aov) {
  return aov >= Aov::Normal && aov < Aov::Rank;
}
/// Whether it comes from the keys.
[[nodiscard]] constexpr bool needs_keys(Aov aov) {
  return aov == Aov::Depth || aov == Aov::Id;
}

/// The layers of a frame beside its radiance, those that are wanted.
struct AovLayers {
  std::map<Aov, TileLayer<Rgb>> rgb;
  std::map<Aov, TileLayer<float>> single;  ///< Rank, Cost, Coverage

  AovLayers() = default;
  AovLayers(const FrameLayout& layout, std::span<const Aov> wanted);

  /// Null where coverage is not wanted.
  [[nodiscard]] const TileLayer<float>* coverage() const;

  /// Where the shader is to put them, beside `radiance`.
  [[nodiscard]] LightOutput output(TileLayer<Rgb>& radiance);
};

/// One screen's values, row by row, as the channels of an EXR file. `view`: of the screen or a block of it.
[[nodiscard]] ExrLayer to_exr(Aov aov, const Image<Rgb>& values);
[[nodiscard]] ExrLayer to_exr(Aov aov, const Image<float>& values);
[[nodiscard]] ExrLayer to_exr(Aov aov, const Image<Key>& keys, const View& view);

}  // namespace hpr
