#include "image/tone.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace hpr {
namespace {

constexpr std::array<Tone, kToneNames.size()> kTones{Tone::Neutral, Tone::Aces, Tone::Agx, Tone::Filmic, Tone::None};

float grey_of(Tone tone, float light) {
  return tone_map(tone, {light, light, light}).g;
}

TEST(Tone, EveryCurveRisesFromBlackToWhiteAndStaysThere) {
  for (const Tone tone : kTones) {
    EXPECT_NEAR(grey_of(tone, 0.0F), 0.0F, 1e-3F) << name_of(tone);
    float before = 0.0F;
    for (float light = 0x1p-12F; light < 0x1p20F; light *= 1.0905077F) {
      const Rgb mapped = tone_map(tone, {light, light, light});
      // Their published constants are rounded: greys have a tint of less than a level.
      EXPECT_NEAR(mapped.r, mapped.g, 2e-3F) << name_of(tone) << light;
      EXPECT_NEAR(mapped.b, mapped.g, 2e-3F) << name_of(tone) << light;
      EXPECT_GE(mapped.g, before - 1e-6F) << name_of(tone) << light;
      EXPECT_LE(mapped.g, 1.0F) << name_of(tone) << light;
      before = mapped.g;
    }
    EXPECT_GT(before, 0.97F) << name_of(tone);
  }
}

TEST(Tone, GreyOfEighteenPercentStaysInTheMiddle) {
  EXPECT_FLOAT_EQ(grey_of(Tone::None, 0.18F), 0.18F);
  EXPECT_FLOAT_EQ(grey_of(Tone::Neutral, 0.18F), 0.14F);
  for (const Tone tone : {Tone::Aces, Tone::Agx, Tone::Filmic}) {
    EXPECT_GT(grey_of(tone, 0.18F), 0.1F) << name_of(tone);
    EXPECT_LT(grey_of(tone, 0.18F), 0.25F) << name_of(tone);
  }
}

// Hand-computed from the published formulas.
TEST(Tone, NeutralKeepsColorsBelowItsStartAndBendsThoseAbove) {
  const Rgb plain = tone_map(Tone::Neutral, {0.7F, 0.5F, 0.3F});
  EXPECT_FLOAT_EQ(plain.r, 0.66F);
  EXPECT_FLOAT_EQ(plain.g, 0.46F);
  EXPECT_FLOAT_EQ(plain.b, 0.26F);
  // Pure red has nothing to take away; its peak of 1 becomes 1 - 0.24^2 / (1 + 0.24 - 0.76) = 0.88.
  const Rgb red = tone_map(Tone::Neutral, {1.0F, 0.0F, 0.0F});
  const float white = 1.0F - 1.0F / (0.15F * 0.12F + 1.0F);
  EXPECT_NEAR(red.r, 0.88F, 1e-6F);
  EXPECT_NEAR(red.g, 0.88F * white, 1e-6F);
  // In the toe 0.04 becomes 6.25 x 0.04^2.
  EXPECT_NEAR(grey_of(Tone::Neutral, 0.04F), 0.01F, 1e-7F);
}

TEST(Tone, OthersHaveThePublishedValues) {
  const auto hable = [](double x) {
    return (x * (0.15 * x + 0.1 * 0.5) + 0.2 * 0.02) / (x * (0.15 * x + 0.5) + 0.2 * 0.3) - 0.02 / 0.3;
  };
  EXPECT_NEAR(grey_of(Tone::Filmic, 0.5F), hable(1.0) / hable(11.2), 1e-6);
  EXPECT_NEAR(grey_of(Tone::Filmic, 5.6F), 1.0F, 1e-6F);
  const auto hill = [](double x) {
    return (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.432951) + 0.238081);
  };
  EXPECT_NEAR(grey_of(Tone::Aces, 0.6F), hill(1.0), 1e-4);
  const auto contrast = [](double x) {
    return 15.5 * std::pow(x, 6) - 40.14 * std::pow(x, 5) + 31.96 * std::pow(x, 4) - 6.868 * std::pow(x, 3) +
           0.4298 * x * x + 0.1191 * x - 0.00232;
  };
  EXPECT_NEAR(grey_of(Tone::Agx, 1.0F), std::pow(contrast(12.47393 / 16.5), 2.2), 1e-3);
}

