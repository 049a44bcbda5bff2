#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/session.h"
#include "cluster/assignment.h"
#include "image/tiles.h"
#include "rt/lighter.h"
#include "scene/view.h"

namespace hpr {

enum class Shading {
  Deferred,  ///< keys are composited, then whoever owns a pixel lights it: no ray is spent on what is hidden
  Local,     ///< each rank lights what it drew, and colours are composited: the classic order
};

/// How a frame is made; every choice gives the same picture, but for local shading: it has 8 bits a channel, and
/// coplanar surfaces of different ranks show the brighter colour.
struct FrameSettings {
  std::optional<Distribution> distribution;  ///< none: chosen by plan_frame
  int groups = 0;                            ///< of Hybrid; 0: default_groups
  std::string strategy;                      ///< empty: chosen by plan_frame
  Shading shading = Shading::Deferred;
  RaySettings rays;
};

/// Who does what in a frame; computed alike on every rank.
struct FramePlan {
  Distribution distribution = Distribution::SortFirst;
  int groups = 1;
  std::string strategy;
  Shading shading = Shading::Deferred;
  RaySettings rays;
  bool lit = true;  ///< false: only the keys are wanted, no light is spent on them
  FrameLayout layout;
  Assignment mine;                     ///< this rank's part
  std::vector<std::size_t> tiles;      ///< of this rank's group, ascending
  std::vector<std::string> explained;  ///< one line per decision, with its reason
};

[[nodiscard]] FramePlan plan_frame(Session& session, const FrameSettings& settings, std::span<const View> views);

/// A finished frame, in the memory of the ranks that own its tiles.
struct Frame {
  TileLayer<Key>* keys = nullptr;  ///< the session's, valid until its next frame
  TileLayer<Rgb> radiance;         ///< of owned tiles
  std::vector<std::size_t> owned;  ///< tiles this rank lit, ascending
};

/// What a frame took on this rank, besides its ray passes (Lighter::times).
struct FrameTimes {
  double raster_ms = 0.0;
  double composite_ms = 0.0;
};

/// Makes what a frame needs and successive frames share: geometry on the GPU, the ray scene, the group's communicator.
/// Collective. Left out, the first frame does it and takes the longer for it.
void prepare(Session& session, const FramePlan& plan);

/// Draws this rank's objects into its group's tiles of `keys`: the frame's first step, before any rank meets another.
void rasterize(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys);

/// Collective: scene -> cluster -> raster -> compositing -> rt. views[i] is screen i of the plan's layout.
[[nodiscard]] Frame make_frame(Session& session, const FramePlan& plan, std::span<const View> views,
                               FrameTimes* times = nullptr);

}  // namespace hpr
