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

SurfacePlane CoverageTraversal::plane_at(std::uint32_t surface, const RayRequest& ray, WorldTriangle& triangle) const {
  surfaces_.load(surface, triangle);
  return surfaces_.plane(triangle, ray.origin, ray.direction);
}

CoveringLayer CoverageTraversal::layer_at(std::uint32_t surface, const RayRequest& ray, WorldTriangle& triangle) const {
  surfaces_.load(surface, triangle);
  CoveringLayer layer;
  layer.point = surfaces_.meet(triangle, ray.origin, ray.direction);
  layer.plane = {layer.point.position, layer.point.geometric_normal,
                 surfaces_.coplanar_tolerance(triangle, layer.point.offset)};
  layer.coverage = evaluate_alpha(scene_, scene_.materials[layer.point.material], layer.point.uv, layer.point.color.a);
  return layer;
}

namespace {

/// Metres along the normal of `first`, whose viewer they are both seen by.
double distance_behind(const SurfacePlane& first, const SurfacePlane& other) {
  return glm::dot(first.position - other.position, first.normal);
}

bool in_one_plane(const SurfacePlane& first, const SurfacePlane& other) {
  return std::abs(distance_behind(first, other)) <= first.tolerance + other.tolerance;
}

bool hides(const SurfacePlane& end, const SurfacePlane& other) {
  return distance_behind(end, other) > end.tolerance + other.tolerance;
}

bool covers_wholly(const CoveringLayer& layer) {
  return layer.coverage >= 1.0;
}

/// Visits those of one plane, by id, and forgets them. Returns whether the ray goes on.
bool visit_layers(std::size_t ray, std::vector<CoveringLayer>& layers, const CoverageTraversal::Visit& visit) {
  std::ranges::sort(layers, {}, [](const CoveringLayer& layer) { return layer.point.surface; });
  const bool goes_on =
      std::ranges::all_of(layers, [&](const CoveringLayer& layer) { return visit(ray, layer.point, layer.coverage); });
  layers.clear();
  return goes_on;
}

}  // namespace

/// Metres. As far as Embree may find what lies in the backdrop's plane: what lies behind it is told apart in double.
double CoverageTraversal::reach_past(const SurfacePlane& end, const RayRequest& ray) const {
  constexpr double kMinCosine = 1.0 / 1024.0;
  const double sizes = 4.0 * kOriginSteps * kFloatStep / space_.scale;  // ray space reaches 2 to each side
  const double cosine = std::max(std::abs(glm::dot(end.normal, ray.direction)), kMinCosine);
  const double distance = std::max(glm::dot(end.position - ray.origin, ray.direction), 0.0);
  return std::min(ray.reach, distance * (1.0 + kOriginSteps * kFloatStep) + (sizes + end.tolerance) / cosine);
}

/// Makes scratch.batch and scratch.met of the waiting rays.
void CoverageTraversal::push_waiting(const LayeredRays& rays, TraversalScratch& scratch) const {
  scratch.batch.clear();
  scratch.met.clear();
  for (const std::uint32_t ray : scratch.waiting) {
    RayRequest request = rays.requests[ray];
    if (rays.ends_at_plane(ray)) request.reach = reach_past(rays.ends[ray], request);
    // Behind what covers wholly, only more of its own plane matters.
    const std::vector<CoveringLayer>& layers = scratch.layers[ray];
    if (std::ranges::any_of(layers, covers_wholly)) request.reach = reach_past(layers.front().plane, request);
    push(request, scratch.batch);
    scratch.met.push_back(scratch.last[ray]);
  }
}

/// Adds the surface that the waiting ray `i` has met to the layers of its plane, and visits those it lies behind.
/// Returns whether the ray goes on.
bool CoverageTraversal::add_layer(std::size_t i, const LayeredRays& rays, TraversalScratch& scratch,
                                  WorldTriangle& triangle, const Visit& visit) const {
  const std::uint32_t ray = scratch.waiting[i];
  std::vector<CoveringLayer>& layers = scratch.layers[ray];
  if (scratch.surfaces[i] == kNoSurface) {
    (void)visit_layers(ray, layers, visit);
    return false;
  }
  const CoveringLayer layer = layer_at(scratch.surfaces[i], rays.requests[ray], triangle);
  const bool hidden = rays.ends_at_plane(ray) && hides(rays.ends[ray], layer.plane);
  const bool follows = !layers.empty() && (hidden || !in_one_plane(layers.front().plane, layer.plane));
  if (follows && !visit_layers(ray, layers, visit)) return false;
  if (!hidden) layers.push_back(layer);
  const double gained = scratch.met[i].distance - scratch.last[ray].distance;
  scratch.last[ray] = scratch.met[i];
  if (passes_on(scratch.passed[ray], layer.coverage, gained)) return true;
  if (visit_layers(ray, layers, visit)) ++scratch.cut;
  return false;
}

