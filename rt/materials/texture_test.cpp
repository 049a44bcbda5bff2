#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "rt/materials/material_point.h"

namespace hpr {
namespace {

/// Four texels in a row whose red says where they are: 0, 51, 102, 153.
Texture row_of_four(Wrap wrap, bool nearest) {
  Texture texture;
  Image<Rgba8> image({4, 1});
  for (int x = 0; x < 4; ++x) image.at(x, 0) = {static_cast<std::uint8_t>(51 * x), 0, 0, 255};
  texture.image = std::move(image);
  texture.wrap_s = wrap;
  texture.nearest = nearest;
  return texture;
}

double red(const Texture& texture, double u) {
  return sample_texture(texture, Encoding::Linear, {u, 0.5}).r * 5.0;
}

TEST(Texture, ReadsTexelsAtTheirCentresAndMixesBetween) {
  const Texture texture = row_of_four(Wrap::Repeat, false);
  for (int x = 0; x < 4; ++x) EXPECT_NEAR(red(texture, (x + 0.5) / 4.0), x, 1e-12);
  EXPECT_NEAR(red(texture, 0.5), 1.5, 1e-12);
}

TEST(Texture, WrapsAsTheModeSays) {
  EXPECT_NEAR(red(row_of_four(Wrap::Repeat, false), 0.0), 1.5, 1e-12);  // halfway between texel 3 and texel 0
  EXPECT_NEAR(red(row_of_four(Wrap::Repeat, true), 1.3), 1.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::Repeat, true), -0.1), 3.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::MirroredRepeat, true), 1.1), 3.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::MirroredRepeat, true), -0.3), 1.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::MirroredRepeat, false), 1.0), 3.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::ClampToEdge, false), 7.0), 3.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::ClampToEdge, true), 1.0), 3.0, 1e-12);
  EXPECT_NEAR(red(row_of_four(Wrap::ClampToEdge, false), -7.0), 0.0, 1e-12);
}

TEST(Texture, AnyCoordinateIsSafe) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const Wrap wrap : {Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge}) {
    for (const bool nearest : {false, true}) {
      const Texture texture = row_of_four(wrap, nearest);
      for (const double u : {std::nan(""), kInfinity, -kInfinity, 1e30, -1e30, 1e308, -1e-300, -1e-17, 1.0, 2.0}) {
        const double value = red(texture, u);
        EXPECT_TRUE(value >= 0.0 && value <= 3.0) << u;
      }
    }
  }
  EXPECT_EQ(sample_texture(Texture{}, Encoding::Srgb, {0.5, 0.5}), glm::dvec4(1.0));
}

TEST(Texture, DecodesColourBeforeMixingAndNeverAlpha) {
  Texture texture;
  Image<Rgba8> image({2, 1});
  image.at(1, 0) = {255, 255, 255, 255};
  texture.image = image;
  const glm::dvec4 center = sample_texture(texture, Encoding::Srgb, {0.5, 0.5});
  EXPECT_NEAR(center.r, 0.5, 1e-7);
  EXPECT_NEAR(center.a, 0.5, 1e-12);
  image.at(0, 0) = {128, 0, 0, 128};
  texture.image = image;
  const glm::dvec4 left = sample_texture(texture, Encoding::Srgb, {0.25, 0.5});
  EXPECT_NEAR(left.r, 0.2158605, 1e-6);
  EXPECT_NEAR(left.a, 128.0 / 255.0, 1e-12);
}

TEST(Texture, TransformsCoordinatesAsTheExtensionSays) {
  TextureRef reference;
  reference.transform = {2, 3, 5, 7, 11, 13};
  EXPECT_EQ(transformed_uv(reference, {1.0F, 0.0F}), glm::dvec2(13, 16));
  EXPECT_EQ(transformed_uv(reference, {0.0F, 1.0F}), glm::dvec2(16, 20));
}

}  // namespace
}  // namespace hpr
