#include "rt/denoise/coverage_fragments.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <memory>
#include <vector>

#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

const RaySettings kDenoised{.passes = {PassId::Gather}, .max_depth = 2, .denoise = true};

/// Black things before a white sky: so a pixel is the share of the sky in it.
Scene before_the_sky() {
  Scene scene;
  add_material(scene, test::diffuse(glm::vec3(0.0F)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  return scene;
}

struct Error {
  double rms = 0.0;  ///< over pixels that see both
  double mean = 0.0;
  double most = 0.0;
  int pixels = 0;
};

/// Of a picture of such a scene, by what `hides` says of rays through many places of each pixel.
Error error_of(const Scene& scene, const View& view, const std::function<bool(const Ray&)>& hides) {
  const Image<Rgb> image = test::shade(scene, view, kDenoised).image;
  constexpr int kSide = 48;
  Error error;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      int sky = 0;
      for (int i = 0; i < kSide * kSide; ++i) {
        sky += hides(view_ray(view, x + (i % kSide + 0.5) / kSide, y + (static_cast<double>(i / kSide) + 0.5) / kSide))
                   ? 0
                   : 1;
      }
      if (sky == 0 || sky == kSide * kSide) continue;
      const double off = static_cast<double>(image.at(x, y).g) - static_cast<double>(sky) / (kSide * kSide);
      error.rms += off * off;
      error.mean += off;
      error.most = std::max(error.most, std::abs(off));
      ++error.pixels;
    }
  }
  error.rms = std::sqrt(error.rms / error.pixels);
  error.mean /= error.pixels;
  return error;
}

View straight_on(const Scene& scene, const Size& size = {64, 64}) {
  return test::view_from({0, 0, 3}, {0, 0, 0}, size, scene);
}

TEST(CoverageFragments, FractionsAtStraightEdgesAreMeasured) {
  for (const float angle : {0.1F, 0.5F, 0.785F, 1.2F, 2.0F, 3.0F}) {
    Scene scene = before_the_sky();
    const glm::vec3 along(std::cos(angle), std::sin(angle), 0.0F);
    const glm::vec3 across(-along.y, along.x, 0.0F);
    place_mesh(scene, add_mesh(scene, quad(0.03F * across - 8.0F * along, 16.0F * along, 8.0F * across, 0)));
    finish_scene(scene);
    const Error error = error_of(scene, straight_on(scene), [&](const Ray& ray) {
      const glm::dvec3 at = ray.origin - ray.origin.z / ray.direction.z * ray.direction;
      return glm::dot(at, glm::dvec3(across)) > 0.03;
    });
    EXPECT_GT(error.pixels, 50) << angle;
    EXPECT_LT(error.rms, 0.015) << angle;  // edges are halved five times: up to 1/64 off at each end
    EXPECT_NEAR(error.mean, 0.0, 0.006) << angle;
  }
}

/// Radii of about 4 to 15 pixels.
TEST(CoverageFragments, FractionsAtRoundEdgesAreMeasured) {
  for (const double radius : {0.2, 0.4, 0.8}) {
    Scene scene = before_the_sky();
    const glm::dvec3 centre(0.013, 0.037, 0.0);  // else the same few pixels stand all about
    place_mesh(scene, add_mesh(scene, test::sphere(radius, 64, 0)), glm::translate(glm::dmat4(1.0), centre));
    finish_scene(scene);
    const Error error = error_of(scene, straight_on(scene, {64, 48}), [&](const Ray& ray) {
      const glm::dvec3 start = ray.origin - centre;
      const double along = glm::dot(start, glm::normalize(ray.direction));
      return glm::dot(start, start) - along * along < radius * radius;
    });
    EXPECT_GT(error.pixels, 18) << radius;
    EXPECT_LT(error.rms, 0.012) << radius;
    EXPECT_NEAR(error.mean, 0.0, 0.006) << radius;
  }
}

