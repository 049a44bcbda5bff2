#include "engine/checkpoint/checkpoint_file.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <thread>

#include "core/error.h"
#include "core/file.h"
#include "engine/film.h"
#include "engine/samples.h"

namespace hpr {
namespace {

const RunIdentity kIdentity{{"scene", "0123"}, {"seed", "1"}};
const RunIdentity kOther{{"scene", "0123"}, {"seed", "2"}};
const FrameLayout kLayout({{10, 10}});

class CheckpointFileTest : public testing::Test {
 protected:
  CheckpointFileTest() { std::filesystem::create_directories(folder_); }
  ~CheckpointFileTest() override { std::filesystem::remove_all(folder_); }
  CheckpointFileTest(const CheckpointFileTest&) = delete;
  CheckpointFileTest& operator=(const CheckpointFileTest&) = delete;

  static void write(CheckpointFile& file, std::uint32_t samples, bool asked_for = false,
                    const RunIdentity& identity = kIdentity) {
    Film film(kLayout, {});
    Film::Counters counters;
    counters.samples = samples;
    film.set_counters(counters);
    SampleProgress progress;
    progress.samples = samples;
    file.write(identity, film, progress, asked_for);
  }

  /// The samples of what a resumed run goes on with.
  static std::uint32_t read(CheckpointFile& file) {
    Film film(kLayout, {});
    return file.read(kIdentity, film).samples;
  }

  /// What a run is refused with.
  Error refusal() {
    CheckpointFile file(path_, true);
    try {
      (void)read(file);
    } catch (const Error& error) {
      return error;
    }
    ADD_FAILURE() << "nothing was refused";
    return {ExitCode::Done, ""};
  }

  /// Two generations: of 10 samples and of 20.
  void write_two(bool asked_for = false) {
    CheckpointFile file(path_, true);
    write(file, 10);
    write(file, 20, asked_for);
  }

  static void damage(const std::filesystem::path& path) {
    std::vector<std::byte> bytes = read_file(path, 1 << 20);
    bytes[bytes.size() / 2] ^= std::byte{1};
    write_file_atomically(path, bytes);
  }
  static void cut_short(const std::filesystem::path& path) { std::filesystem::resize_file(path, 30); }

  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator()));
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("hpr-generations-" + std::to_string(::getpid()));
  std::filesystem::path path_ = folder_ / "a.checkpoint";
  std::filesystem::path previous_ = folder_ / "a.checkpoint.previous";
};

TEST_F(CheckpointFileTest, KeepsTheOneBefore) {
  write_two();
  EXPECT_EQ(files(), 2U);
  CheckpointFile file(path_, true);
  EXPECT_EQ(read(file), 20U);
  std::filesystem::rename(previous_, path_);
  EXPECT_EQ(read(file), 10U);
}

TEST_F(CheckpointFileTest, GoesOnFromThePreviousOneWhereTheNewestIsLost) {
  const std::map<std::string, std::function<void(const std::filesystem::path&)>> losses{
      {"missing", [](const std::filesystem::path& path) { std::filesystem::remove(path); }},
      {"empty", [](const std::filesystem::path& path) { std::filesystem::resize_file(path, 0); }},
      {"cut short", cut_short},
      {"damaged", damage}};
  for (const auto& [name, lose] : losses) {
    write_two();
    lose(path_);
    CheckpointFile file(path_, true);
    EXPECT_EQ(read(file), 10U) << name;
    // What replaces it does not take the place of the one that is whole.
    write(file, 11);
    EXPECT_EQ(read(file), 11U) << name;
    lose(path_);
    EXPECT_EQ(read(file), 10U) << name;
  }
}

