#include "engine/balance/distribution_choice.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "engine/balance/load_balance.h"
#include "engine/plan.h"
#include "engine/settings/test_frames.h"
#include "scene/load_scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;
using test::settings_with;

constexpr Size kScreen{320, 200};
const char* const kFlake = "gen:sphereflake?s=3&n=5";  ///< its triangles lie in few tiles

View view_of(const Scene& scene) {
  return make_view(choose_camera({}, scene), kScreen, scene.bounds);
}

MachineSpeeds speeds_with(double triangle, double merge) {
  MachineSpeeds speeds;
  speeds.raster.triangle = triangle;
  speeds.merge = merge;
  speeds.merge_in_place = merge;
  return speeds;
}

const MachineSpeeds kDearTriangles = speeds_with(1e4, 1.0);
const MachineSpeeds kDearMerging = speeds_with(10.0, 1e5);

TEST(DistributionChoice, IsWhatIsPredictedToTakeLeast) {
  run_local_ranks(1, [](Communicator& comm) {
    Session session(comm, {.threads = 1}, [] { return load_scene(kFlake); });
    const View view = view_of(session.scene());
    const FrameLoad load = load_of(session, std::span(&view, 1));
    EXPECT_EQ(choose_by_model(load, kDearMerging, 4, 0).distribution, Distribution::SortFirst);
    const PredictedChoice choice = choose_by_model(load, kDearTriangles, 4, 0);
    EXPECT_FALSE(draws_alone(choice.distribution));
    ASSERT_EQ(choice.predictions.size(), kDistributions.size());
    double chosen = 0.0;
    double least = 1e300;
    for (const FramePrediction& prediction : choice.predictions) {
      if (prediction.distribution == choice.distribution) chosen = prediction.total_ms();
      least = std::min(least, prediction.total_ms());
    }
    EXPECT_LE(chosen * (1.0 - kMinDistributionGain), least);
  });
}

TEST(DistributionChoice, StaysWhereLittleIsToBeGained) {
  run_local_ranks(1, [](Communicator& comm) {
    Session session(comm, {.threads = 1}, [] { return load_scene(kFlake); });
    const View view = view_of(session.scene());
    const FrameLoad load = load_of(session, std::span(&view, 1));
    MachineSpeeds alike = speeds_with(1e-3, 1e-3);  // then they are all the same but for light
    alike.raster = {.triangle = 1e-3, .pixel = 1e-3, .read = 1e-3, .draw = 0.0};
    alike.message = alike.post = alike.chunk = alike.group = 0.0;
    alike.host_ranks = 4;
    for (const Distribution current : kDistributions) {
      EXPECT_EQ(choose_by_model(load, alike, 4, 0, current).distribution, current) << name_of(current);
    }
    EXPECT_EQ(choose_by_model(load, alike, 4, 0).distribution, Distribution::SortFirst);
    EXPECT_NE(choose_by_model(load, kDearTriangles, 4, 0, Distribution::SortFirst).distribution,
              Distribution::SortFirst);
  });
}

/// What plan_frame says of the distribution, the same on all ranks.
FramePlan plan_of(const std::string& scene, const test::Options& options, int ranks, const MachineSpeeds* speeds) {
  FramePlan plan;
  run_local_ranks({.size = ranks, .hang_timeout = 60s}, [&](Communicator& comm) {
    Session session(comm, {.threads = 1}, [&] { return load_scene(scene); });
    if (speeds != nullptr) session.balance().set_speeds(*speeds);
    const View view = view_of(session.scene());
    const FramePlan mine = plan_frame(session, settings_with(options).frame, std::span(&view, 1));
    for (const auto& distribution : all_gather_value(comm, mine.distribution)) {
      EXPECT_EQ(distribution, mine.distribution);
    }
    if (comm.rank() == 0) plan = mine;
  });
  return plan;
}

bool says(const FramePlan& plan, const std::string& text) {
  return std::ranges::any_of(plan.explained,
                             [&](const std::string& line) { return line.find(text) != std::string::npos; });
}

TEST(DistributionChoice, FollowsSpeeds) {
  const test::Options raster{{"primary", "raster"}, {"passes", "none"}};
  const FramePlan apart = plan_of(kFlake, raster, 3, &kDearMerging);
  EXPECT_EQ(apart.distribution, Distribution::SortFirst);
  EXPECT_TRUE(apart.distribution_is_predicted);
  const FramePlan together = plan_of(kFlake, raster, 3, &kDearTriangles);
  EXPECT_FALSE(draws_alone(together.distribution));
  EXPECT_TRUE(says(together, "predicted ms of a sample: "));
  EXPECT_TRUE(says(together, "speeds: measured: a triangle 1e+04 ns"));
  MachineSpeeds noisy;
  noisy.noise = "repetitions took 9.0 times the least one";
  EXPECT_TRUE(says(plan_of(kFlake, raster, 3, &noisy), "too noisy to predict well: repetitions took 9.0 times"));
}

