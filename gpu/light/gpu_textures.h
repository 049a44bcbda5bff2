#pragma once

#include <cstdint>
#include <span>

#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_tables.h"
#include "scene/scene.h"

namespace hpr {

/// Textures in a device's memory, as shaders read them (gpu/shaders/textures.glsl): the texels of all in one buffer,
/// those that textures have in common once. The device must outlive it.
class GpuTextures {
 public:
  /// Waits for texels that are not here. Throws Error (Limit) where they do not fit into the device's memory.
  GpuTextures(const GpuDevice& device, std::span<const Texture> textures);

  /// As Textures of textures.glsl.
  [[nodiscard]] std::uint64_t address() const { return address_; }

 private:
  GpuTables tables_;
  std::uint64_t address_ = 0;
};

}  // namespace hpr
