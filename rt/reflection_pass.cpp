#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>

#include "rt/pass.h"

namespace hpr {
namespace {

/// Below it a path changes an 8-bit sRGB picture of scenes whose radiance is below 10 by less than half of its darkest
/// step, 1 / (2 * 255 * 12.92).
constexpr double kLeastThroughput = 1.0 / 65536.0;

/// How much of a mirror image a surface of some roughness keeps. An approximation in place of sampling the lobe: the
/// image stays sharp and fades out, with a flat end where the pass stops looking, so that no edge is seen there.
double sharpness(double roughness) {
  const double x = std::clamp(roughness / kMirrorRoughness, 0.0, 1.0);
  return 1.0 - x * x * (3.0 - 2.0 * x);
}

/// The mirrored direction, bent back above the surface where an interpolated normal would send it inside.
glm::dvec3 mirrored(const SurfacePoint& surface) {
  const glm::dvec3& view = surface.to_viewer;
  const glm::dvec3& normal = surface.facing_normal();
  const glm::dvec3 direction = 2.0 * glm::dot(normal, view) * normal - view;
  const double height = glm::dot(direction, surface.geometric_normal);
  return height < 0.0 ? direction - 2.0 * height * surface.geometric_normal : direction;
}

/// Mirror images on smooth surfaces: one ray per point, weighted by Schlick's Fresnel term.
class ReflectionPass final : public Pass {
 public:
  [[nodiscard]] std::string_view name() const override { return "reflection"; }
  [[nodiscard]] const Requirement& requirement(const Requirements& scene) const override { return scene.reflection; }
  [[nodiscard]] bool needs_rays() const override { return true; }

  void spread(TileWork& tile, const Wave& wave, Wave& next) const override {
    if (wave.depth >= tile.max_depth) return;
    struct Mirrored {
      const PathPoint* from;
      glm::dvec3 direction;
      glm::dvec3 throughput;
    };
    std::vector<Mirrored> rays;
    tile.batch.clear();
    for (const PathPoint& point : wave.points) {
      const Brdf& brdf = point.material.brdf;
      if (brdf.roughness >= kMirrorRoughness) continue;
      const double cosine = std::max(glm::dot(point.surface.facing_normal(), point.surface.to_viewer), 0.0);
      const glm::dvec3 throughput = point.throughput * brdf.fresnel(cosine) * sharpness(brdf.roughness);
      if (std::max({throughput.r, throughput.g, throughput.b}) < kLeastThroughput) continue;
      rays.push_back({&point, mirrored(point.surface), throughput});
      tile.batch.push(ray_origin(tile, point.surface, glm::dvec3(0.0)), rays.back().direction,
                      std::numeric_limits<double>::infinity());
    }
    tile.hits.resize(rays.size());
    tile.counts.reflection += rays.size();
    tile.counts.invalid += tile.rays->closest(tile.batch, tile.hits);

    const glm::dvec3 background(tile.scene.background.r, tile.scene.background.g, tile.scene.background.b);
    WorldTriangle triangle;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Mirrored& ray = rays[i];
      if (tile.hits[i] == kNoSurface) {
        tile.radiance[ray.from->pixel] += ray.throughput * background;
        continue;
      }
      tile.surfaces.load(tile.hits[i], triangle);
      PathPoint& reached = next.points.emplace_back();
      reached.surface = tile.surfaces.meet(triangle, ray.from->surface.position, ray.direction);
      reached.material =
          evaluate_material(tile.scene, tile.scene.materials[reached.surface.material], reached.surface.uv);
      reached.throughput = ray.throughput;
      reached.pixel = ray.from->pixel;
    }
  }
};

}  // namespace

std::unique_ptr<Pass> make_reflection_pass() {
  return std::make_unique<ReflectionPass>();
}

}  // namespace hpr
