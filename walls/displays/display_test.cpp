#include "walls/displays/display.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <limits>

#include "core/bytes.h"
#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "image/image_io.h"
#include "walls/config/wall_file.h"
#include "walls/manifest/manifest.h"

namespace hpr {
namespace {

/// A folder that is gone afterwards.
class Folder {
 public:
  explicit Folder(const std::string& name)
      : path_(std::filesystem::temp_directory_path() / ("hpr_" + name + std::to_string(::getpid()))) {
    std::filesystem::remove_all(path_);
  }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

TEST(Displays, AreMadeByNameAndUnknownNamesListTheChoices) {
  const Folder folder("displays");
  const Wall wall = load_wall("1x1@4x4");
  for (const std::string name : {"file", "none"}) {
    EXPECT_EQ(find_display(name).make(wall, {folder.path(), false})->name(), name);
    EXPECT_NE(std::ranges::find(all_displays(), name), all_displays().end());
  }
  try {
    static_cast<void>(find_display("flie").make(wall, {}));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("did you mean 'file'?"), std::string::npos);
  }
}

TEST(FileDisplay, WritesEachScreenUnderItsIdAndReplacesItsOwnFrames) {
  const Folder folder("frames");
  const Wall wall = load_wall("2x1@5x3");
  const auto display = find_display("file").make(wall, {folder.path() / "sub", false});
  Image<Rgba8> image({5, 3}, {10, 20, 30, 255});
  for (std::uint64_t frame = 0; frame < 2; ++frame) {
    image.at(4, 0) = {static_cast<std::uint8_t>(frame), 1, 2, 255};
    const std::vector<ScreenPicture> pictures{{1, image}};
    display->show({frame, pictures});
  }
  const auto file = folder.path() / "sub" / "wall-r0c1.png";
  const Image<Rgba8> read = decode_image(read_file(file, 1 << 20), "wall-r0c1.png", {});
  EXPECT_EQ(read, image);
  // Neither the other screen nor a temporary file.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path() / "sub"), {}), 1);
}

TEST(FileDisplay, KeepsEveryFrameInAFolderOfItsOwn) {
  const Folder folder("kept");
  const Wall wall = load_wall("1x1@2x1");
  const DisplayOptions options{.folder = folder.path(), .keep_frames = true};
  find_display("file").check(wall, options);
  const auto display = find_display("file").make(wall, options);
  for (const std::uint64_t frame : {7U, 8U}) {
    const Image<Rgba8> image({2, 1}, {static_cast<std::uint8_t>(frame), 0, 0, 255});
    const std::vector<ScreenPicture> pictures{{0, image}};
    display->show({frame, pictures});
  }
  const std::string file = wall.screens.front().id + ".png";
  const auto red_of = [&](const std::filesystem::path& path) {
    return decode_image(read_file(path, 1 << 20), "kept", {}).at(0, 0).r;
  };
  EXPECT_EQ(red_of(folder.path() / file), 8);
  EXPECT_EQ(red_of(folder.path() / "frame-000007" / file), 7);
  EXPECT_EQ(red_of(folder.path() / "frame-000008" / file), 8);
  // Frames of another run are not mixed with this one's.
  std::filesystem::remove(folder.path() / file);
  EXPECT_THROW(find_display("file").check(wall, options), Error);
  DisplayOptions forced = options;
  forced.overwrite = true;
  EXPECT_NO_THROW(find_display("file").check(wall, forced));
}

TEST(FileDisplay, RefusesToReplaceAnotherRunsFilesUnlessForced) {
  const Folder folder("force");
  const Wall wall = load_wall("2x1@5x3");
  std::filesystem::create_directories(folder.path());
  write_file_atomically(folder.path() / "wall-r0c1.png", "someone's");
  try {
    static_cast<void>(find_display("file").make(wall, {folder.path(), false}));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
    EXPECT_NE(error.hint().find("--force"), std::string::npos);
  }
  EXPECT_EQ(folder.files(), 1U);
  EXPECT_EQ(find_display("file").make(wall, {folder.path(), true})->name(), "file");
}

TEST(FileDisplay, AFolderThatIsAFileIsAnIoError) {
  const Folder folder("nofolder");
  const Wall wall = load_wall("1x1@5x3");
  write_file_atomically(folder.path(), "a file");
  EXPECT_THROW(static_cast<void>(find_display("file").make(wall, {folder.path(), true})), Error);
}

TEST(Manifest, HoldsWhatTheContractNames) {
  const Image<Rgba8> image({2, 1}, {1, 2, 3, 255});
  RunManifest manifest;
  manifest.scene_hash = 0xABC;
  manifest.wall_hash = 0x123;
  manifest.seed = 7;
  manifest.versions = {{"hpr", "0.1.0"}};
  manifest.frames.push_back(
      {3,
       12.5,
       "binary-swap",
       {record_screen("a", image, ScreenState::Fresh), record_screen("b", image, ScreenState::Stale),
        record_screen("c", {}, ScreenState::Lost)}});
  manifest.frames.push_back({4, std::numeric_limits<double>::quiet_NaN(), "tree", {}});
  const auto json = Json::parse(to_json(manifest));
  EXPECT_EQ(json["schema"], "hpr.wall-run/1");
  EXPECT_EQ(json["scene_hash"], "0000000000000abc");
  EXPECT_EQ(json["wall_hash"], "0000000000000123");
  EXPECT_EQ(json["seed"], 7);
  EXPECT_EQ(json["versions"]["hpr"], "0.1.0");
  ASSERT_EQ(json["frames"].size(), 2U);
  const auto& frame = json["frames"][0];
  EXPECT_EQ(frame["frame"], 3);
  EXPECT_EQ(frame["ms"], 12.5);
  EXPECT_EQ(frame["strategy"], "binary-swap");
  ASSERT_EQ(frame["screens"].size(), 3U);
  EXPECT_EQ(frame["screens"][0]["id"], "a");
  EXPECT_EQ(frame["screens"][0]["width"], 2);
  EXPECT_EQ(frame["screens"][0]["height"], 1);
  EXPECT_EQ(frame["screens"][0]["xxh64"], hex16(xxh64(std::as_bytes(image.pixels()))));
  EXPECT_EQ(frame["screens"][0]["state"], "fresh");
  EXPECT_EQ(frame["screens"][1]["state"], "stale");
  EXPECT_EQ(frame["screens"][2]["state"], "lost");
  EXPECT_TRUE(json["frames"][1]["ms"].is_null());
}

}  // namespace
}  // namespace hpr