TEST(Tone, LightThatIsNoLightIsBlackAndEndlessLightIsWhite) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  for (const Tone tone : kTones) {
    for (const float nothing : {kNan, -1.0F, -kInfinite}) {
      EXPECT_NEAR(grey_of(tone, nothing), 0.0F, 1e-3F) << name_of(tone);
    }
    for (const float much : {1e20F, std::numeric_limits<float>::max(), kInfinite}) {
      EXPECT_GT(grey_of(tone, much), 0.97F) << name_of(tone);
      const Rgb red = tone_map(tone, {much, 0.0F, kNan});
      EXPECT_TRUE(red.r > 0.5F && red.r <= 1.0F && red.g >= 0.0F && red.b >= 0.0F) << name_of(tone);
    }
  }
}

TEST(Tone, AlphaChangesHowMuchIsSeenNotInWhichTone) {
  for (const Tone tone : {Tone::Neutral, Tone::Agx, Tone::None}) {
    const DisplayTransform transform{1.0, tone};
    const Rgb whole{0.9F, 0.3F, 0.05F};
    const Rgba8 opaque = to_display(whole, 1.0F, transform, AlphaUse::Straight);
    const Rgb half{0.5F * whole.r, 0.5F * whole.g, 0.5F * whole.b};
    Rgba8 expected = opaque;
    expected.a = 128;
    EXPECT_EQ(to_display(half, 0.5F, transform, AlphaUse::Straight), expected);
    Rgba8 plain;
    to_display(std::span(&whole, 1), std::span(&plain, 1), transform);
    EXPECT_EQ(opaque, plain);
    const Rgba8 before_black = to_display(half, 0.5F, transform, AlphaUse::OverBlack);
    EXPECT_EQ(before_black.a, 255);
    EXPECT_NEAR(srgb_to_linear(before_black.g), 0.5F * srgb_to_linear(opaque.g), 0.01F);
  }
  EXPECT_EQ(to_display({}, 0.0F, {}, AlphaUse::Straight), Rgba8{});
  EXPECT_EQ(to_display({}, 0.0F, {}, AlphaUse::OverBlack), (Rgba8{0, 0, 0, 255}));
}

TEST(Tone, WithoutOneDisplayColorsAreThoseOfSrgb) {
  std::vector<Rgb> radiance;
  for (int i = -4; i < 300; ++i) radiance.push_back({static_cast<float>(i) / 255.0F, 0.2F, 2.0F});
  std::vector<Rgba8> display(radiance.size());
  to_display(radiance, display, {});
  for (std::size_t i = 0; i < radiance.size(); ++i) EXPECT_EQ(display[i], to_srgb(radiance[i]));

  to_display(radiance, display, {.exposure_stops = 1.0, .tone = Tone::Neutral});
  for (std::size_t i = 0; i < radiance.size(); ++i) {
    const Rgb brighter{2.0F * radiance[i].r, 2.0F * radiance[i].g, 2.0F * radiance[i].b};
    EXPECT_EQ(display[i], to_srgb(tone_map(Tone::Neutral, brighter)));
  }
}

TEST(Tone, ValuesThatAreNoLightAreShownAsTheyAre) {
  const std::vector<Rgb> values{{0.5F, 0.25F, 1.0F}, {-1.0F, 2.0F, std::numeric_limits<float>::quiet_NaN()}};
  std::vector<Rgba8> shown(values.size());
  const DisplayTransform transform{.exposure_stops = 3.0, .tone = Tone::Aces, .shows = "normal"};
  to_display(values, shown, transform);
  EXPECT_EQ(shown[0], (Rgba8{128, 64, 255, 255}));
  EXPECT_EQ(shown[1], (Rgba8{0, 255, 0, 255}));
  EXPECT_EQ(texts_of(transform).at(kShowText), "normal");
  EXPECT_FALSE(texts_of({}).contains(kShowText));
}

}  // namespace
}  // namespace hpr
