#include "image/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "image/test_pictures.h"

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

TEST(Metrics, TheMeanHasTheStandardErrorOfThePixels) {
  // Means per pixel are 1, 2, 6: their mean is 3, their variance 7.
  const Difference result = compare_values(Values{0, 2, 2, 2, 7, 5}, Values{0, 0, 0, 0, 0, 0}, 2);
  EXPECT_DOUBLE_EQ(result.mean, 3.0);
  EXPECT_DOUBLE_EQ(result.mean_error, std::sqrt(7.0 / 3.0));
  EXPECT_TRUE(std::isnan(compare_values(Values{1, 2}, Values{0, 0}, 2).mean_error)) << "one pixel tells no spread";
  const Difference shift = compare_values(Values(1000, 1e6F), Values(1000, 0.0F), 1);
  EXPECT_EQ(shift.mean_error, 0.0) << "nor does a large mean make one";
}

TEST(Metrics, TheWorstPixelIsTheFirstWithTheLargestDifference) {
  EXPECT_EQ(compare_values(Values{0, 0, 1, 0, 0, -3, 3, 0}, Values(8, 0.0F), 2).worst, 2U);
  EXPECT_EQ(compare_values(Values{0, 5, kNan, kNan}, Values{0, 0, kNan, 0}, 1).worst, 3U);
}

TEST(Metrics, RelativeErrorsAreHeldAgainstTheBrightnessOfTheReference) {
  // Pixels of two channels: squares 1 and 0 against 2^2, 0 and 4 against 0, 0 against 1.
  const Values reference{2, 2, 0, 0, 1, 1};
  const Values image{3, 2, 0, -2, 1, 1};
  const double expected = (0.5 / 4.01 + 2.0 / 0.01 + 0.0) / 3.0;
  EXPECT_NEAR(relative_error(image, reference, 2).all, expected, 1e-9);
  EXPECT_EQ(relative_error(image, reference, 2).trimmed, relative_error(image, reference, 2).all) << "too few to trim";
  EXPECT_NE(relative_error(reference, image, 2).all, relative_error(image, reference, 2).all) << "not symmetric";
  // Channels that cancel are as good as black.
  EXPECT_NEAR(relative_error(Values{2, -1}, Values{1, -1}, 2).all, 0.5 / 0.01, 1e-9);
}

TEST(Metrics, TheTrimmedErrorLeavesOutOnePixelOfAThousand) {
  for (const std::size_t pixels : {999U, 1000U, 2999U, 3000U}) {
    const Values reference(pixels, 1.0F);
    Values image(pixels, 1.5F);
    image[17] = image[500] = image[998] = 1e6F;
    const std::size_t left = 3 - pixels / 1000;  // of the three fireflies
    const double usual = 0.25 / 1.01;
    const double firefly = (1e6 - 1.0) * (1e6 - 1.0) / 1.01;
    const double kept = static_cast<double>(pixels - pixels / 1000);
    const RelativeError error = relative_error(image, reference, 1);
    const double trimmed = (static_cast<double>(left) * firefly + (kept - static_cast<double>(left)) * usual) / kept;
    EXPECT_NEAR(error.trimmed, trimmed, 1e-9 * trimmed) << pixels;
    EXPECT_GT(error.all, error.trimmed * (pixels < 1000 ? 0.99 : 1.1)) << pixels;
  }
}