/// A corner in a pixel, sharp or blunt, is no outline that bends a little, nor is one beside it.
TEST(CoverageFragments, CornersAreCounted) {
  struct Wedge {
    glm::dvec3 a, b;
    double most;
  };
  for (const Wedge& wedge : {Wedge{{-1.3, -1.5, 0}, {1.5, -1.3, 0}, 0.055}, {{-3, -0.8, 0}, {3, -0.7, 0}, 0.02}}) {
    for (const double x : {0.017, 0.03, 0.043}) {
      Scene scene = before_the_sky();
      const glm::dvec3 tip(x, 0.52, 0.0);
      place_mesh(scene, add_mesh(scene, quad(tip, wedge.a, wedge.b, 0)));
      finish_scene(scene);
      const glm::dmat2 to_sides = glm::inverse(glm::dmat2(glm::dvec2(wedge.a), glm::dvec2(wedge.b)));
      const Error error = error_of(scene, straight_on(scene), [&](const Ray& ray) {
        const glm::dvec3 at = ray.origin - ray.origin.z / ray.direction.z * ray.direction - tip;
        const glm::dvec2 along = to_sides * glm::dvec2(at);
        return along.x > 0.0 && along.x < 1.0 && along.y > 0.0 && along.y < 1.0;
      });
      EXPECT_GT(error.pixels, 50);
      EXPECT_LT(error.most, wedge.most) << x;
    }
  }
}

/// Strips thinner than a pixel before an outline, which corners between two of them know nothing of.
TEST(CoverageFragments, WhatNoCornerSeesKeepsItsLight) {
  Scene scene = before_the_sky();
  add_material(scene, test::diffuse(glm::vec3(0.0F)));
  place_mesh(scene, add_mesh(scene, quad({-4, -4, 0}, {8, 0, 0}, {0, 4.01F, 0}, 0)));
  for (int i = -40; i <= 40; ++i) {
    place_mesh(scene,
               add_mesh(scene, quad({0.0412F * static_cast<float>(i), -0.5F, 0.1F}, {0.01F, 0, 0}, {0, 1, 0}, 1)));
  }
  finish_scene(scene);
  const View view = straight_on(scene);
  const auto mean_of = [&](bool denoise) {
    constexpr int kFrames = 64;
    RaySettings settings = kDenoised;
    settings.denoise = denoise;
    double sum = 0.0;
    test::for_each_shaken(scene, view, settings, kFrames, [&](const TileLayer<Rgb>& radiance) {
      for (int x = 0; x < kTileSide; ++x) sum += static_cast<double>(radiance.at(0, x, 31).g) / kTileSide / kFrames;
    });
    return sum;
  };
  const double truth = mean_of(false);
  EXPECT_GT(truth, 0.1);  // the outline runs through that row
  EXPECT_LT(truth, 0.7);
  EXPECT_NEAR(mean_of(true) / truth, 1.0, 0.05);
}

/// Where a screen of points has none, subpixel samples see what the pixel's centre does; the plane's corners say
/// nothing.
TEST(CoverageFragments, SubpixelSamplesGoThroughThePointsOfTheScreen) {
  Scene scene = before_the_sky();
  place_mesh(scene, add_mesh(scene, quad({-9, -9, 0}, {9.5F, 0, 0}, {0, 18, 0}, 0)));
  finish_scene(scene);
  View view = straight_on(scene);
  view.eye.x = 3.0;  // the plane shows sky alone
  Image<glm::vec3> points({64, 64});
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const float none = std::numeric_limits<float>::quiet_NaN();
      points.at(x, y) =
          x > 32 ? glm::vec3(none)
                 : glm::vec3(-3.0F + 0.01F * static_cast<float>(x), 0.01F * static_cast<float>(32 - y), -1.0F);
    }
  }
  view.points = PixelPoints{std::make_shared<const PositionMap>(points), glm::dvec3(0.0), glm::dmat3(1.0), false, 1};
  const Image<Rgb> image = test::shade(scene, view, kDenoised).image;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) ASSERT_EQ(image.at(x, y).g, x > 32 ? 1.0F : 0.0F) << x << ' ' << y;
  }
}

/// Three surfaces meet, and a gap thinner than a pixel runs from there: rays ask.
TEST(CoverageFragments, FractionsAreMeasuredWhereMoreThanOneEdgeRuns) {
  Scene scene = before_the_sky();
  place_mesh(scene, add_mesh(scene, quad({-3.02F, -3, 0}, {3, 0, 0}, {0, 6, 0}, 0)));
  place_mesh(scene, add_mesh(scene, quad({0.02F, -3, 0}, {3, 0, 0}, {0.4F, 3.2F, 0}, 0)));
  finish_scene(scene);
  const Error error = error_of(scene, straight_on(scene), [&](const Ray& ray) {
    const glm::dvec3 at = ray.origin - ray.origin.z / ray.direction.z * ray.direction;
    return at.x < -0.02 || (at.y < 0.2 && at.x > 0.02 + (at.y + 3.0) * 0.4 / 3.2);
  });
  EXPECT_GT(error.pixels, 50);
  EXPECT_LT(error.rms, 0.06);
}

