#include "core/file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/job_environment.h"

namespace hpr {
namespace {

namespace fs = std::filesystem;

/// A fresh folder, gone after the test.
class FileTest : public testing::Test {
 protected:
  FileTest() {
    std::string name = (fs::temp_directory_path() / "hpr-file-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) ADD_FAILURE() << "no scratch folder";
    folder_ = name;
  }
  ~FileTest() override { fs::remove_all(folder_); }
  FileTest(const FileTest&) = delete;
  FileTest& operator=(const FileTest&) = delete;

  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  [[nodiscard]] fs::path path(const std::string& name) const { return folder_ / name; }

  fs::path folder_;
};

std::string text_of(const fs::path& path) {
  const auto bytes = read_file(path, 1U << 20U);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

template <typename Call>
ExitCode code_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_FALSE(std::string(error.what()).empty());
    EXPECT_FALSE(error.hint().empty());
    return error.code();
  }
  return ExitCode::Done;
}

/// While it lives no file may grow past `bytes`: what a full disk looks like to a program.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : old_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{bytes, old_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit old_{};
  void (*old_handler_)(int);
};

TEST_F(FileTest, WhatIsWrittenIsRead) {
  for (const std::size_t size : {0U, 1U, 4097U}) {
    const std::string text(size, 'x');
    write_file_atomically(path("a"), text);
    EXPECT_EQ(text_of(path("a")), text);
  }
  EXPECT_EQ(files(), 1U);
}

TEST_F(FileTest, NewFilesHaveTheRightsTheUmaskGives) {
  const mode_t old = ::umask(027);
  write_file_atomically(path("a"), "text");
  ::umask(old);
  EXPECT_EQ(fs::status(path("a")).permissions(), fs::perms{0640});
}

TEST_F(FileTest, AWriteThatFailsLeavesTheOldFileAndNothingElse) {
  write_file_atomically(path("a"), "old");
  {
    const FileSizeLimit limit(1000);
    EXPECT_EQ(code_of([&] { write_file_atomically(path("a"), std::string(5000, 'x')); }), ExitCode::Io);
    EXPECT_EQ(code_of([&] { write_file_atomically(path("b"), std::string(5000, 'x')); }), ExitCode::Io);
  }
  EXPECT_EQ(text_of(path("a")), "old");
  EXPECT_EQ(files(), 1U);
}

TEST_F(FileTest, AFileThatIsNotSyncedIsWholeOrUntouchedAsWell) {
  write_file_atomically(path("a"), "old", AtomicFile::Sync::None);
  {
    const FileSizeLimit limit(1000);
    EXPECT_EQ(code_of([&] { write_file_atomically(path("a"), std::string(5000, 'x'), AtomicFile::Sync::None); }),
              ExitCode::Io);
  }
  EXPECT_EQ(text_of(path("a")), "old");
  write_file_atomically(path("a"), "new", AtomicFile::Sync::None);
  EXPECT_EQ(text_of(path("a")), "new");
  EXPECT_EQ(files(), 1U);
}

TEST_F(FileTest, AFileWrittenInPiecesHasItsNameOnceItIsCommitted) {
  write_file_atomically(path("a"), "old");
  const auto put = [](const AtomicFile& file, std::string_view text) {
    EXPECT_EQ(::write(file.descriptor(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  };
  {
    AtomicFile given_up(path("a"));
    put(given_up, "half");
  }
  EXPECT_EQ(files(), 1U);
  EXPECT_EQ(text_of(path("a")), "old");
  AtomicFile moved_from(path("a"));
  put(moved_from, "ne");
  AtomicFile file(std::move(moved_from));
  put(file, "w");
  EXPECT_EQ(text_of(path("a")), "old");
  file.commit();
  EXPECT_EQ(text_of(path("a")), "new");
  EXPECT_EQ(files(), 1U);
}

TEST_F(FileTest, NothingIsLeftOfAProcessThatDiesWhileItWrites) {
  const pid_t child = ::fork();
  if (child == 0) {
    const AtomicFile file(path("a"));
    (void)!::write(file.descriptor(), "half", 4);
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  const int unnamed = ::open(path("").c_str(), O_WRONLY | O_TMPFILE, 0666);
  if (unnamed < 0) GTEST_SKIP() << "the file system has no files without names";
  ::close(unnamed);
  EXPECT_EQ(files(), 0U);
}

TEST_F(FileTest, ANameOfTheGreatestLengthCanBeWritten) {
  const std::string name(255, 'n');
  write_file_atomically(path(name), "text");
  EXPECT_EQ(text_of(path(name)), "text");
}

TEST_F(FileTest, ASymbolicLinkStaysAndItsTargetIsReplaced) {
  write_file_atomically(path("target"), "old");
  fs::create_symlink("target", path("link"));
  write_file_atomically(path("link"), "new");
  EXPECT_TRUE(fs::is_symlink(path("link")));
  EXPECT_EQ(text_of(path("target")), "new");
  fs::create_symlink("later", path("dangling"));
  write_file_atomically(path("dangling"), "made");
  EXPECT_EQ(text_of(path("later")), "made");
}

TEST_F(FileTest, FoldersPipesAndDevicesAreNeitherReadNorReplaced) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  fs::create_directory(path("folder"));
  std::vector<const char*> names{"pipe", "folder"};
  // A device of the test's own: should the code ever replace what it is given, the machine keeps its /dev/null.
  const bool may_make_devices = ::mknod(path("null").c_str(), S_IFCHR | 0600, makedev(1, 3)) == 0;
  if (may_make_devices) names.push_back("null");
  for (const char* name : names) {
    EXPECT_EQ(code_of([&] { (void)read_file(path(name), 100); }), ExitCode::Io) << name;
    EXPECT_EQ(code_of([&] { write_file_atomically(path(name), "text"); }), ExitCode::Io) << name;
    EXPECT_EQ(code_of([&] { check_writable(path(name), true); }), ExitCode::Io) << name;
  }
  EXPECT_TRUE(fs::is_fifo(path("pipe")));
  if (may_make_devices) {
    EXPECT_TRUE(fs::is_character_file(path("null")));
  }
  EXPECT_EQ(files(), names.size());
}

TEST_F(FileTest, MissingFilesAndFoldersAreIoErrors) {
  EXPECT_EQ(code_of([&] { (void)read_file(path("none"), 100); }), ExitCode::Io);
  EXPECT_EQ(code_of([&] { write_file_atomically(path("none/a"), "text"); }), ExitCode::Io);
  EXPECT_EQ(code_of([&] { check_writable(path("none/a"), false); }), ExitCode::Io);
  EXPECT_EQ(code_of([] { write_file_atomically("", "text"); }), ExitCode::Io);
  EXPECT_EQ(code_of([] { check_writable("", true); }), ExitCode::Io);
}

TEST_F(FileTest, AFileIsReadUpToTheLimitAndNotBeyond) {
  write_file_atomically(path("a"), std::string(100, 'x'));
  EXPECT_EQ(read_file(path("a"), 100).size(), 100U);
  EXPECT_EQ(code_of([&] { (void)read_file(path("a"), 99); }), ExitCode::Limit);
}

TEST_F(FileTest, AnExistingFileIsOverwrittenOnlyWhenAsked) {
  EXPECT_EQ(code_of([&] { check_writable(path("a"), false); }), ExitCode::Done);
  write_file_atomically(path("a"), "text");
  EXPECT_EQ(code_of([&] { check_writable(path("a"), false); }), ExitCode::Io);
  EXPECT_EQ(code_of([&] { check_writable(path("a"), true); }), ExitCode::Done);
  EXPECT_EQ(text_of(path("a")), "text");
}

TEST_F(FileTest, FoldersMadeAndLeftEmptyAreRemoved) {
  {
    const EmptyFolders tidy(path("a/b/c/"));
    fs::create_directories(path("a/b/c"));
  }
  EXPECT_EQ(files(), 0U);
  {
    const EmptyFolders tidy(path("a/b/c"));
    fs::create_directories(path("a/b/c"));
    write_file_atomically(path("a/file"), "text");
  }
  EXPECT_TRUE(fs::exists(path("a/file")));
  EXPECT_FALSE(fs::exists(path("a/b")));
  fs::create_directory(path("mine"));
  { const EmptyFolders tidy(path("mine")); }
  { const EmptyFolders tidy(path("never/made")); }
  { const EmptyFolders tidy(""); }
  EXPECT_TRUE(fs::exists(path("mine")));
}

TEST_F(FileTest, AFolderIsHeldByOneAtATime) {
  fs::create_directory(path("results"));
  {
    const FolderLock first(path("results"));
    EXPECT_EQ(code_of([&] { const FolderLock second(path("results")); }), ExitCode::Io);
    const FolderLock other(path("."));
  }
  EXPECT_NO_THROW(const FolderLock again(path("results")));
  EXPECT_EQ(code_of([&] { const FolderLock none(path("none")); }), ExitCode::Io);
}

TEST_F(FileTest, AFolderThatForbidsWritingIsRefusedBeforeTheWork) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  fs::create_directory(path("closed"));
  fs::permissions(path("closed"), fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_EQ(code_of([&] { check_writable(path("closed/a"), true); }), ExitCode::Io);
}

namespace fs = std::filesystem;

/// TMPDIR as it is set while this lives.
class TmpdirSetting {
 public:
  explicit TmpdirSetting(const std::string& value) {
    if (const char* const old = std::getenv("TMPDIR"); old != nullptr) old_ = old;
    ::setenv("TMPDIR", value.c_str(), 1);
  }
  ~TmpdirSetting() { old_ ? ::setenv("TMPDIR", old_->c_str(), 1) : ::unsetenv("TMPDIR"); }
  TmpdirSetting(const TmpdirSetting&) = delete;
  TmpdirSetting& operator=(const TmpdirSetting&) = delete;

 private:
  std::optional<std::string> old_;
};

std::string refusal() {
  try {
    const TemporaryFile file;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
    EXPECT_NE(error.hint().find("set TMPDIR"), std::string::npos) << error.hint();
    return error.what();
  }
  return {};
}

TEST_F(FileTest, WhatKilledWritersLeftIsRemovedAndNothingElse) {
  const fs::path left = path(".hpr-" + host_name() + "-1-0.part");
  const fs::path held = path(".hpr-" + host_name() + "-1-1.part");
  const fs::path other = path(".hpr-" + host_name() + "er-1-0.part");
  const fs::path young = path(".hpr-" + host_name() + "-1-2.part");
  for (const fs::path& each : {left, held, other, young}) std::ofstream(each) << "half";
  for (const fs::path& each : {left, held, other}) {
    fs::last_write_time(each, fs::file_time_type::clock::now() - std::chrono::minutes(5));
  }
  const int lock = ::open(held.c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_EQ(::flock(lock, LOCK_EX | LOCK_NB), 0);
  check_writable(path("result"), false);
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(held));
  EXPECT_TRUE(fs::exists(other));
  EXPECT_TRUE(fs::exists(young));
  ::close(lock);
  { const FolderLock folder(folder_); }
  EXPECT_FALSE(fs::exists(held));
}

TEST_F(FileTest, AFileThatIsBeingWrittenIsLocked) {
  const AtomicFile file(path("a"));
  const int again = ::open(("/proc/self/fd/" + std::to_string(file.descriptor())).c_str(), O_WRONLY | O_CLOEXEC);
  ASSERT_GE(again, 0);
  EXPECT_NE(::flock(again, LOCK_EX | LOCK_NB), 0);
  ::close(again);
}

TEST(TemporaryFile, HasNoNameAndGoesWithItsOwner) {
  std::string name = (temporary_folder() / "hpr-temporary-test-XXXXXX").string();
  ASSERT_NE(::mkdtemp(name.data()), nullptr);
  const TmpdirSetting setting(name);
  fs::path path;
  {
    TemporaryFile made;
    const TemporaryFile file(std::move(made));
    path = file.path();
    std::ofstream(path) << "text";
    std::string text;
    std::ifstream(path) >> text;
    EXPECT_EQ(text, "text");
    EXPECT_TRUE(fs::is_empty(name));
    EXPECT_EQ(fs::status(path).permissions(), fs::perms{0600});
    EXPECT_EQ(fs::read_symlink(path).parent_path(), fs::canonical(name));
  }
  EXPECT_FALSE(fs::exists(path));
  fs::remove_all(name);
}

TEST_F(FileTest, ATreeIsRemovedWithoutWhatItsLinksName) {
  const fs::path tree = folder_ / "tree";
  fs::create_directories(tree / "inner/empty");
  std::ofstream(folder_ / "kept") << "kept";
  std::ofstream(tree / "inner/file") << "gone";
  fs::create_symlink("../kept", tree / "link");
  fs::create_directory_symlink("..", tree / "folder link");
  std::vector<fs::path> entries = entries_of(tree);
  std::ranges::sort(entries);
  EXPECT_EQ(entries, (std::vector<fs::path>{tree / "folder link", tree / "inner", tree / "link"}));

  remove_tree(tree);
  EXPECT_EQ(entries_of(folder_), std::vector<fs::path>{folder_ / "kept"});
  remove_tree(tree);
  EXPECT_TRUE(entries_of(tree).empty());
}

TEST(TemporaryFile, AFolderThatCannotBeWrittenIsNamedWithItsVariable) {
  for (const std::string folder : {"/nonexistent/folder", "/dev/null"}) {
    const TmpdirSetting setting(folder);
    EXPECT_EQ(temporary_folder(), folder);
    const std::string said = refusal();
    EXPECT_NE(said.find("'" + folder + "', which TMPDIR names"), std::string::npos) << said;
  }
}

TEST(TemporaryFolder, IsTheUsualOneWhereNobodyNamesAnother) {
  const TmpdirSetting setting("");
  EXPECT_EQ(temporary_folder(), "/tmp");
}

}  // namespace

}  // namespace hpr
