#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "rt/denoise/denoiser.h"
#include "rt/denoise/pixel_parts.h"
#include "rt/lighter.h"
#include "rt/passes/half_resolution.h"
#include "rt/passes/pass.h"

namespace hpr {

/// The memory one thread needs for a tile. Kept from tile to tile: fresh pages would cost a tenth of the time.
struct Scratch {
  Scratch(TileWork tile_work, std::size_t times) : work(std::move(tile_work)), ms(times, 0.0) {}
  TileWork work;
  SharedLight shared;
  Denoiser denoiser;
  PartFinder finder;
  std::vector<std::vector<PathPoint>> waiting;  ///< by depth
  Wave wave;
  std::vector<double> ms;
};

/// Sums of so many pixels, tile after tile, made 0 where they are wanted, which is everywhere when the mask is empty.
inline void clear_sums(std::vector<glm::dvec3>& sums, std::size_t pixels, std::span<const std::uint8_t> wanted) {
  if (wanted.empty()) {
    sums.assign(pixels, glm::dvec3(0.0));
    return;
  }
  sums.resize(pixels);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    if (wanted[pixel % kTilePixels] != 0) sums[pixel] = glm::dvec3(0.0);
  }
}

/// What all steps took so far.
[[nodiscard]] inline double spent_ms(const Scratch& scratch) {
  return std::accumulate(scratch.ms.begin(), scratch.ms.end(), 0.0);
}

/// Clears what samples of tile `index` are summed in. With `parts` components too; as a denoiser needs it, also what of
/// it is matte, and room for a tile's pixels more.
inline void clear(TileWork& tile, std::size_t index, std::span<const LitSample> samples, bool parts, bool denoises) {
  const LightOutput& output = samples.front().output;  // all want the same
  tile.wants_components =
      parts || std::ranges::any_of(output.components, [](const auto* layer) { return layer != nullptr; });
  tile.wants_matte = denoises;
  tile.wants_cost = output.cost != nullptr;
  const std::span<const std::uint8_t> wanted = mask_of(samples.front().wanted, index);
  const std::size_t pixels = (samples.size() + (denoises ? 1 : 0)) * kTilePixels;
  clear_sums(tile.radiance, pixels, wanted);
  if (tile.wants_matte) clear_sums(tile.matte, pixels, wanted);
  for (std::size_t i = 0; tile.wants_components && i < kComponents; ++i) {
    clear_sums(tile.components.at(i), pixels, wanted);
    if (tile.wants_matte) clear_sums(tile.matte_components.at(i), pixels, wanted);
  }
  if (tile.wants_cost) tile.cost.assign(pixels, 0.0F);
  for (const LitSample& sample : samples) {
    for (TileLayer<Rgb>* layer : {sample.output.normal, sample.output.albedo}) {
      if (layer != nullptr) std::ranges::fill(layer->tile(index), Rgb{});
    }
  }
}

/// While rays travel, more threads wait for theirs than there are: of the time that was spent, each step has its share.
inline void share_out(double spent_ms, std::vector<double>& ms) {
  const double sum = std::accumulate(ms.begin(), ms.end(), 0.0);
  for (double& step : ms) step *= sum > 0.0 ? spent_ms / sum : 0.0;
}

}  // namespace hpr
