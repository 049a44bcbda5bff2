#include "engine/binning/chunk_binning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "engine/settings/test_frames.h"
#include "scene/load_scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;
using test::Options;

RenderSettings settings_with(const Options& options) {
  return test::settings_with(test::joined({{"primary", "raster"}}, options));
}

/// What some ranks drew of a frame, and what they counted.
struct Drawn {
  std::vector<Key> keys;
  std::vector<Rgb> pixels;
  std::vector<RasterStats> raster;  ///< by rank
  std::uint64_t mismatches = 0;
  double exchange_ms = 0.0;
};

/// Three screens, each with an eye of its own, the last one of a single tile; among what is to be seen, so that some of
/// it reaches behind the eyes.
std::vector<View> screens_of(const Scene& scene) {
  const Camera camera = choose_camera({}, scene);
  Camera left = camera;
  left.eye -= 0.1 * camera.axes[0];
  Camera close = camera;
  close.eye = 0.5 * (camera.eye + 0.5 * (scene.bounds.low + scene.bounds.high));
  return {make_view(left, {170, 140}, scene.bounds), make_view(close, {130, 70}, scene.bounds),
          make_view(camera, {64, 64}, scene.bounds)};
}

Drawn draw(const std::string& scene, int ranks, const Options& options) {
  Drawn drawn;
  run_local_ranks({.size = ranks, .hang_timeout = 60s, .disorder = 3}, [&](Communicator& comm) {
    const RenderSettings settings = settings_with(options);
    Session session(comm, {.threads = 1}, [&] { return load_scene(scene); });
    const std::vector<View> screens = screens_of(session.scene());
    FrameMaker maker(session, settings.frame, settings.sampling, screens, std::nullopt, std::nullopt, true);
    Progress progress("none", "sample", 0);
    Frame* const frame = maker.make(screens, 0, progress);
    ASSERT_NE(frame, nullptr);
    test::add_pixels(session, maker, *frame, frame->radiance, drawn.pixels);
    test::add_pixels(session, maker, *frame, *frame->keys, drawn.keys);
    const auto raster = all_gather_value(comm, maker.times().raster);
    if (comm.rank() != 0) return;
    drawn.raster = raster;
    drawn.mismatches = maker.verified().mismatches;
    drawn.exchange_ms = maker.times().chunk_exchange_ms;
  });
  return drawn;
}

Options with(Options options, const std::string& distribution) {
  options.emplace_back("distribute", distribution);
  return options;
}

Options with_data(Options options) {
  options.emplace_back("data", "partitioned");
  return options;
}

std::uint64_t looked_at(const Drawn& drawn) {
  std::uint64_t chunks = 0;
  for (const RasterStats& raster : drawn.raster) chunks += raster.chunks_drawn + raster.chunks_culled;
  return chunks;
}

// Chunks by the hundred; six large instances, which reach behind the eyes; fewer chunks than ranks.
const std::vector<std::string> kScenes{"gen:gallery?s=1", "gen:asteroids?count=300", "gen:tetra"};

TEST(SortMiddle, GivesTheKeysAndLightOfOneRank) {
  const Options few{{"passes", "shadow"}};
  for (const std::string& scene : kScenes) {
    const Drawn expected = draw(scene, 1, few);
    ASSERT_GT(std::ranges::count_if(expected.keys, [](Key key) { return key != kNoKey; }), 1000) << scene;
    for (const int ranks : {1, 2, 3, 4, 7, 8}) {
      const Drawn drawn = draw(scene, ranks, with(few, "sort-middle"));
      EXPECT_TRUE(drawn.keys == expected.keys) << scene << ' ' << ranks;
      EXPECT_TRUE(drawn.pixels == expected.pixels) << scene << ' ' << ranks;
    }
  }
}

