#include "core/progress.h"

#include <gtest/gtest.h>

#include <functional>

namespace hpr {
namespace {

using namespace std::chrono_literals;

/// What is written to stderr, which is no terminal meanwhile.
std::string said(const std::function<void()>& speak) {
  testing::internal::CaptureStderr();
  speak();
  return testing::internal::GetCapturedStderr();
}

void three_steps(Progress& progress) {
  for (const char* const detail : {"a", "bb", "c"}) progress.step(detail);
}

TEST(Progress, ALogIsWrittenInLinesAndOnlySoOften) {
  EXPECT_EQ(said([] {
              Progress progress("auto", "frame", 9, Progress::Pace{0s, 0s});
              three_steps(progress);
            }),
            "hpr: frame 1/9 a\nhpr: frame 2/9 bb\nhpr: frame 3/9 c\n");
  EXPECT_EQ(said([] {
              Progress progress("auto", "frame", 0, Progress::Pace{0s, 1h});
              three_steps(progress);
            }),
            "");
}

TEST(Progress, WithoutAPaceALogGetsNothing) {
  EXPECT_EQ(said([] {
              Progress progress("auto", "frame", 9);
              three_steps(progress);
            }),
            "");
}

TEST(Progress, ABarIsDrawnFirstAndLastAndInBetweenOnlySoOften) {
  const std::string bar = said([] {
    Progress progress("bar", "frame", 3, Progress::Pace{1h, 1h});
    three_steps(progress);
  });
  EXPECT_NE(bar.find("1/3 a"), std::string::npos);
  EXPECT_EQ(bar.find("2/3 bb"), std::string::npos);
  EXPECT_NE(bar.find("3/3 c"), std::string::npos);
  EXPECT_TRUE(bar.ends_with("\n"));
}

TEST(Progress, AShorterLineWipesOutALongerOne) {
  const std::string bar = said([] {
    Progress progress("bar", "frame", 0, Progress::Pace{0s, 0s});
    progress.step("a long line");
    progress.step("short");
  });
  EXPECT_EQ(bar, "\rframe 1 a long line\rframe 2 short      \n");
}

TEST(Progress, IsDueWhereAStepWouldBeReported) {
  Progress silent("none", "frame", 2);
  EXPECT_FALSE(silent.due(1));
  Progress lines("line", "frame", 2);
  EXPECT_TRUE(lines.due(1));
  Progress log("auto", "frame", 2, Progress::Pace{0s, 1h});
  EXPECT_FALSE(log.due(1));
}

}  // namespace
}  // namespace hpr
