#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cluster/distribution/view_groups.h"
#include "image/tiles.h"
#include "scene/view.h"

namespace hpr {

class Session;

/// Collective. What a view shows of the scene's chunks on each of its screens, ascending by screen, then surface. The
/// same on all ranks, of which each bounds some.
[[nodiscard]] std::vector<ScreenChunk> chunks_on_screens(Session& session, std::span<const View> views);

/// The groups of a frame that follow its view (ViewGroups), from frame to frame. Every rank holds the whole scene, so
/// that another group costs no upload.
class ViewGrouping {
 public:
  ViewGrouping() = default;
  /// Collective. Groups the chunks that `views` show. All of it is computed alike on every rank: `light_costs` and
  /// `speeds` are the same on all.
  ViewGrouping(Session& session, const FrameLayout& layout, std::span<const View> views, const DrawSpeeds& speeds,
               std::span<const double> light_costs);

  /// Collective. The groups for other views of these screens; the same views, however they are jittered, change
  /// nothing.
  void follow(Session& session, const FrameLayout& layout, std::span<const View> views, const DrawSpeeds& speeds,
              std::span<const double> light_costs);

  [[nodiscard]] const ViewGroups& groups() const { return groups_; }
  [[nodiscard]] std::span<const ScreenChunk> chunks() const { return chunks_; }
  /// What this rank draws on a screen, as merged ranges.
  [[nodiscard]] const std::vector<SurfaceRange>& surfaces(std::size_t screen) const { return surfaces_.at(screen); }
  /// Whether the groups are those of these views, but for their jitter.
  [[nodiscard]] bool fits(std::span<const View> views) const;

 private:
  void select(Session& session, const FrameLayout& layout);

  std::vector<View> views_;
  std::vector<ScreenChunk> chunks_;
  ViewGroups groups_;
  std::vector<std::vector<SurfaceRange>> surfaces_;  ///< per screen, of this rank
};

/// How the groups are, for people: chunks, overlap and how even the work is.
[[nodiscard]] std::string describe(const ViewGrouping& grouping);

}  // namespace hpr
