#include "rt/show/show.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

constexpr int kSide = 64;

/// A square of 2 x 2 metres in the plane z = 0 that looks along +z.
Mesh square(std::uint32_t material) {
  return quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, material);
}

Scene one_square() {
  Scene scene;
  add_material(scene, test::diffuse());
  place_mesh(scene, add_mesh(scene, square(0)));
  finish_scene(scene);
  return scene;
}

/// Sees 4 x 4 metres of the plane z = 0 from the front: a square of 2 x 2 takes pixels 16 to 48 of the 64.
View front_view(const Scene& scene) {
  return test::view_from({0, 0, 2}, {0, 0, 0}, {kSide, kSide}, scene, 2.0 * std::atan(1.0));
}

Image<Rgb> shown(const Scene& scene, Show show, const View& view) {
  return test::shade(scene, view, {.show = show}).image;
}
Image<Rgb> shown(const Scene& scene, Show show) {
  return shown(scene, show, front_view(scene));
}

void expect_color(const Rgb& color, float r, float g, float b) {
  EXPECT_NEAR(color.r, r, 1e-6F);
  EXPECT_NEAR(color.g, g, 1e-6F);
  EXPECT_NEAR(color.b, b, 1e-6F);
}

TEST(Show, TheNormalOfASquareThatFacesTheEyeIsHalfHalfOne) {
  const Image<Rgb> image = shown(one_square(), Show::Normal);
  expect_color(image.at(32, 32), 0.5F, 0.5F, 1.0F);
  expect_color(image.at(17, 46), 0.5F, 0.5F, 1.0F);
  expect_color(image.at(4, 4), 0.0F, 0.0F, 0.0F);
}

TEST(Show, TextureCoordinatesGoFromZeroToOneAcrossASquare) {
  const Scene scene = one_square();
  const Image<Rgb> image = shown(scene, Show::Uv);
  // Pixel 16 + i of 32 shows (i + 0.5) / 32; v points up, rows go down.
  expect_color(image.at(16, 47), 0.5F / 32.0F, 0.5F / 32.0F, 0.0F);
  expect_color(image.at(40, 20), 24.5F / 32.0F, 27.5F / 32.0F, 0.0F);
  expect_color(image.at(10, 32), 0.0F, 0.0F, 0.0F);
}

TEST(Show, TextureCoordinatesPastOneBeginAgain) {
  Scene scene;
  add_material(scene, test::diffuse());
  Mesh mesh = square(0);
  for (glm::vec2& uv : mesh.uvs[0]) uv = 4.0F * uv - 2.0F;
  place_mesh(scene, add_mesh(scene, mesh));
  finish_scene(scene);
  // 4 * 24.5 / 32 - 2 = 1.0625 and 4 * 27.5 / 32 - 2 = 1.4375; 4 * 1.5 / 32 - 2 = -1.8125.
  expect_color(shown(scene, Show::Uv).at(40, 20), 0.0625F, 0.4375F, 0.0F);
  expect_color(shown(scene, Show::Uv).at(17, 46), 0.1875F, 0.1875F, 0.0F);
}

TEST(Show, AnEdgeIsAPixelWideWhateverItsDistance) {
  const Scene scene = one_square();
  const Image<Rgb> image = shown(scene, Show::Wireframe);
  // Left edge between pixels 15 and 16; the diagonal goes through the centers from lower left to upper right.
  expect_color(image.at(16, 30), 0.5F, 0.5F, 0.5F);
  expect_color(image.at(17, 25), 1.0F, 1.0F, 1.0F);
  expect_color(image.at(30, 33), 0.0F, 0.0F, 0.0F);
  expect_color(image.at(31, 33), std::sqrt(0.5F), std::sqrt(0.5F), std::sqrt(0.5F));
  expect_color(image.at(32, 33), 1.0F, 1.0F, 1.0F);
  expect_color(image.at(4, 4), 1.0F, 1.0F, 1.0F);

  // From twice as far away the same edge lies at another place and is as wide.
  const View far_view = test::view_from({0, 0, 4}, {0, 0, 0}, {kSide, kSide}, scene, 2.0 * std::atan(1.0));
  const Image<Rgb> smaller = shown(scene, Show::Wireframe, far_view);
  expect_color(smaller.at(24, 30), 0.5F, 0.5F, 0.5F);
  expect_color(smaller.at(25, 28), 1.0F, 1.0F, 1.0F);
}

