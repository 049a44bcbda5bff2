#include "walls/manifest/run_journal.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "core/job_environment.h"

namespace hpr {
namespace {

TEST(RunJournal, KeepsFramesAndRestartsInOrder) {
  RunJournal journal;
  journal.add_frame(R"({"frame":0})");
  journal.add_frame(R"({"frame":1})");
  journal.add_restart("rank 1 was killed");
  journal.add_frame(R"({"frame":2})");
  const auto entries = journal.read();
  EXPECT_EQ(entries.frames, (std::vector<std::string>{R"({"frame":0})", R"({"frame":1})", R"({"frame":2})"}));
  EXPECT_FALSE(entries.ended);
  EXPECT_EQ(entries.secret.size(), 32U);
  EXPECT_EQ(journal.read().secret, entries.secret);
  EXPECT_NE(RunJournal().read().secret, entries.secret);
  EXPECT_EQ(entries.begun, 0U);
  journal.add_begin();
  EXPECT_EQ(journal.read().begun, 1U);
  journal.add_end();
  EXPECT_TRUE(journal.read().ended);
  EXPECT_EQ(journal.read().frames.size(), 3U);
  ASSERT_EQ(entries.restarts.size(), 1U);
  EXPECT_EQ(entries.restarts[0], R"({"frame":2,"why":"rank 1 was killed"})");
}

TEST(RunJournal, ALineThatWasCutShortIsNoFrame) {
  RunJournal journal;
  journal.add_frame(R"({"frame":0})");
  std::ofstream(journal.path(), std::ios::app) << R"(frame {"frame":)";
  EXPECT_EQ(journal.read().frames.size(), 1U);
  journal.add_restart("killed while it wrote");
  journal.add_frame(R"({"frame":1})");
  EXPECT_EQ(journal.read().frames.size(), 2U);
  EXPECT_EQ(journal.read().restarts.size(), 1U);
}

TEST(RunJournal, ReachesJobsThroughTheEnvironmentAndGoesWithItsOwner) {
  std::filesystem::path path;
  {
    RunJournal journal;
    path = journal.path();
    ASSERT_EQ(::setenv(RunJournal::kVariable, path.c_str(), 1), 0);
    EXPECT_FALSE(RunJournal::of_supervisor()) << "of a process that was not launched by one";
    ASSERT_EQ(::setenv(kLoneRankVariable, std::to_string(::getppid()).c_str(), 1), 0);
    auto of_job = RunJournal::of_supervisor();
    ASSERT_TRUE(of_job);
    of_job->add_frame("{}");
    EXPECT_EQ(journal.read().frames.size(), 1U);
    ::unsetenv(RunJournal::kVariable);
    ::unsetenv(kLoneRankVariable);
    EXPECT_FALSE(RunJournal::of_supervisor());
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace hpr
