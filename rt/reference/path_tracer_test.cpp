#include "rt/reference/path_tracer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "rt/reference/test_paths.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::estimate;
using test::Estimate;
using test::PathBench;
using test::place_mesh;

constexpr Size kSmall{8, 8};
constexpr int kNoLimit = 1'000'000;

void expect_equal(const Estimate& estimate, double expected, double max_error) {
  EXPECT_LT(estimate.error, max_error) << "too uncertain to mean anything";
  EXPECT_NEAR(estimate.mean, expected, 4.0 * estimate.error + 1e-6 * expected) << "+- " << estimate.error;
}

void expect_equal(const Estimate& one, const Estimate& other, double max_error) {
  const double error = std::hypot(one.error, other.error);
  EXPECT_LT(error, max_error * one.mean) << "too uncertain to mean anything";
  EXPECT_NEAR(one.mean, other.mean, 4.0 * error);
}

/// Where the ray through a pixel's centre meets the plane y = 0.
glm::dvec3 on_floor(const View& view, int x, int y) {
  const Ray ray = view_ray(view, x + 0.5, y + 0.5);
  return ray.origin - ray.direction * (ray.origin.y / ray.direction.y);
}

/// A grey floor at y = 0, 20 m a side.
Scene floor_scene(float albedo) {
  Scene scene;
  const std::uint32_t look = add_material(scene, test::diffuse(glm::vec3(albedo)));
  place_mesh(scene, add_mesh(scene, test::quad({-10, 0, 10}, {20, 0, 0}, {0, 0, -20}, look)));
  return scene;
}

void add_point_light(Scene& scene, const glm::dvec3& position) {
  Light light;
  light.position = position;
  light.intensity = glm::vec3(10.0F);
  scene.lights.push_back(light);
}

/// A square light of side 2 at y = 2 that shines down on the floor.
void add_square_light(Scene& scene, float radiance) {
  const std::uint32_t look = add_material(scene, test::glowing(glm::vec3(radiance)));
  place_mesh(scene, add_mesh(scene, test::quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, look)));
}

/// Every pixel sees the floor.
constexpr glm::dvec3 kAboveFloor{0.0, 2.5, 4.0};

View down_at_floor(const Scene& scene, Size size = kSmall) {
  return test::view_from(kAboveFloor, {0.0, 0.0, 0.0}, size, scene, 0.6);
}

TEST(PathTracer, AClosedFurnaceShinesByTheGeometricSeries) {
  for (const double albedo : {0.5, 0.9, 0.99}) {
    const Scene scene = test::closed_box(test::diffuse(glm::vec3(static_cast<float>(albedo))), 1.0);
    const PathBench bench(scene);
    const View view = test::view_from({0.2, -0.3, 0.4}, {0.9, 0.1, -0.6}, kSmall, scene);
    const double exact = 1.0 / (1.0 - static_cast<double>(static_cast<float>(albedo)));
    const Estimate found = estimate(bench, view, {.max_depth = kNoLimit}, 16, 4);
    expect_equal(found, exact, 0.03 * exact);
  }
}

TEST(PathTracer, APointLightGivesTheFloorItsIrradiance) {
  Scene scene = floor_scene(0.5F);
  add_point_light(scene, {0.5, 3.0, -0.5});
  finish_scene(scene);
  const PathBench bench(scene);
  const View view = down_at_floor(scene);
  const Image<Rgb> image = test::trace(bench, view, {.spread_in_pixel = false});
  for (int y = 0; y < kSmall.height; ++y) {
    for (int x = 0; x < kSmall.width; ++x) {
      const glm::dvec3 offset = scene.lights[0].position - on_floor(view, x, y);
      const double distance = glm::length(offset);
      const double irradiance = 10.0 * (offset.y / distance) / (distance * distance);
      EXPECT_NEAR(image.at(x, y).g, 0.5 / std::numbers::pi * irradiance, 1e-5) << x << ' ' << y;
    }
  }
}

/// The part of a differential floor's hemisphere, by cosine, that an axis-parallel rectangle above covers (Howell, "A
/// Catalog of Radiation Heat Transfer Configuration Factors", B-4), summed over signed quarters.
double floor_to_rectangle(const glm::dvec3& position, double height, double x0, double x1, double z0, double z1) {
  const auto corner = [&](double a, double b) {
    const double ra = std::sqrt(height * height + a * a);
    const double rb = std::sqrt(height * height + b * b);
    return (a / ra * std::atan(b / ra) + b / rb * std::atan(a / rb)) / (2.0 * std::numbers::pi);
  };
  const double a0 = x0 - position.x;
  const double a1 = x1 - position.x;
  const double b0 = z0 - position.z;
  const double b1 = z1 - position.z;
  return corner(a1, b1) - corner(a0, b1) - corner(a1, b0) + corner(a0, b0);
}

