#include "engine/display/exposure.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "engine/frame.h"
#include "engine/output.h"
#include "engine/session.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

Rgb grey(double value) {
  const auto light = static_cast<float>(value);
  return {light, light, light};
}

LuminanceHistogram of(std::initializer_list<std::pair<double, int>> counts) {
  LuminanceHistogram histogram;
  for (const auto& [light, count] : counts) {
    for (int i = 0; i < count; ++i) histogram.add(grey(light));
  }
  return histogram;
}

TEST(Exposure, MeanOfLogarithmsIsRightToHalfABin) {
  for (const double light : {1e-5, 0.01, 0.18, 1.0, 3.0, 1e5}) {
    const auto mean = of({{light, 100}}).mean_stops();
    ASSERT_TRUE(mean);
    EXPECT_NEAR(*mean, std::log2(light), 0.09) << light;
  }
  EXPECT_NEAR(of({{0.25, 50}, {4.0, 50}}).mean_stops().value(), 0.0, 0.09);
}

TEST(Exposure, TheDarkestAndTheBrightestTwentiethDoNotCount) {
  EXPECT_EQ(of({{0.18, 90}, {1e-5, 5}, {1e5, 5}}).mean_stops(), of({{0.18, 1}}).mean_stops());
  EXPECT_GT(of({{0.18, 90}, {1e5, 10}}).mean_stops().value(), of({{0.18, 1}}).mean_stops().value() + 0.5);
}

TEST(Exposure, WhatIsBlackOrNoNumberCountsNowhere) {
  LuminanceHistogram histogram;
  for (const double light : {0.0, 1e-7, -1.0, std::numeric_limits<double>::quiet_NaN()}) histogram.add(grey(light));
  EXPECT_EQ(histogram.pixels(), 0U);
  EXPECT_FALSE(histogram.mean_stops().has_value());
  EXPECT_EQ(automatic_exposure(histogram), 0.0);
  histogram.add(grey(std::numeric_limits<double>::infinity()));
  EXPECT_EQ(histogram.pixels(), 1U);
}

TEST(Exposure, PicturesLitAsMeantStayAndOthersComeToTheBorder) {
  for (const double light : {0.08, 0.18, 0.33}) EXPECT_EQ(automatic_exposure(of({{light, 10}})), 0.0) << light;
  for (const double stops : {3.0, 10.0}) {
    EXPECT_NEAR(automatic_exposure(of({{0.18 * std::exp2(stops), 10}})), kBrightStops - stops, 0.09);
    EXPECT_NEAR(automatic_exposure(of({{0.18 * std::exp2(-stops), 10}})), stops - kDarkStops, 0.09);
  }
}

TEST(Exposure, FollowsTheLightSlowlyAndArrives) {
  SmoothExposure exposure;
  EXPECT_EQ(exposure.next(2.0), 2.0);
  EXPECT_NEAR(exposure.next(-3.0), 1.5, 1e-12);
  EXPECT_NEAR(exposure.next(-3.0), 1.05, 1e-12);
  for (int i = 0; i < 100; ++i) (void)exposure.next(-3.0);
  EXPECT_EQ(exposure.next(-3.0), -3.0);
}

