#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_kernel.h"
#include "gpu/gpu_scene.h"
#include "gpu/light/gpu_lights.h"
#include "gpu/light/gpu_materials.h"
#include "gpu/light/gpu_photons.h"
#include "gpu/light/gpu_surfaces.h"
#include "rt/light_device.h"

namespace hpr {

/// Lights tiles on a device: what DeferredShader does, one thread a pixel (gpu/shaders/light_*.comp). Equal keys get
/// equal light on devices of one kind, whatever tiles are lit together; that of the CPU differs by rounding.
class GpuLight final : public LightDevice {
 public:
  /// Puts what `sources` have on the device. Both must outlive this. `threads` build trees. Throws Error (Limit) where
  /// the device's memory ends.
  GpuLight(const GpuDevice& device, const LightSources& sources, int threads);

  void shade(const DeviceTiles& lit, RayCounts& counts, const Store& store) override;

 private:
  void compile();
  void grow(std::size_t tiles, std::size_t views);
  void follow_paths(std::size_t tiles, bool gathers_photons);
  void shade_some(const DeviceTiles& lit, const ShadedSample& sample, std::span<const std::size_t> tiles,
                  RayCounts& counts, const Store& store);

  const GpuDevice& device_;
  LightSources sources_;
  GpuScene scene_;
  GpuSurfaces surfaces_;
  GpuMaterials materials_;
  GpuLights lights_;
  GpuPhotons photons_;
  GpuKernel start_;
  GpuKernel vertex_;
  GpuKernel direct_;
  GpuKernel follow_;
  GpuKernel finish_;
  std::optional<GpuKernel> ambient_;  ///< where the pass runs
  std::optional<GpuKernel> photon_;
  std::size_t state_bytes_ = 0;    ///< of a pixel while it is lit
  std::size_t waiting_bytes_ = 0;  ///< of the vertices that may wait for it
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
  GpuBatch batch_;
};

/// Why a device leaves light to the CPU; empty: it does not.
[[nodiscard]] std::string refusal_of_light(const Scene& scene, const RaySettings& settings,
                                           std::span<const PassPlan> plan);

}  // namespace hpr
