#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "engine/aov.h"
#include "engine/session.h"
#include "engine/tile_ownership.h"
#include "image/tiles.h"
#include "rt/deferred_shader.h"
#include "scene/view.h"

namespace hpr {

enum class Shading {
  Deferred,  ///< keys are composited, then whoever owns a pixel lights it: no ray is spent on what is hidden
  Local,     ///< each rank lights what it drew, and colours are composited: the classic order
};
inline constexpr std::array<std::string_view, 2> kShadingNames{"deferred", "local"};

/// What makes the keys.
enum class Primary {
  Raster,  ///< OpenGL
  Rays,    ///< Embree, one ray through each pixel's centre; other surfaces are seen at some edges
  Auto,    ///< whichever a measurement finds quicker
};
inline constexpr std::array<std::string_view, 3> kPrimaryNames{"raster", "rays", "auto"};

/// How a frame is made; every choice gives the same picture, but for local shading: it has 8 bits a channel, and
/// coplanar surfaces of different ranks show the brighter colour.
struct FrameSettings {
  std::optional<Distribution> distribution;  ///< none: chosen by plan_frame
  int groups = 0;                            ///< of Hybrid; 0: default_groups
  std::string strategy;                      ///< empty: chosen by plan_frame
  Primary primary = Primary::Raster;
  DepthFormat depth_format = DepthFormat::Float32;  ///< fewer bits with Primary::Raster only
  Shading shading = Shading::Deferred;
  RaySettings rays;
  bool partitioned = false;         ///< each rank's ray scene holds its share of the objects only, and rays travel
  bool indirect_is_chosen = false;  ///< whether rays.gather says who brings indirect light; else plan_frame finds out
  bool photons_fit_frame = false;   ///< no more photons a sample than the frame has pixels
  double resolution_scale = 1.0;    ///< of the screens' pixels: the frame is made of so many a side, and enlarged
  std::vector<Aov> aovs;            ///< with deferred shading only
};

/// Who does what in a frame; computed alike on every rank.
struct FramePlan {
  Distribution distribution = Distribution::SortFirst;
  int groups = 1;
  std::string strategy;
  Primary primary = Primary::Raster;  ///< never Auto
  DepthFormat depth_format = DepthFormat::Float32;
  Shading shading = Shading::Deferred;
  RaySettings rays;
  std::vector<Aov> aovs;
  bool lit = true;  ///< false: only the keys are wanted, no light is spent on them
  FrameLayout layout;
  Assignment mine;                     ///< this rank's part
  std::vector<std::size_t> tiles;      ///< of this rank's group, ascending
  std::vector<std::string> explained;  ///< one line per decision, with its reason
};

/// Collective, as it may measure (`Primary::Auto`).
[[nodiscard]] FramePlan plan_frame(Session& session, const FrameSettings& settings, std::span<const View> views);

/// A finished frame, in the memory of the ranks that own its tiles.
struct Frame {
  TileLayer<Key>* keys = nullptr;  ///< the session's, valid until its next frame
  TileLayer<Rgb> radiance;         ///< of owned tiles
  std::vector<std::size_t> owned;  ///< tiles this rank lit, ascending
  AovLayers aovs;                  ///< of owned tiles
};

/// What a frame took on this rank; of several samples, added up.
struct FrameTimes {
  double primary_ms = 0.0;  ///< the keys, drawn or traced
  PrimaryRayStats primary;
  double composite_ms = 0.0;
  std::vector<PassTime> passes;  ///< summed over threads
  RayCounts rays;
  int samples = 0;

  FrameTimes& operator+=(const FrameTimes& other);
};

/// Makes what a frame needs and successive frames share: geometry on the GPU, the ray scene, the group's communicator.
/// Collective. Left out, the first frame does it and takes the longer for it.
void prepare(Session& session, const FramePlan& plan);

/// Which frame of several that are one picture's samples.
struct FrameSample {
  SampleNumber number;
  std::optional<TileOwnership>* homes = nullptr;  ///< tiles are lit where they were in the first sample; null: anywhere
  const PixelMask* wanted = nullptr;              ///< pixels that are lit; null: all. Others' radiance means nothing
  const std::function<void()>* at_home = nullptr;  ///< called once tiles are at home, before any is lit
};

/// One of several samples that are drawn together.
struct JitteredViews {
  std::vector<View> views;  ///< views[i] is screen i of the plan's layout; those of the samples differ by their jitter
  FrameSample sample;
};

/// Draws this rank's objects into its group's tiles of `keys`: the frame's first step, before any rank meets another.
void rasterize(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys);
/// The same by rays, for several looks together, a layer each; all want the same pixels. Returns what it took.
PrimaryRayStats trace_primary(Session& session, const FramePlan& plan, std::span<const JitteredViews> looks,
                              std::span<TileLayer<Key>* const> keys);

/// Collective. A frame before compositing: this rank's layer, its objects drawn into its group's tiles of `keys`, and
/// lit if shading is local. Returns what that took.
FrameTimes draw_layer(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys,
                      const FrameSample& sample = {});

/// How many samples of a plan may be drawn together: 1 where they are composited, or each asks for light of its own.
[[nodiscard]] std::size_t max_in_round(Session& session, const FramePlan& plan);

/// Collective: several samples step by step together, to the bit what make_frame gives one by one. What rays and lights
/// look up for one sample is at hand for the next. At least one and at most max_in_round(); all want the same pixels.
[[nodiscard]] std::vector<Frame> make_round(Session& session, const FramePlan& plan,
                                            std::span<const JitteredViews> looks, FrameTimes& times);

/// Collective: scene -> cluster -> raster -> compositing -> rt. views[i] is screen i of the plan's layout.
[[nodiscard]] Frame make_frame(Session& session, const FramePlan& plan, std::span<const View> views,
                               FrameTimes* times = nullptr, const FrameSample& sample = {});

}  // namespace hpr
