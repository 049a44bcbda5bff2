#include "core/job_board.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <thread>

#include "core/job_environment.h"
#include "core/parallel.h"
#include "core/timing.h"

namespace hpr {
namespace {

/// Runs `reports` in a process that was told of the board, as ranks are.
void in_rank(const JobBoard& board, const std::string& address, int rank, const std::function<void()>& reports) {
  ASSERT_FALSE(board.address().empty());
  const pid_t child = ::fork();
  if (child == 0) {
    ::setenv(JobBoard::kVariable, address.c_str(), 1);  // NOLINT(concurrency-mt-unsafe): one thread
    join_job_board(rank);
    reports();
    ::_exit(::testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST(JobBoardTest, TellsWhatRanksReport) {
  const JobBoard board(2);
  EXPECT_FALSE(board.read(1));
  in_rank(board, board.address(), 1, [] {
    report_frame(57);
    report_stall_limit(std::chrono::seconds(10));
    const trace::Span outer("frame");
    { const trace::Span inner("raster"); }
    const trace::Span inner("composite");
    report_wait(0);
    ::_exit(0);
  });
  EXPECT_FALSE(board.read(0));
  const auto report = board.read(1);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->host, host_name());
  EXPECT_GT(report->process, 0);
  EXPECT_EQ(report->stall_limit, std::chrono::seconds(10));
  EXPECT_GT(report->steps, 0U);
  EXPECT_EQ(describe(1, *report), "rank 1 on " + host_name() + ": composite of frame 57, waiting for rank 0");
}

TEST(JobBoardTest, TellsOfAWaitAsLongAsItLasts) {
  const JobBoard board(1);
  in_rank(board, board.address(), 0, [&] {
    const trace::Span span("composite");
    {
      const WaitReport wait(kOtherRanks);
      EXPECT_EQ(describe(0, *board.read(0)), "rank 0 on " + host_name() + ": composite, waiting for other ranks");
    }
    EXPECT_EQ(describe(0, *board.read(0)), "rank 0 on " + host_name() + ": composite");
  });
}

TEST(JobBoardTest, EachPartOfWorkThatManyThreadsShareIsAStep) {
  const JobBoard board(1);
  in_rank(board, board.address(), 0, [] {
    parallel_for(3, 100, [](std::size_t /*part*/) {});
    ::_exit(0);
  });
  EXPECT_GE(board.read(0)->steps, 100U);
}

TEST(JobBoardTest, AnEndedSpanGivesWayToTheOneAround) {
  const JobBoard board(1);
  in_rank(board, board.address(), 0, [] {
    const trace::Span outer("frame");
    { const trace::Span inner("raster"); }
    ::_exit(0);
  });
  EXPECT_EQ(board.read(0)->phase, "frame");
  EXPECT_EQ(board.read(0)->frame, std::nullopt);
}

TEST(JobBoardTest, OtherThreadsTellOnlyThatTheyGetOn) {
  const JobBoard board(1);
  in_rank(board, board.address(), 0, [] {
    const trace::Span outer("light");
    std::jthread([] { const trace::Span tile("light tile"); }).join();
    ::_exit(0);
  });
  EXPECT_EQ(board.read(0)->phase, "light");
  EXPECT_EQ(board.read(0)->steps, 2U);
}

TEST(JobBoardTest, IsNotReadOnAnotherHost) {
  const JobBoard board(1);
  const std::string path = board.address().substr(board.address().find(':'));
  in_rank(board, "elsewhere" + path, 0, [] { report_frame(3); });
  EXPECT_FALSE(board.read(0));
}

TEST(JobBoardTest, AnErrorOfSeveralRanksIsPrintedByOne) {
  EXPECT_TRUE(claim_error("of no job"));
  const JobBoard board(2);
  for (const bool first : {true, false}) {
    in_rank(board, board.address(), first ? 0 : 1, [&] { EXPECT_EQ(claim_error("the same"), first); });
  }
  in_rank(board, board.address(), 1, [] { EXPECT_TRUE(claim_error("another")); });
}

TEST(JobBoardTest, HasNoSlotForARankTooMany) {
  const JobBoard board(1);
  in_rank(board, board.address(), 1, [] { report_frame(3); });
  EXPECT_FALSE(board.read(0));
}

}  // namespace
}  // namespace hpr