TEST(DistributionChoice, MeasuresWhereNoSpeedsAreKnown) {
  const FramePlan plan = plan_of(kFlake, {{"primary", "raster"}, {"passes", "none"}}, 2, nullptr);
  EXPECT_TRUE(plan.distribution_is_predicted);
  EXPECT_TRUE(says(plan, "speeds: measured: a triangle "));
  // As it is where nothing was measured.
  EXPECT_FALSE(says(plan, "a triangle 100 ns, a pixel 2.1 ns, a pixel merged 8 ns in place and 8 ns sent"));
}

TEST(DistributionChoice, LeavesOutWhatAStrategyCannotComposite) {
  const test::Options options{{"primary", "raster"}, {"passes", "none"}, {"strategy", "radix-k:3"}};
  EXPECT_TRUE(draws_alone(plan_of(kFlake, options, 2, &kDearTriangles).distribution));
  EXPECT_FALSE(draws_alone(plan_of(kFlake, options, 3, &kDearTriangles).distribution));
}

TEST(DistributionChoice, DoesNotLookAtFramesWhoseDrawingCannotMatter) {
  const FramePlan small = plan_of("gen:cornell", {{"primary", "raster"}}, 3, &kDearTriangles);
  EXPECT_EQ(small.distribution, Distribution::SortFirst);
  EXPECT_FALSE(small.distribution_is_predicted);
  EXPECT_TRUE(says(small, "few enough to cull on every rank"));
  const FramePlan local = plan_of(kFlake, {{"primary", "raster"}, {"shading", "local"}}, 3, &kDearTriangles);
  EXPECT_EQ(local.distribution, Distribution::SortFirst);
  EXPECT_FALSE(local.distribution_is_predicted);
  const FramePlan rays = plan_of(kFlake, {{"primary", "rays"}}, 3, &kDearTriangles);
  EXPECT_EQ(rays.distribution, Distribution::SortFirst);
  EXPECT_TRUE(says(rays, "rays find a surface among many"));
  EXPECT_EQ(plan_of(kFlake, {{"primary", "raster"}}, 1, &kDearTriangles).distribution, Distribution::SortFirst);
  const FramePlan asked = plan_of(kFlake, {{"primary", "raster"}, {"distribute", "sort-middle"}}, 3, &kDearTriangles);
  EXPECT_EQ(asked.distribution, Distribution::SortMiddle);
  EXPECT_FALSE(asked.distribution_is_predicted);
}

TEST(DistributionChoice, ChangesBetweenFramesAndNoBitWithIt) {
  run_local_ranks({.size = 3, .hang_timeout = 60s}, [](Communicator& comm) {
    Session session(comm, {.threads = 1}, [] { return load_scene(kFlake); });
    const RenderSettings settings = settings_with({{"primary", "raster"}, {"passes", "shadow"}, {"spp", "1"}});
    std::vector<View> views{view_of(session.scene())};
    session.balance().set_speeds(kDearMerging);
    FrameMaker maker(session, settings.frame, settings.sampling, views, {}, {}, true);
    Progress silent("none", "sample", 0);
    std::vector<Distribution> distributions;
    std::vector<std::vector<Rgb>> pictures;
    for (int number = 0; number < 3; ++number) {
      Frame& frame = *maker.make(views, 0, silent);
      distributions.push_back(maker.plan().distribution);
      test::add_pixels(session, maker, frame, frame.radiance, pictures.emplace_back());
      session.balance().set_speeds(kDearTriangles);
    }
    EXPECT_EQ(distributions.front(), Distribution::SortFirst);
    EXPECT_FALSE(draws_alone(distributions.at(1)));
    EXPECT_TRUE(says(maker.plan(), fmt::format("distribute: {} over 3 ranks", name_of(distributions.at(1)))));
    EXPECT_FALSE(says(maker.plan(), "distribute: sort-first"));
    EXPECT_EQ(distributions.at(2), distributions.at(1));
    EXPECT_EQ(pictures.at(1), pictures.front());
    EXPECT_EQ(pictures.at(2), pictures.front());
  });
}

}  // namespace
}  // namespace hpr
