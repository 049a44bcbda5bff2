#include "core/file.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/file_bytes.h"
#include "core/job_environment.h"
#include "core/text.h"

namespace hpr {
namespace {

/// A POSIX file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int get() const { return fd_; }

 private:
  int fd_;
};

ExitCode code_of(int error) {
  return error == ENOMEM ? ExitCode::Limit : ExitCode::Io;
}

[[noreturn]] void fail(std::string_view doing, const std::filesystem::path& path, int error) {
  const std::string reason = std::generic_category().message(error);
  throw Error(code_of(error), fmt::format("{} '{}': {}", doing, printable(path.string(), 300), reason),
              file_error_hint(error));
}

void write_all(int file, std::span<const std::byte> bytes, const std::filesystem::path& path) {
  constexpr std::size_t kMaxBytes = std::size_t{1} << 30;
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), std::min(bytes.size(), kMaxBytes));
    if (written < 0) {
      if (errno == EINTR) continue;
      fail("cannot write", path, errno);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

std::filesystem::path folder_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

constexpr std::string_view kPartPrefix = ".hpr-";
constexpr std::string_view kPartSuffix = ".part";

/// Of this host: locks may not reach others.
std::string part_prefix() {
  return fmt::format("{}{:.64}-", kPartPrefix, host_name());
}

/// Calls `make` with one name after the other in `folder` until it does not fail for the name being taken; returns what
/// it did, and the name. Names are short whatever the final one is, so that none the file system allows is too long.
template <typename Make>
int with_temporary_name(const std::filesystem::path& folder, std::string& name, const Make& make) {
  constexpr int kTries = 10000;  // each one is a file that a killed run left behind
  int result = -1;
  for (int i = 0; i < kTries; ++i) {
    name = (folder / fmt::format("{}{}-{}{}", part_prefix(), ::getpid(), i, kPartSuffix)).string();
    result = make(name.c_str());
    if (result >= 0 || errno != EEXIST) break;
  }
  return result;
}

/// The path from which an open file without a name can be linked.
std::string link_of(int file) {
  return fmt::format("/proc/self/fd/{}", file);
}

/// Creates a file without a name, which vanishes with the process; -1 where the file system has none.
int create_unnamed(const std::filesystem::path& folder) {
  const int file = ::open(folder.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
  if (file < 0 || ::access(link_of(file).c_str(), F_OK) == 0) return file;
  ::close(file);
  return -1;
}

int create_named(const std::filesystem::path& folder, std::string& name, int access, mode_t mode) {
  return with_temporary_name(
      folder, name, [&](const char* path) { return ::open(path, access | O_CREAT | O_EXCL | O_CLOEXEC, mode); });
}

constexpr const char* kTemporaryVariable = "TMPDIR";

/// None where it is not set, or empty.
const char* named_folder() {
  const char* const folder =
      std::getenv(kTemporaryVariable);  // NOLINT(concurrency-mt-unsafe): nobody writes the environment
  return folder != nullptr && *folder != '\0' ? folder : nullptr;
}

int create_in(const std::filesystem::path& folder) {
  int file = ::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
  if (file >= 0) return file;
  // Not every file system has files that never had a name.
  std::string name = (folder / "hpr-XXXXXX").string();
  file = ::mkostemp(name.data(), O_CLOEXEC);
  if (file >= 0) ::unlink(name.c_str());
  return file;
}

std::string environment(const char* name) {
  const char* const value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): nothing sets variables
  return value == nullptr ? std::string() : std::string(value);
}

std::filesystem::path chosen_folder() {
  if (const std::string own = environment("HPR_CACHE"); !own.empty()) return own;
  if (const std::string shared = environment("XDG_CACHE_HOME"); !shared.empty()) {
    return std::filesystem::path(shared) / "hpr";
  }
  if (const std::string home = environment("HOME"); !home.empty())
    return std::filesystem::path(home) / ".cache" / "hpr";
  throw Error(ExitCode::Io, "there is no folder to keep things in: neither HPR_CACHE nor HOME is set",
              "set HPR_CACHE to a folder");
}

}  // namespace

std::string file_error_hint(int error) {
  if (error == ENOSPC || error == EDQUOT) return "free some space or write elsewhere with -o; nothing partial was left";
  if (error == EFBIG)
    return "raise the limit of file sizes (ulimit -f), or write elsewhere with -o; nothing partial was left";
  return "check the path and its permissions";
}

std::string_view without_mark(std::string_view text) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  return text;
}

namespace {

/// The size of an open file that may be read.
std::uint64_t checked_size(const Descriptor& file, const std::filesystem::path& path, std::uint64_t limit_bytes) {
  if (file.get() < 0) fail("cannot read", path, errno);
  struct stat info {};
  if (::fstat(file.get(), &info) != 0) fail("cannot read", path, errno);
  if (!S_ISREG(info.st_mode)) {
    throw Error(ExitCode::Io, fmt::format("cannot read '{}': not a regular file", path.string()),
                "name a file, not a folder, pipe or device");
  }
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > limit_bytes) {
    throw Error(ExitCode::Limit,
                fmt::format("'{}' has {} bytes, more than the limit of {}", path.string(), size, limit_bytes),
                "raise the limit with --limit-mem if the file is to be trusted");
  }
  return size;
}

