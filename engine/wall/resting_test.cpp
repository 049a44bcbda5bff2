#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "compositing/assembly.h"
#include "core/interrupt.h"
#include "core/progress.h"
#include "core/signals.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "engine/settings_table.h"
#include "engine/wall/wall_driver.h"
#include "scene/load_scene.h"
#include "walls/config/wall_file.h"
#include "walls/displays/display.h"

namespace hpr {
namespace {

/// The bits of three samples of a resting picture in which `raised_on` overtakes the second one, once; -1: nobody does.
std::vector<Rgb> refine(int ranks, const std::vector<std::pair<std::string, std::string>>& options, int raised_on) {
  std::vector<Rgb> pixels;
  run_local_ranks(
      ranks,
      [&](Communicator& comm) {
        RenderSettings settings;
        settings.frame.primary = Primary::Rays;
        set_setting(settings, "spp", "3");
        for (const auto& [name, value] : options) set_setting(settings, name, value);
        settings = resolve(settings, 1);
        Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
        const View view =
            make_view(choose_camera(settings.camera, session.scene()), {200, 150}, session.scene().bounds);
        const Blocks blocks = cut_blocks(std::span(&view, 1));
        const FramePlan plan = plan_frame(session, settings.frame, blocks.views);
        FrameSampler sampler(session, plan, settings.sampling, 0, false);
        EXPECT_TRUE(sampler.refine(blocks.views));
        Interrupt interrupt([&] { return comm.rank() == raised_on; });
        EXPECT_EQ(sampler.refine(blocks.views, &interrupt), raised_on < 0);
        while (sampler.sample_progress().samples < 3) EXPECT_TRUE(sampler.refine(blocks.views));
        const std::vector<int> to_root{0};
        Frame& frame = sampler.frame();
        session.assembler().assemble(comm, frame.radiance, frame.owned, to_root);
        if (comm.rank() != 0) return;
        const Image<Rgb> image = to_image(frame.radiance, 0);
        pixels.assign(image.pixels().begin(), image.pixels().end());
      },
      std::chrono::seconds(30));
  return pixels;
}

TEST(Resting, ASampleOvertakenOnAnyRankIsDroppedOnAllAndDrawnAgainWithTheSameBits) {
  const std::vector<Rgb> expected = refine(1, {}, -1);
  ASSERT_FALSE(expected.empty());
  EXPECT_TRUE(refine(1, {}, 0) == expected);
  const std::vector<std::vector<std::pair<std::string, std::string>>> distributions{
      {{"distribute", "sort-first"}}, {{"distribute", "sort-middle"}, {"primary", "raster"}},
      {{"distribute", "sort-last"}},  {{"distribute", "hybrid"}, {"groups", "2"}},
      {{"data", "partitioned"}},
  };
  for (const auto& options : distributions) {
    EXPECT_TRUE(refine(3, options, -1) == expected) << options.front().second;
    for (int rank = 0; rank < 3; ++rank)
      EXPECT_TRUE(refine(3, options, rank) == expected) << options.front().second << rank;
  }
  EXPECT_TRUE(refine(3, {{"quality", "best"}, {"spp", "3"}}, 2) == refine(1, {{"quality", "best"}, {"spp", "3"}}, -1));
}

TEST(Resting, AnAdaptivePictureLosesNothingToADroppedSample) {
  EXPECT_TRUE(refine(3, {{"adaptive", "true"}, {"spp", "3"}}, 1) ==
              refine(1, {{"adaptive", "true"}, {"spp", "3"}}, -1));
}

/// What the viewer of the display below does next.
DisplayInput& next_input() {
  static DisplayInput input;
  return input;
}

class ScriptedDisplay final : public Display {
 public:
  [[nodiscard]] std::string_view name() const override { return "scripted"; }
  void show(const WallFrame& /*frame*/) override {}
  [[nodiscard]] DisplayInput take_input() override { return std::exchange(next_input(), {}); }
};

/// Runs `body` with the driver of a viewer's wall, whose resting pictures have 2 samples.
void drive_view(const std::function<void(WallDriver&)>& body) {
  next_input() = {};
  DisplayKind kind = find_display("none");
  kind.interactive = true;
  kind.make = [](const Wall&, const DisplayOptions&) -> std::unique_ptr<Display> {
    return std::make_unique<ScriptedDisplay>();
  };
  run_local_ranks(
      1,
      [&](Communicator& comm) {
        WallJob job;
        job.wall = load_wall("1x1@64x48");
        set_setting(job.settings, "quality", "draft");
        set_setting(job.settings, "spp", "2");
        set_setting(job.settings, "exposure", "0");
        job.display = &kind;
        job.until_stopped = true;
        Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
        WallDriver driver(job, session);
        body(driver);
      },
      std::chrono::seconds(30));
}

bool draw(WallDriver& driver, std::uint64_t number) {
  Progress progress("none", "sample", 1);
  return driver.draw(number, progress);
}

TEST(Resting, ASignalDropsTheSampleAtHandAndEndsTheRun) {
  watch_requests();
  drive_view([](WallDriver& driver) {
    EXPECT_TRUE(draw(driver, 0));
    EXPECT_TRUE(driver.follow_viewers());
    EXPECT_TRUE(draw(driver, 1));
    EXPECT_FALSE(driver.settled());
    ASSERT_EQ(std::raise(SIGUSR1), 0);
    EXPECT_FALSE(draw(driver, 2));
    EXPECT_EQ(driver.manifest().frames.size(), 2U);
    EXPECT_FALSE(driver.follow_viewers());
    EXPECT_TRUE(driver.interrupted());
  });
}

TEST(Resting, ADragDropsTheSampleAtHandAndMovesTheCamera) {
  drive_view([](WallDriver& driver) {
    EXPECT_TRUE(draw(driver, 0));
    EXPECT_TRUE(draw(driver, 1));
    next_input().orbit.turn_right = 0.5;
    EXPECT_FALSE(draw(driver, 2)) << "the drag came before the second sample";
    EXPECT_TRUE(driver.follow_viewers());
    EXPECT_TRUE(draw(driver, 2));
    EXPECT_FALSE(driver.frames().report()->resting) << "the camera has moved";
    EXPECT_TRUE(draw(driver, 3));
    EXPECT_TRUE(draw(driver, 4));
    EXPECT_TRUE(driver.settled());
  });
}

TEST(Resting, ADragBeforeTheFirstSampleLeavesTheLastMovingPicture) {
  drive_view([](WallDriver& driver) {
    EXPECT_TRUE(draw(driver, 0));
    next_input().orbit.dolly = 0.1;
    EXPECT_FALSE(draw(driver, 1));
    EXPECT_TRUE(driver.follow_viewers());
    EXPECT_TRUE(draw(driver, 1));
    EXPECT_EQ(driver.manifest().frames.size(), 2U);
  });
}

TEST(Resting, KeysChangeExposureToneAndWireframe) {
  drive_view([](WallDriver& driver) {
    EXPECT_TRUE(draw(driver, 0));
    EXPECT_TRUE(draw(driver, 1));
    EXPECT_TRUE(draw(driver, 2));
    EXPECT_TRUE(driver.settled());
    const Tone tone = driver.transform().tone;
    next_input().keys = {.half_stops = 3, .tones = 1};
    EXPECT_TRUE(driver.follow_viewers());
    EXPECT_FALSE(driver.settled()) << "the same light is shown otherwise";
    EXPECT_TRUE(draw(driver, 3));
    EXPECT_EQ(driver.transform().exposure_stops, 1.5);
    EXPECT_EQ(static_cast<std::size_t>(driver.transform().tone),
              (static_cast<std::size_t>(tone) + 1) % kToneNames.size());
    EXPECT_TRUE(driver.frames().report()->resting) << "no sample is lost";
    EXPECT_TRUE(driver.settled());

    next_input().keys = {.wireframes = 1};
    EXPECT_TRUE(driver.follow_viewers());
    EXPECT_TRUE(draw(driver, 4));
    EXPECT_EQ(driver.plan().rays.show, Show::Wireframe);
    EXPECT_EQ(driver.transform().shows, "wireframe");
    next_input().keys = {.wireframes = 1};
    EXPECT_TRUE(driver.follow_viewers());
    EXPECT_TRUE(draw(driver, 5));
    EXPECT_EQ(driver.plan().rays.show, Show::Shaded);
    EXPECT_EQ(driver.transform().exposure_stops, 1.5);
  });
}

}  // namespace
}  // namespace hpr