TEST(Show, AnEdgeIsAPixelWideWhereThePlaneIsSeenAtAGrazingAngle) {
  const Scene scene = test::white_floor();
  const View view = test::view_from({0, 1, 6}, {0, 0, 0}, {kSide, kSide}, scene);
  const Image<Rgb> image = shown(scene, Show::Wireframe, view);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  // The front edge, z = 4, is a row of the picture: y where a ray meets (0, 0, 4).
  const glm::dvec4 clip = clip_from_world(view, glm::dvec3(0.0)) * glm::dvec4(0.0, 0.0, 4.0, 1.0);
  const double row = (1.0 - clip.y / clip.w) * 0.5 * kSide;
  int found = 0;
  for (int y = 0; y < kSide; ++y) {
    if (keys.at(0, 20, y) == kNoKey || std::abs(y + 0.5 - row) > 2.0) continue;
    EXPECT_NEAR(image.at(20, y).r, std::min(std::abs(y + 0.5 - row), 1.0), 1e-5) << y;
    ++found;
  }
  EXPECT_GE(found, 2);
}

TEST(Show, InstancesHaveColorsOfTheirOwn) {
  Scene scene;
  add_material(scene, test::diffuse());
  const std::uint32_t mesh = add_mesh(scene, quad({-0.5F, -0.5F, 0}, {1, 0, 0}, {0, 1, 0}, 0));
  place_mesh(scene, mesh, glm::translate(glm::dmat4(1.0), glm::dvec3(-0.5, 0.0, 0.0)));
  place_mesh(scene, mesh, glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0.0, 0.0)));
  finish_scene(scene);
  const Image<Rgb> image = shown(scene, Show::Ids);
  EXPECT_EQ(image.at(20, 32), distinct_color(0));
  EXPECT_EQ(image.at(31, 26), distinct_color(0));
  EXPECT_EQ(image.at(32, 26), distinct_color(1));
  EXPECT_EQ(image.at(4, 4), Rgb{});
  // The first hue is red, the next one 0.618 of the circle on: 222 degrees.
  expect_color(distinct_color(0), 1.0F, 0.2F, 0.2F);
  EXPECT_GT(distinct_color(1).b, 0.79F);
}

TEST(Show, ManyNumbersHaveManyColors) {
  for (std::uint32_t i = 0; i < 64; ++i) {
    for (std::uint32_t j = 0; j < i; ++j) {
      const Rgb a = distinct_color(i);
      const Rgb b = distinct_color(j);
      EXPECT_GT(std::abs(a.r - b.r) + std::abs(a.g - b.g) + std::abs(a.b - b.b), 3.0F / 255.0F) << i << ' ' << j;
    }
  }
}

TEST(Show, CountsGoFromBlackOverRedAndYellowToWhite) {
  expect_color(count_color(0.0, 255.0), 0.0F, 0.0F, 0.0F);
  expect_color(count_color(1.0, 255.0), 3.0F / 8.0F, 0.0F, 0.0F);
  expect_color(count_color(15.0, 255.0), 1.0F, 0.5F, 0.0F);
  expect_color(count_color(255.0, 255.0), 1.0F, 1.0F, 1.0F);
  expect_color(count_color(1e9, 255.0), 1.0F, 1.0F, 1.0F);
}

/// A square of 2 x 2 before one of 4 x 4 metres, both through the same pixels as front_view() says.
Scene two_squares(AlphaMode mode) {
  Scene scene;
  add_material(scene, test::diffuse());
  Material front = test::diffuse();
  front.base_color.a = 0.25F;
  front.alpha_mode = mode;
  add_material(scene, front);
  place_mesh(scene, add_mesh(scene, quad({-1, -1, -0.5F}, {2, 0, 0}, {0, 2, 0}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-0.5F, -0.5F, 0.5F}, {1, 0, 0}, {0, 1, 0}, 1)));
  finish_scene(scene);
  return scene;
}

TEST(Show, OverdrawCountsTheSurfacesOfARay) {
  for (const AlphaMode mode : {AlphaMode::Opaque, AlphaMode::Blend}) {
    const Image<Rgb> image = shown(two_squares(mode), Show::Overdraw);
    // Both diagonals go through the centers of pixels: a triangle on each side of them counts once.
    for (int i = 24; i < 40; ++i) EXPECT_EQ(image.at(i, 63 - i), count_color(2.0, kMaxOverdraw)) << i;
    EXPECT_EQ(image.at(30, 28), count_color(2.0, kMaxOverdraw));
    EXPECT_EQ(image.at(20, 32), count_color(1.0, kMaxOverdraw));
    EXPECT_EQ(image.at(20, 42), count_color(1.0, kMaxOverdraw));
    EXPECT_EQ(image.at(4, 4), Rgb{});
  }
}

TEST(Show, OverdrawCountsNoFaceThatIsCulled) {
  Scene scene = two_squares(AlphaMode::Opaque);
  scene.materials[1].double_sided = false;
  EXPECT_EQ(shown(scene, Show::Overdraw).at(32, 32), count_color(2.0, kMaxOverdraw));
  for (Instance& instance : scene.instances) {
    if (scene.mesh_of(instance).material == 1) {
      instance.to_world = glm::rotate(glm::dmat4(1.0), glm::radians(180.0), glm::dvec3(0.0, 1.0, 0.0));
      instance.to_world[3].z = 1.0;
    }
  }
  finish_scene(scene);
  EXPECT_EQ(shown(scene, Show::Overdraw).at(32, 32), count_color(1.0, kMaxOverdraw));
}