/// O_NONBLOCK so that opening a FIFO returns at once and can be refused.
Descriptor open_to_read(const std::filesystem::path& path) {
  return Descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
}

}  // namespace

FileBytes map_file(const std::filesystem::path& path, std::uint64_t limit_bytes) {
  const Descriptor file = open_to_read(path);
  return FileBytes::mapped(file.get(), checked_size(file, path, limit_bytes));
}

std::vector<std::byte> read_file(const std::filesystem::path& path, std::uint64_t limit_bytes) {
  const Descriptor file = open_to_read(path);
  std::vector<std::byte> bytes(checked_size(file, path, limit_bytes));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::read(file.get(), bytes.data() + done, bytes.size() - done);
    if (got < 0) {
      if (errno == EINTR) continue;
      fail("cannot read", path, errno);
    }
    if (got == 0) {
      throw Error(ExitCode::Io, fmt::format("'{}' shrank while it was read", path.string()),
                  "try again when it is complete");
    }
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

std::filesystem::path written_file(const std::filesystem::path& path) {
  if (!path.has_filename()) {
    throw Error(ExitCode::Io, fmt::format("cannot write '{}': it names no file", path.string()), "name a file");
  }
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (std::filesystem::is_directory(status)) {
    throw Error(ExitCode::Io, fmt::format("cannot write '{}': it is a folder", path.string()), "name a file");
  }
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    throw Error(ExitCode::Io, fmt::format("cannot write '{}': not a regular file", path.string()),
                "name a file, not a pipe or device");
  }
  // A rename would replace a symbolic link, not what it points at.
  std::filesystem::path target = path;
  // Ends: status() above has followed the same links, and a loop of them is an error there and at the write.
  for (int links = 0; links < 40 && std::filesystem::is_symlink(target, error); ++links) {
    target = folder_of(target) / std::filesystem::read_symlink(target, error);
  }
  return target;
}