/// A wider filter reaches beyond the pixel: its half of a straight outline through the middle is one half too.
TEST(CoverageFragments, WiderFiltersAreCounted) {
  Scene scene = before_the_sky();
  place_mesh(scene, add_mesh(scene, quad({-4, -4, 0}, {4, 0, 0}, {0, 8, 0}, 0)));
  finish_scene(scene);
  RaySettings settings = kDenoised;
  settings.filter = PixelFilter::Gaussian;
  const Image<Rgb> image = test::shade(scene, straight_on(scene, {65, 65}), settings).image;
  for (int y = 0; y < 64; ++y) EXPECT_NEAR(image.at(32, y).g, 0.5, 0.1) << y;
}

TEST(CoverageFragments, AreFoundOnceWhileTheViewStays) {
  Scene scene = before_the_sky();
  place_mesh(scene, add_mesh(scene, test::sphere(0.8, 32, 0)));
  finish_scene(scene);
  View view = straight_on(scene);
  DeferredShader shader(scene, kDenoised);
  std::vector<std::uint64_t> rays;
  std::vector<std::vector<Rgb>> pictures;
  for (const double x : {0.0, 0.0, 0.25}) {
    view.eye.x = x;
    const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {});
    rays.push_back(shader.counts().primary);
    pictures.emplace_back(radiance.tile(0).begin(), radiance.tile(0).end());
  }
  EXPECT_GT(rays[0], 65U * 65U);
  EXPECT_LT(rays[1], 100U);
  EXPECT_GT(rays[2], 65U * 65U);
  EXPECT_EQ(pictures[0], pictures[1]);
  EXPECT_NE(pictures[0], pictures[2]);
}

SurfaceFeature on_sphere(double x, double y, double radius) {
  const glm::vec3 normal(x / radius, y / radius, std::sqrt(1.0 - (x * x + y * y) / (radius * radius)));
  return {true, 3, static_cast<float>(radius) * normal - glm::vec3(0, 0, 100), normal};
}

/// Pixels as far away as `radius` from the middle of a sphere, which is looked at from afar.
TEST(Patch, FollowsASphereUpToItsOutline) {
  constexpr double kRadius = 10.0;
  const glm::dvec2 pixel(9.3, 0.4);  // the outline runs through it, at x of 0.68 or so from its centre
  std::vector<KnownFeature> known;
  std::vector<SurfaceFeature> features;
  for (const glm::vec2& at : {glm::vec2(-0.5F, -0.5F), {-0.5F, 0.5F}, {0.5F, -0.5F}, {0.6F, 0.1F}}) {
    known.push_back({at, static_cast<std::uint32_t>(features.size())});
    features.push_back(on_sphere(pixel.x + at.x, pixel.y + at.y, kRadius));
  }
  const Patch patch(known, features, {0, 0, 1});
  for (const glm::vec2& at : {glm::vec2(-0.4F, 0.3F), {0.0F, 0.0F}, {0.3F, -0.3F}, {0.4F, 0.2F}, {0.6F, 0.0F}}) {
    const SurfaceFeature truth = on_sphere(pixel.x + at.x, pixel.y + at.y, kRadius);
    const SurfaceFeature found = patch.at(at);
    EXPECT_EQ(found.material, 3U);
    EXPECT_NEAR(glm::length(found.normal), 1.0F, 1e-5F);
    EXPECT_LT(glm::distance(found.normal, truth.normal), 0.05F) << at.x << ' ' << at.y;
    EXPECT_LT(glm::distance(found.position, truth.position), 1.0F) << at.x << ' ' << at.y;
  }
  EXPECT_NEAR(glm::length(patch.at({3.0F, 0.0F}).normal), 1.0F, 1e-5F);  // past the outline
}

TEST(Patch, OfOnePlaceIsThatEverywhere) {
  const SurfaceFeature feature = on_sphere(0.3, 0.2, 1.0);
  const KnownFeature known{{0.25F, -0.25F}, 0};
  const Patch patch(std::span(&known, 1), std::span(&feature, 1), {0, 0, 1});
  for (const glm::vec2& at : {glm::vec2(0.0F), {0.5F, 0.5F}}) {
    EXPECT_LT(glm::distance(patch.at(at).normal, feature.normal), 1e-5F);
    EXPECT_LT(glm::distance(patch.at(at).position, feature.position), 1e-4F);
  }
}

}  // namespace
}  // namespace hpr
