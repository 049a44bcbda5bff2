#pragma once

#include <cstdint>

#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_tables.h"
#include "gpu/light/gpu_textures.h"
#include "scene/scene.h"

namespace hpr {

/// All materials and textures of a scene in a device's memory, as shaders read them (gpu/shaders/materials.glsl). The
/// device must outlive it, the scene need not.
class GpuMaterials {
 public:
  /// Waits for texels that are not here. Throws Error (Limit) where they do not fit into the device's memory.
  GpuMaterials(const GpuDevice& device, const Scene& scene);

  /// As Materials of materials.glsl.
  [[nodiscard]] std::uint64_t address() const { return address_; }

 private:
  GpuTextures textures_;
  GpuTables tables_;
  std::uint64_t address_ = 0;
};

}  // namespace hpr
