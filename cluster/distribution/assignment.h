#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/tiles.h"
#include "scene/scene.h"

namespace hpr {

/// How the work of a frame is dealt to the ranks.
enum class Distribution {
  SortFirst,   ///< each rank draws the whole scene, culled to its own tiles
  SortMiddle,  ///< each rank culls its share of the scene to all tiles; their owners draw what was found for them
  SortLast,    ///< each rank draws its own objects over the whole frame; keys are composited
  Hybrid,      ///< groups of ranks own tiles (sort-first), ranks of a group share the objects (sort-last)
};
inline constexpr std::array kDistributions{Distribution::SortFirst, Distribution::SortMiddle, Distribution::SortLast,
                                           Distribution::Hybrid};
[[nodiscard]] std::string_view name_of(Distribution distribution);
/// The names of kDistributions: "sort-first, sort-last, ...".
[[nodiscard]] std::string distribution_names();
/// Whether each rank has tiles of its own, which it alone draws: nothing is composited.
[[nodiscard]] constexpr bool draws_alone(Distribution distribution) {
  return distribution == Distribution::SortFirst || distribution == Distribution::SortMiddle;
}
/// Throws Error (Usage) with the choices and `further` ones that the caller has.
[[nodiscard]] Distribution parse_distribution(std::string_view name, std::span<const std::string> further = {});

/// A rectangle of one screen, its edges on tile borders or the screen's edge.
struct ScreenRect {
  std::size_t screen = 0;
  Rect pixels;

  bool operator==(const ScreenRect&) const = default;
};

/// The screens cut into `weights.size()` areas of rectangles, area i with about weights[i] of the tiles' sum: halved
/// recursively, whole screens first, then along the longer side at a tile border, with a step of one row where a
/// straight cut would be unfair. An area may be empty when there are more areas than tiles. Every tile lies in exactly
/// one area.
[[nodiscard]] std::vector<std::vector<ScreenRect>> assign_tiles(const FrameLayout& layout,
                                                                const std::vector<int>& weights);

/// The triangles of a scene cut into `parts` shares, balanced by triangle count to one chunk and spatially coherent:
/// chunks of at most `chunk` neighbouring triangles are halved recursively about the longest axis of their centres.
/// Ranges of a share ascend. The same on every rank. Of a scene that is shared out, its own parts.
[[nodiscard]] std::vector<std::vector<SurfaceRange>> partition_objects(const Scene& scene, int parts,
                                                                       std::uint32_t chunk = kPartChunk);

/// Neighboring triangles that stay together.
struct ObjectChunk {
  SurfaceRange surfaces;
  glm::dvec3 center{0.0};
};
/// Partitions chunks as partition_objects does those of a scene.
[[nodiscard]] std::vector<std::vector<SurfaceRange>> partition_chunks(std::vector<ObjectChunk> chunks, int parts);

/// Which ranks form which group: contiguous, sizes differing by one at most.
[[nodiscard]] std::vector<std::vector<int>> make_groups(int ranks, int groups);

/// The number of groups of tiles that hybrid distribution has where the user names none and they do not follow the
/// view: about the square root of the ranks.
[[nodiscard]] int default_groups(int ranks);

/// What one rank does in a frame.
struct Assignment {
  std::vector<int> group;             ///< the ranks that composite together, this one among them
  std::vector<SurfaceRange> objects;  ///< what this rank draws
  std::vector<ScreenRect> area;       ///< where this rank draws: its group's tiles
};

/// The tiles of some rectangles, ascending.
[[nodiscard]] std::vector<std::size_t> tiles_of(const FrameLayout& layout, std::span<const ScreenRect> area);

/// The rectangles that an area has on one screen.
[[nodiscard]] std::vector<Rect> parts_of(std::span<const ScreenRect> area, std::size_t screen);

/// Every rank's assignment, computed alike on all ranks. `groups` counts for Hybrid only.
[[nodiscard]] std::vector<Assignment> assign(Distribution distribution, const Scene& scene, const FrameLayout& layout,
                                             int ranks, int groups);

}  // namespace hpr
