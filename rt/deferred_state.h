#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/denoise/coverage_fragments.h"
#include "rt/lights/light_sampler.h"
#include "rt/materials/medium.h"
#include "rt/passes/pass.h"
#include "rt/passes/path_vertex.h"
#include "rt/photons/photon_tracer.h"
#include "rt/reference/path_tracer.h"
#include "rt/tile_scratch.h"
#include "rt/tile_shader.h"
#include "rt/trace/ray_forwarding.h"
#include "rt/trace/ray_scene.h"

namespace hpr {

// Where each step's time stands.
inline constexpr std::size_t kSurfaceStep = 0;
inline constexpr std::size_t kDirectStep = 1;
inline constexpr std::size_t kFirstPassStep = 2;

struct RunningPass {
  const PassInfo& info;
  std::unique_ptr<Pass> pass;
};

/// Whether a mask leaves any pixel; one that is empty leaves all.
[[nodiscard]] inline bool wants_any(std::span<const std::uint8_t> wanted) {
  return wanted.empty() || std::ranges::find(wanted, std::uint8_t{1}) != wanted.end();
}

struct DeferredShader::State {
  const Scene& scene;
  RaySettings settings;
  std::vector<PassPlan> plan;
  RaySpace space;
  Surfaces surfaces;
  LightSampler lights;
  MediumFinder media;
  std::vector<RunningPass> passes;
  ComponentSet shared = 0;  ///< see HalfResShading
  std::array<bool, kLobes.size()> followed_lobes{};
  bool gathers;
  std::optional<RayScene> own_opaque;
  const RayScene* opaque = nullptr;
  std::optional<RayScene> alpha_tested;
  std::optional<CoverageTraversal> rays;
  std::optional<RayScene> whole;  ///< for photons; only where `opaque` is not all
  std::optional<PhotonMapBuilder> photons;
  std::optional<PathTracer> reference;
  CoverageFragments fragments;  ///< of the pixels that denoising samples again
  ScratchPool<TileScratch> tile_memory;
  ScratchPool<WaveScratch> wave_memory;
  std::mutex mutex;
  RayCounts counts;
  double photon_ms = 0.0;   ///< spent on tracing photons, since the last gather_counts()
  bool has_warned = false;  ///< that rays were cut
  std::vector<PassTime> times;
  std::vector<TileCost> costs;  ///< of the parts that the last shade() shaded

  RayForwarding* forwarding;
  std::unique_ptr<TileShader> device;  ///< null: the CPU lights all

  State(const Scene& lit, RaySettings chosen, const Requirements& requirements, const RaySource& source,
        RayForwarding* others, const MakeTileShader& make_device);
  void build_rays(const RaySource& source);
  const RayScene& build(std::optional<RayScene>& made, std::vector<SurfaceRange> objects);
  void build_photons();
  void build_reference();
  void for_each(std::size_t count, const std::function<void(std::size_t)>& body) const;
  /// What rays meet that decide about coverage themselves.
  const RayScene& whole_scene();
  void trace_reference(const ShadedSample& sample, std::span<const std::size_t> tiles);
  const PhotonMaps* photon_maps(const SampleNumber& number);
  void warn_of_cut_rays();
  [[nodiscard]] std::size_t steps() const { return kFirstPassStep + passes.size() + 1; }
  void show_tile(const LightContext& context, TileScratch& scratch, std::span<const TileJob> jobs, std::size_t index,
                 std::span<const ShadedSample> samples) const;
  void shade_tile(const LightContext& context, TileScratch& scratch, std::span<const TileJob> jobs, std::size_t index,
                  std::span<const ShadedSample> samples);
  [[nodiscard]] std::size_t count_margins(const LightContext& context, const TileJob& job, bool denoises) const;
  /// Tile `index` in some samples.
  struct TilePart {
    std::span<const TileJob> jobs;
    std::span<const ShadedSample> samples;
    std::size_t index = 0;
    bool denoises = false;
  };
  /// Called with what a margin shows, sample after sample.
  using UsePoints = std::function<void(std::vector<PathVertex>&& points)>;
  void start_tile(const LightContext& context, TileScratch& scratch, const TilePart& part, const UsePoints& use);
  void start_filters(const LightContext& context, TileScratch& scratch, const TilePart& part, std::size_t margins,
                     const UsePoints& use);
  void find_margins(const LightContext& context, TileScratch& scratch, const TilePart& part, const UsePoints& use);
  void find_rows(const LightContext& context, TileScratch& scratch, WaveScratch& memory, const TilePart& part,
                 std::size_t sample, const RowRange& rows, std::vector<PathVertex>& points) const;
  void denoise(const LightContext& context, TileScratch& scratch, std::span<const TileJob> jobs, std::size_t index);
  /// What all parts of a call of shade() share.
  struct Call {
    std::span<const ShadedSample> samples;
    const PhotonMaps* photons = nullptr;
    std::vector<Media> eyes;
    const std::function<bool()>& is_overtaken;

    [[nodiscard]] bool overtaken() const { return is_overtaken && is_overtaken(); }
  };
  /// What a device did.
  struct DeviceWork {
    RayCounts traced;
    double ms = 0.0;  ///< that it alone took
  };
  [[nodiscard]] Call start_call(std::span<const ShadedSample> samples, const std::function<bool()>& is_overtaken);
  [[nodiscard]] std::vector<TileJob> jobs_of(const Call& call, const ShadedPart& part) const;
  [[nodiscard]] LightContext context_of(const Call& call, std::size_t screen) const;
  void shade_part(const Call& call, const ShadedPart& part);
  void gather_counts(double spent_ms);
  /// Of the sample that is shaded first.
  [[nodiscard]] bool denoises(const SampleNumber& number) const {
    return settings.denoise && number.sample < kDenoisedSamples;
  }
  /// Lights what the device can and returns the tiles that are left to the CPU, of all samples.
  [[nodiscard]] std::vector<std::size_t> light_by_device(const Call& call, std::span<const std::size_t> tiles,
                                                         DeviceWork& done);
  /// Lights samples that are denoised, and returns what is left: the CPU finds what pixels show and filters light, the
  /// device makes it.
  [[nodiscard]] std::vector<std::size_t> light_filtered(const Call& call, std::span<const std::size_t> tiles,
                                                        DeviceWork& done);
  class FilteredTiles;
  void shade_rows(const LightContext& context, TileScratch& scratch, WaveScratch& memory, const TilePart& part,
                  const RowRange& rows) const;
  void shade_points(const LightContext& context, TileScratch& scratch);
  void shade_waves(std::size_t count, TileScratch& scratch, const std::function<void(std::size_t, WaveScratch&)>& body);
  void shade_all_rows(const LightContext& context, TileScratch& scratch, const TilePart& part);
  void shade_waiting(const LightContext& context, WaveScratch& memory, PixelSums& sums) const;
  void shade_wavefront(const LightContext& context, WaveScratch& memory, PixelSums& sums) const;
};

}  // namespace hpr
