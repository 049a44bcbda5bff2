#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"

namespace hpr {

/// How a rank's synthetic layer covers the image.
enum class SyntheticKind {
  Dense,    ///< every pixel
  Half,     ///< one rectangle of half the pixels, somewhere
  Sparse,   ///< one disc of a tenth of the pixels, somewhere
  Scatter,  ///< each pixel with probability 1/2, independently: the worst case for run lengths
  Checker,  ///< every other pixel
};
[[nodiscard]] std::string_view name_of(SyntheticKind kind);
[[nodiscard]] const std::vector<SyntheticKind>& all_synthetic_kinds();
/// Throws Error (Usage) with the choices and the nearest one.
[[nodiscard]] SyntheticKind parse_synthetic_kind(std::string_view name);

/// The layer `rank` contributes: integer arithmetic only, the same bits on every machine, so the composited frame has a
/// hash known in advance. Depth is smooth noise of 64-pixel pitch, distinct for ranks 0..254 at every pixel; colour is
/// one hue per rank. Keys carry the colour: make_color_key(1 - depth, rgba).
[[nodiscard]] TileLayer<Key> synthetic_layer(SyntheticKind kind, int rank, Size size, std::uint32_t seed);

/// The picture of synthetic_layer at `screen` times `grid` pixels, cut into grid.width x grid.height screens: row after
/// row from the top.
[[nodiscard]] TileLayer<Key> synthetic_wall(SyntheticKind kind, int rank, Size screen, Size grid, std::uint32_t seed);

/// Draws `rank` over every pixel, at one depth: a full layer that costs nothing to make.
void draw_everywhere(TileLayer<Key>& layer, int rank);

/// The layout of `grid` equal screens, in the order of synthetic_wall.
[[nodiscard]] FrameLayout grid_layout(Size screen, Size grid);

}  // namespace hpr
