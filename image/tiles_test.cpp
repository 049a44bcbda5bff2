#include "image/tiles.h"

#include <gtest/gtest.h>

#include <vector>

namespace hpr {
namespace {

const std::vector<std::vector<Size>> kLayouts{{{1, 1}},     {{64, 64}}, {{65, 1}},
                                              {{333, 217}}, {{1, 700}}, {{100, 50}, {64, 128}, {1, 1}, {129, 65}}};

TEST(FrameLayout, TilesCoverEveryPixelOfEveryScreenOnce) {
  for (const auto& screens : kLayouts) {
    const FrameLayout layout(screens);
    std::vector<Image<int>> covered;
    for (const Size& size : screens) covered.emplace_back(size, 0);
    for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
      const TilePlace position = layout.place(tile);
      EXPECT_FALSE(position.pixels.empty());
      EXPECT_LE(position.pixels.width(), kTileSide);
      EXPECT_LE(position.pixels.height(), kTileSide);
      EXPECT_TRUE(layout.tiles_of(position.screen).contains(tile));
      for (int y = position.pixels.y0; y < position.pixels.y1; ++y) {
        for (int x = position.pixels.x0; x < position.pixels.x1; ++x) {
          ++covered[position.screen].at(x, y);
          ASSERT_EQ(layout.tile_at(position.screen, x, y), tile);
        }
      }
    }
    for (const auto& image : covered) {
      EXPECT_EQ(std::ranges::count(image.pixels(), 1), static_cast<std::ptrdiff_t>(image.pixels().size()));
    }
  }
}

TEST(FrameLayout, NumbersTilesScreenAfterScreenRowAfterRow) {
  const FrameLayout layout({{130, 70}, {64, 64}});
  EXPECT_EQ(layout.tiles(), 7U);
  EXPECT_EQ(layout.tile_grid(0), (Size{3, 2}));
  EXPECT_EQ(layout.tiles_of(0), (TileRun{0, 6}));
  EXPECT_EQ(layout.tiles_of(1), (TileRun{6, 1}));
  EXPECT_EQ(layout.place(2).pixels, (Rect{128, 0, 130, 64}));
  EXPECT_EQ(layout.place(3).pixels, (Rect{0, 64, 64, 70}));
  EXPECT_EQ(layout.place(5).pixels, (Rect{128, 64, 130, 70}));
  EXPECT_EQ(layout.place(6).screen, 1U);
}

TEST(FrameLayout, AFrameWithoutScreensHasNoTiles) {
  EXPECT_EQ(FrameLayout().tiles(), 0U);
  EXPECT_EQ(FrameLayout(std::vector<Size>{}), FrameLayout());
}

TEST(TileRun, ContainsItsFirstTileAndNotItsEnd) {
  const TileRun run{3, 2};
  EXPECT_FALSE(run.contains(2));
  EXPECT_TRUE(run.contains(3));
  EXPECT_TRUE(run.contains(4));
  EXPECT_FALSE(run.contains(5));
  EXPECT_FALSE((TileRun{3, 0}).contains(3));
}

TEST(TileLayer, StartsEmptyAndZero) {
  const TileLayer<std::uint64_t> layer(FrameLayout({{100, 100}}));
  EXPECT_EQ(layer.tiles(), 4U);
  EXPECT_EQ(layer.active_tiles(), 0U);
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    EXPECT_FALSE(layer.active(tile));
    for (const std::uint64_t pixel : layer.tile(tile)) ASSERT_EQ(pixel, 0U);
  }
}

TEST(TileLayer, ClearZeroesWhatWasWrittenAndNothingElse) {
  TileLayer<int> layer(FrameLayout({{200, 64}}));
  for (const std::size_t tile : {0U, 2U}) {
    std::ranges::fill(layer.tile(tile), 7);
    layer.set_active(tile);
  }
  EXPECT_EQ(layer.active_tiles(), 2U);
  layer.clear(0);
  EXPECT_FALSE(layer.active(0));
  EXPECT_EQ(std::ranges::count(layer.tile(0), 0), static_cast<std::ptrdiff_t>(kTilePixels));
  EXPECT_EQ(std::ranges::count(layer.tile(2), 7), static_cast<std::ptrdiff_t>(kTilePixels));
  layer.clear();
  EXPECT_EQ(layer.active_tiles(), 0U);
  EXPECT_EQ(std::ranges::count(layer.tile(2), 0), static_cast<std::ptrdiff_t>(kTilePixels));
}

TEST(TileLayer, AnEmptyLayerOfManyTilesTouchesNoMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers keep account of every byte, touched or not";
#endif
  // 16 GiB of pixels: would not fit if they were touched.
  const TileLayer<std::uint64_t> layer(FrameLayout(std::vector<Size>(8, {16384, 16384})));
  EXPECT_EQ(layer.tiles(), 8U * 256U * 256U);
  EXPECT_EQ(layer.at(7, 16383, 16383), 0U);
}

TEST(TileLayer, ARunIsItsTilesOneAfterTheOther) {
  TileLayer<int> layer(FrameLayout({{64, 256}}));
  layer.tile(1)[0] = 1;
  layer.tile(2)[5] = 2;
  const auto run = layer.run({1, 2});
  EXPECT_EQ(run.size(), 2 * kTilePixels);
  EXPECT_EQ(run[0], 1);
  EXPECT_EQ(run[kTilePixels + 5], 2);
  EXPECT_TRUE(layer.run({4, 0}).empty());
}

TEST(TileLayer, ToImageShowsEachPixelWhereItWasPut) {
  for (const auto& screens : kLayouts) {
    TileLayer<int> layer{FrameLayout(screens)};
    const auto code = [](std::size_t screen, int x, int y) {
      return static_cast<int>(screen) * 10'000'000 + y * 1000 + x + 1;
    };
    for (std::size_t screen = 0; screen < screens.size(); ++screen) {
      for (int y = 0; y < screens[screen].height; ++y) {
        for (int x = 0; x < screens[screen].width; ++x) {
          layer.at(screen, x, y) = code(screen, x, y);
          layer.set_active(layer.layout().tile_at(screen, x, y));
        }
      }
    }
    for (std::size_t screen = 0; screen < screens.size(); ++screen) {
      const Image<int> image = to_image(layer, screen);
      ASSERT_EQ(image.size(), screens[screen]);
      for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) ASSERT_EQ(image.at(x, y), code(screen, x, y));
      }
    }
  }
}

TEST(TileLayer, ToImageShowsInactiveTilesAsZeros) {
  TileLayer<int> layer(FrameLayout({{128, 64}}));
  layer.at(0, 70, 3) = 5;
  layer.set_active(1);
  const Image<int> image = to_image(layer, 0);
  EXPECT_EQ(image.at(70, 3), 5);
  EXPECT_EQ(std::ranges::count(image.pixels(), 0), 128 * 64 - 1);
}

TEST(Rect, IntersectionsAreEmptyWhenNothingIsShared) {
  EXPECT_EQ(intersection({0, 0, 10, 10}, {5, 3, 20, 7}), (Rect{5, 3, 10, 7}));
  EXPECT_TRUE(intersection({0, 0, 10, 10}, {10, 0, 20, 10}).empty());
  EXPECT_EQ(intersection({0, 0, 10, 10}, {20, 20, 30, 30}).area(), 0U);
}

}  // namespace
}  // namespace hpr
