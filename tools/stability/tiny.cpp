#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "cluster/distribution/assignment.h"
#include "tools/stability/cases.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr std::uint32_t kCells = 707;  // a side: 999 698 triangles
constexpr Size kSize{256, 256};
constexpr int kFirst = 65;  // pixels [65, 127) of each side, inside one tile
constexpr int kPixels = 62;

/// `kCells` x `kCells` squares of two triangles, of side 1 / kCells.
Mesh fine_grid() {
  Mesh mesh;
  for (std::uint32_t row = 0; row <= kCells; ++row) {
    for (std::uint32_t column = 0; column <= kCells; ++column) {
      mesh.positions.emplace_back(glm::dvec3(column, row, 0.0) / static_cast<double>(kCells));
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  }
  for (std::uint32_t row = 0; row < kCells; ++row) {
    for (std::uint32_t column = 0; column < kCells; ++column) {
      const std::uint32_t a = row * (kCells + 1) + column;
      const std::uint32_t b = a + kCells + 1;
      mesh.triangles.emplace_back(a, a + 1, b + 1);
      mesh.triangles.emplace_back(a, b + 1, b);
    }
  }
  return mesh;
}

/// Over a square of `pixels` from pixel (first, first) of a view of slope 1, counted from below, a metre away.
glm::dmat4 over_pixels(int first, int pixels) {
  const double side = 2.0 / kSize.width;
  const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {-1.0 + first * side, -1.0 + first * side, -1.0});
  return glm::scale(moved, glm::dvec3(pixels * side, pixels * side, 1.0));
}

/// Pixels that are open though inside, covered though outside, or show a cell that does not hold their centre.
std::size_t wrong_pixels(const Image<Key>& keys) {
  std::size_t wrong = 0;
  constexpr double kCellsPerPixel = static_cast<double>(kCells) / kPixels;
  constexpr double kSnap = kCellsPerPixel / 256.0;
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const Key key = keys.at(x, kSize.height - 1 - y);
      const bool inside = x >= kFirst && x < kFirst + kPixels && y >= kFirst && y < kFirst + kPixels;
      if ((key != kNoKey) != inside) {
        ++wrong;
      } else if (inside) {
        const std::uint32_t cell = key_surface(key) / 2;
        const auto off = [&](int pixel, std::uint32_t at) {
          const double center = (pixel - kFirst + 0.5) * kCellsPerPixel;
          return center < at - kSnap || center > at + 1.0 + kSnap;
        };
        wrong += off(x, cell % kCells) || off(y, cell / kCells) ? 1U : 0U;
      }
    }
  }
  return wrong;
}

/// The largest share of `parts` over the mean, in chunks of neighbouring triangles.
double most_over_mean(const Scene& scene, int parts, std::uint32_t chunk) {
  std::uint32_t most = 0;
  for (const auto& ranges : partition_objects(scene, parts, chunk)) {
    std::uint32_t count = 0;
    for (const SurfaceRange& range : ranges) count += range.count();
    most = std::max(most, count);
  }
  return (most - static_cast<double>(scene.triangles) / parts) / chunk;
}

}  // namespace

std::vector<StabilityFinding> tiny(const Globals& globals) {
  Drawer drawer(globals);
  Scene scene;
  add(scene, fine_grid(), over_pixels(kFirst, kPixels));
  finish_scene(scene);
  StabilityFinding pixels;
  pixels.name = "tiny/pixels";
  pixels.parameter = fmt::format("{} triangles, each 1/130 of a pixel, in one tile", scene.triangles);
  pixels.unit = "pixels open, covered or shown wrongly";
  pixels.measured = static_cast<double>(wrong_pixels(drawer.draw(scene, head_on(kSize, 1.0, 0.01))));
  pixels.why = "Every centre lies in a cell but for 1/256 pixel of snapping.";

  StabilityFinding balance;
  balance.name = "tiny/balance";
  balance.parameter = "the same, and the same over all the screen, shared out to 2 .. 512 ranks";
  balance.unit = "chunks of 512 triangles above the mean, largest share";
  balance.limit = 1.5;
  balance.why =
      "Halving whole chunks is off by half a chunk a level, halved by each level below: 1 chunk, and the last.";
  balance.curve.x = "ranks";
  Scene spread = scene;
  spread.instances[0].to_world = over_pixels(0, kSize.width);
  finish_scene(spread);
  for (int ranks = 2; ranks <= 512; ranks = ranks * 3 / 2 + 1) {
    const double worst = std::max(most_over_mean(scene, ranks, 512), most_over_mean(spread, ranks, 512));
    balance.curve.points.emplace_back(ranks, worst);
    balance.measured = std::max(balance.measured, worst);
  }
  return {pixels, balance};
}

}  // namespace hpr::stability
