#include "engine/wall/wall_driver.h"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "core/bytes.h"
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
void drive_wall(const std::function<void(WallDriver&, FailingCommunicator&)>& body,
                const DisplayKind& display = find_display("none")) {
  run_local_ranks(
      1,
      [&](Communicator& comm) {
        FailingCommunicator failing(comm);
        WallJob job;
        job.wall = load_wall("2x1@64x48");
        set_setting(job.settings, "quality", "draft");
        job.display = &display;
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

/// What the displays below have shown, and what they are to do.
struct Shown {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::uint64_t> frames;
  std::vector<std::uint64_t> hashes;            ///< of screen 0
  std::uint64_t held_back = ~std::uint64_t{0};  ///< a frame that is not shown before may_go_on
  bool may_go_on = false;
  bool was_held_back = false;
  std::uint64_t failing = ~std::uint64_t{0};  ///< a frame that cannot be shown
  bool finished = false;
};

Shown& shown() {
  static Shown shown;
  return shown;
}

class NotingDisplay final : public Display {
 public:
  [[nodiscard]] std::string_view name() const override { return "noting"; }
  void show(const WallFrame& frame) override {
    Shown& into = shown();
    std::unique_lock lock(into.mutex);
    if (frame.number == into.held_back) {
      into.was_held_back = into.changed.wait_for(lock, std::chrono::seconds(10), [&] { return into.may_go_on; });
    }
    if (frame.number == into.failing) throw Error(ExitCode::Io, "the disk is full");
    into.frames.push_back(frame.number);
    into.hashes.push_back(xxh64(std::as_bytes(frame.screens[0].image.pixels())));
    costs_ = {{0, 1.0, 100 + frame.number}};
  }
  [[nodiscard]] std::vector<ScreenCost> costs() const override { return costs_; }
  void finish() override { shown().finished = true; }

 private:
  std::vector<ScreenCost> costs_;
};

DisplayKind noting_display(bool on_any_thread) {
  Shown& fresh = shown();
  const std::lock_guard lock(fresh.mutex);
  fresh.frames.clear();
  fresh.hashes.clear();
  fresh.held_back = fresh.failing = ~std::uint64_t{0};
  fresh.may_go_on = fresh.was_held_back = fresh.finished = false;
  DisplayKind kind = find_display("none");
  kind.shows_on_any_thread = on_any_thread;
  kind.make = [](const Wall&, const DisplayOptions&) -> std::unique_ptr<Display> {
    return std::make_unique<NotingDisplay>();
  };
  return kind;
}

TEST(WallDriver, FramesShownWhileTheNextIsDrawnAreTheSameInTheSameOrder) {
  for (const bool on_any_thread : {false, true}) {
    const DisplayKind kind = noting_display(on_any_thread);
    drive_wall(
        [](WallDriver& driver, FailingCommunicator& comm) {
          for (std::uint64_t frame = 0; frame < 5; ++frame) {
            if (frame == 3) comm.failures = 2;  // shows frame 2 again
            draw(driver, frame);
          }
          EXPECT_TRUE(driver.finish());
          EXPECT_TRUE(shown().finished);
          EXPECT_EQ(shown().frames, (std::vector<std::uint64_t>{0, 1, 2, 3, 4}));
          ASSERT_EQ(driver.manifest().frames.size(), 5U);
          for (std::size_t i = 0; i < 5; ++i) {
            const ScreenRecord& screen = driver.manifest().frames[i].screens[0];
            EXPECT_EQ(screen.xxh64, shown().hashes.at(i)) << i;
            EXPECT_EQ(screen.bytes, 100 + i) << "what showing a frame took belongs to that frame";
          }
          EXPECT_EQ(shown().hashes[3], shown().hashes[2]);
          EXPECT_NE(shown().hashes[4], shown().hashes[2]);
          EXPECT_FALSE(driver.collect_pictures()[0].pixels().empty());
        },
        kind);
  }
}

TEST(WallDriver, ANextFrameIsDrawnWhileOneIsShownButNotShownBeforeIt) {
  const DisplayKind kind = noting_display(true);
  drive_wall(
      [](WallDriver& driver, FailingCommunicator&) {
        shown().held_back = 0;
        draw(driver, 0);
        EXPECT_EQ(driver.frames().times().samples, 1) << "it was drawn";
        {
          const std::lock_guard lock(shown().mutex);
          EXPECT_TRUE(shown().frames.empty()) << "draw() has returned, and it is not shown yet";
        }
        std::jthread later([] {
          std::this_thread::sleep_for(std::chrono::milliseconds(100));
          const std::lock_guard lock(shown().mutex);
          shown().may_go_on = true;
          shown().changed.notify_all();
        });
        draw(driver, 1);
        EXPECT_TRUE(driver.finish());
        EXPECT_TRUE(shown().was_held_back);
        EXPECT_EQ(shown().frames, (std::vector<std::uint64_t>{0, 1}));
        for (std::size_t i = 0; i < 2; ++i) {
          EXPECT_EQ(driver.manifest().frames[i].screens[0].xxh64, shown().hashes.at(i)) << "it keeps its pictures";
        }
      },
      kind);
}

TEST(WallDriver, AFrameThatCannotBeShownEndsTheRunWhenTheNextIsDrawnOrAtTheEnd) {
  for (const std::uint64_t failing : {1U, 2U}) {
    const DisplayKind kind = noting_display(true);
    try {
      drive_wall(
          [&](WallDriver& driver, FailingCommunicator&) {
            shown().failing = failing;
            draw(driver, 0);
            draw(driver, 1);
            if (failing == 1) {
              Progress progress("none", "sample", 1);
              (void)driver.draw(2, progress);
              ADD_FAILURE() << "the run goes on";
            }
            draw(driver, 2);
            (void)driver.finish();
            ADD_FAILURE() << "the last frame is lost";
          },
          kind);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Io) << failing;
    }
    EXPECT_FALSE(shown().finished) << "what is shown is not complete";
  }
}

}  // namespace
}  // namespace hpr
