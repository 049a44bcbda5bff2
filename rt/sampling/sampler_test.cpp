#include "rt/sampling/sampler.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <vector>

namespace hpr {
namespace {

std::vector<glm::dvec2> points(std::uint64_t stream, std::uint32_t count, int pair) {
  std::vector<glm::dvec2> result;
  for (std::uint32_t i = 0; i < count; ++i) {
    Sampler sampler(stream, i);
    glm::dvec2 p{};
    for (int k = 0; k <= pair; ++k) p = sampler.two();
    result.push_back(p);
  }
  return result;
}

TEST(Sampler, EveryPairIsStratifiedInAllElementaryIntervals) {
  for (const std::uint64_t stream : {0ULL, 7ULL, 0xFFFFFFFFFFFFFFFFULL}) {
    for (const int pair : {0, 1, 5}) {
      const std::vector<glm::dvec2> all = points(stream, 256, pair);
      for (int columns = 1; columns <= 256; columns *= 2) {
        std::set<int> cells;
        for (const glm::dvec2& p : all) {
          ASSERT_TRUE(p.x >= 0.0 && p.x < 1.0 && p.y >= 0.0 && p.y < 1.0);
          const int rows = 256 / columns;
          cells.insert(static_cast<int>(p.x * columns) * rows + static_cast<int>(p.y * rows));
        }
        EXPECT_EQ(cells.size(), 256U) << columns << " columns, pair " << pair;
      }
    }
  }
}

TEST(Sampler, PairsOfThePixelAreStratifiedInAllElementaryIntervals) {
  for (const std::uint64_t stream : {0ULL, 7ULL}) {
    for (int columns = 1; columns <= 256; columns *= 2) {
      std::set<int> cells;
      for (std::uint32_t i = 0; i < 256; ++i) {
        const glm::dvec2 p = Sampler(stream, i).two_of_pixel();
        const int rows = 256 / columns;
        cells.insert(static_cast<int>(p.x * columns) * rows + static_cast<int>(p.y * rows));
      }
      EXPECT_EQ(cells.size(), 256U) << columns << " columns";
    }
    std::array<std::set<int>, 2> sides;
    for (std::uint32_t i = 0; i < 256; ++i) {
      const glm::dvec2 p = Sampler(stream, i).two_with_pixel();
      sides[0].insert(static_cast<int>(p.x * 256));
      sides[1].insert(static_cast<int>(p.y * 256));
    }
    EXPECT_EQ(sides[0].size(), 256U);
    EXPECT_EQ(sides[1].size(), 256U);
  }
}

TEST(Sampler, EvenAndOddSamplesLookThroughAllOfThePixel) {
  for (const std::uint32_t samples : {32U, 256U}) {
    for (const bool odd : {false, true}) {
      glm::dvec2 sum(0.0);
      for (std::uint32_t i = odd ? 1 : 0; i < samples; i += 2) sum += Sampler(3, i).two_of_pixel();
      const glm::dvec2 mean = sum / (0.5 * samples);
      EXPECT_NEAR(mean.x, 0.5, 1.0 / std::sqrt(samples)) << samples;
      EXPECT_NEAR(mean.y, 0.5, 1.0 / std::sqrt(samples)) << samples;
    }
  }
}

/// The squared error of what 256 samples make of a disc's area, which moves with the place in the pixel.
double moving_disc_error(bool together) {
  constexpr double kRadius = 0.4;
  constexpr double kArea = 3.14159265358979 * kRadius * kRadius / 4.0;
  constexpr int kStreams = 300;
  double sum = 0.0;
  for (std::uint64_t stream = 0; stream < kStreams; ++stream) {
    int inside = 0;
    for (std::uint32_t i = 0; i < 256; ++i) {
      const glm::dvec2 pixel = Sampler(1000 + stream, i).two_of_pixel();
      Sampler sampler(2000 + stream, i);
      const glm::dvec2 u = together ? sampler.two_with_pixel() : sampler.two();
      const double x = 2.0 * u.x - 1.0 + 0.6 * (pixel.x - 0.5) - 0.2;
      const double y = 2.0 * u.y - 1.0 + 0.6 * (pixel.y - 0.5) + 0.2;
      if (x * x + y * y < kRadius * kRadius) ++inside;
    }
    const double error = inside / 256.0 - kArea;
    sum += error * error / kStreams;
  }
  return sum;
}

TEST(Sampler, WhatGoesWithThePixelIsSpreadEvenlyTogetherWithIt) {
  const double apart = moving_disc_error(false);
  EXPECT_LT(moving_disc_error(true), 0.65 * apart);
  EXPECT_LT(apart, 0.6 * 0.126 * 0.874 / 256.0) << "independent samples";
}

TEST(Sampler, PairsAndStreamsAreIndependent) {
  const auto correlation = [](const std::vector<glm::dvec2>& a, const std::vector<glm::dvec2>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i].x - 0.5) * (b[i].x - 0.5);
    return 12.0 * sum / static_cast<double>(a.size());
  };
  const auto first = points(1, 4096, 0);
  EXPECT_LT(std::abs(correlation(first, points(1, 4096, 1))), 0.08);
  EXPECT_LT(std::abs(correlation(first, points(2, 4096, 0))), 0.08);
}

TEST(Sampler, OneSampleOfManyStreamsIsUniform) {
  std::array<int, 16> bins{};
  for (int x = 0; x < 128; ++x) {
    for (int y = 0; y < 128; ++y) {
      Sampler sampler(pixel_stream({}, 0, x, y), 0);
      const glm::dvec2 p = sampler.two();
      ++bins.at(static_cast<std::size_t>(p.x * 4) * 4 + static_cast<std::size_t>(p.y * 4));
    }
  }
  double chi2 = 0.0;
  for (const int count : bins) chi2 += (count - 1024.0) * (count - 1024.0) / 1024.0;
  EXPECT_LT(chi2, 37.7);  // 15 degrees of freedom, one in a thousand
}

TEST(Sampler, StreamsDifferBySeedFrameScreenAndPlace) {
  std::set<std::uint64_t> streams;
  for (const std::uint64_t seed : {0ULL, 1ULL}) {
    for (const std::uint64_t frame : {0ULL, 1ULL}) {
      for (const std::uint32_t screen : {0U, 1U}) {
        for (int x = 0; x < 4; ++x) {
          for (int y = 0; y < 4; ++y) streams.insert(pixel_stream({seed, frame}, screen, x, y));
        }
      }
      streams.insert(photon_stream({seed, frame}));
    }
  }
  EXPECT_EQ(streams.size(), 2U * 2U * (2U * 16U + 1U));
}

TEST(Sampler, NumbersAreTheSameOnEveryMachine) {
  Sampler sampler(42, 7);
  const glm::dvec2 a = sampler.two();
  const double b = sampler.one();
  EXPECT_EQ(static_cast<std::uint32_t>(a.x * 4294967296.0), 2556543998U);
  EXPECT_EQ(static_cast<std::uint32_t>(a.y * 4294967296.0), 2653724025U);
  EXPECT_EQ(static_cast<std::uint32_t>(b * 4294967296.0), 1436968868U);
}

}  // namespace
}  // namespace hpr
