#include "image/convolve.h"

#include <gtest/gtest.h>

#include <vector>

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

TEST(Convolve, EveryPlaceIsFilteredAlikeWhateverTheWidth) {
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

}  // namespace
}  // namespace hpr
