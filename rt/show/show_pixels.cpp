#include "rt/show/show_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "rt/sampling/sampling.h"
#include "rt/show/show.h"

namespace hpr {
namespace {

constexpr glm::dvec3 kBlack(0.0);
constexpr glm::dvec3 kWhite(1.0);

glm::dvec3 to_vector(const Rgb& color) {
  return {color.r, color.g, color.b};
}

/// What stands where nothing is seen.
glm::dvec3 background(Show show) {
  return show == Show::Wireframe || show == Show::Ao ? kWhite : kBlack;
}

glm::dvec3 uv_color(const SurfacePoint& point) {
  const glm::dvec2 uv(point.uv[0]);
  const glm::dvec2 part = uv - glm::floor(uv);
  return {part, 0.0};
}

/// Areas that a ray sees of a triangle, one per edge and up to a common factor: linear in where the ray goes through
/// the screen, 0 on the edge. Moeller and Trumbore's barycentric coordinates before they divide.
std::array<double, 3> edge_areas(const WorldTriangle& triangle, const Ray& ray) {
  const glm::dvec3 from_v0 = ray.origin - triangle.v0;
  const glm::dvec3 p = glm::cross(ray.direction, triangle.e2);
  const double u = glm::dot(from_v0, p);
  const double v = glm::dot(ray.direction, glm::cross(from_v0, triangle.e1));
  return {u, v, glm::dot(triangle.e1, p) - u - v};
}

/// How many pixels the nearest edge of the triangle is away from the place (x, y) in the tile.
double pixels_to_edge(const WorldTriangle& triangle, const TileJob& job, double x, double y) {
  const auto areas_at = [&](double dx, double dy) {
    return edge_areas(triangle, view_ray(*job.view, job.rect.x0 + x + dx, job.rect.y0 + y + dy));
  };
  const std::array<double, 3> here = areas_at(0.0, 0.0);
  const std::array<double, 3> right = areas_at(1.0, 0.0);
  const std::array<double, 3> below = areas_at(0.0, 1.0);
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t edge = 0; edge < here.size(); ++edge) {
    const double slope = std::hypot(right[edge] - here[edge], below[edge] - here[edge]);
    nearest = std::min(nearest, slope > 0.0 ? std::abs(here[edge]) / slope : 0.0);
  }
  return nearest;
}

/// Some rows of a tile, see show_pixels().
class ShownRows {
 public:
  ShownRows(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers, PixelSums& sums,
            std::span<const PathVertex> points)
      : context_(context), job_(job), rows_(rows), buffers_(buffers), sums_(sums), points_(points) {}

  void show() {
    each_pixel([&](std::uint32_t pixel, int, int) { sums_.radiance[job_.first_pixel + pixel] = kBlack; });
    if (context_.settings.show == Show::Overdraw) {
      show_overdraw();
    } else if (context_.settings.show == Show::Ao) {
      show_occlusion();
    } else {
      show_surfaces();
    }
  }

 private:
  template <typename Body>
  void each_pixel(const Body& body) const {
    for (int y = rows_.first; y < rows_.end; ++y) {
      for (int x = 0; x < job_.rect.width(); ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
        if (job_.wants(pixel)) body(pixel, x, y);
      }
    }
  }

  [[nodiscard]] glm::dvec3 value_of(const PathVertex& point) {
    const std::uint32_t pixel = point.pixel - job_.first_pixel;
    const std::uint32_t x = pixel % kTileSide;
    const std::uint32_t y = pixel / kTileSide;
    switch (context_.settings.show) {
      case Show::Normal:
        return 0.5 * point.material.normal + 0.5;
      case Show::Uv:
        return uv_color(point.surface);
      case Show::Wireframe:
        return glm::dvec3(std::min(pixels_to_edge(triangle_of(point), job_, x + 0.5, y + 0.5), 1.0));
      case Show::Ids:
        return to_vector(distinct_color(triangle_of(point).instance));
      default:
        return kBlack;  // Rank: the shader does not know who drew the surface
    }
  }

