#include "image/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace hpr {
namespace {

using Values = std::vector<float>;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(Metrics, EqualImagesDoNotDiffer) {
  const Values image{0.0F, 1.0F, -0.0F, kNan, kInfinity, 1e-45F};
  const Difference result = compare_values(image, image, 3);
  EXPECT_EQ(result.rmse, 0.0);
  EXPECT_EQ(result.psnr, kInfinity);
  EXPECT_EQ(result.max, 0.0);
  EXPECT_EQ(result.mean, 0.0);
  EXPECT_EQ(result.pixels, 2U);
  EXPECT_EQ(result.differing, 0U);
}

TEST(Metrics, AgreeWithTheHandComputedValues) {
  // Differences 0.5, 0, 0, -0.25, 0, 0.25 in two pixels of three values.
  const Difference result = compare_values(Values{0.5F, 1, 2, 0, 3, 0.5F}, Values{0, 1, 2, 0.25F, 3, 0.25F}, 3);
  EXPECT_DOUBLE_EQ(result.rmse, 0.25);  // sqrt(0.375 / 6)
  EXPECT_DOUBLE_EQ(result.psnr, -20.0 * std::log10(0.25));
  EXPECT_DOUBLE_EQ(result.max, 0.5);
  EXPECT_DOUBLE_EQ(result.mean, 0.5 / 6.0);
  EXPECT_EQ(result.differing, 2U);
}

TEST(Metrics, CountsPixelsNotValues) {
  EXPECT_EQ(compare_values(Values{1, 1, 1, 0, 0, 0}, Values{0, 0, 0, 0, 0, 0}, 3).differing, 1U);
  EXPECT_EQ(compare_values(Values{1, 1, 1, 0, 0, 0}, Values{0, 0, 0, 0, 0, 0}, 1).differing, 3U);
}

TEST(Metrics, ASmallestDifferenceCountsAndSignedZerosDoNot) {
  const Difference tiny = compare_values(Values{std::numeric_limits<float>::denorm_min()}, Values{0.0F}, 1);
  EXPECT_EQ(tiny.differing, 1U);
  EXPECT_GT(tiny.rmse, 0.0);
  EXPECT_EQ(compare_values(Values{-0.0F}, Values{0.0F}, 1).differing, 0U);
}

TEST(Metrics, NanInOneImageIsAnInfiniteDifference) {
  for (const auto& [a, b] : {std::pair{kNan, 1.0F}, std::pair{1.0F, kNan}}) {
    const Difference result = compare_values(Values{a, 0}, Values{b, 0}, 1);
    EXPECT_EQ(result.rmse, kInfinity);
    EXPECT_EQ(result.psnr, -kInfinity);
    EXPECT_EQ(result.max, kInfinity);
    EXPECT_EQ(result.differing, 1U);
  }
}

TEST(Metrics, NothingComparedIsEqual) {
  const Difference result = compare_values({}, {}, 3);
  EXPECT_EQ(result.pixels, 0U);
  EXPECT_EQ(result.rmse, 0.0);
  EXPECT_EQ(result.psnr, kInfinity);
}

TEST(MetricsDeathTest, ImagesOfDifferentSizesBreakTheContract) {
  EXPECT_DEATH((void)compare_values(Values{1}, Values{1, 2}, 1), "broken contract");
}

}  // namespace
}  // namespace hpr
