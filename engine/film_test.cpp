#include "engine/film.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

#include "cluster/transport/local_communicator.h"

namespace hpr {
namespace {

struct Light {
  explicit Light(const FrameLayout& layout, std::vector<Aov> wanted = {})
      : radiance(layout), aovs(layout, wanted), keys(layout) {}

  void fill(Rgb color) {
    for (std::size_t tile = 0; tile < radiance.tiles(); ++tile) {
      std::ranges::fill(radiance.tile(tile), color);
      radiance.set_active(tile);
    }
  }
  [[nodiscard]] SampleLight sample() const { return {radiance, aovs, keys}; }

  TileLayer<Rgb> radiance;
  AovLayers aovs;
  TileLayer<Key> keys;
};

void add_to(Film& film, const Light& light, double weight) {
  const SampleLight sample = light.sample();
  film.add({&sample, 1}, {&weight, 1}, all_tiles(film.layout()), 1);
}

Image<Rgb> mean_of(const Film& film) {
  TileLayer<Rgb> radiance(film.layout());
  AovLayers none;
  film.resolve(all_tiles(film.layout()), 1, radiance, none);
  return to_image(radiance, 0);
}

TEST(Film, OneSampleComesBackBitByBit) {
  const FrameLayout layout({{5, 3}});
  Light light(layout);
  const Rgb color{0.1F, std::numeric_limits<float>::denorm_min(), 3e38F};
  light.fill(color);
  Film film(layout, {});
  add_to(film, light, 1.0);
  const Image<Rgb> mean = mean_of(film);
  for (const Rgb& pixel : mean.pixels()) EXPECT_EQ(pixel, color);
}

TEST(Film, CoverageIsTheMeanByWeightFromNothingToAll) {
  const FrameLayout layout({{2, 1}});
  Film film(layout, {.aovs = {Aov::Coverage}});
  Light light(layout, {Aov::Coverage});
  TileLayer<float>& coverage = light.aovs.single.at(Aov::Coverage);
  coverage.set_active(0);
  const auto add = [&](float first, float second, double weight) {
    coverage.at(0, 0, 0) = first;
    coverage.at(0, 1, 0) = second;
    add_to(film, light, weight);
  };
  add(1.0F, 1.0F, 3.0);
  add(0.5F, 0.0F, 2.0);
  add(0.0F, 1.0F, -1.0);
  TileLayer<Rgb> radiance(layout);
  AovLayers resolved(layout, std::vector<Aov>{Aov::Coverage});
  film.resolve(all_tiles(layout), 1, radiance, resolved);
  EXPECT_EQ(resolved.coverage()->at(0, 0, 0), 1.0F) << "4 / 4";
  EXPECT_EQ(resolved.coverage()->at(0, 1, 0), 0.5F) << "2 / 4";
  add(1.0F, -20.0F, 1.0);
  film.resolve(all_tiles(layout), 1, radiance, resolved);
  EXPECT_EQ(resolved.coverage()->at(0, 1, 0), 0.0F) << "clamped";
}

/// The last 20 000 of a million samples, added to what the others sum to in integers: where a sum of floats, at 5e5,
/// would move in steps of 1 / 32.
TEST(Film, AMillionSamplesLoseNothing) {
  constexpr int kAll = 1'000'000;
  constexpr int kBefore = 980'000;
  constexpr double kStep = 1.0 / 16777216.0;
  const FrameLayout layout({{1, 1}});
  std::mt19937 random(3);
  const auto steps = [&] { return static_cast<std::uint32_t>(random() >> 8U); };
  std::uint64_t sum = 0;
  for (int i = 0; i < kBefore; ++i) sum += steps();
  const float tenth = 0.1F;
  Film film(layout, {});
  film.each_layer([&](auto& layer) {
    if constexpr (std::is_same_v<decltype(layer), TileLayer<ColorSum>&>) {
      layer.set_active(0);
      layer.at(0, 0, 0) = {0.5 * kBefore * static_cast<double>(tenth), 0.5 * static_cast<double>(sum) * kStep, 0.0};
    }
  });
  film.set_counters({kBefore, {0.5 * kBefore, 0.5 * kBefore}});
  Light light(layout);
  light.radiance.set_active(0);
  for (int i = kBefore; i < kAll; ++i) {
    const std::uint32_t value = steps();
    sum += value;
    light.radiance.at(0, 0, 0) = {tenth, static_cast<float>(value * kStep), 1e-30F};
    add_to(film, light, 1.0);
  }
  const Rgb mean = mean_of(film).at(0, 0);
  EXPECT_EQ(film.samples(), std::uint32_t{kAll});
  EXPECT_EQ(mean.r, tenth);
  EXPECT_EQ(mean.g, static_cast<float>(static_cast<double>(sum) * kStep / kAll));
  EXPECT_NEAR(mean.b, 1e-30 * (kAll - kBefore) / kAll, 1e-38);
}

TEST(Film, WeightsCountAndTheirSumDivides) {
  const FrameLayout layout({{2, 2}});
  Light light(layout);
  Film film(layout, {});
  light.fill({1.0F, 2.0F, 3.0F});
  for (int i = 0; i < 3; ++i) add_to(film, light, 1.0);
  light.fill({5.0F, 2.0F, 0.0F});
  add_to(film, light, -1.0);
  EXPECT_EQ(mean_of(film).at(1, 1), (Rgb{-1.0F, 2.0F, 4.5F}));
}

TEST(Film, MeansStayFinite) {
  const FrameLayout layout({{1, 1}});
  Light light(layout);
  Film film(layout, {});
  light.fill({3e38F, 3e38F, 0.0F});
  for (int i = 0; i < 3; ++i) add_to(film, light, 1.0);
  light.fill({-3e38F, 0.0F, 0.0F});
  add_to(film, light, -1.0);
  const Rgb mean = mean_of(film).at(0, 0);
  EXPECT_TRUE(std::isfinite(mean.r) && std::isfinite(mean.g));
  EXPECT_GT(mean.r, 3.4e38F);
}

TEST(Film, PartsAreMeansAndSurfacesAreTheFirstSamples) {
  const FrameLayout layout({{2, 1}});
  const std::vector<Aov> wanted{Aov::Id, Aov::Normal, Aov::Direct, Aov::Rank, Aov::Cost};
  Film film(layout, {wanted, false});
  for (int i = 0; i < 4; ++i) {
    Light light(layout, wanted);
    const auto value = static_cast<float>(i);
    light.fill({});
    light.aovs.rgb.at(Aov::Normal).at(0, 1, 0) = {value + 1.0F, 0.0F, 0.0F};
    light.aovs.rgb.at(Aov::Normal).set_active(0);
    light.aovs.rgb.at(Aov::Direct).at(0, 1, 0) = {0.0F, value, 0.0F};
    light.aovs.rgb.at(Aov::Direct).set_active(0);
    light.aovs.single.at(Aov::Rank).at(0, 1, 0) = value + 7.0F;
    light.aovs.single.at(Aov::Rank).set_active(0);
    light.aovs.single.at(Aov::Cost).at(0, 1, 0) = 2.0F * value;
    light.keys.at(0, 1, 0) = make_key(0.5F, static_cast<std::uint32_t>(i) + 40U);
    light.keys.set_active(0);
    add_to(film, light, 1.0);
  }
  TileLayer<Rgb> radiance(layout);
  AovLayers aovs(layout, wanted);
  film.resolve(all_tiles(layout), 1, radiance, aovs);
  EXPECT_EQ(aovs.rgb.at(Aov::Normal).at(0, 1, 0).r, 1.0F);
  EXPECT_EQ(aovs.rgb.at(Aov::Direct).at(0, 1, 0).g, 1.5F);
  EXPECT_EQ(aovs.single.at(Aov::Rank).at(0, 1, 0), 7.0F);
  EXPECT_EQ(aovs.single.at(Aov::Cost).at(0, 1, 0), 3.0F);
  EXPECT_EQ(key_surface(film.keys().at(0, 1, 0)), 40U);
}

/// Noise of a known variance: the estimate must tell the relative error of the mean, which is variance / n / (mean^2 +
/// 0.01), within what so many pixels allow.
TEST(Film, TheHalvesTellTheErrorOfTheMean) {
  const FrameLayout layout({{256, 128}});
  std::mt19937 random(11);
  Light light(layout);
  Film film(layout, {});
  constexpr int kSamples = 32;
  for (int i = 0; i < kSamples; ++i) {
    for (const std::size_t tile : all_tiles(layout)) {
      for (Rgb& pixel : light.radiance.tile(tile)) {
        const auto noise = [&] { return 1.0F + static_cast<float>(random() >> 8U) / 16777216.0F; };
        pixel = {noise(), noise(), noise()};
      }
      light.radiance.set_active(tile);
    }
    add_to(film, light, 1.0);
  }
  const double expected = (1.0 / 12.0) / kSamples / (1.5 * 1.5 + 0.01);
  std::vector<double> found;
  for (const int ranks : {1, 3}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      std::vector<std::size_t> mine;
      for (const std::size_t tile : all_tiles(layout)) {
        if (tile % static_cast<std::size_t>(ranks) == static_cast<std::size_t>(comm.rank())) mine.push_back(tile);
      }
      const double error = estimated_relmse(comm, film, mine, 1);
      if (comm.rank() == ranks - 1) found.push_back(error);
    });
  }
  EXPECT_NEAR(found.at(0), expected, 0.05 * expected);
  EXPECT_EQ(found.at(0), found.at(1)) << "ranks change its bits";
}

TEST(Film, VariancesAreThoseOfSamplesRelativeToTheirMean) {
  const FrameLayout layout({{2, 1}});
  Film film(layout, {{}, false, 8});
  Light light(layout);
  for (int i = 0; i < 8; ++i) {
    light.fill({0.25F, 0.25F, 0.25F});
    light.radiance.at(0, 1, 0) = i % 2 == 0 ? Rgb{1.0F, 1.0F, 1.0F} : Rgb{3.0F, 3.0F, 3.0F};
    add_to(film, light, 1.0);
  }
  const std::vector<double> variances = film.variances(0);
  EXPECT_EQ(variances[0], 0.0);
  EXPECT_NEAR(variances[1], 3.0 / (4.0 + 0.01), 1e-12);
}

}  // namespace
}  // namespace hpr
