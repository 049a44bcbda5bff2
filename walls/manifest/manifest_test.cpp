#include "walls/manifest/manifest.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace hpr {
namespace {

RunManifest manifest() {
  RunManifest run;
  run.scene_hash = 0xfedc'ba98'7654'3210U;
  run.wall_hash = 7;
  run.seed = 3;
  run.frames = {{.frame = 0, .ms = 1.5, .strategy = "tree", .screens = {{"a", {2, 1}, 9, ScreenState::Lost}}},
                {.frame = 1, .ms = 2.5, .strategy = "tree", .screens = {{"a", {2, 1}, 9, ScreenState::Fresh}}}};
  run.restarts = {R"({"frame":1,"why":"x"})"};
  return run;
}

TEST(ManifestFile, ReadsWhatIsWritten) {
  RunManifest run = manifest();
  const ManifestFile file = parse_manifest(to_json(run), "m");
  EXPECT_EQ(file.scene_hash, run.scene_hash);
  EXPECT_EQ(file.wall_hash, run.wall_hash);
  EXPECT_EQ(file.seed, run.seed);
  EXPECT_EQ(file.frames, (std::vector<std::string>{to_json(run.frames[0]), to_json(run.frames[1])}));
  EXPECT_EQ(file.restarts, run.restarts);
  EXPECT_FALSE(file.stopped_of);
  run.stopped_of = 100;
  EXPECT_EQ(parse_manifest(to_json(run), "m").stopped_of, 100);
  // What is read is written again as it was.
  RunManifest again = run;
  again.earlier = parse_manifest(to_json(run), "m").frames;
  again.frames.clear();
  EXPECT_EQ(to_json(again), to_json(run));
}

TEST(ManifestFile, TellsWhetherItsFramesAreThoseOfAWall) {
  WallScreen screen;
  screen.id = "a";
  screen.pixels = {2, 1};
  const auto check = [&](const RunManifest& run) {
    check_records(parse_manifest(to_json(run), "m"), {&screen, 1}, "m");
  };
  EXPECT_NO_THROW(check(manifest()));
  RunManifest other = manifest();
  other.frames[1].frame = 2;
  EXPECT_THROW(check(other), Error);
  other = manifest();
  other.frames[0].screens[0].size = {2, 2};
  EXPECT_THROW(check(other), Error);
  other = manifest();
  other.frames[0].screens.clear();
  EXPECT_THROW(check(other), Error);
  other = manifest();
  other.frames[1].screens[0].id = "b";
  EXPECT_THROW(check(other), Error);
  std::string text = to_json(manifest());
  text.replace(text.find("\"xxh64\": \"") + 10, 2, "zz");
  EXPECT_THROW(check_records(parse_manifest(text, "m"), {&screen, 1}, "m"), Error);
}

TEST(ManifestFile, FramesThatFailedAreFoundAgain) {
  RunManifest run = manifest();
  EXPECT_TRUE(failed_frames(parse_manifest(to_json(run), "m").frames).empty());
  run.frames[1].failed = "OpenGL ran out of memory";
  const ManifestFile file = parse_manifest(to_json(run), "m");
  EXPECT_EQ(failed_frames(file.frames), std::vector<std::uint64_t>{1});
  EXPECT_NE(file.frames[1].find("\"failed\":\"OpenGL ran out of memory\""), std::string::npos) << file.frames[1];
}

TEST(ManifestFile, RefusesWhatIsNone) {
  const std::string sound = to_json(manifest());
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = sound;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  };
  for (const std::string& bad :
       {std::string(), std::string("[]"), sound.substr(0, sound.size() / 2), std::string(100'000, '['),
        with("hpr.wall-run/1", "hpr.wall-run/2"), with("\"seed\": 3", "\"seed\": -3"),
        with("\"seed\": 3", "\"seed\": \"3\""), with("fedcba", "xedcba"), with("\"frames\": [", "\"frames\": [1,"),
        with("\"restarts\": [", "\"restarts\": 4, \"x\": ["),
        with("\"seed\": 3", "\"seed\": 3, \"stopped\": {\"of\": 1.5}"),
        with("\"frames\": [",
             "\"frames\": [{\"a\": " + std::string(100'000, '[') + std::string(100'000, ']') + "}, ")}) {
    try {
      (void)parse_manifest(bad, "m.json");
      ADD_FAILURE() << "taken: " << bad.substr(0, 300);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput);
      EXPECT_NE(std::string(error.what()).find("m.json"), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace hpr
