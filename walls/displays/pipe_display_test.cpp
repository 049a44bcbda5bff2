#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/file.h"
#include "core/timing.h"
#include "walls/config/wall_file.h"
#include "walls/displays/display.h"

namespace hpr {
namespace {

using std::chrono::milliseconds;

class PipeDisplay : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }

  /// Both screens of the wall, `value` in their red.
  void show(Display& display, std::uint8_t value) const {
    const Image<Rgba8> left({40, 30}, {value, 1, 2, 255});
    const Image<Rgba8> right({40, 30}, {value, 3, 4, 255});
    const std::vector<ScreenPicture> pictures{{0, left}, {1, right}};
    display.show({value, pictures});
  }

  /// The message of the Error that `work` throws, which must be of `code`.
  template <typename Work>
  [[nodiscard]] static std::string message(ExitCode code, const Work& work) {
    try {
      work();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  }

  const Wall wall_ = load_wall("2x1@40x30");

 private:
  std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("hpr_pipe" + std::to_string(::getpid()));
};

TEST_F(PipeDisplay, ACommandGetsEveryFrameOfTheScreenAskedFor) {
  const PipeOptions pipe{
      .command = "cat > '" + file("frames").string() + "'", .format = PipeFormat::Rgba, .screen = wall_.screens[1].id};
  const auto display = find_display("pipe").make(wall_, {.pipe = pipe});
  show(*display, 7);
  show(*display, 8);
  display->finish();
  const std::vector<std::byte> bytes = read_file(file("frames"), 1 << 20);
  const std::size_t frame = 4 * 40 * 30;
  ASSERT_EQ(bytes.size(), 2 * frame);
  EXPECT_EQ(std::to_integer<int>(bytes[0]), 7);
  EXPECT_EQ(std::to_integer<int>(bytes[1]), 3);
  EXPECT_EQ(std::to_integer<int>(bytes[frame]), 8);
}

TEST_F(PipeDisplay, AScreenThatAFrameLacksIsSentAsItWas) {
  const PipeOptions pipe{
      .command = "cat > '" + file("frames").string() + "'", .format = PipeFormat::Rgba, .screen = wall_.screens[1].id};
  const auto display = find_display("pipe").make(wall_, {.pipe = pipe});
  const Image<Rgba8> left({40, 30}, {1, 1, 1, 255});
  const std::vector<ScreenPicture> one{{0, left}};
  display->show({0, one});
  show(*display, 7);
  display->show({2, one});
  display->finish();
  const std::vector<std::byte> bytes = read_file(file("frames"), 1 << 20);
  const std::size_t frame = 4 * 40 * 30;
  ASSERT_EQ(bytes.size(), 3 * frame);
  EXPECT_EQ(std::to_integer<int>(bytes[0]), 0);
  EXPECT_EQ(std::to_integer<int>(bytes[frame]), 7);
  EXPECT_EQ(std::to_integer<int>(bytes[2 * frame]), 7);
}

TEST_F(PipeDisplay, TheWallKeepsThePicturesOfScreensThatAFrameLacks) {
  const PipeOptions pipe{.command = "cat > '" + file("frames").string() + "'", .format = PipeFormat::Rgba};
  const auto display = find_display("pipe").make(wall_, {.pipe = pipe});
  show(*display, 7);
  display->show({1, {}});
  display->finish();
  const std::vector<std::byte> bytes = read_file(file("frames"), 1 << 20);
  ASSERT_FALSE(bytes.empty());
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(bytes.size() / 2),
                         bytes.begin() + static_cast<std::ptrdiff_t>(bytes.size() / 2)));
  EXPECT_EQ(std::to_integer<int>(bytes[bytes.size() / 2]), 7);
}

TEST_F(PipeDisplay, AFileHasItsNameOnceItIsComplete) {
  const DisplayOptions options{.pipe = {.file = file("wall.y4m")}};
  find_display("pipe").check(wall_, options);
  {
    const auto unfinished = find_display("pipe").make(wall_, options);
    show(*unfinished, 1);
  }
  EXPECT_TRUE(std::filesystem::is_empty(file(".")));
  const auto display = find_display("pipe").make(wall_, options);
  show(*display, 1);
  EXPECT_FALSE(std::filesystem::exists(file("wall.y4m")));
  display->finish();
  EXPECT_TRUE(std::filesystem::exists(file("wall.y4m")));
  EXPECT_NE(message(ExitCode::Io, [&] { find_display("pipe").check(wall_, options); }).find("exists"),
            std::string::npos);
}

