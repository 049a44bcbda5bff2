#pragma once

#include <cstdint>

#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_tables.h"
#include "gpu/light/gpu_materials.h"
#include "rt/lights/light_sampler.h"
#include "scene/scene.h"

namespace hpr {

/// All that gives light in a scene in a device's memory, as shaders sample it (gpu/shaders/lights.glsl), by the tables
/// of a LightSampler. The device must outlive it.
class GpuLights {
 public:
  /// `materials`: the scene's, which must outlive this; scene and sampler need not. Throws Error (Limit) where tables
  /// do not fit into the device's memory.
  GpuLights(const GpuDevice& device, const Scene& scene, const LightSampler& sampler, const GpuMaterials& materials);

  /// As Lights of lights.glsl.
  [[nodiscard]] std::uint64_t address() const { return address_; }

 private:
  GpuTables tables_;
  std::uint64_t address_ = 0;
};

}  // namespace hpr
