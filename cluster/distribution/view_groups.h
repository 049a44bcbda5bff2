#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/tiles.h"
#include "scene/scene.h"

namespace hpr {

/// What work takes on a rank, in nanoseconds: by these, work is shared out.
struct DrawSpeeds {
  double triangle = 100.0;  ///< drawn
  double pixel = 10.0;      ///< drawn, those behind others too
  double merge = 8.0;       ///< a pixel sent to another rank and merged there
  double light = 300.0;     ///< a visible pixel lit

  bool operator==(const DrawSpeeds&) const = default;
};

/// Neighboring triangles on a screen that shows them.
struct ScreenChunk {
  SurfaceRange surfaces;
  std::uint32_t screen = 0;
  Rect pixels;           ///< of the screen, not empty; nothing is drawn outside
  float covered = 0.0F;  ///< about how many pixels are drawn
};

/// Who draws what of a frame where groups follow the view, and who owns what comes of it.
///
/// Every tile that a chunk can touch is covered by the parts of that chunk, of one rank or of several. So it does not
/// matter for the picture where else a rank draws its parts.
struct ViewGroups {
  /// A chunk, as far as a rank draws it.
  struct Part {
    std::uint32_t chunk = 0;  ///< index into the list of the frame's chunks
    Rect tiles;               ///< of the screen's grid of tiles
  };

  std::vector<std::vector<Part>> parts;         ///< per rank, ascending by chunk
  std::vector<std::vector<std::size_t>> tiles;  ///< per rank those that it may draw into, ascending
  std::vector<int> owners;   ///< per tile the rank that merges it: one that may draw into it, where there is one
  std::vector<int> regions;  ///< per tile the rank in whose part of the screens it lies

  std::vector<double> draw_ns;   ///< per rank what drawing is expected to take
  std::vector<double> merge_ns;  ///< per rank, merging of its tiles
  std::vector<double> light_ns;  ///< per rank, lighting them
  /// Pixels times ranks that draw there by pixels, both of tiles that anybody may draw into: 1 where no tile is shared.
  double overlap = 1.0;
  /// slowest_ns() by ideal_ns() when the groups were made, or last compared with others.
  double made_unevenness = 1.0;

  /// Draw, merge and light, each of its slowest rank.
  [[nodiscard]] double slowest_ns() const;
  /// What these would take if every rank had as much to do.
  [[nodiscard]] double ideal_ns() const;
  [[nodiscard]] double unevenness() const { return ideal_ns() > 0.0 ? slowest_ns() / ideal_ns() : 1.0; }
};

/// Groups `chunks` (ascending by screen, then surface) for `ranks` ranks: halved recursively together with the screens,
/// by where they lie on them, so that each half's drawing is even, across the axis that leaves fewer pixels in the
/// other half. A chunk that reaches into the other half goes to one of them, or is drawn in both, each its own tiles of
/// it, where that takes less than merging. Owners of tiles are chosen so that merging and light are even.
/// `light_costs`: per tile what its light took before, in any unit; empty: not known. After Samanta, Funkhouser, Li,
/// Singh, "Hybrid Sort-First and Sort-Last Parallel Rendering with a Cluster of PCs", 2000.
[[nodiscard]] ViewGroups group_by_view(const FrameLayout& layout, std::span<const ScreenChunk> chunks, int ranks,
                                       const DrawSpeeds& speeds, std::span<const double> light_costs = {});

/// The groups of another view, `chunks`, by the same ranks: chunks stay with the rank that drew them for the view
/// before, `old_chunks`, and new ones go to whose region they lie in. Where that has become less even by more than
/// kMinRegroupGain, and grouping anew makes the slowest rank faster by more than that, it is done.
[[nodiscard]] ViewGroups follow_view(const ViewGroups& old, std::span<const ScreenChunk> old_chunks,
                                     const FrameLayout& layout, std::span<const ScreenChunk> chunks,
                                     const DrawSpeeds& speeds, std::span<const double> light_costs = {});

inline constexpr double kMinRegroupGain = 0.1;

/// The surfaces of a rank's parts on a screen, as merged ranges.
[[nodiscard]] std::vector<SurfaceRange> drawn_surfaces(const ViewGroups& groups, std::span<const ScreenChunk> chunks,
                                                       int rank, std::size_t screen);

/// The smallest rectangle of pixels of a screen that holds a rank's parts, on tile borders or the screen's edge.
[[nodiscard]] Rect drawn_area(const ViewGroups& groups, const FrameLayout& layout, std::span<const ScreenChunk> chunks,
                              int rank, std::size_t screen);

}  // namespace hpr
