#include "image/pixel_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"

namespace hpr {
namespace {

/// The filters as their papers write them, not normalised.
double value(PixelFilter filter, double x) {
  x = std::abs(x);
  switch (filter) {
    case PixelFilter::Box:
      return x <= 0.5 ? 1.0 : 0.0;
    case PixelFilter::Triangle:
      return std::max(0.0, 1.0 - x);
    case PixelFilter::Gaussian:
      return x <= 1.5 ? std::exp(-2.0 * x * x) : 0.0;
    case PixelFilter::BSpline:
      if (x >= 2.0) return 0.0;
      return x < 1.0 ? (4.0 - 6.0 * x * x + 3.0 * x * x * x) / 6.0 : std::pow(2.0 - x, 3.0) / 6.0;
    case PixelFilter::Mitchell: {
      constexpr double b = 1.0 / 3.0;
      constexpr double c = 1.0 / 3.0;
      if (x >= 2.0) return 0.0;
      if (x >= 1.0) {
        return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + 8 * b + 24 * c) / 6.0;
      }
      return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + 6 - 2 * b) / 6.0;
    }
  }
  return 0.0;
}

class PixelFilterTest : public testing::TestWithParam<PixelFilter> {};

INSTANTIATE_TEST_SUITE_P(All, PixelFilterTest, testing::ValuesIn(all_pixel_filters()), [](const auto& each) {
  std::string name(name_of(each.param));
  std::erase(name, '-');
  return name;
});

/// sum of weight g(offset) over sum of weights, for evenly spread u.x, against the integral of f g over that of f.
TEST_P(PixelFilterTest, WeightedSamplesHaveTheMomentsOfTheFilter) {
  constexpr int kSteps = 200'000;
  for (const int power : {0, 1, 2, 4}) {
    double sampled = 0.0;
    double weights = 0.0;
    double integral = 0.0;
    double whole = 0.0;
    for (int i = 0; i < kSteps; ++i) {
      const double u = (i + 0.5) / kSteps;
      const FilterSample x = sample_filter(GetParam(), {u, 0.5});
      sampled += x.weight * std::pow(x.offset.x, power);
      weights += x.weight;
      const double place = -2.5 + 5.0 * u;
      integral += value(GetParam(), place) * std::pow(place, power);
      whole += value(GetParam(), place);
      ASSERT_EQ(x.offset.y, 0.0);
    }
    EXPECT_NEAR(sampled / weights, integral / whole, 3e-5) << power;
  }
}

TEST_P(PixelFilterTest, SamplesAreMonotoneInsideTheRadiusAndSymmetric) {
  double last = -10.0;
  for (int i = 0; i < 4096; ++i) {
    const double u = i / 4096.0;
    const double x = sample_filter(GetParam(), {u, 0.25}).offset.x;
    EXPECT_GT(x, last);
    last = x;
    EXPECT_NEAR(sample_filter(GetParam(), {0.25, 1.0 - u}).offset.y, -x, 1e-9) << u;
  }
  EXPECT_LE(last, 2.0);
}

TEST_P(PixelFilterTest, TheWeightIsTheFiltersSign) {
  for (int i = 1; i < 100; ++i) {
    for (int j = 1; j < 100; ++j) {
      const FilterSample sample = sample_filter(GetParam(), {i / 100.0 + 1e-3, j / 100.0 + 1e-3});
      const double f = value(GetParam(), sample.offset.x) * value(GetParam(), sample.offset.y);
      EXPECT_GT(sample.weight * f, 0.0) << i << ' ' << j;
      EXPECT_EQ(std::abs(sample.weight), 1.0);
    }
  }
}

TEST(PixelFilter, MitchellsNegativeShareIsSmallerThanASixteenthPerSide) {
  int negative = 0;
  for (int i = 0; i < 16384; ++i) negative += sample_filter(PixelFilter::Mitchell, {i / 16384.0, 0.5}).weight < 0.0;
  EXPECT_GT(negative, 0);
  EXPECT_LT(negative / 2, 16384 / 16);
}

TEST(PixelFilter, NamesGoBothWaysAndUnknownOnesListTheChoices) {
  for (const PixelFilter filter : all_pixel_filters()) EXPECT_EQ(parse_pixel_filter(name_of(filter)), filter);
  try {
    (void)parse_pixel_filter("mitchel");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("mitchell"), std::string::npos);
  }
}

}  // namespace
}  // namespace hpr