TEST(Metrics, RelativeErrorsOfEqualPicturesVanishAndOfNanAreNoNumber) {
  EXPECT_EQ(relative_error(Values{1, 2, 3}, Values{1, 2, 3}, 3).all, 0.0);
  EXPECT_EQ(relative_error(Values{1, 2, 3}, Values{1, 2, 3}, 3).trimmed, 0.0);
  EXPECT_EQ(relative_error({}, {}, 3).trimmed, 0.0);
  for (const float bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_TRUE(std::isnan(relative_error(Values{1, bad}, Values{1, 2}, 1).trimmed));
    EXPECT_TRUE(std::isnan(relative_error(Values{1, 2}, Values{1, bad}, 1).all));
    EXPECT_TRUE(std::isnan(relative_error(Values{1, bad}, Values{1, bad}, 1).all)) << "in both";
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

using test::ramps;

TEST(Ssim, IsOneForEqualPictures) {
  for (const Size size : {Size{100, 70}, Size{11, 11}, Size{3, 2}, Size{1, 1}, Size{0, 0}}) {
    EXPECT_EQ(ssim(ramps(size, 1), ramps(size, 1), size, 1), 1.0) << size.width;
  }
}

TEST(Ssim, IsNeverMoreThanOneByARounding) {
  const Size size{3, 2};
  for (int level = 0; level < 256; ++level) {
    const std::vector<float> even(size.area() * 3, static_cast<float>(level) / 255.0F);
    std::vector<float> near = even;
    for (float& value : near) value = std::nextafter(value, 1.0F);
    EXPECT_LE(ssim(near, even, size, 1), 1.0) << level;
    near.front() = std::nextafter(near.front(), 1.0F);
    EXPECT_LE(ssim(near, even, size, 1), 1.0) << level;
  }
}

// structural_similarity of scikit-image 0.26.0 with channel_axis=2, gaussian_weights=True, sigma=1.5,
// use_sample_covariance=False, data_range=1.0, in double precision.
TEST(Ssim, AgreesWithScikitImage) {
  const auto of = [](Size size) { return ssim(ramps(size, 1), ramps(size, 0), size, 1); };
  EXPECT_NEAR(of({100, 70}), 0.5695534334684406, 1e-6);
  EXPECT_NEAR(of({40, 30}), 0.5709689919294095, 1e-6);
  EXPECT_NEAR(of({11, 11}), 0.7419809804011929, 1e-6);
}

// The formula by NumPy 2.4.6 with gaussian_filter(sigma=1.5, truncate=3.5, mode="reflect") of SciPy 1.17.1, averaged
// over all pixels.
TEST(Ssim, MirrorsPicturesSmallerThanItsWindow) {
  const auto of = [](Size size) { return ssim(ramps(size, 1), ramps(size, 0), size, 1); };
  EXPECT_NEAR(of({10, 20}), 0.736862062793603, 1e-6);
  EXPECT_NEAR(of({3, 2}), 0.8356064424696332, 1e-6);
}

TEST(Ssim, OfEvenColorsIsTheTermOfTheirLuminance) {
  const auto term = [](double a, double b) { return (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4); };
  for (const Size size : {Size{1, 1}, Size{30, 20}}) {
    const std::vector<float> dark(size.area() * 3, 0.25F);
    const std::vector<float> light(size.area() * 3, 0.75F);
    EXPECT_NEAR(ssim(dark, light, size, 1), term(0.25, 0.75), 1e-12) << size.width;
  }
}

TEST(Ssim, IsSymmetricAndLessForMoreNoise) {
  const Size size{50, 40};
  EXPECT_EQ(ssim(ramps(size, 0), ramps(size, 1), size, 1), ssim(ramps(size, 1), ramps(size, 0), size, 1));
  EXPECT_LT(ssim(ramps(size, 2), ramps(size, 0), size, 1), ssim(ramps(size, 1), ramps(size, 0), size, 1));
  // A negative of itself is as unlike as can be: structure counts below zero.
  std::vector<float> negative = ramps(size, 1);
  for (float& value : negative) value = 1.0F - value;
  EXPECT_LT(ssim(negative, ramps(size, 1), size, 1), 0.0);
}

TEST(Ssim, HasTheSameBitsForAnyNumberOfThreads) {
  const Size size{40, 211};  // four bands of rows
  const double alone = ssim(ramps(size, 1), ramps(size, 0), size, 1);
  for (const int threads : {2, 3, 8}) EXPECT_EQ(ssim(ramps(size, 1), ramps(size, 0), size, threads), alone);
}

TEST(Ssim, OfValuesThatAreNotFiniteIsNoNumber) {
  const Size size{12, 12};
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    std::vector<float> picture = ramps(size, 0);
    picture[100] = bad;
    EXPECT_TRUE(std::isnan(ssim(picture, ramps(size, 0), size, 1)));
    EXPECT_TRUE(std::isnan(ssim(ramps(size, 0), picture, size, 1)));
    EXPECT_TRUE(std::isnan(ssim(picture, picture, size, 1)));
  }
}

}  // namespace

}  // namespace hpr
