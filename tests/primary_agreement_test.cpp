#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "core/timing.h"
#include "raster/rasterizer.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/surfaces.h"
#include "scene/load_scene.h"
#include "tools/sweep.h"

// Keys by OpenGL against keys by rays. HPR_AGREEMENT="SCENE SCENE ..." compares, and times, those scenes at 1920x1080.
namespace hpr {
namespace {

/// A triangle's plane as the ray through a place of the screen meets it.
struct Met {
  std::array<double, 3> barycentric{};
  double distance = 0.0;  ///< along the view axis
};

Met meet(const View& view, const WorldTriangle& triangle, double x, double y) {
  const Ray ray = view_ray(view, x, y);
  const glm::dvec3 from_v0 = ray.origin - triangle.v0;
  const glm::dvec3 p = glm::cross(ray.direction, triangle.e2);
  const glm::dvec3 q = glm::cross(from_v0, triangle.e1);
  const double determinant = glm::dot(triangle.e1, p);
  const double u = glm::dot(from_v0, p) / determinant;
  const double v = glm::dot(ray.direction, q) / determinant;
  return {{1.0 - u - v, u, v}, glm::dot(triangle.e2, q) / determinant};
}

/// In pixels, to where a quantity that is `here` and grows by (across, down) per pixel is zero.
double pixels_to_zero(double here, double across, double down) {
  const double slope = std::hypot(across, down);
  return slope > 0.0 ? std::abs(here) / slope : std::numeric_limits<double>::infinity();
}

constexpr double kStep = 1e-3;  // pixels

/// In pixels, from a place of the screen to the outline of a triangle.
double pixels_to_outline(const View& view, const WorldTriangle& triangle, double x, double y) {
  const Met here = meet(view, triangle, x, y);
  const Met right = meet(view, triangle, x + kStep, y);
  const Met below = meet(view, triangle, x, y + kStep);
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const double across = (right.barycentric.at(i) - here.barycentric.at(i)) / kStep;
    const double down = (below.barycentric.at(i) - here.barycentric.at(i)) / kStep;
    const double away = pixels_to_zero(here.barycentric.at(i), across, down);
    // Outside, the farthest of the edges it is outside of counts; inside, the nearest edge.
    least = std::min(least, here.barycentric.at(i) < 0.0 ? -away : away);
  }
  return std::isfinite(least) ? std::abs(least) : 0.0;  // a triangle seen edge-on is all outline
}

/// In pixels, from a place of the screen to where two triangles' planes cross.
double pixels_to_crossing(const View& view, const WorldTriangle& a, const WorldTriangle& b, double x, double y) {
  const auto apart = [&](double dx, double dy) {
    return meet(view, a, x + dx, y + dy).distance - meet(view, b, x + dx, y + dy).distance;
  };
  const double here = apart(0.0, 0.0);
  return pixels_to_zero(here, (apart(kStep, 0.0) - here) / kStep, (apart(0.0, kStep) - here) / kStep);
}

struct Agreement {
  std::size_t pixels = 0;
  std::size_t covered = 0;
  std::size_t differing = 0;
  std::size_t coverage = 0;         ///< of those, one of the two sees nothing
  double farthest_from_edge = 0.0;  ///< pixels
};

Agreement compare(const Scene& scene, const View& view, const Image<Key>& raster, const Image<Key>& rays) {
  Agreement result;
  const Surfaces surfaces(scene, RaySpace(scene));
  for (int y = 0; y < raster.height(); ++y) {
    for (int x = 0; x < raster.width(); ++x) {
      const Key a = raster.at(x, y);
      const Key b = rays.at(x, y);
      ++result.pixels;
      result.covered += a != kNoKey ? 1U : 0U;
      if (a == b || (a != kNoKey && b != kNoKey && key_surface(a) == key_surface(b))) continue;
      ++result.differing;
      std::array<WorldTriangle, 2> triangles;
      double least = std::numeric_limits<double>::infinity();
      for (const auto& [key, triangle] : {std::pair{a, &triangles[0]}, {b, &triangles[1]}}) {
        if (key == kNoKey) continue;
        surfaces.load(key_surface(key), *triangle);
        least = std::min(least, pixels_to_outline(view, *triangle, x + 0.5, y + 0.5));
      }
      if (a == kNoKey || b == kNoKey) {
        ++result.coverage;
      } else {
        least = std::min(least, pixels_to_crossing(view, triangles[0], triangles[1], x + 0.5, y + 0.5));
      }
      result.farthest_from_edge = std::max(result.farthest_from_edge, least);
    }
  }
  return result;
}

/// A draw into a cleared layer, in ms.
template <typename Draw>
double time_of(TileLayer<Key>& layer, Draw&& draw) {
  layer.clear();
  const Stopwatch watch;
  draw();
  return watch.ms();
}

/// Draws both ways, in turn, so that a machine that slows down slows down both; prints what `tries` > 1 tries took.
Agreement agreement_on(const std::string& source, Size size, int tries) {
  const Scene scene = load_scene(source, {});
  const Camera camera = scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front();
  const View view = make_view(camera, size, scene.bounds);
  const int threads = 2;
  const std::array all{view.block};
  TileLayer<Key> layer(FrameLayout({size}));

  const auto context = make_gl_context({.backend = "auto", .device = -1, .local_rank = 0, .threads = threads});
  Rasterizer rasterizer(*context, scene, std::array{SurfaceRange{0, scene.triangles}}, threads);
  const Stopwatch build;
  const RayScene rays(scene, RaySpace(scene), threads);
  const double build_ms = build.ms();
  PrimaryRays primary(scene, rays, threads);
  std::vector<double> raster_ms;
  std::vector<double> rays_ms;
  std::vector<double> ratios;
  Image<Key> raster;
  for (int i = 0; i < tries; ++i) {
    raster_ms.push_back(time_of(layer, [&] { rasterizer.draw(view, 0, all, layer); }));
    raster = to_image(layer, 0);
    rays_ms.push_back(time_of(layer, [&] { primary.draw(view, 0, all, layer); }));
    ratios.push_back(raster_ms.back() / rays_ms.back());
  }
  const Agreement result = compare(scene, view, raster, to_image(layer, 0));
  if (tries > 1) {
    fmt::print(
        "{}: {} triangles, raster {:.1f} ms, rays {:.1f} ms ({:.2f} x, from {:.2f} to {:.2f}; Embree's scene {:.0f} "
        "ms), {} of {} pixels covered, {} ({:.4f} %) show another surface, {} of them nothing on one side, {:.4f} px "
        "at most from an edge; {} weighed, {} retraced\n",
        source, scene.triangles, median(raster_ms), median(rays_ms), median(ratios), std::ranges::min(ratios),
        std::ranges::max(ratios), build_ms, result.covered, result.pixels, result.differing,
        100.0 * static_cast<double>(result.differing) / static_cast<double>(result.pixels), result.coverage,
        result.farthest_from_edge, primary.stats().weighed, primary.stats().retraced);
  }
  return result;
}

void expect_agreement(const Agreement& result) {
  EXPECT_GT(result.covered, result.pixels / 100);
  EXPECT_LE(result.differing * 1000, result.pixels);
  // OpenGL rounds corners to 1/256 of a pixel.
  EXPECT_LT(result.farthest_from_edge, 1.0 / 32.0);
}

TEST(PrimaryAgreement, RaysAndOpenGlSeeTheSameButAtEdges) {
  for (const char* const source : {"gen:gallery", "gen:asteroids?count=300", "gen:cornell", "gen:cloud"}) {
    SCOPED_TRACE(source);
    expect_agreement(agreement_on(source, {640, 360}, 1));
  }
}

TEST(PrimaryAgreement, OnTheScenesOfTheEnvironment) {
  const char* const scenes = std::getenv("HPR_AGREEMENT");
  if (scenes == nullptr) GTEST_SKIP() << "HPR_AGREEMENT names no scenes";
  const std::string list(scenes);
  for (std::size_t start = 0; start < list.size();) {
    const std::size_t end = std::min(list.find(' ', start), list.size());
    const std::string source = list.substr(start, end - start);
    SCOPED_TRACE(source);
    expect_agreement(agreement_on(source, {1920, 1080}, 11));
    start = end + 1;
  }
}

}  // namespace
}  // namespace hpr
