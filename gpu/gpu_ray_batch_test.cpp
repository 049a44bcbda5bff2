#include "gpu/gpu_ray_batch.h"

#include <array>
#include <limits>
#include <vector>

#include "gpu/device/test_gpu.h"
#include "scene/scene.h"

namespace hpr {
namespace {

using GpuRates = test::OnGpu;

/// A square of two metres a side about the origin, seen from +z.
Scene square() {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.instances.push_back({});
  finish_scene(scene);
  return scene;
}

TEST_F(GpuRates, CountWhatRaysMeetWithinTheirReach) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Scene scene = square();
  const GpuScene there(device(), scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  const glm::dvec3 down(0.0, 0.0, -1.0);
  std::vector<GpuRay> rays{{{0.3, 0.1, 5.0}, down, kInfinity},
                           {{0.3, 0.1, 5.0}, down, 4.9},
                           {{0.3, 0.1, 5.0}, down, 5.1},
                           {{3.0, 0.1, 5.0}, down, kInfinity},
                           {{0.3, 0.1, -5.0}, -down, kInfinity}};
  // More than are traced at once, of which one in five is too short and one goes past.
  for (int i = 0; i < 15; ++i) rays.insert(rays.end(), rays.begin(), rays.begin() + static_cast<int>(rays.size()));
  GpuRayBatch batch(device(), there, rays);
  for (const auto query : {GpuRayBatch::Query::Closest, GpuRayBatch::Query::AnyHit}) {
    const GpuTime time = batch.trace(query);
    EXPECT_GT(time.clock_ms, 0.0);
    EXPECT_EQ(time.device_ms > 0.0, device().timestamp_ns() > 0.0);
    EXPECT_EQ(batch.count_hits(), rays.size() / 5 * 3);
  }
}

TEST_F(GpuRates, OfReadingBackTakeTime) {
  const GpuTime time = measure_read_back(device(), std::size_t{1} << 20U);
  EXPECT_GT(time.ms(), 0.0);
  EXPECT_GE(time.clock_ms, time.device_ms);
}

}  // namespace
}  // namespace hpr
