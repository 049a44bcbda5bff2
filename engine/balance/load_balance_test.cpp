#include "engine/balance/load_balance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
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
  return test::settings_with(test::joined({{"primary", "rays"}}, options));
}

/// Two screens beside each other; what is to be seen stands in a corner of the first.
std::vector<View> screens_of(const Scene& scene, int frame) {
  Camera camera = choose_camera({}, scene);
  camera.eye += 0.02 * frame * camera.axes[0];
  const View view = make_view(camera, {170, 140}, scene.bounds);
  const View other = make_view(camera, {90, 70}, scene.bounds);
  return {view, other};
}

/// The bits of three frames by some ranks; what was lent in them is added to `lent`.
std::vector<Rgb> draw(const LocalRanks& ranks, const Options& options, std::uint64_t* lent = nullptr) {
  std::vector<Rgb> pixels;
  run_local_ranks(ranks, [&](Communicator& comm) {
    const RenderSettings settings = settings_with(options);
    Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
    FrameMaker maker(session, settings.frame, settings.sampling, screens_of(session.scene(), 0), std::nullopt);
    for (int number = 0; number < 3; ++number) {
      Progress progress("none", "sample", 0);
      Frame* const frame =
          maker.make(screens_of(session.scene(), number), static_cast<std::uint64_t>(number), progress);
      ASSERT_NE(frame, nullptr);
      test::add_pixels(session, maker, *frame, frame->radiance, pixels);
      const auto works = all_gather_value(comm, maker.times().work);
      if (comm.rank() != 0) continue;
      for (const FrameWork& work : works) {
        if (lent != nullptr) *lent += work.lent;
      }
    }
  });
  return pixels;
}

/// Every distribution, and rays that travel.
std::vector<Options> all_distributions() {
  std::vector<Options> all;
  for (const Distribution distribution : kDistributions) {
    all.push_back({{"distribute", std::string(name_of(distribution))}});
    if (distribution == Distribution::Hybrid) all.back().emplace_back("groups", "2");
  }
  all.push_back({{"distribute", "sort-last"}, {"data", "partitioned"}});
  return all;
}

TEST(LoadBalance, FramesHaveTheSameBitsHoweverTheyAreBalanced) {
  const Options few{{"photons", "500"}};
  const std::vector<Rgb> expected = draw({.size = 1, .hang_timeout = 60s}, few);
  ASSERT_FALSE(expected.empty());
  std::uint64_t lent = 0;
  for (const int ranks : {2, 3, 5, 8}) {
    for (const Options& distribution : all_distributions()) {
      for (const std::string_view balance : kBalanceNames) {
        Options options = few;
        options.insert(options.end(), distribution.begin(), distribution.end());
        options.emplace_back("balance", balance);
        std::uint64_t here = 0;
        const LocalRanks local{.size = ranks, .hang_timeout = 60s, .disorder = 3};
        EXPECT_TRUE(draw(local, options, &here) == expected)
            << ranks << ' ' << distribution.front().second << ' ' << balance;
        const bool may_lend = balance == "demand" && distribution.back().first != "data";
        EXPECT_TRUE(here == 0 || may_lend) << distribution.back().second << ' ' << balance;
        lent += here;
      }
    }
  }
  EXPECT_GT(lent, 0U);
}

TEST(LoadBalance, PicturesOfSeveralSamplesHaveThemToo) {
  const Options few{{"photons", "500"}};
  const std::vector<Options> choices{{{"spp", "4"}},
                                     {{"spp", "4"}, {"denoise", "true"}},
                                     {{"spp", "16"}, {"adaptive", "true"}, {"passes", "shadow"}},
                                     {{"half-resolution", "shadow"}},
                                     {{"show", "normal"}},
                                     {{"reference", "true"}}};
  for (const Options& choice : choices) {
    const std::vector<Rgb> expected = draw({.size = 1, .hang_timeout = 60s}, test::joined(few, choice));
    for (const std::string_view distribution : {"sort-first", "sort-last"}) {
      Options options = test::joined(few, choice);
      options.emplace_back("distribute", distribution);
      const LocalRanks hosts{.size = 4, .hang_timeout = 60s, .ranks_per_host = 2};
      EXPECT_TRUE(draw({.size = 3, .hang_timeout = 60s}, options) == expected) << choice.back().first << distribution;
      EXPECT_TRUE(draw(hosts, options) == expected) << choice.back().first << distribution << ", two hosts";
    }
  }
}

