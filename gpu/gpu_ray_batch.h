#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_kernel.h"
#include "gpu/gpu_scene.h"

namespace hpr {

/// A ray in the world; `direction` has unit length, `reach` is in metres.
struct GpuRay {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0};
  double reach = 0.0;
};

/// How long a device was at something.
struct GpuTime {
  double device_ms = 0.0;  ///< by its own clock; 0 where it has none
  double clock_ms = 0.0;   ///< by the CPU's, from submitting to the end of the wait

  GpuTime& operator+=(const GpuTime& other);
  /// By the device's clock, where it has one.
  [[nodiscard]] double ms() const { return device_ms > 0.0 ? device_ms : clock_ms; }
};

/// Rays that lie ready on a device, to find out how fast it traces them. Both sides of surfaces are met.
class GpuRayBatch {
 public:
  /// `scene` must outlive this. Throws Error (Limit) where the device's memory ends.
  GpuRayBatch(const GpuDevice& device, const GpuScene& scene, std::span<const GpuRay> rays);

  enum class Query : std::uint8_t { Closest, AnyHit };
  /// Traces all of them.
  [[nodiscard]] GpuTime trace(Query query);
  /// How many met something, the last time they were traced.
  [[nodiscard]] std::uint64_t count_hits();

 private:
  const GpuDevice& device_;
  const GpuScene& scene_;
  std::size_t count_;
  const GpuKernel& kernel_;
  GpuBuffer rays_;
  GpuBuffer answers_;
  GpuBatch batch_;
};

/// How long copying so many bytes from a device's memory into the CPU's takes.
[[nodiscard]] GpuTime measure_read_back(const GpuDevice& device, std::size_t bytes);

}  // namespace hpr