/// Pixels of two screens that are their own light, and garbage past the screens' edges.
double exposure_of_screens(int ranks) {
  const FrameLayout layout({{130, 70}, {64, 100}});
  std::vector<View> views(2);
  for (std::size_t i = 0; i < 2; ++i) views[i].block = {0, 0, layout.size(i).width, layout.size(i).height};
  std::mutex mutex;
  std::vector<double> all_stops;
  run_local_ranks(
      ranks,
      [&](Communicator& comm) {
        Session session(comm, {.threads = 2}, [] { return load_scene("gen:cornell"); });
        Frame frame;
        frame.radiance = TileLayer<Rgb>(layout);
        for (const std::size_t tile : all_tiles(layout)) {
          if (static_cast<int>(tile) % ranks != comm.rank()) continue;
          frame.owned.push_back(tile);
          const Rect pixels = layout.place(tile).pixels;
          for (int y = 0; y < kTileSide; ++y) {
            for (int x = 0; x < kTileSide; ++x) {
              const bool on_screen = x < pixels.width() && y < pixels.height();
              frame.radiance.tile(tile)[static_cast<std::size_t>(y * kTileSide + x)] =
                  grey(on_screen ? 8.0 + static_cast<double>(tile) : 1e-4);
            }
          }
          frame.radiance.set_active(tile);
        }
        const DisplayTransform transform =
            transform_for(session, frame, views, {.exposure_stops = {}, .tone = Tone::Agx});
        EXPECT_EQ(transform.tone, Tone::Agx);
        const std::lock_guard lock(mutex);
        all_stops.push_back(transform.exposure_stops);
      },
      std::chrono::seconds(20));
  for (const double stops : all_stops) EXPECT_EQ(stops, all_stops.front());
  return all_stops.front();
}

TEST(Exposure, IsOneForAllScreensAndTheSameForAnyNumberOfRanks) {
  const double alone = exposure_of_screens(1);
  // Lights from 8 to 16: about 6 stops over grey.
  EXPECT_NEAR(alone, kBrightStops - 6.0, 0.3);
  EXPECT_EQ(exposure_of_screens(3), alone);
}

/// Four screens that touch, made with fewer pixels: each also has what enlarging takes of its neighbors.
TEST(Exposure, CountsEveryPixelOfJoinedScreensOnce) {
  std::vector<View> screens(4);
  for (std::size_t i = 0; i < screens.size(); ++i) {
    View& view = screens[i];
    view.screen_number = static_cast<std::uint32_t>(i);
    view.screen = {171, 105};
    view.block = {0, 0, 171, 105};
    view.left = i % 2 == 0 ? -1.71 : 0.0;
    view.right = view.left + 1.71;
    view.bottom = i < 2 ? 0.0 : -1.05;
    view.top = view.bottom + 1.05;
  }
  for (const double scale : {0.37, 0.5, 1.0}) {
    const Blocks blocks = cut_blocks(join_screens(screens), scale);
    const Size whole = blocks.made[0].whole;
    // Light by the place in the picture, so that whichever screen has a pixel has the same.
    const auto light_at = [&](int x, int y) { return grey(std::exp2((x + 7 * y) % 13)); };
    LuminanceHistogram expected;
    for (int y = 0; y < whole.height; ++y) {
      for (int x = 0; x < whole.width; ++x) expected.add(light_at(x, y));
    }
    run_local_ranks(
        2,
        [&](Communicator& comm) {
          Session session(comm, {.threads = 2}, [] { return load_scene("gen:cornell"); });
          Frame frame;
          frame.radiance = TileLayer<Rgb>(layout_of(blocks.views));
          const FrameLayout& layout = frame.radiance.layout();
          for (const std::size_t tile : all_tiles(layout)) {
            if (static_cast<int>(tile) % 2 != comm.rank()) continue;
            frame.owned.push_back(tile);
            const TilePlace location = layout.place(tile);
            const Rect& block = blocks.views[location.screen].block;
            for (int y = 0; y < location.pixels.height(); ++y) {
              for (int x = 0; x < location.pixels.width(); ++x) {
                frame.radiance.tile(tile)[static_cast<std::size_t>(y * kTileSide + x)] =
                    light_at(block.x0 + location.pixels.x0 + x, block.y0 + location.pixels.y0 + y);
              }
            }
          }
          const LuminanceHistogram measured = measure_luminance(session, frame, blocks.views);
          EXPECT_EQ(measured.pixels(), expected.pixels()) << scale;
          EXPECT_EQ(measured.mean_stops(), expected.mean_stops()) << scale;
        },
        std::chrono::seconds(20));
  }
}

}  // namespace
}  // namespace hpr
