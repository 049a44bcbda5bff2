#include "rt/passes/first_points.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <span>
#include <utility>

namespace hpr {
namespace {

Sampler sampler_of(const LightContext& context, const TileJob& job, int x, int y) {
  const View& view = *job.view;
  return {pixel_stream({context.settings.seed, job.number.frame}, view.screen_number, view.block.x0 + job.place.x0 + x,
                       view.block.y0 + job.place.y0 + y),
          job.number.sample};
}

/// See find_first_points. Points are finished once all are found: by then the memory has what materials read.
class FirstPoints {
 public:
  FirstPoints(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
              PixelSums& sums, std::vector<PathPoint>& points)
      : context_(context), job_(job), rows_(rows), buffers_(buffers), sums_(sums), points_(points) {}

  void find() {
    const std::size_t before = points_.size();
    find_surfaces();
    for (PathPoint& point : std::span(points_).subspan(before)) finish_point(context_, point);
  }

 private:
  void find_surfaces() {
    if (context_.rays != nullptr && context_.rays->has_holes()) look_through_holes();
    const std::optional<glm::dvec3> even = context_.lights.even_environment();
    prefetch(rows_.first);
    for (int y = rows_.first; y < rows_.end; ++y) {
      if (y + 1 < rows_.end) prefetch(y + 1);
      for (int x = 0; x < job_.place.width(); ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
        const double share = left_.empty() ? 1.0 : left_[pixel];
        if (!(share > 0.0) || !job_.wants(pixel)) continue;
        if (job_.keys[pixel] != kNoKey) {
          find_surface(x, y, job_.keys[pixel], share);
          continue;
        }
        const glm::dvec3 light = even ? *even : context_.lights.environment(glm::normalize(ray_of(x, y).direction));
        sums_.add(job_.first_pixel + static_cast<std::uint32_t>(pixel), Component::Direct, share * light);
      }
    }
  }

  void find_surface(int x, int y, Key key, double share) {
    const Ray ray = ray_of(x, y);
    const WorldTriangle& triangle = buffers_.triangles.load(context_.surfaces, key_surface(key));
    PathPoint& point = points_.emplace_back();
    point.surface = context_.surfaces.meet(triangle, ray.origin, ray.direction);
    start_point(context_, job_, x, y, share, point);
  }

  void prefetch(int y) const {
    std::array<std::uint32_t, kTileSide> ids;
    const std::span<const Key> row = job_.keys.subspan(static_cast<std::size_t>(y) * kTileSide, kTileSide);
    std::ranges::transform(row, ids.begin(), [](Key key) { return key == kNoKey ? kNoSurface : key_surface(key); });
    context_.surfaces.prefetch(ids);
  }

  [[nodiscard]] Ray ray_of(int x, int y) const {
    return view_ray(*job_.view, job_.place.x0 + x + 0.5, job_.place.y0 + y + 0.5);
  }

  /// Rays go from the near plane to the surface the key names: what they meet covers a share of what lies behind.
  void look_through_holes() {
    left_.assign(kTilePixels, 1.0);
    buffers_.requests.clear();
    WorldTriangle triangle;
    for (int y = rows_.first; y < rows_.end; ++y) {
      for (int x = 0; x < job_.place.width(); ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
        if (!job_.wants(pixel)) continue;
        const Ray ray = ray_of(x, y);
        RayRequest request = eye_ray(*job_.view, job_, x + 0.5, y + 0.5);
        if (job_.keys[pixel] != kNoKey) {
          context_.surfaces.load(key_surface(job_.keys[pixel]), triangle);
          const SurfacePoint behind = context_.surfaces.meet(triangle, ray.origin, ray.direction);
          request.reach = std::max(0.0, glm::dot(behind.position - request.origin, request.direction));
        }
        request.owner = pixel;
        buffers_.requests.push_back(request);
        sums_.charge_ray(job_.first_pixel + pixel);
      }
    }
    buffers_.counts.primary += buffers_.requests.size();
    std::vector<RayRequest> rays = std::move(buffers_.requests);
    context_.rays->visit_holed(rays, buffers_.scratch,
                               [&](std::size_t i, const SurfacePoint& surface, double coverage) {
                                 const std::uint32_t pixel = rays[i].owner;
                                 const int x = static_cast<int>(pixel) % kTileSide;
                                 const int y = static_cast<int>(pixel) / kTileSide;
                                 Sampler sampler = sampler_of(context_, job_, x, y).branch(surface.surface);
                                 const double covered = left_[pixel] * coverage;
                                 const double share = covered * survival(covered, sampler);
                                 if (share > 0.0) {
                                   PathPoint& point = points_.emplace_back();
                                   point.surface = surface;
                                   start_point(context_, job_, x, y, share, point);
                                 }
                                 left_[pixel] *= 1.0 - coverage;
                                 left_[pixel] *= survival(left_[pixel], sampler);
                                 return left_[pixel] > 0.0;
                               });
    buffers_.requests = std::move(rays);
  }

