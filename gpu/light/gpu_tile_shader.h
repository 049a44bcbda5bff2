#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "gpu/gpu_scene.h"
#include "gpu/light/gpu_lights.h"
#include "gpu/light/gpu_materials.h"
#include "gpu/light/gpu_photon_tracer.h"
#include "gpu/light/gpu_photons.h"
#include "gpu/light/gpu_steps.h"
#include "gpu/light/gpu_surfaces.h"
#include "rt/tile_shader.h"

namespace hpr {

struct GpuLightInput;

/// Lights tiles on a device: what DeferredShader does, one thread a pixel (gpu/shaders/light_*.comp). Equal keys get
/// equal light on devices of one kind, whatever tiles are lit together; that of the CPU differs by rounding.
class GpuTileShader final : public TileShader {
 public:
  /// Puts what `inputs` have on the device. Both must outlive this. `threads` build trees. Throws Error (Limit) where
  /// the device's memory ends.
  GpuTileShader(const GpuDevice& device, const ShadingInputs& inputs, int threads);

  void shade(const TilesToShade& lit, RayCounts& counts, const Store& store) override;
  void shade_points(const PointsToShade& lit, RayCounts& counts) override;
  [[nodiscard]] PhotonDevice* photon_device() override { return photon_tracer_.get(); }
  [[nodiscard]] std::span<const PassTime> times() const override { return steps_.times(); }
  void clear_times() override { steps_.clear_times(); }

 private:
  void run_step(std::size_t step, std::size_t tiles);
  void grow(std::size_t tiles, std::size_t views);
  void hold_photons(const PhotonMaps* maps, const SampleNumber& number);
  void put_view(std::size_t i, const View& view, const Media& media);
  [[nodiscard]] bool light(const GpuLightInput& input, std::size_t tiles, const std::function<bool()>& is_overtaken,
                           RayCounts& counts);
  [[nodiscard]] bool follow_paths(std::size_t tiles, bool with_photons, const std::function<bool()>& is_overtaken);
  [[nodiscard]] GpuLightInput input_of(const PhotonMaps* photons) const;
  struct PointBlock;
  void shade_blocks(std::span<const PointBlock> blocks, const PointsToShade& lit, RayCounts& counts);
  void shade_some(const TilesToShade& lit, const ShadedSample& sample, std::span<const std::size_t> tiles,
                  RayCounts& counts, const Store& store);

  const GpuDevice& device_;
  ShadingInputs inputs_;
  GpuScene scene_;                          ///< surfaces that cover all behind them
  std::unique_ptr<GpuScene> alpha_tested_;  ///< the others, where there are some
  GpuSurfaces surfaces_;
  GpuMaterials materials_;
  GpuLights lights_;
  GpuPhotons photons_;
  std::optional<SampleNumber> held_photons_ = {};  ///< the sample whose photons those are
  std::uint32_t max_waiting_ = 0;                  ///< vertices of a pixel
  std::size_t state_bytes_ = 0;                    ///< of a pixel while it is lit
  std::size_t waiting_bytes_ = 0;                  ///< of the vertices that may wait for it
  std::size_t tiles_at_once_ = 0;
  GpuBuffer input_;
  GpuBuffer counters_;
  std::optional<GpuBuffer> views_;
  std::optional<GpuBuffer> eye_media_;
  std::optional<GpuBuffer> tiles_;
  std::optional<GpuBuffer> keys_;
  std::optional<GpuBuffer> pixels_;
  std::optional<GpuBuffer> states_;
  std::optional<GpuBuffer> waiting_;
  std::optional<GpuBuffer> read_;
  std::optional<GpuBuffer> points_;
  std::optional<GpuBuffer> point_lights_;
  std::optional<GpuBuffer> read_lights_;
  std::unique_ptr<GpuPhotonTracer> photon_tracer_;  ///< null where the CPU traces photons, or nobody
  GpuSteps steps_;
};

/// How many tiles a device lights together, each of which takes so much of its memory meanwhile.
[[nodiscard]] std::size_t tiles_at_once(const GpuInfo& device, std::size_t tile_bytes);

/// Why a device leaves light to the CPU; empty: it does not.
[[nodiscard]] std::string refusal_of_light(const Scene& scene, const RaySettings& settings);

}  // namespace hpr
