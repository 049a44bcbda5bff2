#include "app/launch/job_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <new>
#include <string>

#include "core/file.h"
#include "core/job_environment.h"

namespace hpr {
namespace {

/// Short: sockets' paths are not long.
std::string prefix() {
  return fmt::format("hpr-job-{}-", ::geteuid());
}

/// The lock of a folder of this user; -1 where somebody holds it, or it is no such folder.
int try_to_lock(const std::filesystem::path& folder) {
  const int lock = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (lock < 0) return -1;
  struct stat info {};
  if (::fstat(lock, &info) == 0 && info.st_uid == ::geteuid() && ::flock(lock, LOCK_EX | LOCK_NB) == 0) return lock;
  ::close(lock);
  return -1;
}

/// Removed between being made and being locked, by another who took it for left over.
bool is_removed(int folder) {
  struct stat info {};
  return ::fstat(folder, &info) != 0 || info.st_nlink == 0;
}

void sweep(const std::filesystem::path& parent) {
  for (const std::filesystem::path& folder : entries_of(parent)) {
    if (!folder.filename().string().starts_with(prefix())) continue;
    const int lock = try_to_lock(folder);
    if (lock < 0) continue;
    remove_tree(folder);
    ::close(lock);
  }
}

}  // namespace

JobFolder::JobFolder() {
  if (!is_one_host()) return;
  make(temporary_folder(), "OMPI_MCA_orte_tmpdir_base");
  make("/dev/shm", "OMPI_MCA_btl_vader_backing_directory");
}

JobFolder::~JobFolder() {
  for (const Locked& folder : folders_) {
    try {
      remove_tree(folder.path);
    } catch (const std::bad_alloc&) {  // the next start removes it
    }
    ::close(folder.lock);
  }
}

void JobFolder::make(const std::filesystem::path& parent, const char* variable) {
  constexpr int kTries = 8;
  sweep(parent);
  for (int i = 0; i < kTries; ++i) {
    std::string name = (parent / (prefix() + "XXXXXX")).string();
    if (::mkdtemp(name.data()) == nullptr) return;
    const int lock = try_to_lock(name);
    if (lock >= 0 && !is_removed(lock)) {
      folders_.push_back({variable, name, lock});
      return;
    }
    if (lock >= 0) ::close(lock);
    ::rmdir(name.c_str());
  }
}

void JobFolder::pass_on() const {
  for (const Locked& folder : folders_) {
    ::setenv(folder.variable, folder.path.c_str(), 0);  // NOLINT(concurrency-mt-unsafe): after fork there is one thread
    ::fcntl(folder.lock, F_SETFD, 0);
  }
}

}  // namespace hpr
