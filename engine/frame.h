#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/aov.h"
#include "engine/plan.h"
#include "image/tiles.h"
#include "raster/raster_stats.h"
#include "rt/ray_counts.h"
#include "rt/sampling/sampler.h"
#include "scene/view.h"

namespace hpr {

class Interrupt;
class Session;
class TileOwnership;

/// A finished frame, in the memory of the ranks that own its tiles.
struct Frame {
  TileLayer<Key>* keys = nullptr;  ///< the session's, valid until its next frame
  TileLayer<Rgb> radiance;         ///< of owned tiles
  std::vector<std::size_t> owned;  ///< tiles this rank lit, ascending
  AovLayers aovs;                  ///< of owned tiles
  bool is_transparent = false;     ///< there is no background: the radiance is multiplied by the coverage
  bool overtaken = false;          ///< by FrameSample::interrupt: of all this only the keys mean anything

  /// The picture's alpha, of owned tiles; null where it is 1 everywhere.
  [[nodiscard]] const TileLayer<float>* alpha() const { return is_transparent ? aovs.coverage() : nullptr; }
};

/// What verifying some of a frame's tiles found; the same on all ranks.
struct VerifyCounts {
  std::uint64_t tiles = 0;       ///< drawn again, counted once a sample
  std::uint64_t mismatches = 0;  ///< whose second drawing differed, in any of the samples drawn together
  std::uint64_t unmended = 0;    ///< of these, those of which a third drawing agreed with neither

  VerifyCounts& operator+=(const VerifyCounts& other);
  bool operator==(const VerifyCounts&) const = default;
};

/// What this rank computed for a frame itself, on all of its threads: waiting for others is not in it.
struct FrameWork {
  double keys_ms = 0.0;
  double light_ms = 0.0;
  std::uint64_t lent = 0;  ///< pieces of this rank's tiles that others lit

  FrameWork& operator+=(const FrameWork& other);
};

/// Times and ray counts of a frame on this rank; summed over its samples.
struct FrameTimes {
  double primary_ms = 0.0;  ///< the keys, drawn or traced
  PrimaryRayStats primary;
  RasterStats raster;              ///< of keys that were drawn
  double chunk_exchange_ms = 0.0;  ///< before they are drawn, waiting included
  double composite_ms = 0.0;
  double move_ms = 0.0;          ///< bringing keys to the owners of their tiles
  double return_ms = 0.0;        ///< bringing back light that others lit, once all have done so
  double light_ms = 0.0;         ///< photons and light, until this rank's are done
  std::vector<PassTime> passes;  ///< summed over threads
  RayCounts rays;
  FrameWork work;
  VerifyCounts verified;
  int samples = 0;

  FrameTimes& operator+=(const FrameTimes& other);
};

/// Makes what a frame needs and successive frames share: geometry on the GPU, the ray scene, the group's communicator.
/// Collective. Without this call the first frame does it and takes longer.
void prepare(Session& session, const FramePlan& plan);

/// Which frame of several that are one picture's samples.
struct FrameSample {
  SampleNumber number;
  std::optional<TileOwnership>* ownership = nullptr;  ///< made by the first sample; null: keys do not move
  const PixelMask* wanted = nullptr;  ///< pixels that are lit; null: all. Others' radiance means nothing
  const std::function<void()>* before_shading = nullptr;  ///< called once the owners of tiles have their keys
  Interrupt* interrupt = nullptr;  ///< of this rank: raised on any, it ends light within a tile; null: on none
};

/// One of several samples that are drawn together.
struct JitteredViews {
  std::vector<View> views;  ///< views[i] is screen i of the plan's layout; those of the samples differ by their jitter
  FrameSample sample;
};

/// Draws this rank's objects into its group's tiles of `keys`: the frame's first step. Collective under sort-middle;
/// else before any rank meets another. Adds to `spent` what it counts.
void rasterize(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys,
               FrameTimes& spent);
/// Makes the keys of several samples by primary rays, one layer each, in place of rasterize(); all samples want the
/// same pixels. Adds to `work` and returns the ray counts.
PrimaryRayStats trace_primary(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                              std::span<TileLayer<Key>* const> keys, FrameWork& work);

/// What a layer took.
struct DrawnLayer {
  FrameTimes spent;
  bool overtaken = false;  ///< by FrameSample::interrupt, on all ranks alike: the layer has keys, and there is no light
};

/// Collective. A frame before compositing: this rank's layer, its objects drawn into its group's tiles of `keys`, and
/// lit if shading is local.
DrawnLayer draw_layer(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys,
                      const FrameSample& sample = {});

/// How many samples of a plan may be drawn together: 1 where they are composited, or each needs photons or shared light
/// of its own.
[[nodiscard]] std::size_t max_round_size(Session& session, const FramePlan& plan);

/// Collective: several samples step by step together, to the bit what make_frame gives one by one. What rays and lights
/// look up for one sample is at hand for the next. At least one and at most max_round_size(); all want the same pixels.
[[nodiscard]] std::vector<Frame> make_round(Session& session, const FramePlan& plan,
                                            std::span<const JitteredViews> jittered, FrameTimes& times);

/// Collective: scene -> cluster -> raster -> compositing -> rt. views[i] is screen i of the plan's layout.
[[nodiscard]] Frame make_frame(Session& session, const FramePlan& plan, std::span<const View> views,
                               FrameTimes* times = nullptr, const FrameSample& sample = {});

}  // namespace hpr