/// Costs of a frame whose upper left corner is dear, with so much noise.
std::vector<TileCost> costs_with(const FrameLayout& layout, double noise, int frame) {
  std::vector<TileCost> costs;
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
    const Rect pixels = layout.place(tile).pixels;
    const double cost = pixels.x0 < 200 && pixels.y0 < 200 ? 20.0 : 1.0;
    costs.push_back({tile, cost * (1.0 + noise * std::sin(static_cast<double>(tile) + frame))});
  }
  return costs;
}

TEST(LoadBalance, AreasFollowWhatTilesTookAndStayWhereItChangesLittle) {
  run_local_ranks({.size = 4, .hang_timeout = 60s}, [](Communicator& comm) {
    const RenderSettings settings = settings_with({{"distribute", "sort-first"}});
    Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
    const View view = make_view(choose_camera({}, session.scene()), {960, 640}, session.scene().bounds);
    FramePlan plan = plan_frame(session, settings.frame, std::span(&view, 1));
    const auto load = [&] {
      double mine = 0.0;
      for (const std::size_t tile : plan.tiles) mine += costs_with(plan.layout, 0.0, 0)[tile].ms;
      return slowest_over_mean(all_gather_value(comm, mine));
    };
    const auto frame_of = [&](double noise, int number) {
      // Whoever lit it: here the ranks in turns.
      std::vector<TileCost> mine;
      for (const TileCost& cost : costs_with(plan.layout, noise, number)) {
        if (static_cast<int>(cost.tile + static_cast<std::size_t>(number)) % comm.size() == comm.rank())
          mine.push_back(cost);
      }
      session.balance().start_frame(plan.layout);
      session.balance().add_light(plan.layout, mine);
      session.balance().finish_frame(comm, plan.layout, 1);
      update_areas(session, plan, std::span(&view, 1));
    };
    for (int number = 0; number < 2; ++number) frame_of(0.0, number);
    EXPECT_LE(load(), 1.1);
    const std::vector<std::size_t> tiles = plan.tiles;
    for (int number = 2; number < 12; ++number) {
      frame_of(0.03, number);
      EXPECT_EQ(plan.tiles, tiles) << number;
    }
    session.balance().forget();
    EXPECT_TRUE(session.balance().costs(plan.layout).empty());
  });
}

/// A rank that has none of a frame's tiles adds nothing to it, and knows what all know.
TEST(LoadBalance, RanksWithoutTilesKnowWhatAllKnow) {
  run_local_ranks({.size = 3, .hang_timeout = 60s}, [](Communicator& comm) {
    const FrameLayout small({{64, 64}});
    const FrameLayout large({{128, 64}});
    const std::vector<TileCost> tile{{0, 4.0}};
    LoadBalance balance;
    const auto frame_of = [&](const FrameLayout& layout) {
      balance.start_frame(layout);
      if (comm.rank() == 0) balance.add_keys(layout, tile);
      if (comm.rank() == 0) balance.add_light(layout, tile);
      balance.finish_frame(comm, layout, 2);
    };
    frame_of(large);
    frame_of(small);
    EXPECT_TRUE(balance.costs(large).empty());
    ASSERT_EQ(balance.costs(small).size(), 1U);
    EXPECT_EQ(balance.costs(small)[0], 4.0);
    EXPECT_EQ(balance.light_costs(small)[0], 2.0);
    // What a frame took that was never finished, as a resting picture's samples, does not count for the next one.
    balance.start_frame(small);
    if (comm.rank() == 0) balance.add_light(small, std::vector<TileCost>{{0, 1000.0}});
    if (comm.rank() == 0) balance.add_light(large, std::vector<TileCost>{{1, 1000.0}});
    frame_of(small);
    EXPECT_EQ(balance.costs(small)[0], 4.0);
    EXPECT_TRUE(balance.costs(large).empty());
  });
}