TEST(Show, WhatCoversInPartCountsByThatPart) {
  const Scene scene = two_squares(AlphaMode::Blend);
  const View view = front_view(scene);
  Scene opaque = scene;  // what covers in part has no keys
  opaque.instances.pop_back();
  const TileLayer<Key> keys = test::cast_keys(opaque, std::span(&view, 1));
  const auto at_front = [&](Show show) {
    TileLayer<Rgb> values(keys.layout());
    DeferredShader(scene, {.show = show})
        .shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &values});
    return values.at(0, 32, 30);
  };
  expect_color(at_front(Show::Normal), 0.5F, 0.5F, 1.0F);
  const Rgb behind = distinct_color(0);
  const Rgb before = distinct_color(1);
  expect_color(at_front(Show::Ids), 0.75F * behind.r + 0.25F * before.r, 0.75F * behind.g + 0.25F * before.g,
               0.75F * behind.b + 0.25F * before.b);
}

TEST(Show, TheCostOfASurfaceUnderTwoLampsIsTwoRays) {
  Scene scene = one_square();
  for (const double x : {-1.0, 1.0}) {
    Light light;
    light.position = glm::dvec3(x, 0.0, 3.0);
    scene.lights.push_back(light);
  }
  const Image<Rgb> image = shown(scene, Show::Cost);
  EXPECT_EQ(image.at(32, 32), count_color(2.0, kMaxCost));
  EXPECT_EQ(image.at(4, 4), Rgb{});
}

TEST(Show, NothingStopsTheRaysOfALoneSquare) {
  const Image<Rgb> image = shown(one_square(), Show::Ao);
  expect_color(image.at(32, 32), 1.0F, 1.0F, 1.0F);
  expect_color(image.at(4, 4), 1.0F, 1.0F, 1.0F);
}

TEST(Show, AWallStopsHalfTheRaysBesideIt) {
  Scene scene = test::white_floor();
  place_mesh(scene, add_mesh(scene, quad({0, 0, 4}, {0, 0, -8}, {0, 8, 0}, 0)));
  finish_scene(scene);
  // A millimetre beside the foot of a wall that is high and long against the reach of rays; cosines halve likewise.
  const View view = test::view_from({1, 1, 0}, {0.001, 0, 0}, {1, 1}, scene, 1e-6);
  const test::Shaded first = test::shade(scene, view, {.show = Show::Ao});
  EXPECT_EQ(first.counts[PassId::AmbientOcclusion], static_cast<std::uint64_t>(kShownOcclusionRays));
  const glm::dvec3 mean = test::mean_pixel(scene, view, 0, 0, 256, {.show = Show::Ao});
  EXPECT_NEAR(mean.r, 0.5, 0.02);
  EXPECT_EQ(mean.r, mean.b);
}

TEST(Show, SamplesTogetherGiveTheBitsOfSamplesOneByOne) {
  const Scene scene = two_squares(AlphaMode::Blend);
  const View view = front_view(scene);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  for (std::size_t i = 1; i < kShowNames.size(); ++i) {
    const RaySettings settings{.show = static_cast<Show>(i)};
    std::vector<TileLayer<Rgb>> layers;
    for (int sample = 0; sample < 3; ++sample) layers.emplace_back(keys.layout());
    std::vector<ShadedSample> samples;
    for (std::uint32_t sample = 0; sample < 3; ++sample) {
      samples.push_back({std::span(&view, 1), &keys, {.radiance = &layers[sample]}, {.sample = sample}});
    }
    DeferredShader shader(scene, settings);
    shader.shade(samples, all_tiles(keys.layout()));
    for (std::uint32_t sample = 0; sample < 3; ++sample) {
      TileLayer<Rgb> alone(keys.layout());
      DeferredShader(scene, settings)
          .shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &alone}, {.sample = sample});
      EXPECT_TRUE(to_image(alone, 0) == to_image(layers[sample], 0)) << kShowNames.at(i);
    }
  }
}

TEST(Show, NoLightIsComputedForWhatStandsInItsPlace) {
  Scene scene = one_square();
  scene.lights.emplace_back();
  for (const Show show : {Show::Normal, Show::Uv, Show::Wireframe, Show::Ids, Show::Rank}) {
    const test::Shaded made = test::shade(scene, front_view(scene), {.show = show, .denoise = true, .reference = true});
    EXPECT_EQ(made.counts[PassId::Shadow], 0U) << name_of(show);
  }
}

}  // namespace
}  // namespace hpr
