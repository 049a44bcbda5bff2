#include "app/launch/job_folder.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <string>

#include "core/file.h"

namespace hpr {
namespace {

constexpr const char* kShared = "/dev/shm";

/// Those of this user, of jobs anywhere.
std::set<std::filesystem::path> folders_in(const std::filesystem::path& parent) {
  std::set<std::filesystem::path> found;
  const std::string prefix = "hpr-job-" + std::to_string(::geteuid()) + "-";
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(parent, error)) {
    if (entry.path().filename().string().starts_with(prefix)) found.insert(entry.path());
  }
  return found;
}

class JobFolderTest : public testing::Test {
 protected:
  JobFolderTest() {
    if (const char* const before = std::getenv("TMPDIR")) before_ = before;
    std::string name = (temporary_folder() / "hpr-job-folder-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) ADD_FAILURE() << "no scratch folder";
    scratch_ = name;
    ::setenv("TMPDIR", scratch_.c_str(), 1);
  }
  ~JobFolderTest() override {
    before_ ? ::setenv("TMPDIR", before_->c_str(), 1) : ::unsetenv("TMPDIR");
    std::filesystem::remove_all(scratch_);
  }
  JobFolderTest(const JobFolderTest&) = delete;
  JobFolderTest& operator=(const JobFolderTest&) = delete;

  std::filesystem::path scratch_;
  std::optional<std::string> before_;
};

/// What a launcher that is killed leaves behind: `then` is run by it before.
template <typename Then>
void die_with_a_folder(Then then) {
  const pid_t child = ::fork();
  if (child == 0) {
    const JobFolder folder;
    then();
    ::raise(SIGKILL);
  }
  ::waitpid(child, nullptr, 0);
}

TEST_F(JobFolderTest, GoesWithItsOwner) {
  {
    const JobFolder folder;
    EXPECT_EQ(folders_in(scratch_).size(), 1U);
  }
  EXPECT_TRUE(folders_in(scratch_).empty());
}

TEST_F(JobFolderTest, ThatOfADeadLauncherGoesAtTheNextStart) {
  die_with_a_folder([&] {
    std::filesystem::create_directories(*folders_in(scratch_).begin() / "ompi.host.0/pid.1");
    std::ofstream(*folders_in(scratch_).begin() / "ompi.host.0/pid.1/contact.txt") << "left";
  });
  const auto left = folders_in(scratch_);
  ASSERT_EQ(left.size(), 1U);
  const JobFolder folder;
  EXPECT_EQ(folders_in(scratch_).size(), 1U);
  EXPECT_NE(folders_in(scratch_), left);
}

TEST_F(JobFolderTest, ThatOfALivingOneStays) {
  const JobFolder first;
  const auto living = folders_in(scratch_);
  std::filesystem::create_directory(scratch_ / "hpr-job-other");
  std::ofstream(scratch_ / ("hpr-job-" + std::to_string(::geteuid()) + "-file")) << "no folder";
  {
    const JobFolder second;
    EXPECT_TRUE(std::filesystem::exists(*living.begin()));
  }
  EXPECT_TRUE(std::filesystem::exists(*living.begin()));
  EXPECT_TRUE(std::filesystem::exists(scratch_ / "hpr-job-other"));
}

/// The launcher is killed, and what it started still runs.
TEST_F(JobFolderTest, ThatOfAJobWhoseLauncherDiedStaysWhileItRuns) {
  std::array<int, 2> running{};
  ASSERT_EQ(::pipe(running.data()), 0);
  const pid_t launcher = ::fork();
  if (launcher == 0) {
    const JobFolder folder;
    if (::fork() == 0) {
      folder.pass_on();
      ::dup2(running[0], STDIN_FILENO);
      ::close(running[1]);
      ::execlp("cat", "cat", nullptr);
      ::_exit(127);
    }
    ::raise(SIGKILL);
  }
  ::waitpid(launcher, nullptr, 0);
  ::close(running[0]);
  const auto left = folders_in(scratch_);
  ASSERT_EQ(left.size(), 1U);
  { const JobFolder next; }
  EXPECT_EQ(folders_in(scratch_), left);
  ::close(running[1]);  // it ends
  for (int i = 0; i < 500 && folders_in(scratch_) == left; ++i) {
    ::usleep(10'000);
    const JobFolder next;
  }
  EXPECT_TRUE(folders_in(scratch_).empty());
}

TEST_F(JobFolderTest, WhatTheUserNamedStays) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::setenv("OMPI_MCA_orte_tmpdir_base", "/elsewhere", 1);
    const JobFolder folder;
    folder.pass_on();
    const bool stays = std::string(::getenv("OMPI_MCA_orte_tmpdir_base")) == "/elsewhere";
    const char* const shared = ::getenv("OMPI_MCA_btl_vader_backing_directory");
    ::_exit(stays && shared != nullptr && std::string(shared).starts_with(kShared) ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}

}  // namespace
}  // namespace hpr
