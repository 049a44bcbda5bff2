#pragma once

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <optional>
#include <span>

#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_tables.h"
#include "scene/scene.h"

namespace hpr {

/// Surfaces of a scene in a device's memory, as shaders read them (gpu/shaders/scene.glsl): meshes with a tree of their
/// triangles each, and a tree of their instances. The device must outlive it.
class GpuScene {
 public:
  /// `objects`: the surfaces it holds. The whole meshes have to be here (Mesh::partial). Throws Error (Limit) where
  /// they do not fit into the device's memory. `threads` build its trees.
  GpuScene(const GpuDevice& device, const Scene& scene, std::span<const SurfaceRange> objects, int threads);

  /// As SceneTrees of scene.glsl.
  [[nodiscard]] std::uint64_t address() const { return address_; }

 private:
  GpuTables tables_;
  std::uint64_t address_ = 0;
};

/// What undoes `linear`; none where that flattens what it places, or nearly so: boxes in a mesh's own coordinates would
/// lose all digits.
[[nodiscard]] std::optional<glm::dmat3> usable_inverse(const glm::dmat3& linear);

}  // namespace hpr
