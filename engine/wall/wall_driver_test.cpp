#include "engine/wall/wall_driver.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <functional>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/job_board.h"
#include "engine/settings_table.h"
#include "scene/load_scene.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Throws in place of the next `failures` exchanges: the one by which a single rank brings a frame to its screens.
class FailingCommunicator final : public ForwardingCommunicator {
 public:
  using ForwardingCommunicator::ForwardingCommunicator;

  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override {
    if (failures > 0) {
      --failures;
      throw Error(code, "out of memory");
    }
    ForwardingCommunicator::exchange(out, from, arrived);
  }

  int failures = 0;
  ExitCode code = ExitCode::Limit;
};

/// Runs `body` with the driver of a wall of two screens, whose frames differ by their noise.
void drive_wall(const std::function<void(WallDriver&, FailingCommunicator&)>& body) {
  run_local_ranks(
      1,
      [&](Communicator& comm) {
        FailingCommunicator failing(comm);
        WallJob job;
        job.wall = load_wall("2x1@64x48");
        set_setting(job.settings, "quality", "draft");
        job.display = &find_display("none");
        job.frames = 100;
        Session session(failing, {.threads = 1}, [] { return load_scene("gen:cornell"); });
        WallDriver driver(job, session);
        body(driver, failing);
      },
      std::chrono::seconds(20));
}

void draw(WallDriver& driver, std::uint64_t frame) {
  Progress progress("none", "sample", 1);
  EXPECT_TRUE(driver.draw(frame, progress));
}

TEST(WallDriver, AFrameThatFailsOnceIsDrawnAgain) {
  std::vector<std::vector<std::uint64_t>> hashes;
  for (const int failures : {0, 1}) {
    drive_wall([&](WallDriver& driver, FailingCommunicator& comm) {
      comm.failures = failures;
      draw(driver, 0);
      EXPECT_EQ(driver.failed().count(), 0U);
      const FrameRecord& frame = driver.manifest().frames.back();
      EXPECT_EQ(frame.failed, "");
      EXPECT_EQ(frame.screens[0].state, ScreenState::Fresh);
      hashes.push_back({frame.screens[0].xxh64, frame.screens[1].xxh64});
    });
  }
  EXPECT_EQ(hashes.at(0), hashes.at(1));
}

TEST(WallDriver, AFrameThatFailsTwiceKeepsThePicturesAndTheRunGoesOn) {
  drive_wall([](WallDriver& driver, FailingCommunicator& comm) {
    draw(driver, 0);
    comm.failures = 2;
    draw(driver, 1);
    draw(driver, 2);
    const std::vector<FrameRecord>& frames = driver.manifest().frames;
    ASSERT_EQ(frames.size(), 3U);
    EXPECT_EQ(frames[1].failed, "out of memory");
    EXPECT_EQ(frames[2].failed, "");
    for (std::size_t screen = 0; screen < 2; ++screen) {
      EXPECT_EQ(frames[1].screens[screen].state, ScreenState::Stale);
      EXPECT_EQ(frames[1].screens[screen].xxh64, frames[0].screens[screen].xxh64);
      EXPECT_EQ(frames[2].screens[screen].state, ScreenState::Fresh);
    }
    EXPECT_NE(frames[2].screens[0].xxh64, frames[0].screens[0].xxh64);
    EXPECT_EQ(driver.failed().describe(), "1 frame failed: 1");
  });
}

TEST(WallDriver, AFirstFrameThatFailsEndsTheRunAsThereIsNoPictureToKeep) {
  const auto run = [] {
    drive_wall([](WallDriver& driver, FailingCommunicator& comm) {
      comm.failures = 2;
      draw(driver, 0);
    });
  };
  try {
    run();
    ADD_FAILURE() << "the run goes on";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit);
  }
}

TEST(WallDriver, TenFramesThatFailInARowEndTheRunAndNineDoNot) {
  drive_wall([](WallDriver& driver, FailingCommunicator& comm) {
    std::uint64_t frame = 0;
    const auto fail = [&](int count) {
      for (int i = 0; i < count; ++i) {
        comm.failures = 2;
        draw(driver, frame++);
      }
    };
    draw(driver, frame++);
    fail(9);
    draw(driver, frame++);
    fail(9);
    EXPECT_EQ(driver.manifest().frames.size(), 20U);
    EXPECT_THROW(fail(1), Error);
  });
}

TEST(WallDriver, FramesHaveToComeAndResultsMayTakeTheirTime) {
  const JobBoard board(1);
  ASSERT_EQ(::setenv(JobBoard::kVariable, board.address().c_str(), 1), 0);
  join_job_board(0);
  ::unsetenv(JobBoard::kVariable);
  drive_wall([&](WallDriver& driver, FailingCommunicator&) {
    EXPECT_EQ(board.read(0)->stall_limit, std::chrono::seconds(0)) << "before there is a frame to compare with";
    draw(driver, 7);
    EXPECT_GE(board.read(0)->stall_limit, std::chrono::seconds(10));
    EXPECT_EQ(board.read(0)->frame, 7U);
    EXPECT_TRUE(driver.finish());
    EXPECT_EQ(board.read(0)->stall_limit, std::chrono::seconds(0));
  });
}

TEST(WallDriver, AFullDiskIsNotAboutAFrame) {
  drive_wall([](WallDriver& driver, FailingCommunicator& comm) {
    draw(driver, 0);
    comm.code = ExitCode::Io;
    comm.failures = 1;
    EXPECT_THROW(draw(driver, 1), Error);
    EXPECT_EQ(driver.manifest().frames.size(), 1U);
  });
}

}  // namespace
}  // namespace hpr