TEST(LoadBalance, TheFirstFrameIsSharedOutByWhatRaysSee) {
  const auto most_pixels = [](const std::string& balance) {
    double ratio = 0.0;
    run_local_ranks({.size = 2, .hang_timeout = 60s}, [&](Communicator& comm) {
      const RenderSettings settings = settings_with({{"distribute", "sort-first"}, {"balance", balance}});
      Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
      Camera camera = choose_camera({}, session.scene());
      const Bounds& bounds = session.scene().bounds;
      const double distance = glm::length(0.5 * (bounds.low + bounds.high) - camera.eye);
      camera.eye += 0.35 * distance * camera.axes[0];  // all stands on the left
      const View view = make_view(camera, {640, 384}, session.scene().bounds);
      const FramePlan plan = plan_frame(session, settings.frame, std::span(&view, 1));
      const Frame frame = make_frame(session, plan, std::span(&view, 1));
      double seen = 0.0;
      for (const std::size_t tile : frame.owned) seen += cost_of_keys(*frame.keys, tile);
      const double found = slowest_over_mean(all_gather_value(comm, seen));
      if (comm.rank() == 0) ratio = found;
    });
    return ratio;
  };
  EXPECT_GT(most_pixels("static"), 1.25);
  EXPECT_LE(most_pixels("measured"), 1.1);
}

/// From frame to frame some ranks may have a new group while others keep theirs.
TEST(LoadBalance, FramesOfOtherGroupsFollowEachOther) {
  run_local_ranks({.size = 3, .hang_timeout = 60s}, [](Communicator& comm) {
    Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
    const View view = make_view(choose_camera({}, session.scene()), {130, 100}, session.scene().bounds);
    for (const char* distribution : {"sort-first", "hybrid", "sort-middle", "hybrid", "sort-last", "sort-middle"}) {
      const RenderSettings settings = settings_with({{"distribute", distribution}});
      const FramePlan plan = plan_frame(session, settings.frame, std::span(&view, 1));
      const Frame frame = make_frame(session, plan, std::span(&view, 1));
      std::size_t owned = 0;
      for (const std::size_t tiles : all_gather_value(comm, frame.owned.size())) owned += tiles;
      EXPECT_EQ(owned, plan.layout.tiles()) << distribution;
    }
  });
}

TEST(LoadBalance, WhatIsCompositedGoesOnToWhoHasTime) {
  run_local_ranks({.size = 3, .hang_timeout = 60s}, [](Communicator& comm) {
    TileLayer<Key> keys(FrameLayout({{640, 640}}));
    std::vector<std::size_t> present;  // rank 0 has two thirds of the surfaces
    for (std::size_t tile = 0; tile < keys.tiles(); ++tile) {
      const int owner = tile < 60 ? 0 : tile < 80 ? 1 : 2;
      if (owner != comm.rank()) continue;
      present.push_back(tile);
      if (tile >= 90) continue;
      std::ranges::fill(keys.tile(tile), Key{1});
      keys.set_active(tile);
    }
    const LoadBalance balance;
    const std::vector<int> owners = balance.owners_of_light(comm, keys, present);
    std::vector<double> loads(3, 0.0);
    for (std::size_t tile = 0; tile < keys.tiles(); ++tile) {
      loads.at(static_cast<std::size_t>(owners[tile])) += tile < 90 ? 1.0 : 0.05;
    }
    EXPECT_LE(slowest_over_mean(loads), 1.06);
    EXPECT_EQ(std::ranges::count(owners, 1) >= 20, true);
    for (std::size_t tile = 60; tile < 100; ++tile) EXPECT_EQ(owners[tile], tile < 80 ? 1 : 2);
  });
}

}  // namespace
}  // namespace hpr