  [[nodiscard]] const WorldTriangle& triangle_of(const PathVertex& point) {
    return buffers_.triangles.load(context_.surfaces, point.surface.surface);
  }

  void show_surfaces() {
    for (const PathVertex& point : points_) add(point, value_of(point));
    add_background();
  }

  void add(const PathVertex& point, const glm::dvec3& value) {
    covered_[point.pixel - job_.first_pixel] += point.coverage;
    sums_.radiance[point.pixel] += point.coverage * value;
  }

  void add_background() {
    const glm::dvec3 value = background(context_.settings.show);
    each_pixel([&](std::uint32_t pixel, int, int) {
      sums_.radiance[job_.first_pixel + pixel] += std::max(1.0 - covered_[pixel], 0.0) * value;
    });
  }

  void show_overdraw() {
    buffers_.requests.clear();
    each_pixel([&](std::uint32_t pixel, int x, int y) {
      RayRequest ray = eye_ray(*job_.view, job_, x + 0.5, y + 0.5);
      ray.owner = job_.first_pixel + pixel;
      buffers_.requests.push_back(ray);
      sums_.count_ray(ray.owner);
    });
    std::vector<std::uint32_t> surfaces(buffers_.requests.size());
    buffers_.counts.primary += surfaces.size();
    buffers_.scratch.batch.purpose = {RayKind::Primary};
    buffers_.counts.invalid += context_.rays->count_surfaces(buffers_.requests, surfaces, buffers_.scratch);
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      sums_.radiance[buffers_.requests[i].owner] = to_vector(count_color(surfaces[i], kMaxOverdraw));
    }
  }

  /// A direction that leads behind the surface is one that the surface itself stops.
  void show_occlusion() {
    const double reach = occlusion_reach(context_.scene);
    buffers_.requests.clear();
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      const SurfacePoint& surface = points_[i].surface;
      Sampler sampler = points_[i].sampler.branch(kOcclusionBranch);
      for (int ray = 0; ray < kShownOcclusionRays; ++ray) {
        const glm::dvec3 direction = warp::cosine_lobe(surface.facing_normal(), sampler.two());
        if (!(glm::dot(direction, surface.geometric_normal) > 0.0)) continue;
        buffers_.requests.push_back(
            {ray_origin(surface, direction) + surface.lift, direction, reach, nullptr, i, Faces::Both});
        sums_.count_ray(points_[i].pixel);
      }
    }
    std::vector<float> passed(buffers_.requests.size());
    buffers_.counts[PassId::AmbientOcclusion] += passed.size();
    buffers_.scratch.batch.purpose = {RayKind::Occlusion, 1};
    buffers_.counts.invalid += context_.rays->passed(buffers_.requests, passed, buffers_.scratch);
    std::vector<double> open(points_.size(), 0.0);
    for (std::size_t i = 0; i < passed.size(); ++i) open[buffers_.requests[i].owner] += static_cast<double>(passed[i]);
    for (std::size_t i = 0; i < points_.size(); ++i) add(points_[i], glm::dvec3(open[i] / kShownOcclusionRays));
    add_background();
  }

  static constexpr std::uint32_t kOcclusionBranch = 17;

  const LightContext& context_;
  const TileJob& job_;
  RowRange rows_;
  RayBuffers& buffers_;
  PixelSums& sums_;
  std::span<const PathVertex> points_;
  std::array<double, kTilePixels> covered_{};  ///< per pixel: the part that surfaces cover
};

}  // namespace

void show_pixels(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                 PixelSums& sums, std::span<const PathVertex> points) {
  ShownRows(context, job, rows, buffers, sums, points).show();
}

void show_cost(const TileJob& job, PixelSums& sums) {
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (job.wants(i)) {
      sums.radiance[job.first_pixel + i] =
          to_vector(count_color(static_cast<double>(sums.cost[job.first_pixel + i]), kMaxCost));
    }
  }
}

}  // namespace hpr
