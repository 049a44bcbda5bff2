#include "image/ssim.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "image/test_pictures.h"

namespace hpr {
namespace {

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