TEST_F(PipeDisplay, AFileBesideItAndALinkToItStay) {
  write_file_atomically(file("wall.y4m.part"), "somebody's own");
  write_file_atomically(file("real.y4m"), "old");
  std::filesystem::create_symlink("real.y4m", file("wall.y4m"));
  const auto display = find_display("pipe").make(
      wall_, {.overwrite = true, .pipe = {.file = file("wall.y4m"), .format = PipeFormat::Rgba}});
  show(*display, 1);
  display->finish();
  EXPECT_EQ(read_file(file("wall.y4m.part"), 1 << 20).size(), std::string_view("somebody's own").size());
  EXPECT_TRUE(std::filesystem::is_symlink(file("wall.y4m")));
  EXPECT_GT(read_file(file("real.y4m"), 1 << 20).size(), 1000U);
}

TEST_F(PipeDisplay, AReaderThatStopsReadingIsAnErrorWithinTheTimeLimit) {
  const PipeOptions pipe{.command = "sleep 60", .format = PipeFormat::Rgba, .time_limit = milliseconds(200)};
  const Stopwatch watch;
  {
    const auto display = find_display("pipe").make(wall_, {.pipe = pipe});
    const std::string said = message(ExitCode::Io, [&] {
      for (std::uint8_t frame = 0; frame < 100; ++frame) show(*display, frame);
    });
    EXPECT_NE(said.find("read nothing for 0.2 s"), std::string::npos) << said;
  }
  EXPECT_LT(watch.ms(), 5000.0);
}

TEST_F(PipeDisplay, AReaderThatGoesAwayIsAnErrorAndNoSignal) {
  const auto display = find_display("pipe").make(wall_, {.pipe = {.command = "exit 3"}});
  const std::string said = message(ExitCode::Io, [&] {
    for (std::uint8_t frame = 0; frame < 200; ++frame) show(*display, frame);
  });
  EXPECT_NE(said.find("stopped reading"), std::string::npos) << said;
}

TEST_F(PipeDisplay, ACommandThatFailsAtItsEndFailsTheRun) {
  const auto display = find_display("pipe").make(wall_, {.pipe = {.command = "cat > /dev/null; exit 3"}});
  show(*display, 1);
  EXPECT_NE(message(ExitCode::Io, [&] { display->finish(); }).find("left with 3"), std::string::npos);
}

TEST_F(PipeDisplay, AFifoNobodyReadsIsAnErrorWithinTheTimeLimit) {
  ASSERT_EQ(::mkfifo(file("fifo").c_str(), 0600), 0);
  const PipeOptions pipe{.file = file("fifo"), .time_limit = milliseconds(100)};
  EXPECT_NO_THROW(find_display("pipe").check(wall_, {.pipe = pipe}));
  const std::string said =
      message(ExitCode::Io, [&] { static_cast<void>(find_display("pipe").make(wall_, {.pipe = pipe})); });
  EXPECT_NE(said.find("nobody reads"), std::string::npos) << said;
}

TEST_F(PipeDisplay, OptionsThatDoNotFitAreUsageErrors) {
  static_cast<void>(message(ExitCode::Usage, [&] { find_display("pipe").check(wall_, {}); }));
  const PipeOptions both{.command = "cat", .file = "-"};
  static_cast<void>(message(ExitCode::Usage, [&] { find_display("pipe").check(wall_, {.pipe = both}); }));
  const PipeOptions unknown{.command = "cat", .screen = "nowhere"};
  static_cast<void>(message(ExitCode::Usage, [&] { find_display("pipe").check(wall_, {.pipe = unknown}); }));
  static_cast<void>(message(ExitCode::Usage, [] { static_cast<void>(parse_pipe_format("mp4")); }));
}

}  // namespace
}  // namespace hpr
