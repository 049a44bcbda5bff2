#include <gtest/gtest.h>

#include <algorithm>

#include "core/error.h"
#include "walls/config/wall_file.h"
#include "walls/drawing/plan.h"
#include "walls/manifest/manifest.h"

namespace hpr {
namespace {

/// Four frames of a 2x1 wall: the left screen is quick and never late, the right one slow, once stale, once lost.
RunManifest measured(const Wall& wall) {
  RunManifest run;
  run.wall_hash = wall.hash;
  for (std::uint64_t frame = 0; frame < 4; ++frame) {
    ScreenRecord left{wall.screens[0].id, {640, 360}, 1, ScreenState::Fresh, 0, 2.0, 2048};
    ScreenRecord right{wall.screens[1].id, {640, 360}, 2, ScreenState::Fresh, 1, frame % 2 == 0 ? 4.0 : 6.0, 10240};
    if (frame == 1) right.state = ScreenState::Stale;
    if (frame == 2) right.state = ScreenState::Lost;
    run.frames.push_back({frame, 10.0, "tree", {left, right}});
  }
  return run;
}

ManifestFile file_of(const RunManifest& run) {
  return parse_manifest(to_json(run), "m");
}

TEST(WallHeat, IsTheMedianTimeTheMeanSizeAndTheShareOfFramesMissed) {
  const Wall wall = load_wall("2x1");
  const ManifestFile file = file_of(measured(wall));
  const auto values = [&](const char* by) { return wall_heat(wall, file, "m", by).values; };
  using Values = std::vector<std::optional<double>>;
  EXPECT_EQ(values("ms"), (Values{2.0, 4.0}));
  EXPECT_EQ(values("bytes"), (Values{2.0, 10.0}));
  EXPECT_EQ(values("stale"), (Values{0.0, 25.0}));
  EXPECT_EQ(values("lost"), (Values{0.0, 25.0}));
  const WallHeat heat = wall_heat(wall, file, "m", "ms");
  EXPECT_EQ(heat.largest(), 4.0);
  EXPECT_EQ(heat.notes[1], (std::vector<std::string>{"4.0 ms, 10.0 KiB", "stale 25.0 %, lost 25.0 %", "by rank 1"}));
}

TEST(WallHeat, RefusesAnotherWallAndWhatWasNotMeasured) {
  const Wall wall = load_wall("2x1");
  const auto refused = [](const Wall& of, const RunManifest& run, const char* by) {
    try {
      (void)wall_heat(of, file_of(run), "out/manifest.json", by);
      return ExitCode::Done;
    } catch (const Error& error) {
      EXPECT_FALSE(error.hint().empty());
      return error.code();
    }
  };
  RunManifest run = measured(wall);
  EXPECT_EQ(refused(load_wall("3x1"), run, "ms"), ExitCode::BadInput);
  EXPECT_EQ(refused(wall, run, "speed"), ExitCode::Usage);
  for (FrameRecord& frame : run.frames) {
    for (ScreenRecord& screen : frame.screens) screen.ms.reset();
  }
  EXPECT_EQ(refused(wall, run, "ms"), ExitCode::BadInput);
  EXPECT_EQ(refused(wall, run, "stale"), ExitCode::Done);
  run.frames.clear();
  EXPECT_EQ(refused(wall, run, "stale"), ExitCode::BadInput);
}

TEST(WallHeat, ThePlanHasAScaleAndTheWorstScreenItsLastColour) {
  const Wall wall = load_wall("2x1");
  const WallHeat heat = wall_heat(wall, file_of(measured(wall)), "m", "ms");
  const std::string svg = wall_plan_svg(wall, &heat);
  for (const char* const part :
       {">0 ms<", ">4 ms<", "median time to hand a picture over, 4 frames", ">2.0 ms, 2.0 KiB<", "by rank 1"}) {
    EXPECT_NE(svg.find(part), std::string::npos) << part;
  }
  const auto pixels = [&](const Image<Rgba8>& image, Rgba8 color) { return std::ranges::count(image.pixels(), color); };
  constexpr Rgba8 kHottest{240, 110, 90, 255};
  EXPECT_GT(pixels(wall_plan_image(wall, &heat), kHottest), 100'000);
  EXPECT_EQ(pixels(wall_plan_image(wall), kHottest), 0);
}

}  // namespace
}  // namespace hpr
