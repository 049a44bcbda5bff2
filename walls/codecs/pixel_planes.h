#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "image/color.h"

namespace hpr {

/// A cheap reversible filter before general compressors: pixels become four planes, r - g, g, b - g and a, each byte
/// less the one before it (all modulo 256). On a rendered frame zstd takes a third less for it than for plain pixels.
/// `planes` has four bytes a pixel.
void split_planes(std::span<const Rgba8> pixels, std::span<std::uint8_t> planes);
void join_planes(std::span<const std::uint8_t> planes, std::span<Rgba8> pixels);

/// Every r, g and b as the number of the step of 2 error + 1 it is nearest to, and back: within `error` of what it was.
/// Alpha stays.
void quantize(std::span<const Rgba8> pixels, int error, std::span<Rgba8> steps);
void dequantize(std::span<const Rgba8> steps, int error, std::span<Rgba8> pixels);

/// No r, g or b differs by more than `error`, and no alpha at all. Equal counts.
[[nodiscard]] bool all_within(std::span<const Rgba8> a, std::span<const Rgba8> b, int error);

}  // namespace hpr
