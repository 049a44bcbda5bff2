#include "engine/frame_retry.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <new>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"

namespace hpr {
namespace {

constexpr std::chrono::seconds kLimit{20};

/// Draws a frame on `ranks` ranks; `draw` is called with the rank and how often it was called before. Returns rank 0's
/// failure and counts all calls.
std::optional<Error> draw_on(int ranks, std::atomic<int>& calls, const std::function<void(Communicator&, int)>& draw) {
  std::optional<Error> failure;
  run_local_ranks(
      ranks,
      [&](Communicator& comm) {
        int before = 0;
        const std::optional<Error> mine = draw_with_retry(comm, "frame 57", [&] {
          ++calls;
          draw(comm, before++);
        });
        if (comm.rank() == 0) failure = mine;
        barrier(comm);
      },
      kLimit);
  return failure;
}

TEST(FrameRetry, AFrameThatFailsOnOneRankIsDrawnOnceMoreByAll) {
  for (const int ranks : {1, 2, 3}) {
    std::atomic<int> calls = 0;
    testing::internal::CaptureStderr();
    const auto failure = draw_on(ranks, calls, [&](Communicator& comm, int before) {
      agree_on_failure(comm, [&] {
        if (before == 0 && comm.rank() == ranks - 1) throw Error(ExitCode::Limit, "OpenGL ran out of memory");
      });
    });
    EXPECT_FALSE(failure);
    EXPECT_EQ(calls, 2 * ranks);
    const std::string warnings = testing::internal::GetCapturedStderr();
    EXPECT_NE(warnings.find("frame 57: OpenGL ran out of memory; drawing it once more"), std::string::npos) << warnings;
    EXPECT_EQ(std::ranges::count(warnings, '\n'), 1) << warnings;
  }
}

TEST(FrameRetry, AFrameThatFailsTwiceHasFailed) {
  for (const ExitCode code : {ExitCode::Internal, ExitCode::NoDevice, ExitCode::Limit, ExitCode::CheckFailed}) {
    std::atomic<int> calls = 0;
    const auto failure = draw_on(
        2, calls, [&](Communicator& comm, int) { agree_on_failure(comm, [&] { throw Error(code, "no", "a hint"); }); });
    ASSERT_TRUE(failure);
    EXPECT_EQ(failure->code(), code);
    EXPECT_EQ(failure->hint(), "a hint");
    EXPECT_EQ(calls, 4);
  }
}

TEST(FrameRetry, ErrorsOfTheMachineOrTheUserEndTheRunAtOnce) {
  for (const ExitCode code : {ExitCode::Lost, ExitCode::Hang, ExitCode::Io, ExitCode::Usage, ExitCode::BadInput}) {
    std::atomic<int> calls = 0;
    const auto draw = [&](Communicator& comm, int) { agree_on_failure(comm, [&] { throw Error(code, "no"); }); };
    EXPECT_THROW((void)draw_on(2, calls, draw), Error);
    EXPECT_EQ(calls, 2);
  }
}

TEST(FrameRetry, AnErrorOfOneRankThatOthersDoNotKnowOfEndsTheRunAndHangsNobody) {
  std::atomic<int> calls = 0;
  const auto draw = [](Communicator& comm, int) {
    if (comm.rank() == 1) throw Error(ExitCode::Limit, "rank 1 alone");
    (void)comm.receive(1);
  };
  try {
    (void)draw_on(3, calls, draw);
    ADD_FAILURE() << "the frame was drawn";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "rank 1 alone");
  }
  EXPECT_EQ(calls, 3);
}

TEST(FrameRetry, ASingleRankTakesWhateverFailed) {
  std::atomic<int> calls = 0;
  const auto failure = draw_on(1, calls, [](Communicator&, int) { throw std::bad_alloc(); });
  ASSERT_TRUE(failure);
  EXPECT_EQ(failure->code(), ExitCode::Limit);
  EXPECT_EQ(calls, 2);
}

TEST(FailedFrames, AreCountedAndTheFirstOnesNamed) {
  FailedFrames failed;
  failed.add_failed(57);
  EXPECT_EQ(failed.describe(), "1 frame failed: 57");
  failed.add_failed(58);
  EXPECT_EQ(failed.in_a_row(), 2);
  failed.add_drawn();
  EXPECT_EQ(failed.in_a_row(), 0);
  EXPECT_EQ(failed.count(), 2U);
  for (std::uint64_t frame = 60; frame < 70; ++frame) failed.add_failed(frame);
  EXPECT_EQ(failed.describe(), "12 frames failed: 57, 58, 60, 61, 62, 63, 64, 65, 66, 67 and 2 more");
}

}  // namespace
}  // namespace hpr
