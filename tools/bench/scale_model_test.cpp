#include "tools/bench/scale_model.h"

#include <gtest/gtest.h>

#include "core/json.h"
#include "engine/settings_table.h"

namespace hpr {
namespace {

ScaleInput input_of(const std::string& scene) {
  RenderSettings settings;
  set_setting(settings, "primary", "raster");
  set_setting(settings, "spp", "1");
  return {scene, resolve(settings, 1), {160, 96}, {{1, 1}, {2, 1}}, 1};
}

SimulatedCluster cluster_of(int hosts, int ranks) {
  SimulatedCluster cluster;
  cluster.hosts = hosts;
  cluster.ranks = ranks;
  return cluster;
}

TEST(ScaleModel, LinksAreTheClustersAndWorkIsWhatWasMeasured) {
  SimulatedCluster cluster = cluster_of(4, 16);
  cluster.latency = 10e-6;
  cluster.overhead = 1e-6;
  cluster.bandwidth = 1e9;
  cluster.merge = 4e9;
  MachineSpeeds measured;
  measured.raster.triangle = 50.0;
  const MachineSpeeds between = speeds_on(cluster, measured, 16);
  EXPECT_DOUBLE_EQ(between.message, 12e3);
  EXPECT_DOUBLE_EQ(between.merge, 8.0 + 2.0);
  EXPECT_DOUBLE_EQ(between.merge_in_place, 2.0);
  EXPECT_DOUBLE_EQ(between.collect, 1.0);
  EXPECT_EQ(between.host_ranks, 4);
  EXPECT_DOUBLE_EQ(between.raster.triangle, 50.0);
  const MachineSpeeds inside = speeds_on(cluster, measured, 4);
  EXPECT_LT(inside.message, between.message);
  EXPECT_LT(inside.merge, between.merge);
  cluster.bandwidth = 1e9 / 4.0;  // a rank's part of its host's link, all of which one of them may use
  EXPECT_DOUBLE_EQ(speeds_on(cluster, measured, 16).collect, 4.0);
}

TEST(ScaleModel, HasEveryWallRankCountAndDistribution) {
  const ScaleModelReport report = model_scale({}, input_of("gen:cornell"), cluster_of(6, 6), 2);
  EXPECT_EQ(report.runs.size(), 2U * 4U * kDistributions.size());  // 1, 2, 4 and 6 ranks
  for (const ModelledScale& run : report.runs) {
    EXPECT_GT(run.frame.total_ms(), 0.0);
    EXPECT_EQ(run.hosts, run.ranks);
    if (run.ranks == 1) {
      EXPECT_NEAR(run.speed_up, 1.0, 0.15) << name_of(run.frame.distribution);
    } else {
      EXPECT_LT(run.efficiency(), 1.01);
      EXPECT_TRUE(run.efficiency() > 0.9 || run.limit.part > 0.0);
    }
  }
  const Json json = Json::parse(scale_model_json(report));
  EXPECT_EQ(json.at("schema"), "hpr.bench-scale-model/1");
  EXPECT_EQ(json.at("simulated").at("ranks"), 6);
  EXPECT_GT(json.at("measured").at("triangle_ns").get<double>(), 0.0);
  EXPECT_EQ(json.at("runs").size(), report.runs.size());
  const std::string table = scale_model_table(report);
  EXPECT_NE(table.find("simulated: 6 hosts"), std::string::npos);
  EXPECT_NE(table.find("sort-middle"), std::string::npos);
}

TEST(ScaleModel, LightIsWhatItTookHere) {
  ScaleInput input = input_of("gen:cornell");
  const auto light_of = [&](const char* passes, const char* samples) {
    set_setting(input.settings, "passes", passes);
    set_setting(input.settings, "light-samples", samples);
    const ScaleModelReport report = model_scale({}, input, cluster_of(2, 2), 0);
    EXPECT_NEAR(report.runs.front().frame.light_ms, 1e-6 * report.measured.light * 160.0 * 96.0,
                1e-6 * report.runs.front().frame.light_ms);
    return report.measured.light;
  };
  EXPECT_GT(light_of("shadow,ambient-occlusion,reflection", "64"), 2.0 * light_of("none", "1"));
}

TEST(ScaleModel, SlowLinksAreWhatLimits) {
  SimulatedCluster slow = cluster_of(16, 16);
  slow.bandwidth = 1e6;
  for (const ModelledScale& run : model_scale({}, input_of("gen:cornell"), slow, 0).runs) {
    if (run.ranks < 8) continue;
    const std::string limit = run.limit.phase->name;
    EXPECT_TRUE(limit == "compositing" || limit == "tiles to screens") << limit;
  }
}

}  // namespace
}  // namespace hpr
