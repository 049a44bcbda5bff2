#include "image/flip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "image/test_pictures.h"

namespace hpr {
namespace {

using test::ramps;

TEST(Flip, IsZeroForEqualPictures) {
  for (const Size size : {Size{100, 70}, Size{3, 2}, Size{1, 1}, Size{0, 0}}) {
    const FlipError error = flip_error(ramps(size, 1), ramps(size, 1), size, 1);
    EXPECT_EQ(error.mean, 0.0) << size.width;
    EXPECT_EQ(error.map, Image<float>(size)) << size.width;
  }
}

// flip_evaluator.evaluate(reference, test, "LDR") of flip-evaluator 1.7. Its white point is rounded otherwise.
TEST(Flip, AgreesWithFlipEvaluator) {
  const auto of = [](Size size) { return flip_error(ramps(size, 1), ramps(size, 0), size, 1).mean; };
  EXPECT_NEAR(of({100, 70}), 0.4739293158054352, 1e-4);
  EXPECT_NEAR(of({40, 30}), 0.47747060656547546, 1e-4);
  EXPECT_NEAR(of({11, 11}), 0.27615687251091003, 1e-4);
  EXPECT_NEAR(of({3, 2}), 0.1313539296388626, 1e-4);
  const std::vector<float> dark(3, 0.5F);
  const std::vector<float> light(3, 0.6F);
  EXPECT_NEAR(flip_error(light, dark, {1, 1}, 1).mean, 0.2850629687309265, 1e-4);
}

TEST(Flip, TheMapAgreesWithFlipEvaluatorWithinBandsAndAtTheirSeams) {
  const Image<float> map = flip_error(ramps({100, 70}, 1), ramps({100, 70}, 0), {100, 70}, 1).map;
  EXPECT_NEAR(map.at(0, 0), 0.1110191F, 1e-4F);
  EXPECT_NEAR(map.at(99, 69), 0.19619538F, 1e-4F);
  EXPECT_NEAR(map.at(20, 35), 0.51139474F, 1e-4F);
  EXPECT_NEAR(map.at(50, 63), 0.8376171F, 1e-4F);
  EXPECT_NEAR(map.at(50, 64), 0.53579134F, 1e-4F);
  EXPECT_NEAR(*std::ranges::max_element(map.pixels()), 0.97940314F, 1e-4F);
}

TEST(Flip, AgreesWithFlipEvaluatorAtAnotherDistance) {
  EXPECT_NEAR(flip_error(ramps({100, 70}, 1), ramps({100, 70}, 0), {100, 70}, 1, 20.0).mean, 0.4559563994407654, 1e-4);
  EXPECT_NEAR(flip_error(ramps({3, 2}, 1), ramps({3, 2}, 0), {3, 2}, 1, 20.0).mean, 0.11582855135202408, 1e-4);
}

TEST(Flip, GreenAndBlueAreAsFarApartAsColorsCanBe) {
  const Size size{5, 4};
  std::vector<float> green(size.area() * 3, 0.0F);
  std::vector<float> blue = green;
  for (std::size_t i = 0; i < green.size(); i += 3) green[i + 1] = blue[i + 2] = 1.0F;
  EXPECT_NEAR(flip_error(green, blue, size, 1).mean, 1.0, 1e-4);
}

TEST(Flip, IsSymmetric) {
  const Size size{50, 40};
  const FlipError there = flip_error(ramps(size, 0), ramps(size, 1), size, 1);
  const FlipError back = flip_error(ramps(size, 1), ramps(size, 0), size, 1);
  EXPECT_EQ(there.mean, back.mean);
  EXPECT_EQ(there.map, back.map);
}

TEST(Flip, AnEdgeOrAPointIsSeenMoreThanItsColors) {
  const Size size{64, 64};
  const std::vector<float> grey(size.area() * 3, 0.5F);
  std::vector<float> line = grey;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (i / 3 % 64 >= 32) line[i] = 0.6F;
  }
  const Image<float> map = flip_error(line, grey, size, 1).map;
  const std::vector<float> lighter(size.area() * 3, 0.6F);
  const float even = flip_error(lighter, grey, size, 1).map.at(32, 32);
  EXPECT_GT(map.at(34, 32), even + 0.02F) << "beside the edge";
  EXPECT_NEAR(map.at(60, 32), even, 1e-3F) << "far from it";
  EXPECT_NEAR(map.at(4, 32), 0.0F, 1e-3F) << "where nothing differs";
}

TEST(Flip, FinePatternsVanishFromAfar) {
  const Size size{64, 64};
  const std::vector<float> grey(size.area() * 3, 0.5F);
  std::vector<float> dots = grey;
  for (std::size_t i = 0; i < dots.size(); ++i) dots[i] = (i / 3 + i / 3 / 64) % 2 == 0 ? 0.55F : 0.45F;
  const double near = flip_error(dots, grey, size, 1, 10.0).mean;
  const double far = flip_error(dots, grey, size, 1, 67.0).mean;
  EXPECT_GT(near, 5.0 * far);
}

TEST(Flip, HasTheSameBitsForAnyNumberOfThreads) {
  const Size size{40, 211};  // four bands of rows
  const FlipError alone = flip_error(ramps(size, 1), ramps(size, 0), size, 1);
  for (const int threads : {2, 3, 8}) {
    const FlipError together = flip_error(ramps(size, 1), ramps(size, 0), size, threads);
    EXPECT_EQ(together.mean, alone.mean);
    EXPECT_EQ(together.map, alone.map);
  }
}

TEST(Flip, OfValuesThatAreNotFiniteIsNoNumber) {
  const Size size{12, 12};
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    std::vector<float> picture = ramps(size, 0);
    picture[100] = bad;
    for (const FlipError& error :
         {flip_error(picture, ramps(size, 0), size, 1), flip_error(ramps(size, 0), picture, size, 1),
          flip_error(picture, picture, size, 1)}) {
      EXPECT_TRUE(std::isnan(error.mean));
      EXPECT_EQ(error.map.size(), Size{});
    }
  }
}

TEST(Flip, HoldsAtAnyDistance) {
  const Size size{9, 7};
  for (const double pixels_per_degree : {1e-3, 1.0, 7.0, 500.0}) {
    const FlipError error = flip_error(ramps(size, 1), ramps(size, 0), size, 1, pixels_per_degree);
    EXPECT_GE(error.mean, 0.0) << pixels_per_degree;
    EXPECT_LE(error.mean, 1.0) << pixels_per_degree;
  }
}

}  // namespace
}  // namespace hpr