void CoverageTraversal::visit_alpha_tested(std::span<const RayRequest> rays, TraversalScratch& scratch,
                                           const Visit& visit, std::span<const SurfacePlane> ends) const {
  if (alpha_tested_ == nullptr) return;
  HPR_CHECK(ends.empty() || ends.size() == rays.size());
  const LayeredRays layered{rays, ends};
  scratch.waiting.resize(rays.size());
  std::iota(scratch.waiting.begin(), scratch.waiting.end(), 0U);
  scratch.passed.assign(rays.size(), 0);
  scratch.last.assign(rays.size(), Passed{});
  scratch.layers.resize(std::max(scratch.layers.size(), rays.size()));
  WorldTriangle triangle;
  while (!scratch.waiting.empty()) {
    push_waiting(layered, scratch);
    scratch.surfaces.resize(scratch.waiting.size());
    (void)alpha_tested_->closest(scratch.batch, scratch.met, scratch.surfaces);
    surfaces_.prefetch(scratch.surfaces, scratch.batch.purpose.generation);
    std::size_t left = 0;
    for (std::size_t i = 0; i < scratch.waiting.size(); ++i) {
      if (add_layer(i, layered, scratch, triangle, visit)) scratch.waiting[left++] = scratch.waiting[i];
    }
    scratch.waiting.resize(left);
  }
}

std::uint64_t CoverageTraversal::closest_opaque(std::span<const RayRequest> rays, std::span<std::uint32_t> hits,
                                                TraversalScratch& scratch, Coherence coherence) const {
  HPR_CHECK(hits.size() == rays.size());
  scratch.batch.clear();
  for (const RayRequest& ray : rays) push(ray, scratch.batch);
  return opaque_.closest(scratch.batch, hits, coherence);
}

std::uint64_t CoverageTraversal::closest(std::span<const RayRequest> rays, std::span<std::uint32_t> hits,
                                         TraversalScratch& scratch, Coherence coherence) const {
  const std::uint64_t invalid = closest_opaque(rays, hits, scratch, coherence);
  surfaces_.prefetch(hits, scratch.batch.purpose.generation);
  if (alpha_tested_ == nullptr) return invalid;
  WorldTriangle triangle;
  scratch.ends.assign(rays.size(), SurfacePlane{});
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i] != kNoSurface) scratch.ends[i] = plane_at(hits[i], rays[i], triangle);
  }
  visit_alpha_tested(
      rays, scratch,
      [&](std::size_t i, const SurfacePoint& point, double coverage) {
        if (passes_by_chance(coverage, *rays[i].sampler)) return true;
        hits[i] = point.surface;
        return false;
      },
      scratch.ends);
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

/// Counts those that one of the two scenes holds.
std::uint64_t CoverageTraversal::add_surfaces(const RayScene& scene, std::span<const RayRequest> rays,
                                              std::span<std::uint32_t> counts, TraversalScratch& scratch) const {
  scratch.waiting.resize(rays.size());
  std::iota(scratch.waiting.begin(), scratch.waiting.end(), 0U);
  scratch.met.assign(rays.size(), Passed{});
  std::uint64_t invalid = 0;
  for (bool is_first = true; !scratch.waiting.empty(); is_first = false) {
    scratch.batch.clear();
    for (const std::uint32_t ray : scratch.waiting) push(rays[ray], scratch.batch);
    scratch.surfaces.resize(scratch.waiting.size());
    const std::uint64_t refused = scene.closest(scratch.batch, scratch.met, scratch.surfaces);
    if (is_first) invalid = refused;
    std::size_t left = 0;
    for (std::size_t i = 0; i < scratch.waiting.size(); ++i) {
      if (scratch.surfaces[i] == kNoSurface) continue;
      ++counts[scratch.waiting[i]];
      scratch.waiting[left] = scratch.waiting[i];
      scratch.met[left++] = scratch.met[i];
    }
    scratch.waiting.resize(left);
    scratch.met.resize(left);
  }
  return invalid;
}

std::uint64_t CoverageTraversal::count_surfaces(std::span<const RayRequest> rays, std::span<std::uint32_t> counts,
                                                TraversalScratch& scratch) const {
  HPR_CHECK(counts.size() == rays.size());
  std::ranges::fill(counts, 0U);
  const std::uint64_t invalid = add_surfaces(opaque_, rays, counts, scratch);
  if (alpha_tested_ != nullptr) (void)add_surfaces(*alpha_tested_, rays, counts, scratch);
  return invalid;
}

}  // namespace hpr
