#include "rt/outlines.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <optional>

namespace hpr {
namespace {

/// How far one place may lie off the other's tangent plane, in distances between the two.
constexpr float kMostBent = 0.5F;
/// How far apart they may lie, in distances from the eye.
constexpr float kMostApart = 0.1F;
/// Cosine between the normals of two corners of a pixel that no outline lies between.
constexpr float kLeastCosine = 0.8F;

bool goes_through_the_same(const std::optional<PixelPoints>& a, const std::optional<PixelPoints>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->map == b->map && a->eye == b->eye && a->axes == b->axes && a->orthographic == b->orthographic &&
         a->scale == b->scale;
}

/// But for the place in the pixels.
bool shows_the_same(const View& a, const View& b) {
  return a.eye == b.eye && a.axes == b.axes && a.left == b.left && a.right == b.right && a.bottom == b.bottom &&
         a.top == b.top && a.near_distance == b.near_distance && a.far_distance == b.far_distance &&
         a.orthographic == b.orthographic && a.screen == b.screen && a.block == b.block &&
         a.screen_number == b.screen_number && goes_through_the_same(a.points, b.points);
}

/// What a corner of a pixel shows.
struct Corner {
  bool seen = false;
  std::uint32_t material = 0;
  glm::vec3 place{0.0F};
  glm::vec3 normal{0.0F};
};

bool is_outline(const View& view, const Corner& a, const Corner& b) {
  if (a.seen != b.seen) return true;
  if (!a.seen) return false;
  return a.material != b.material || glm::dot(a.normal, b.normal) < kLeastCosine ||
         !is_placed_alike(view, a.place, b.place, a.normal);
}

}  // namespace

bool is_placed_alike(const View& view, const glm::vec3& first, const glm::vec3& second, const glm::vec3& normal) {
  const glm::vec3 way = second - first;
  const float distance2 = glm::dot(way, way);
  const float off = glm::dot(way, normal);
  if (off * off > kMostBent * kMostBent * distance2) return false;
  // Parallel rays have no eye to be far from.
  return view.orthographic || distance2 <= kMostApart * kMostApart * glm::dot(second, second);
}

void trace_from_eye(TileWork& work) {
  work.hits.resize(work.requests.size());
  work.counts.primary += work.requests.size();
  work.counts.invalid += work.rays->closest(work.requests, work.hits, work.scratch, Coherence::High);
}

void Outlines::prepare(const FrameLayout& layout, std::span<const View> views) {
  if (layout_ == layout && std::ranges::equal(views_, views, shows_the_same)) return;
  layout_ = layout;
  views_.assign(views.begin(), views.end());
  masks_.assign(layout.tiles(), {});
}

std::span<const std::uint8_t> Outlines::of_tile(TileWork& work, const TileJob& job, std::size_t tile) {
  Mask& mask = masks_[tile];
  if (mask.empty()) mask = find(work, job);
  return mask;
}

Outlines::Mask Outlines::find(TileWork& work, const TileJob& job) {
  Mask mask(kTilePixels, 0);
  if (work.rays->has_holes()) return mask;
  View view = *job.view;
  view.jitter = glm::dvec2(0.0);
  const int width = job.place.width();
  const int height = job.place.height();
  work.requests.clear();
  for (int y = 0; y <= height; ++y) {
    for (int x = 0; x <= width; ++x) work.requests.push_back(eye_ray(view, job, x, y));
  }
  trace_from_eye(work);
  std::vector<Corner> corners(work.hits.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (work.hits[i] == kNoSurface) continue;
    const WorldTriangle& triangle = work.triangles.load(work.surfaces, work.hits[i]);
    const SurfacePoint point = work.surfaces.meet(triangle, work.requests[i].origin, work.requests[i].direction);
    corners[i] = {true, point.material, point.position - view.eye, point.facing_normal()};
  }
  const auto at = [&](int x, int y) -> const Corner& {
    return corners[static_cast<std::size_t>(y) * static_cast<std::size_t>(width + 1) + static_cast<std::size_t>(x)];
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool crossed = is_outline(view, at(x, y), at(x + 1, y)) ||
                           is_outline(view, at(x, y + 1), at(x + 1, y + 1)) ||
                           is_outline(view, at(x, y), at(x, y + 1)) || is_outline(view, at(x + 1, y), at(x + 1, y + 1));
      mask[static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x)] = crossed ? 1 : 0;
    }
  }
  return mask;
}

}  // namespace hpr
