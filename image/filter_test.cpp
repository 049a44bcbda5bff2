#include "image/filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"

namespace hpr {
namespace {

Image<double> numbered(Size size) {
  Image<double> image(size);
  for (std::size_t i = 0; i < size.area(); ++i) image.pixels()[i] = static_cast<double>((i * i) % 101);
  return image;
}

TEST(Convolve, RowsAndColumnsAreSumsInTheOrderOfTheWeights) {
  const std::vector<double> weights{1.0, 10.0, 100.0};
  Image<double> row({4, 1});
  for (int x = 0; x < 4; ++x) row.at(x, 0) = x + 1.0;
  const Image<double> along_x = filter_rows<double>(row, weights);
  EXPECT_EQ(along_x.size(), (Size{2, 1}));
  EXPECT_EQ(along_x.at(0, 0), 321.0);
  EXPECT_EQ(along_x.at(1, 0), 432.0);
  Image<double> column({1, 4});
  for (int y = 0; y < 4; ++y) column.at(0, y) = y + 1.0;
  const Image<double> along_y = filter_columns<double>(column, weights);
  EXPECT_EQ(along_y.size(), (Size{1, 2}));
  EXPECT_EQ(along_y.at(0, 0), 321.0);
  EXPECT_EQ(along_y.at(0, 1), 432.0);
}

TEST(Convolve, EveryPositionIsFilteredAlikeWhateverTheWidth) {
  const std::vector<double> weights{0.5, -2.0, 0.25, 3.0};
  for (const int width : {4, 18, 19, 20, 35, 37}) {  // sums are taken 16 at a time, the rest one by one
    const Image<double> in = numbered({width, 6});
    const Image<double> out = filter_columns<double>(filter_rows<double>(in, weights), weights);
    ASSERT_EQ(out.size(), (Size{width - 3, 3}));
    for (int y = 0; y < out.height(); ++y) {
      for (int x = 0; x < out.width(); ++x) {
        double sum = 0.0;
        for (int j = 0; j < 4; ++j) {
          for (int i = 0; i < 4; ++i) {
            sum += weights[static_cast<std::size_t>(i)] * weights[static_cast<std::size_t>(j)] * in.at(x + i, y + j);
          }
        }
        EXPECT_NEAR(out.at(x, y), sum, 1e-9) << width << ": " << x << ',' << y;
      }
    }
  }
}

TEST(ConvolveDeathTest, AFilterLargerThanThePlaneBreaksTheContract) {
  const std::vector<float> weights{1.0F, 1.0F, 1.0F};
  EXPECT_DEATH((void)filter_rows<float>(Image<float>({2, 5}), weights), "broken contract");
  EXPECT_DEATH((void)filter_columns<float>(Image<float>({5, 2}), weights), "broken contract");
}

/// Red tells the column, green the row, blue is even.
Image<Rgb> slope(Size size) {
  Image<Rgb> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at(x, y) = {(static_cast<float>(x) + 0.5F) / static_cast<float>(size.width),
                        (static_cast<float>(y) + 0.5F) / static_cast<float>(size.height), 0.3F};
    }
  }
  return image;
}

TEST(Enlarge, OfTheSameSizeIsTheSame) {
  for (const Size size : {Size{1, 1}, Size{7, 5}, Size{64, 33}}) {
    const Image<Rgb> image = slope(size);
    EXPECT_EQ(enlarge(image, size, 1), image);
  }
}

TEST(Enlarge, KeepsAnEvenPicture) {
  const Rgb color{0.1F, 1e-30F, 3e30F};
  const Image<Rgb> even({3, 5}, color);
  const Image<Rgb> large = enlarge(even, {31, 40}, 2);
  EXPECT_TRUE(std::ranges::all_of(large.pixels(), [&](const Rgb& each) { return each == color; }));
}

TEST(Enlarge, PutsASlopeWhereItWas) {
  // Pixel centres keep their places on the screen: off by half a pixel, the picture would shift as it is made smaller.
  for (const Size from : {Size{10, 6}, Size{7, 9}}) {
    const Size to{33, 25};
    const Image<Rgb> large = enlarge(slope(from), to, 2);
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) {
        const double column = (x + 0.5) / to.width;
        const double row = (y + 0.5) / to.height;
        const double half_column = 0.5 / from.width;  // nothing is known beyond the outermost centres
        const double half_row = 0.5 / from.height;
        ASSERT_NEAR(large.at(x, y).r, std::clamp(column, half_column, 1.0 - half_column), 1e-6) << x << ' ' << y;
        ASSERT_NEAR(large.at(x, y).g, std::clamp(row, half_row, 1.0 - half_row), 1e-6) << x << ' ' << y;
        ASSERT_EQ(large.at(x, y).b, 0.3F);
      }
    }
  }
}

TEST(Enlarge, MixesInLinearLight) {
  Image<Rgb> image({2, 1});
  image.at(1, 0) = {8.0F, 4.0F, 0.0F};
  const Image<Rgb> large = enlarge(image, {4, 1}, 1);
  EXPECT_EQ(large.at(0, 0), Rgb{});
  EXPECT_EQ(large.at(1, 0), (Rgb{2.0F, 1.0F, 0.0F}));
  EXPECT_EQ(large.at(2, 0), (Rgb{6.0F, 3.0F, 0.0F}));
  EXPECT_EQ(large.at(3, 0), (Rgb{8.0F, 4.0F, 0.0F}));
}

/// A picture of which no two pixels are alike.
Image<Rgb> uneven(Size size) {
  Image<Rgb> image(size);
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    const auto value = static_cast<float>(std::sin(static_cast<double>(i) * 12.9898) * 43758.5453);
    image.pixels()[i] = {value, -value, value * value};
  }
  return image;
}

TEST(Enlarge, HasTheSameBitsForAnyNumberOfThreads) {
  const Image<Rgb> image = uneven({37, 23});
  const Image<Rgb> alone = enlarge(image, {111, 70}, 1);
  for (const int threads : {2, 5}) EXPECT_EQ(enlarge(image, {111, 70}, threads), alone);
}

Image<Rgb> crop(const Image<Rgb>& image, const Rect& rect) {
  Image<Rgb> part({rect.width(), rect.height()});
  for (int y = rect.y0; y < rect.y1; ++y) {
    std::ranges::copy(image.row(y).subspan(static_cast<std::size_t>(rect.x0), static_cast<std::size_t>(rect.width())),
                      part.row(y - rect.y0).begin());
  }
  return part;
}

TEST(Enlarge, PartsAreThoseOfTheWhole) {
  const Image<Rgb> small = uneven({37, 23});
  const Size size{111, 70};
  const Image<Rgb> large = enlarge(small, size, 1);
  const PicturePart made{small.size(), {9, 0, 26, 16}};
  const PicturePart shown{size, {30, 0, 76, 45}};
  EXPECT_EQ(enlarge(crop(small, made.pixels), made, shown, 2), crop(large, shown.pixels));
}

TEST(Enlarge, ADotGrowsFromOnePixel) {
  const Image<Rgb> large = enlarge(Image<Rgb>({1, 1}, {1.0F, 2.0F, 3.0F}), {50, 3}, 1);
  EXPECT_TRUE(std::ranges::all_of(large.pixels(), [](const Rgb& each) { return each == Rgb{1.0F, 2.0F, 3.0F}; }));
}

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
      const double position = -2.5 + 5.0 * u;
      integral += value(GetParam(), position) * std::pow(position, power);
      whole += value(GetParam(), position);
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
