#include "engine/balance/view_grouping.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <glm/geometric.hpp>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "engine/settings/test_frames.h"
#include "raster/chunk_bounds.h"
#include "rt/show/show.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;
using test::Options;

/// Three screens, each with an eye of its own: one from the scene's camera, one from the midst of what is to be seen,
/// and one from far. All walk from frame to frame.
std::vector<View> screens_of(const Scene& scene, int frame) {
  Camera camera = choose_camera({}, scene);
  const glm::dvec3 center = 0.5 * (scene.bounds.low + scene.bounds.high);
  const double extent = glm::length(scene.bounds.high - scene.bounds.low);
  camera.eye += 0.03 * frame * extent * camera.axes[0];
  std::vector<View> views{make_view(camera, {200, 140}, scene.bounds)};
  camera.eye = center + 0.05 * (frame + 1) * extent * camera.axes[2];
  views.push_back(make_view(camera, {150, 130}, scene.bounds));
  camera.eye = center + (6.0 - 2.0 * frame) * extent * camera.axes[2];
  views.push_back(make_view(camera, {90, 70}, scene.bounds));
  return views;
}

/// The bits of three frames by some ranks, by OpenGL unless the options say otherwise.
std::vector<Rgb> draw(int ranks, const std::string& scene, const Options& options, bool expect_groups = true) {
  std::vector<Rgb> pixels;
  run_local_ranks({.size = ranks, .hang_timeout = 60s, .disorder = 3}, [&](Communicator& comm) {
    const RenderSettings settings =
        test::settings_with(test::joined({{"primary", "raster"}, {"passes", "none"}}, options));
    Session session(comm, {.threads = 1}, [&] { return load_scene(scene); });
    FrameMaker maker(session, settings.frame, settings.sampling, screens_of(session.scene(), 0), std::nullopt);
    EXPECT_EQ(maker.plan().by_view.has_value(), ranks > 1 && expect_groups);
    for (int number = 0; number < 3; ++number) {
      Progress progress("none", "sample", 0);
      Frame* const frame =
          maker.make(screens_of(session.scene(), number), static_cast<std::uint64_t>(number), progress);
      ASSERT_NE(frame, nullptr);
      test::add_pixels(session, maker, *frame, frame->radiance, pixels);
    }
  });
  return pixels;
}

const Options kByView{{"distribute", "hybrid"}};

/// The letters and digits of a text, to name a test by.
std::string letters_of(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isalnum(c) == 0; });
  return text;
}

class ViewGroupingOfScene : public testing::TestWithParam<const char*> {};

TEST_P(ViewGroupingOfScene, FramesHaveTheBitsOfOneRank) {
  const std::string scene = GetParam();
  const std::vector<Rgb> expected = draw(1, scene, {});
  ASSERT_FALSE(expected.empty());
  for (const int ranks : {2, 3, 8}) {
    EXPECT_TRUE(draw(ranks, scene, kByView) == expected) << ranks;
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, ViewGroupingOfScene,
                         testing::Values("gen:gallery?s=1&n=1&k=1", "gen:sphereflake?s=2&n=2", "gen:tetra?s=10",
                                         "gen:asteroids?count=30&k=2", "gen:cloud?count=500", "gen:cornell"),
                         [](const auto& named) { return letters_of(named.param); });

class ViewGroupingWith : public testing::TestWithParam<Options> {};

TEST_P(ViewGroupingWith, FramesHaveTheBitsOfOneRank) {
  const std::string scene = "gen:sphereflake?s=2&n=2";
  const std::vector<Rgb> expected = draw(1, scene, GetParam());
  for (const int ranks : {2, 7}) {
    EXPECT_TRUE(draw(ranks, scene, test::joined(kByView, GetParam())) == expected) << ranks;
  }
}

INSTANTIATE_TEST_SUITE_P(Options, ViewGroupingWith,
                         testing::Values(Options{{"spp", "16"}, {"filter", "mitchell"}},
                                         Options{{"spp", "8"}, {"adaptive", "true"}}, Options{{"depth-format", "16"}},
                                         Options{{"shading", "local"}}, Options{{"passes", "shadow"}, {"spp", "2"}},
                                         Options{{"balance", "static"}}, Options{{"balance", "measured"}},
                                         Options{{"verify", "100"}}),
                         [](const auto& named) {
                           return letters_of(named.param.front().first + named.param.front().second);
                         });

TEST(ViewGrouping, WhoNamesAStrategyOrGroupsGetsGroupsOfTilesCutBeforehand) {
  const std::string scene = "gen:cornell";
  const std::vector<Rgb> expected = draw(1, scene, {});
  for (const Options& options :
       {Options{{"groups", "2"}}, Options{{"strategy", "binary-swap"}}, Options{{"strategy", "direct-send"}}}) {
    EXPECT_TRUE(draw(4, scene, test::joined(kByView, options), false) == expected) << options.front().first;
  }
  EXPECT_TRUE(draw(4, scene, test::joined(kByView, {{"primary", "rays"}}), false) ==
              draw(1, scene, {{"primary", "rays"}}));
}

TEST(ViewGrouping, ShownRanksAreThoseWhoDrawASurface) {
  const std::vector<Rgb> shown = draw(3, "gen:sphereflake?s=2&n=2", test::joined(kByView, {{"show", "rank"}}));
  for (std::uint32_t rank = 0; rank < 3; ++rank) {
    EXPECT_GT(std::ranges::count(shown, distinct_color(rank)), 100) << rank;
  }
}

TEST(ViewGrouping, NothingIsDrawnOutsideTheTilesThatARankSaysItDrawsInto) {
  run_local_ranks(4, [](Communicator& comm) {
    RenderSettings settings;
    for (const auto& [name, value] : kByView) set_setting(settings, name, value);
    set_setting(settings, "primary", "raster");
    settings = resolve(settings, 1);
    Session session(comm, {.threads = 1}, [] { return load_scene("gen:asteroids?count=60&k=3"); });
    std::vector<View> views = screens_of(session.scene(), 0);
    const FramePlan plan = plan_frame(session, settings.frame, views);
    for (View& view : views) view.jitter = {-kMaxJitter, kMaxJitter};
    TileLayer<Key> keys(plan.layout);
    FrameTimes spent;
    rasterize(session, plan, views, keys, spent);
    std::vector<bool> expected(plan.layout.tiles(), false);
    for (const std::size_t tile : plan.by_view->groups().tiles[static_cast<std::size_t>(comm.rank())]) {
      expected[tile] = true;
    }
    for (std::size_t tile = 0; tile < plan.layout.tiles(); ++tile) EXPECT_LE(keys.active(tile), expected[tile]) << tile;
    EXPECT_GT(std::ranges::count(expected, true), 0);
  });
}

}  // namespace
}  // namespace hpr