TEST(SortMiddle, DrawsEverySampleAndSettingAsOneRankDoes) {
  const std::vector<Options> choices{{{"spp", "4"}, {"filter", "gaussian"}},
                                     {{"spp", "8"}, {"adaptive", "true"}, {"passes", "shadow"}},
                                     {{"spp", "2"}, {"verify", "100"}, {"passes", "none"}},
                                     {{"depth-format", "16"}, {"passes", "none"}},
                                     {{"background", "transparent"}},
                                     {{"primary", "rays"}, {"spp", "2"}},
                                     {{"shading", "local"}, {"passes", "none"}},
                                     {{"balance", "static"}, {"passes", "none"}}};
  for (const Options& choice : choices) {
    const Drawn expected = draw("gen:gallery?s=1", 1, choice);
    const Drawn drawn = draw("gen:gallery?s=1", 3, with(choice, "sort-middle"));
    EXPECT_TRUE(drawn.pixels == expected.pixels) << choice.front().first;
    EXPECT_EQ(drawn.mismatches, 0U);
  }
}

TEST(SortMiddle, TrianglesOfAPartitionedSceneGiveTheKeysAndLightOfOneRank) {
  const std::vector<Options> choices{{{"passes", "shadow"}}, {{"spp", "3"}, {"passes", "none"}}, {{"photons", "300"}}};
  for (std::size_t i = 0; i < choices.size(); ++i) {
    const std::string& scene = kScenes[i];
    const Drawn expected = draw(scene, 1, choices[i]);
    for (const int ranks : {2, 3, 8}) {
      const Drawn drawn = draw(scene, ranks, with(with_data(choices[i]), "sort-middle"));
      EXPECT_TRUE(drawn.keys == expected.keys) << scene << ' ' << ranks;
      EXPECT_TRUE(drawn.pixels == expected.pixels) << scene << ' ' << ranks;
    }
  }
}

TEST(SortMiddle, ShowsRanksAsSortFirstDoes) {
  const Options shown{{"show", "rank"}, {"balance", "static"}};
  for (const int ranks : {3, 7}) {
    EXPECT_TRUE(draw("gen:gallery?s=1", ranks, with(shown, "sort-middle")).pixels ==
                draw("gen:gallery?s=1", ranks, with(shown, "sort-first")).pixels)
        << ranks;
  }
}

TEST(SortMiddle, NoRankCullsTheWholeScene) {
  const Options unlit{{"passes", "none"}, {"balance", "static"}};
  const std::string scene = "gen:asteroids?count=1000";
  const std::uint64_t chunks = looked_at(draw(scene, 1, {{"passes", "none"}}));  // once for each screen
  for (const int ranks : {2, 7}) {
    const Drawn first = draw(scene, ranks, with(unlit, "sort-first"));
    const Drawn binned = draw(scene, ranks, with(unlit, "sort-middle"));
    std::uint64_t drawn_first = 0;
    std::uint64_t drawn_binned = 0;
    for (const RasterStats& raster : first.raster) drawn_first += raster.chunks_drawn;
    for (const RasterStats& raster : binned.raster) drawn_binned += raster.chunks_drawn;
    EXPECT_GT(drawn_binned, 0U);
    EXPECT_LE(drawn_binned, drawn_first) << ranks;  // a chunk behind the eye may be left out earlier
    // Beyond its part of the chunks a rank looks at little but what it draws.
    EXPECT_LE(looked_at(binned), chunks + 2 * drawn_binned) << ranks;
    EXPECT_LT(looked_at(binned), looked_at(first)) << ranks;
    for (const RasterStats& raster : binned.raster) {
      EXPECT_LE(raster.chunks_drawn + raster.chunks_culled,
                chunks / static_cast<std::uint64_t>(ranks) + 2 * raster.chunks_drawn + 10);
    }
    EXPECT_EQ(first.exchange_ms, 0.0);
    EXPECT_GT(binned.exchange_ms, 0.0);
  }
}

}  // namespace
}  // namespace hpr