TEST(PathTracer, ASquareLightGivesTheFloorItsFormFactor) {
  Scene scene = floor_scene(0.5F);
  add_square_light(scene, 3.0F);
  finish_scene(scene);
  const PathBench bench(scene);
  const View view = down_at_floor(scene);
  for (const Technique technique : {Technique::Both, Technique::Lights, Technique::Surfaces}) {
    const bool by_chance = technique == Technique::Surfaces;
    const Estimate found = estimate(bench, view, {.max_depth = 2, .technique = technique, .spread_in_pixel = false}, 16,
                                    by_chance ? 64 : 4, [&](int x, int y) {
                                      const glm::dvec3 at = on_floor(view, x, y);
                                      return 0.5 * 3.0 * floor_to_rectangle(at, 2.0, -1.0, 1.0, -1.0, 1.0);
                                    });
    expect_equal(found, 1.0, 0.02);
  }
}

/// A room of matte and glossy things under a small lamp and a sky.
Scene mixed_scene() {
  Scene scene = floor_scene(0.6F);
  add_square_light(scene, 4.0F);
  Material glossy = test::mirror(0.8F);
  glossy.roughness = 0.35F;
  const std::uint32_t metal = add_material(scene, glossy);
  place_mesh(scene, add_mesh(scene, test::quad({-3, 0, -2}, {6, 0, 0}, {0, 4, 0}, metal)));
  Material plastic = test::diffuse(glm::vec3(0.7F));
  plastic.ior = 1.5F;
  plastic.roughness = 0.2F;
  place_mesh(scene, add_mesh(scene, test::sphere(0.6, 12, add_material(scene, plastic))),
             glm::dmat4({1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0.5, 0.6, 0.5, 1}));
  scene.environment = test::white_sky();
  scene.environment->scale = 0.1;
  finish_scene(scene);
  return scene;
}

TEST(PathTracer, EveryTechniqueHasTheSameMean) {
  const Scene scene = mixed_scene();
  const PathBench bench(scene);
  const View view = down_at_floor(scene);
  const Estimate both = estimate(bench, view, {.technique = Technique::Both}, 24, 32);
  const Estimate lights = estimate(bench, view, {.technique = Technique::Lights}, 24, 32);
  const Estimate surfaces = estimate(bench, view, {.technique = Technique::Surfaces}, 24, 32);
  expect_equal(both, lights, 0.02);
  expect_equal(both, surfaces, 0.02);
  EXPECT_LT(both.error, lights.error);
  EXPECT_LT(both.error, surfaces.error);
}

TEST(PathTracer, RouletteChangesNoMean) {
  const Scene scene = mixed_scene();
  const PathBench bench(scene);
  const View view = down_at_floor(scene);
  const Estimate without = estimate(bench, view, {.roulette_from = kNoLimit}, 24, 16);
  const Estimate with = estimate(bench, view, {.roulette_from = 1}, 24, 32);
  expect_equal(without, with, 0.02);
}

TEST(PathTracer, GlassInAWhiteSkyIsNotSeen) {
  Scene scene;
  Material glass = test::clear_glass(1.5F, 1.0F);
  Mesh smooth = test::sphere(1.0, 8, add_material(scene, glass));
  Mesh faceted;  // with interpolated normals, light is lost where they disagree with the faces
  faceted.material = smooth.material;
  for (const glm::uvec3& t : smooth.triangles) {
    const auto first = static_cast<std::uint32_t>(faceted.positions.size());
    for (int corner = 0; corner < 3; ++corner) faceted.positions.push_back(smooth.positions[t[corner]]);
    faceted.triangles.emplace_back(first, first + 1, first + 2);
  }
  place_mesh(scene, add_mesh(scene, std::move(faceted)));
  scene.environment = test::white_sky();
  finish_scene(scene);
  const PathBench bench(scene);
  const View view = test::view_from({0.0, 0.0, 3.0}, {0.0, 0.0, 0.0}, {48, 48}, scene);
  PathCounts counts;
  const Image<Rgb> image = test::trace(bench, view, {.max_depth = kNoLimit, .roulette_from = kNoLimit}, &counts);
  EXPECT_GT(counts.transmission, 2U * 500U) << "in and out again";
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 48; ++x) EXPECT_NEAR(image.at(x, y).g, 1.0F, 1e-5F) << x << ' ' << y;
  }
}

