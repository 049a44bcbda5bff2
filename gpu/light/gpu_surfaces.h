#pragma once

#include <cstdint>

#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_tables.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

/// What points of a scene's surfaces are made from, in a device's memory, as shaders read it
/// (gpu/shaders/surfaces.glsl). The device must outlive it.
class GpuSurfaces {
 public:
  /// The whole meshes have to be here (Mesh::partial). Throws Error (Limit) where they do not fit into the device's
  /// memory.
  GpuSurfaces(const GpuDevice& device, const Scene& scene, const Surfaces& surfaces);

  /// As SurfaceTables of surfaces.glsl.
  [[nodiscard]] std::uint64_t address() const { return address_; }

 private:
  GpuTables tables_;
  std::uint64_t address_ = 0;
};

}  // namespace hpr
