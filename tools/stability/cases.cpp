#include "tools/stability/cases.h"

#include <array>

namespace hpr {

std::span<const StabilityCase> all_stability_cases() {
  using namespace stability;
  static const std::array cases{
      // Geometry, rasterisation and frames.
      StabilityCase{"depth-order", "pairs of close surfaces from 1 mm to 10 000 km: the nearer one is seen",
                    depth_order},
      StabilityCase{"crossing", "two planes that cross at a small angle: the line lies where it should",
                    crossing_planes},
      StabilityCase{"coplanar", "64 surfaces in one plane: the picture is the same on any ranks, by any strategy",
                    coplanar},
      StabilityCase{"slivers", "fans, strips and T-junctions: every pixel is covered exactly once", slivers},
      StabilityCase{"slanted", "ground to the horizon: what its depth resolves", slanted_planes},
      StabilityCase{"offset", "scene and eye far from the origin: the picture stays", offset},
      StabilityCase{"scale", "scenes of micrometres and of thousands of kilometres: the picture stays", scale},
      StabilityCase{"nodes", "chains of nodes that cancel out: the placement stays", nodes},
      StabilityCase{"frusta", "the eye nears the plane of a screen: its corners stay", frusta},
      StabilityCase{"giant", "triangles of 1e9 m, ground to the horizon, an eye almost on a wall", giant},
      StabilityCase{"tiny", "a million triangles in one tile: what is seen, and how they are shared out", tiny},
      StabilityCase{"degenerate", "points, doubles, segments and needles in a mesh: it looks as without", degenerate},
      StabilityCase{"layers", "64 translucent layers in any order: the exact mixture", layers},
      StabilityCase{"frames", "frames and messages past 2^31 bytes", frames},
      // Light.
      StabilityCase{"watertight", "rays aimed at shared edges and vertices of a closed mesh: none gets through",
                    watertight},
      StabilityCase{"acne", "light at 89.9 degrees and covers close above floors: no false shadow, no leak", acne},
      StabilityCase{"accumulator", "a million samples of a pixel: what the film's sums lose", accumulator},
      StabilityCase{"photons", "photons from none to more than 32 bits count: senders change no bit, no light is lost",
                    photons},
      StabilityCase{"mirrors", "facing mirrors: radiance falls by the same share at every reflection", mirrors},
      StabilityCase{"lights", "lights on a surface, as small as a point, at the horizon", lights},
      StabilityCase{"materials", "roughness and index at their ends: no energy is made, nothing jumps", materials},
      StabilityCase{"not-finite", "NaN and infinities in files and sums: refused or counted, never shown", not_finite},
  };
  return cases;
}

}  // namespace hpr