TEST(PathTracer, PathsBetweenMirrorsEndAtTheirDepth) {
  const Scene scene = test::closed_box(test::mirror(1.0F), 0.0);
  const PathBench bench(scene);
  const View view = test::view_from({0.2, -0.3, 0.4}, {0.9, 0.1, -0.6}, kSmall, scene);
  PathCounts counts;
  test::trace(bench, view, {.max_depth = 64}, &counts);
  EXPECT_EQ(counts.paths, 64U);
  EXPECT_EQ(counts.too_long, 64U);
  EXPECT_EQ(counts.reflection, 64U * 63U);
}

TEST(PathTracer, AGlowingMirrorBoxSumsItsReflections) {
  const Scene scene = test::closed_box(test::mirror(0.5F), 1.0);
  const PathBench bench(scene);
  const View view = test::view_from({0.2, -0.3, 0.4}, {0.9, 0.1, -0.6}, kSmall, scene);
  const Image<Rgb> image = test::trace(bench, view, {.max_depth = 4, .roulette_from = kNoLimit});
  // Schlick's term makes each reflection a little brighter than one half.
  for (int y = 0; y < kSmall.height; ++y) {
    for (int x = 0; x < kSmall.width; ++x) {
      EXPECT_GE(image.at(x, y).g, 1.875F - 1e-5F);
      EXPECT_LT(image.at(x, y).g, 4.0F);
    }
  }
}

TEST(PathTracer, CoverageThinsSightAndShadow) {
  for (const bool cover_the_eye : {true, false}) {
    Scene scene = floor_scene(0.5F);
    add_point_light(scene, {0.0, 3.0, 0.0});
    finish_scene(scene);
    const PathBench open(scene);
    const View view = down_at_floor(scene);
    const Estimate uncovered = estimate(open, view, {.spread_in_pixel = false}, 2, 1);

    Material veil = test::diffuse(glm::vec3(0.0F));
    veil.alpha_mode = AlphaMode::Blend;
    veil.base_color.a = 0.25F;
    Scene covered = scene;
    const std::uint32_t look = add_material(covered, veil);
    if (cover_the_eye) {  // a wall before the eye, so large that no light passes beside it unseen
      const glm::dvec3 eye = kAboveFloor;
      const glm::vec3 back(glm::normalize(eye));
      const glm::vec3 right(1, 0, 0);
      const glm::vec3 up = glm::cross(back, right);
      place_mesh(covered, add_mesh(covered, test::quad(glm::vec3(eye) - 0.1F * back - 0.2F * right - 0.2F * up,
                                                       0.4F * right, 0.4F * up, look)));
    } else {  // two, between light and floor, above the eye's rays
      for (const float height : {2.6F, 2.8F})
        place_mesh(covered, add_mesh(covered, test::quad({-9, height, 9}, {18, 0, 0}, {0, 0, -18}, look)));
    }
    finish_scene(covered);
    const PathBench bench(covered);
    const Estimate found = estimate(bench, view, {.spread_in_pixel = false}, 16, 32);
    expect_equal(found, uncovered.mean * (cover_the_eye ? 0.75 : 0.75 * 0.75), 0.02 * uncovered.mean);
  }
}

/// What two parallel sheets let through and reflect together, when each lets through `t` and reflects `r`.
double two_sheets(double t, double r) {
  return r + t * t * (r + 1.0) / (1.0 - r * r);
}

TEST(PathTracer, SheetsThatCoverAQuarterReflectAQuarterAsMuch) {
  Scene scene;
  Material sheet = test::diffuse(glm::vec3(0.0F));
  sheet.ior = 1.5F;
  sheet.roughness = 0.0F;
  sheet.transmission = 0.75F;
  sheet.alpha_mode = AlphaMode::Blend;
  sheet.base_color.a = 0.25F;
  const std::uint32_t look = add_material(scene, sheet);
  for (const float height : {0.0F, 0.03F})
    place_mesh(scene, add_mesh(scene, test::quad({-50, height, 50}, {100, 0, 0}, {0, 0, -100}, look)));
  scene.environment = test::white_sky();
  finish_scene(scene);
  const PathBench bench(scene);
  const double incidence = 1.2;
  const View view = test::view_from({0.0, 4.0 * std::cos(incidence), 4.0 * std::sin(incidence)}, {0.0, 0.0, 0.0},
                                    kSmall, scene, 1e-3);
  const double cosine = std::cos(incidence);
  const double refracted = std::sqrt(1.0 - (1.0 - cosine * cosine) / (1.5 * 1.5));
  const double parallel = (1.5 * cosine - refracted) / (1.5 * cosine + refracted);
  const double across = (cosine - 1.5 * refracted) / (cosine + 1.5 * refracted);
  const double fresnel = 0.5 * (parallel * parallel + across * across);
  expect_equal(estimate(bench, view, {}, 32, 64), two_sheets(0.75, 0.25 * fresnel), 0.005);
}

