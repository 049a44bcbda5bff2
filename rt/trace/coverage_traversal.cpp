#include "rt/trace/coverage_traversal.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "core/error.h"
#include "rt/materials/bsdf.h"

namespace hpr {

void CoverageTraversal::push(const RayRequest& ray, RayBatch& batch) const {
  // Space is scaled by a power of two, so an infinite reach stays one.
  batch.push(space_.from_world(ray.origin), ray.direction, ray.reach * space_.scale, ray.faces);
}

double CoverageTraversal::coverage_of(const SurfacePoint& point) const {
  return evaluate_alpha(scene_, scene_.materials[point.material], point.uv, point.color.a);
}

void CoverageTraversal::visit_alpha_tested(std::span<const RayRequest> rays, TraversalScratch& scratch,
                                           const Visit& visit) const {
  if (alpha_tested_ == nullptr) return;
  scratch.waiting.resize(rays.size());
  std::iota(scratch.waiting.begin(), scratch.waiting.end(), 0U);
  scratch.passed.assign(rays.size(), 0);
  scratch.last.assign(rays.size(), Passed{});
  WorldTriangle triangle;
  while (!scratch.waiting.empty()) {
    scratch.batch.clear();
    scratch.met.clear();
    for (const std::uint32_t ray : scratch.waiting) {
      push(rays[ray], scratch.batch);
      scratch.met.push_back(scratch.last[ray]);
    }
    scratch.surfaces.resize(scratch.waiting.size());
    (void)alpha_tested_->closest(scratch.batch, scratch.met, scratch.surfaces);
    std::size_t left = 0;
    for (std::size_t i = 0; i < scratch.waiting.size(); ++i) {
      if (scratch.surfaces[i] == kNoSurface) continue;
      const std::uint32_t ray = scratch.waiting[i];
      surfaces_.load(scratch.surfaces[i], triangle);
      const SurfacePoint point = surfaces_.meet(triangle, rays[ray].origin, rays[ray].direction);
      const double coverage = coverage_of(point);
      if (!visit(ray, point, coverage)) continue;
      const double gained = scratch.met[i].distance - scratch.last[ray].distance;
      scratch.last[ray] = scratch.met[i];
      if (passes_on(scratch.passed[ray], coverage, gained)) {
        scratch.waiting[left++] = ray;
      } else {
        ++scratch.cut;
      }
    }
    scratch.waiting.resize(left);
  }
}

std::uint64_t CoverageTraversal::closest(std::span<const RayRequest> rays, std::span<std::uint32_t> hits,
                                         TraversalScratch& scratch, Coherence coherence) const {
  HPR_CHECK(hits.size() == rays.size());
  scratch.batch.clear();
  for (const RayRequest& ray : rays) push(ray, scratch.batch);
  const std::uint64_t invalid = opaque_.closest(scratch.batch, hits, coherence);
  surfaces_.prefetch(hits);
  if (alpha_tested_ == nullptr) return invalid;
  WorldTriangle triangle;
  scratch.rest.assign(rays.begin(), rays.end());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i] == kNoSurface) continue;
    RayRequest& ray = scratch.rest[i];
    surfaces_.load(hits[i], triangle);
    const SurfacePoint point = surfaces_.meet(triangle, ray.origin, ray.direction);
    ray.reach = std::min(ray.reach, glm::dot(point.position - ray.origin, ray.direction));
  }
  visit_alpha_tested(scratch.rest, scratch, [&](std::size_t i, const SurfacePoint& point, double coverage) {
    if (passes_by_chance(coverage, *rays[i].sampler)) return true;
    hits[i] = point.surface;
    return false;
  });
  return invalid;
}

std::uint64_t CoverageTraversal::passed(std::span<const RayRequest> rays, std::span<float> passed,
                                        TraversalScratch& scratch) const {
  HPR_CHECK(passed.size() == rays.size());
  scratch.batch.clear();
  for (const RayRequest& ray : rays) push(ray, scratch.batch);
  scratch.blocked.resize(rays.size());
  const std::uint64_t invalid = opaque_.occluded(scratch.batch, scratch.blocked);
  for (std::size_t i = 0; i < rays.size(); ++i) passed[i] = scratch.blocked[i] != 0 ? 0.0F : 1.0F;
  if (alpha_tested_ == nullptr) return invalid;
  scratch.rest.assign(rays.begin(), rays.end());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (passed[i] == 0.0F) scratch.rest[i].reach = 0.0;
  }
  visit_alpha_tested(scratch.rest, scratch, [&](std::size_t i, const SurfacePoint&, double coverage) {
    passed[i] *= static_cast<float>(1.0 - coverage);
    return passed[i] > 0.0F;
  });
  return invalid;
}

}  // namespace hpr