TEST_F(CheckpointFileTest, ThatNeitherIsWholeIsSaidOfBoth) {
  write_two();
  damage(path_);
  cut_short(previous_);
  const Error error = refusal();
  EXPECT_EQ(error.code(), ExitCode::BadInput);
  EXPECT_EQ(std::string(error.what()),
            path_.string() + ": the checkpoint is damaged; " + previous_.string() + ": the checkpoint is damaged");
  std::filesystem::remove(path_);
  EXPECT_EQ(refusal().code(), ExitCode::BadInput);
  std::filesystem::remove(previous_);
  EXPECT_EQ(refusal().code(), ExitCode::Io);
}

TEST_F(CheckpointFileTest, AnotherRunsIsNoReasonToTakeTheOneBefore) {
  CheckpointFile file(path_, true);
  write(file, 10);
  write(file, 20, false, kOther);
  EXPECT_NE(std::string(refusal().what()).find("seed is 2, not 1"), std::string::npos);
}

TEST_F(CheckpointFileTest, ThePreviousOneOfAnotherRunIsRefusedWithBothReasons) {
  CheckpointFile file(path_, true);
  write(file, 10, false, kOther);
  write(file, 20);
  damage(path_);
  const std::string what = refusal().what();
  EXPECT_NE(what.find("damaged"), std::string::npos) << what;
  EXPECT_NE(what.find("seed is 2, not 1"), std::string::npos) << what;
}

TEST_F(CheckpointFileTest, AFinishedRunLeavesNone) {
  {
    CheckpointFile file(path_, true);
    write(file, 10);
    write(file, 20);
    write(file, 30);
    file.remove_unasked();
    EXPECT_EQ(files(), 0U);
  }
  write_two();
  CheckpointFile resumed(path_, true);
  (void)read(resumed);
  resumed.remove_unasked();
  EXPECT_EQ(files(), 0U);
}

TEST_F(CheckpointFileTest, WhatWasAskedForStays) {
  write_two(true);
  CheckpointFile resumed(path_, true);
  EXPECT_EQ(read(resumed), 20U);
  write(resumed, 30);
  resumed.remove_unasked();
  EXPECT_EQ(files(), 1U);
  EXPECT_EQ(read(resumed), 30U);
}

TEST_F(CheckpointFileTest, AnotherRunsStaysWhereThisOneWroteNone) {
  write_two();
  CheckpointFile(path_, true).remove_unasked();
  EXPECT_EQ(files(), 2U);
}

/// Writes checkpoints of more and more samples until it is killed.
[[noreturn]] void write_for_ever(CheckpointFile& file, std::uint32_t samples) {
  Film film(kLayout, {});
  Film::Counters counters;
  SampleProgress progress;
  for (progress.samples = samples;; ++progress.samples) {
    counters.samples = progress.samples;
    film.set_counters(counters);
    file.write(kIdentity, film, progress, false);
  }
}

TEST_F(CheckpointFileTest, ADeathAtAnyMomentLeavesOneThatIsWhole) {
  write_two();
  std::mt19937 random(9);
  std::uniform_int_distribution<int> microseconds(0, 60'000);
  std::uint32_t before = 20;
  for (int death = 0; death < 40; ++death) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      CheckpointFile file(path_, true);
      write_for_ever(file, read(file) + 1);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(microseconds(random)));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    CheckpointFile file(path_, true);
    std::uint32_t samples = 0;
    ASSERT_NO_THROW(samples = read(file)) << "death " << death;
    EXPECT_GE(samples + 1, before);  // the newest, or the one before it
    before = samples;
  }
  EXPECT_GT(before, 20U);
}

TEST_F(CheckpointFileTest, BothStandWhereASymbolicLinkLeads) {
  std::filesystem::create_directories(folder_ / "elsewhere");
  std::filesystem::create_symlink("elsewhere/state", path_);
  write_two();
  EXPECT_TRUE(std::filesystem::is_symlink(path_));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "elsewhere/state.previous"));
  std::filesystem::remove(folder_ / "elsewhere/state");
  CheckpointFile resumed(path_, true);
  EXPECT_EQ(read(resumed), 10U);
}

}  // namespace
}  // namespace hpr