TEST(PathTracer, AbsorbingGlassDimsByBeersLaw) {
  Scene scene;
  Material glass = test::clear_glass(1.0F, 1.0F);
  glass.attenuation_color = glm::vec3(0.5F);
  glass.attenuation_distance = 0.25F;
  const std::uint32_t look = add_material(scene, glass);
  place_mesh(scene, add_mesh(scene, test::quad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, look)));
  place_mesh(scene, add_mesh(scene, test::quad({-5, -5, -0.5}, {0, 10, 0}, {10, 0, 0}, look)));
  scene.environment = test::white_sky();
  finish_scene(scene);
  const PathBench bench(scene);
  const View view = test::view_from({0.0, 0.0, 3.0}, {0.0, 0.0, 0.0}, kSmall, scene);
  const Image<Rgb> image = test::trace(bench, view, {.spread_in_pixel = false});
  for (int y = 0; y < kSmall.height; ++y) {
    for (int x = 0; x < kSmall.width; ++x) {
      const glm::dvec3 direction = glm::normalize(view_ray(view, x + 0.5, y + 0.5).direction);
      EXPECT_NEAR(image.at(x, y).g, std::pow(0.5, 0.5 / 0.25 / -direction.z), 1e-5) << x << ' ' << y;
    }
  }
}

TEST(PathTracer, UnlitSurfacesShowTheirColourAndEndPaths) {
  Scene scene = floor_scene(0.5F);
  scene.materials[0].unlit = true;
  add_point_light(scene, {0.5, 3.0, -0.5});
  finish_scene(scene);
  const PathBench bench(scene);
  PathCounts counts;
  const Image<Rgb> image = test::trace(bench, down_at_floor(scene), {}, &counts);
  for (int y = 0; y < kSmall.height; ++y) {
    for (int x = 0; x < kSmall.width; ++x) EXPECT_EQ(image.at(x, y).g, 0.5F);
  }
  EXPECT_EQ(counts.shadow, 0U);
  EXPECT_EQ(counts.diffuse, 0U);
}

TEST(PathTracer, SamplesTooBrightForANumberAreBlackAndCounted) {
  const Scene scene = test::closed_box(test::diffuse(glm::vec3(0.9F)), 3e38);
  const PathBench bench(scene);
  const View view = test::view_from({0.2, -0.3, 0.4}, {0.9, 0.1, -0.6}, kSmall, scene);
  PathCounts counts;
  const Image<Rgb> image = test::trace(bench, view, {}, &counts);
  EXPECT_GT(counts.not_finite, 0U);
  for (int y = 0; y < kSmall.height; ++y) {
    for (int x = 0; x < kSmall.width; ++x) EXPECT_TRUE(std::isfinite(image.at(x, y).r));
  }
}

TEST(PathTracer, ThreadsTileListsAndBlocksChangeNoBit) {
  const Scene scene = mixed_scene();
  const PathBench bench(scene);
  const View view = down_at_floor(scene, {150, 90});
  const Image<Rgb> whole = test::trace(bench, view, {});

  EXPECT_TRUE(whole == test::trace(bench, view, {.threads = 3}));

  TileLayer<Rgb> radiance{FrameLayout({view.size()})};
  PathTracer tracer(scene, bench.rays, bench.lights, {});
  for (const std::size_t tile : {4U, 0U, 5U, 2U, 1U, 3U})
    tracer.trace(std::span(&view, 1), std::vector<std::size_t>{tile}, {}, {.radiance = &radiance});
  EXPECT_TRUE(whole == to_image(radiance, 0));

  for (const View& block : split_into_blocks(view, 64)) {
    TileLayer<Rgb> part{FrameLayout({block.size()})};
    tracer.trace(std::span(&block, 1), all_tiles(part.layout()), {}, {.radiance = &part});
    for (int y = 0; y < block.size().height; ++y) {
      for (int x = 0; x < block.size().width; ++x) {
        EXPECT_EQ(part.at(0, x, y), whole.at(block.block.x0 + x, block.block.y0 + y));
      }
    }
  }
  PathSettings other;
  other.seed = 2;
  EXPECT_FALSE(whole == test::trace(bench, view, other));
}

TEST(PathTracer, AnEmptySceneShowsItsSky) {
  Scene scene;
  scene.environment = test::white_sky();
  finish_scene(scene);
  const PathBench bench(scene);
  const View view = test::view_from({0.0, 0.0, 3.0}, {0.0, 0.0, 0.0}, kSmall, scene);
  const Image<Rgb> image = test::trace(bench, view, {});
  EXPECT_EQ(image.at(3, 4), (Rgb{1.0F, 1.0F, 1.0F}));
}

}  // namespace
}  // namespace hpr