  const LightContext& context_;
  const TileJob& job_;
  RowRange rows_;
  RayBuffers& buffers_;
  PixelSums& sums_;
  std::vector<PathPoint>& points_;
  std::vector<double> left_;  ///< per pixel: the share not yet covered; empty where nothing covers in part
};

}  // namespace

void start_point(const LightContext& context, const TileJob& job, int x, int y, double share, PathPoint& point) {
  point.share = share;
  point.media = context.eye_media;
  point.throughput = share * left_after(point.media.here, glm::distance(job.view->eye, point.surface.position));
  point.sampler = sampler_of(context, job, x, y);
  point.pixel = job.first_pixel + static_cast<std::uint32_t>(y * kTileSide + x);
  prefetch_material(context.scene, point.surface);
}

RayRequest eye_ray(const View& view, const TileJob& job, double x, double y) {
  const Ray ray = view_ray(view, job.place.x0 + x, job.place.y0 + y);
  RayRequest request;
  request.origin = ray.origin + ray.direction * view.near_distance;
  request.direction = glm::normalize(ray.direction);
  request.reach = view.orthographic ? view.far_distance - view.near_distance : std::numeric_limits<double>::infinity();
  return request;
}

std::vector<std::size_t> fullest_first(std::span<const std::size_t> tiles, const TileLayer<Key>& keys, int threads) {
  constexpr std::size_t kManyPerThread = 64;
  std::vector<std::size_t> order(tiles.begin(), tiles.end());
  if (threads < 2 || order.size() > kManyPerThread * static_cast<std::size_t>(threads)) return order;
  std::vector<std::pair<std::ptrdiff_t, std::size_t>> empty;  // pixels, of every fourth row
  for (const std::size_t tile : order) {
    std::ptrdiff_t pixels = keys.active(tile) ? 0 : kTilePixels;
    for (std::size_t row = 0; keys.active(tile) && row < kTilePixels; row += 4 * std::size_t{kTileSide}) {
      pixels += std::ranges::count(keys.tile(tile).subspan(row, kTileSide), kNoKey);
    }
    empty.emplace_back(pixels, tile);
  }
  std::ranges::sort(empty);
  std::ranges::transform(empty, order.begin(), [](const auto& each) { return each.second; });
  return order;
}

int end_of_wave(const TileJob& job, int first) {
  if (job.wanted.empty()) return std::min(first + static_cast<int>(kWavePoints) / kTileSide, job.place.height());
  std::size_t points = 0;
  int row = first;
  do {
    const auto pixels = job.wanted.subspan(static_cast<std::size_t>(row) * kTileSide, kTileSide);
    points += static_cast<std::size_t>(std::ranges::count(pixels, std::uint8_t{1}));
  } while (++row < job.place.height() && points + kTileSide <= kWavePoints);
  return row;
}

void find_first_points(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                       PixelSums& sums, std::vector<PathPoint>& points) {
  FirstPoints(context, job, rows, buffers, sums, points).find();
}

}  // namespace hpr
