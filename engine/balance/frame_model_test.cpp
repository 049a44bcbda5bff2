#include "engine/balance/frame_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "engine/session.h"
#include "scene/load_scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

/// Six views from about a scene.
std::vector<FrameLoad> loads_of(const std::string& scene, Size size) {
  std::vector<FrameLoad> loads;
  run_local_ranks(1, [&](Communicator& comm) {
    Session session(comm, {.threads = 1}, [&] { return load_scene(scene); });
    const Bounds& bounds = session.scene().bounds;
    const glm::dvec3 center = 0.5 * (bounds.low + bounds.high);
    const double extent = glm::length(bounds.high - bounds.low);
    for (int side = 0; side < 6; ++side) {
      const glm::dvec3 direction(std::cos(1.05 * side), 0.25 + 0.1 * side, std::sin(1.05 * side));
      const View view = make_view(
          look_at(center + 0.75 * extent * glm::normalize(direction), center, {0.0, 1.0, 0.0}, 0.8), size, bounds);
      loads.push_back(load_of(session, std::span(&view, 1)));
    }
  });
  return loads;
}

/// Of ranks that each show their part of a wall.
double mean_efficiency(const std::vector<FrameLoad>& loads, Distribution distribution, int ranks) {
  double sum = 0.0;
  for (FrameLoad load : loads) {
    load.writers = ranks;
    const FramePrediction one = predict_frame(Distribution::SortFirst, load, {}, 1);
    sum += efficiency(one, predict_frame(distribution, load, {}, ranks), ranks);
  }
  return sum / static_cast<double>(loads.size());
}

TEST(FrameModel, OneRankTakesAsLongHoweverNothingIsSharedOut) {
  for (const FrameLoad& load : loads_of("gen:gallery?s=1", {320, 200})) {
    const FramePrediction first = predict_frame(Distribution::SortFirst, load, {}, 1);
    for (const Distribution distribution : kDistributions) {
      const FramePrediction made = predict_frame(distribution, load, {}, 1);
      EXPECT_NEAR(made.draw_ms, first.draw_ms, 0.1 * first.draw_ms) << name_of(distribution);
      EXPECT_DOUBLE_EQ(made.light_ms, first.light_ms);
      EXPECT_DOUBLE_EQ(made.imbalance, 1.0);
      EXPECT_EQ(made.composite_ms, 0.0);
    }
  }
}

TEST(FrameModel, OnManyRanksHybridIsMostEfficientAndNoSlowerOnMore) {
  const std::vector<FrameLoad> loads = loads_of("gen:sphereflake?s=4&n=4", {1920, 1080});
  const double hybrid = mean_efficiency(loads, Distribution::Hybrid, 64);
  EXPECT_GT(hybrid, 0.8);
  EXPECT_GT(hybrid, mean_efficiency(loads, Distribution::SortFirst, 64));
  EXPECT_GT(hybrid, mean_efficiency(loads, Distribution::SortLast, 64));
  FrameLoad load = loads.front();
  double before = predict_frame(Distribution::Hybrid, load, {}, 1).total_ms();
  for (int ranks = 2; ranks <= 1024; ranks *= 2) {
    load.writers = ranks;
    const double now = predict_frame(Distribution::Hybrid, load, {}, ranks).total_ms();
    EXPECT_LT(now, 1.02 * before) << ranks;
    before = now;
  }
}

TEST(FrameModel, WhereTrianglesAreDearWhoDrawsThemOnceWinsAndWhereMergingIsWhoMergesNothing) {
  const std::vector<FrameLoad> loads = loads_of("gen:sphereflake?s=3", {640, 480});
  MachineSpeeds dear_merging;
  dear_merging.merge = 1e5;
  MachineSpeeds dear_triangles;
  dear_triangles.raster.triangle = 1e4;
  for (const FrameLoad& load : loads) {
    const auto ms = [&](Distribution distribution, const MachineSpeeds& speeds) {
      return predict_frame(distribution, load, speeds, 8).total_ms();
    };
    EXPECT_LT(ms(Distribution::SortFirst, dear_merging), ms(Distribution::SortLast, dear_merging));
    EXPECT_GT(ms(Distribution::SortFirst, dear_triangles), ms(Distribution::SortLast, dear_triangles));
  }
}

TEST(FrameModel, NamesWhatLimits) {
  const FrameLoad load = loads_of("gen:sphereflake?s=3", {640, 480}).front();
  const auto limit = [&](Distribution distribution, const MachineSpeeds& speeds, int ranks) {
    const FramePrediction one = predict_frame(Distribution::SortFirst, load, speeds, 1);
    const FrameLimit found = limit_of(one, predict_frame(distribution, load, speeds, ranks), ranks);
    EXPECT_GT(found.part, 0.0);
    EXPECT_LT(found.part, 1.0);
    return std::string(found.phase->name);
  };
  MachineSpeeds dear_merging;
  dear_merging.merge = 1e4;
  EXPECT_EQ(limit(Distribution::SortLast, dear_merging, 16), "compositing");
  MachineSpeeds dear_triangles;
  dear_triangles.raster.triangle = 1e4;  // few tiles have them all
  EXPECT_EQ(limit(Distribution::SortFirst, dear_triangles, 16), "drawing");
  MachineSpeeds slow_link;
  slow_link.collect = 1e3;
  EXPECT_EQ(limit(Distribution::Hybrid, slow_link, 16), "tiles to screens");
}

TEST(FrameModel, ScreensOfSeveralRanksAreFilledTogether) {
  FrameLoad load = loads_of("gen:gallery?s=1", {320, 200}).front();
  const FramePrediction one_writer = predict_frame(Distribution::SortFirst, load, {}, 8);
  load.writers = 2;
  const FramePrediction two = predict_frame(Distribution::SortFirst, load, {}, 8);
  const double pixels = 320.0 * 200.0;
  EXPECT_NEAR(one_writer.show_ms - two.show_ms, 1e-6 * pixels / 2.0 * 7.0 / 8.0 * MachineSpeeds().collect, 1e-9);
}

TEST(FrameModel, RanksThatCrowdTheCoresGainNothing) {
  const FrameLoad load = loads_of("gen:sphereflake?s=3", {640, 480}).front();
  MachineSpeeds crowded;  // speeds are those while all work
  crowded.crowding = 4.0;
  for (const Distribution distribution : kDistributions) {
    EXPECT_LE(predict_frame(distribution, load, crowded, 4).draw_ms, predict_frame(distribution, load, {}, 4).draw_ms);
  }
}

}  // namespace
}  // namespace hpr