AtomicFile::AtomicFile(std::filesystem::path path) : path_(std::move(path)), target_(written_file(path_)) {
  descriptor_ = create_unnamed(folder_of(target_));
  if (descriptor_ < 0) descriptor_ = create_named(folder_of(target_), temporary_, O_WRONLY, 0666);
  if (descriptor_ < 0) fail("cannot write", path_, errno);
  (void)::flock(descriptor_, LOCK_EX | LOCK_NB);  // nobody takes it for abandoned
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      temporary_(std::exchange(other.temporary_, {})),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::commit(Sync sync, const std::filesystem::path& former) {
  HPR_CHECK(descriptor_ >= 0);
  if (sync == Sync::Disk && ::fsync(descriptor_) != 0) fail("cannot write", path_, errno);
  if (temporary_.empty()) {  // a link replaces nothing, so what is there is replaced by a rename
    const int linked = with_temporary_name(folder_of(target_), temporary_, [&](const char* name) {
      return ::linkat(AT_FDCWD, link_of(descriptor_).c_str(), AT_FDCWD, name, AT_SYMLINK_FOLLOW);
    });
    if (linked != 0) {
      const int error = errno;
      temporary_.clear();
      fail("cannot write", path_, error);
    }
  }
  const Descriptor locked(::fcntl(descriptor_, F_DUPFD_CLOEXEC, 0));  // until the name is the final one
  if (::close(std::exchange(descriptor_, -1)) != 0) fail("cannot write", path_, errno);
  if (!former.empty() && ::rename(target_.c_str(), former.c_str()) != 0 && errno != ENOENT) {
    fail("cannot replace", former, errno);
  }
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("cannot write", path_, errno);
  temporary_.clear();
  if (sync == Sync::None) return;
  // The rename itself is on disk only once the folder is synced; some file systems refuse that, and lose nothing by it.
  const Descriptor folder(::open(folder_of(target_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() >= 0) ::fsync(folder.get());
}

void write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes,
                           const std::filesystem::path& former) {
  AtomicFile file(path);
  write_all(file.descriptor(), bytes, path);
  file.commit(AtomicFile::Sync::Disk, former);
}

void write_file_atomically(const std::filesystem::path& path, std::string_view text, AtomicFile::Sync sync) {
  AtomicFile file(path);
  write_all(file.descriptor(), std::as_bytes(std::span(text)), path);
  file.commit(sync);
}

namespace {

bool is_abandoned(const std::filesystem::path& path) {
  constexpr std::time_t kYoungSeconds = 60;
  const Descriptor file(::open(path.c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat info {};
  if (file.get() < 0 || ::fstat(file.get(), &info) != 0) return false;
  return S_ISREG(info.st_mode) && info.st_uid == ::geteuid() && info.st_mtime + kYoungSeconds < std::time(nullptr) &&
         ::flock(file.get(), LOCK_EX | LOCK_NB) == 0;
}

}  // namespace

std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> entries;
  const std::unique_ptr<DIR, int (*)(DIR*)> stream(::opendir(folder.c_str()), ::closedir);
  if (!stream) return entries;
  while (const dirent* const entry = ::readdir(stream.get())) {  // NOLINT(concurrency-mt-unsafe): the stream is its own
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..") entries.push_back(folder / name);
  }
  return entries;
}

void remove_tree(const std::filesystem::path& path) {
  if (::unlink(path.c_str()) == 0) return;
  for (const std::filesystem::path& entry : entries_of(path)) remove_tree(entry);
  ::rmdir(path.c_str());
}

void remove_abandoned_files(const std::filesystem::path& folder) {
  for (const std::filesystem::path& path : entries_of(folder)) {
    const std::string name = path.filename().string();
    if (!name.starts_with(part_prefix()) || !name.ends_with(kPartSuffix)) continue;
    if (is_abandoned(path)) ::unlink(path.c_str());
  }
}

void check_writable(const std::filesystem::path& path, bool overwrite) {
  const std::filesystem::path folder = folder_of(written_file(path));
  std::error_code error;
  if (!overwrite && std::filesystem::exists(path, error)) {
    throw Error(ExitCode::Io, fmt::format("'{}' exists", printable(path.string(), 300)),
                "choose another name or overwrite it with --force");
  }
  if (!std::filesystem::is_directory(folder, error)) {
    throw Error(ExitCode::Io,
                fmt::format("cannot write '{}': there is no folder '{}'", printable(path.string(), 300),
                            printable(folder.string(), 300)),
                "create the folder first");
  }
  if (::access(folder.c_str(), W_OK | X_OK) != 0) fail("cannot write", path, errno);
  remove_abandoned_files(folder);
}

void check_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::path there = std::filesystem::absolute(folder, error).lexically_normal();
  int problem = error.value();
  while (there.has_relative_path() && !std::filesystem::exists(std::filesystem::symlink_status(there, error))) {
    there = there.parent_path();
  }
  if (problem == 0 && !std::filesystem::is_directory(there, error)) {
    problem = ENOTDIR;
  } else if (problem == 0 && ::access(there.c_str(), W_OK | X_OK) != 0) {
    problem = errno;
  }
  if (problem == 0) return;
  throw Error(code_of(problem),
              fmt::format("cannot make the folder '{}': {}", printable(folder.string(), 300),
                          std::generic_category().message(problem)),
              "name a folder that can be written with -o");
}

FolderLock::FolderLock(const std::filesystem::path& folder)
    : folder_(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (folder_ < 0 && errno == EACCES) return;  // it may still be written to
  if (folder_ < 0) fail("cannot open", folder, errno);
  if (::flock(folder_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) {
    remove_abandoned_files(folder.empty() ? "." : folder);
    return;
  }
  ::close(folder_);
  throw Error(ExitCode::Io, fmt::format("another run writes into '{}'", printable(folder.string(), 300)),
              "wait for it, or name another folder with -o");
}

FolderLock::~FolderLock() {
  if (folder_ >= 0) ::close(folder_);
}

EmptyFolders::EmptyFolders(const std::filesystem::path& folder) {
  std::error_code error;
  for (std::filesystem::path path = folder; !path.empty() && !std::filesystem::exists(path, error);
       path = path.parent_path()) {
    missing_.push_back(path);
  }
}

EmptyFolders::~EmptyFolders() {
  for (const std::filesystem::path& path : missing_) ::rmdir(path.c_str());  // refuses what is not empty
}

std::filesystem::path temporary_folder() {
  const char* const named = named_folder();
  return named == nullptr ? "/tmp" : named;
}

TemporaryFile::TemporaryFile() : descriptor_(create_in(temporary_folder())) {
  if (descriptor_ < 0) {
    throw Error(ExitCode::Io,
                fmt::format("cannot write temporary files in '{}'{}: {}", printable(temporary_folder().string(), 300),
                            named_folder() == nullptr ? "" : fmt::format(", which {} names", kTemporaryVariable),
                            std::generic_category().message(errno)),
                fmt::format("set {} to a folder that can be written", kTemporaryVariable));
  }
  path_ = fmt::format("/proc/{}/fd/{}", ::getpid(), descriptor_);
}

TemporaryFile::TemporaryFile(const std::filesystem::path& folder) : has_name_(true) {
  remove_abandoned_files(folder.empty() ? "." : folder);
  std::error_code error;
  std::string name;
  descriptor_ = create_named(std::filesystem::absolute(folder.empty() ? "." : folder, error), name, O_RDWR, 0600);
  if (descriptor_ < 0) fail("cannot write", name, errno);
  ::flock(descriptor_, LOCK_EX | LOCK_NB);
  path_ = name;
}

TemporaryFile::~TemporaryFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  if (has_name_) ::unlink(path_.c_str());
}

TemporaryFile::TemporaryFile(TemporaryFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), path_(std::move(other.path_)), has_name_(other.has_name_) {}

std::filesystem::path cache_folder() {
  std::filesystem::path folder = chosen_folder();
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) {
    throw Error(ExitCode::Io, fmt::format("cannot make '{}': {}", folder.string(), failed.message()),
                "set HPR_CACHE to a folder that can be written to");
  }
  return folder;
}

}  // namespace hpr
