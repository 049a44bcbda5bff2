#include "engine/open_sky.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "rt/sampling/sampler.h"
#include "rt/sampling/sampling.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rays through a grid of places of every view.
std::vector<Ray> looks_of(std::span<const View> views) {
  constexpr double kLooks = 1024.0;
  const int side = std::max(4, static_cast<int>(std::sqrt(kLooks / static_cast<double>(views.size()))));
  std::vector<Ray> looks;
  for (const View& view : views) {
    for (int i = 0; i < side * side; ++i) {
      const int column = i % side;
      const int row = i / side;
      const double x = (column + 0.5) * view.size().width / side;
      const double y = (row + 0.5) * view.size().height / side;
      Ray ray = view_ray(view, x, y);
      ray.origin += ray.direction * view.near_distance;
      ray.direction = glm::normalize(ray.direction);
      looks.push_back(ray);
    }
  }
  return looks;
}

}  // namespace

std::optional<double> open_sky(Session& session, const RaySettings& settings, std::span<const View> views) {
  session.share_rays(settings);
  const RayScene& scene = session.ray_scene(settings.build);
  const RaySpace& space = scene.space();
  const Surfaces surfaces(session.scene(), space);
  const std::vector<Ray> looks = looks_of(views);
  RayBatch rays;
  for (const Ray& look : looks) rays.push(space.from_world(look.origin), look.direction, kInfinity);
  std::vector<std::uint32_t> seen(looks.size());
  std::vector<std::uint8_t> blocked;
  scene.for_each(1, 1, [&](std::size_t) {
    (void)scene.closest(rays, seen);
    rays.clear();
    WorldTriangle triangle;
    for (std::size_t i = 0; i < looks.size(); ++i) {
      if (seen[i] == kNoSurface) continue;
      surfaces.load(seen[i], triangle);
      const SurfacePoint point = surfaces.meet(triangle, looks[i].origin, looks[i].direction);
      Sampler sampler(photon_stream({settings.seed, 0}), static_cast<std::uint32_t>(i));
      const glm::dvec3 up = warp::cosine_lobe(point.geometric_normal, sampler.two());
      rays.push(space.from_world(ray_origin(point, up)), up, kInfinity);
    }
    blocked.resize(rays.size());
    (void)scene.occluded(rays, blocked);
  });
  if (blocked.empty()) return std::nullopt;
  return static_cast<double>(std::ranges::count(blocked, 0)) / static_cast<double>(blocked.size());
}

}  // namespace hpr
