#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cluster/distribution/balance.h"
#include "engine/balance/light_lending.h"
#include "engine/balance/machine_speeds.h"
#include "image/tiles.h"
#include "rt/ray_counts.h"

namespace hpr {

class Communicator;
class Session;
struct FramePlan;
struct View;

/// What a session's ranks know of each other's work, from frame to frame: what each tile took. It decides who computes
/// what, and no bit of a picture.
class LoadBalance {
 public:
  /// Forgets what tiles took, as after another scene was loaded.
  void forget();

  /// Begins a frame, on all ranks: nothing is spent on it yet. Costs of another layout are forgotten.
  void start_frame(const FrameLayout& layout);
  /// Adds what this rank spent on the keys of tiles, or on their light. Of another layout than the frame's nothing
  /// counts.
  void add_keys(const FrameLayout& layout, std::span<const TileCost> costs);
  void add_light(const FrameLayout& layout, std::span<const TileCost> costs);
  /// Adds time that this rank spent on the keys of all of `tiles` alike.
  void add_keys(const FrameLayout& layout, std::span<const std::size_t> tiles, double ms);
  /// Collective, after a frame of so many samples: from here on costs() are what all ranks spent on it and on those
  /// before.
  void finish_frame(Communicator& comm, const FrameLayout& layout, int samples);
  /// Per tile of a frame of this layout what a sample takes, the same on all ranks; empty: not known.
  [[nodiscard]] std::span<const double> costs(const FrameLayout& layout) const;
  /// The part of costs() that light takes.
  [[nodiscard]] std::span<const double> light_costs(const FrameLayout& layout) const;

  /// Collective, once layers are composited. `present`: the tiles whose keys this rank has in `keys`. Per tile the rank
  /// that is to light it; -1: none. That is who has its keys, unless that rank had much more to do than others.
  [[nodiscard]] std::vector<int> owners_of_light(Communicator& comm, const TileLayer<Key>& keys,
                                                 std::span<const std::size_t> present) const;

  [[nodiscard]] LightLending& lending() { return lending_; }

  /// Collective. How fast this session's ranks are, measured when first asked for; OpenGL too, where `by_raster` and it
  /// runs.
  [[nodiscard]] const MachineSpeeds& speeds(Session& session, bool by_raster);
  /// Has these speeds in place of measured ones, on all ranks.
  void set_speeds(const MachineSpeeds& speeds);

 private:
  FrameLayout layout_;
  std::vector<double> keys_spent_;  ///< by this rank, on each tile of the frame at hand
  std::vector<double> light_spent_;
  TileCosts costs_;
  TileCosts light_costs_;
  LightLending lending_;
  std::optional<MachineSpeeds> speeds_;
  bool raster_measured_ = false;  ///< whether speeds_ has OpenGL's
};

/// About what the light of a tile costs, as far as its keys tell.
[[nodiscard]] double cost_of_keys(const TileLayer<Key>& keys, std::size_t tile);

/// How the work of a plan is balanced, and why.
[[nodiscard]] std::string explain_balance(const FramePlan& plan);

/// Whether ranks light parts of others' tiles in frames of this plan; the same on all ranks. Collective where the
/// shader is to be made.
[[nodiscard]] bool lends_light(Session& session, const FramePlan& plan);

/// Collective, for a new plan: cuts the screens by what the tiles of the last frame took, else by rays through some
/// pixels of each, where there is a scene for rays anyway, else by their number.
void plan_areas(Session& session, FramePlan& plan, std::span<const View> views);
/// Cuts the screens for the next frame, seen as `views`, by what the last one took, if that gains much; where groups
/// follow the view, they are made anew or follow. The same on all ranks.
void update_areas(Session& session, FramePlan& plan, std::span<const View> views);
/// Has the groups of a plan follow these views from now on. The same on all ranks.
void group_by_view(Session& session, FramePlan& plan, std::span<const View> views);

}  // namespace hpr
