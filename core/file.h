#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// The bytes of a regular file. Throws Error: Io when it is missing, unreadable or no regular file (a FIFO, a device, a
/// directory), Limit when it is larger than `limit_bytes`.
[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path, std::uint64_t limit_bytes);

/// What to do where a file cannot be read or written, by its errno.
[[nodiscard]] std::string file_error_hint(int error);

/// `text` less the byte order mark that some editors and spreadsheets put before UTF-8.
[[nodiscard]] std::string_view without_mark(std::string_view text);

/// The file that a write to `path` makes or replaces: where symbolic links lead. Throws Error (Io) for what no write
/// replaces: folders, pipes and devices.
[[nodiscard]] std::filesystem::path written_file(const std::filesystem::path& path);

/// A file that is written piece by piece: `path` is either complete or untouched, also when the disk fills or the
/// process dies. A symbolic link stays, what it points at is replaced.
class AtomicFile {
 public:
  /// Makes a file without a name in its folder, or where the file system has none of those one with a name of its own.
  /// Throws Error (Io), also when `path` is a folder, pipe or device.
  explicit AtomicFile(std::filesystem::path path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  /// Removes the file unless commit() was called.
  ~AtomicFile();

  /// What is to be written to.
  [[nodiscard]] int descriptor() const { return descriptor_; }

  enum class Sync { Disk, None };
  /// Once, when all is written: syncs and closes it, gives it its name, syncs the folder. Throws Error (Io). Without
  /// syncs it survives the process, and maybe not the machine.
  /// `former`: what had the name gets that one first, in the same file system; empty: it is replaced.
  void commit(Sync sync = Sync::Disk, const std::filesystem::path& former = {});

 private:
  std::filesystem::path path_;    ///< for errors
  std::filesystem::path target_;  ///< where links lead
  std::string temporary_;         ///< the name of its own; empty: it has none, or has its final one
  int descriptor_ = -1;
};

/// Writes `bytes` so that `path` is either complete or untouched, as an AtomicFile. With `former` it may be missing
/// instead, while what it was stands there. Throws Error (Io).
void write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes,
                           const std::filesystem::path& former = {});
void write_file_atomically(const std::filesystem::path& path, std::string_view text,
                           AtomicFile::Sync sync = AtomicFile::Sync::Disk);

/// What a folder holds, in no order, as far as it can be read. Throws std::bad_alloc, where libstdc++'s
/// directory_iterator and remove_all() end the program.
[[nodiscard]] std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder);

/// Removes a file, or a folder with all that it holds, as far as that can be done; follows no links. Throws
/// std::bad_alloc.
void remove_tree(const std::filesystem::path& path);

/// Removes what processes of this user that were killed while they wrote files left in `folder`: an AtomicFile that has
/// a name of its own holds a lock. Nothing younger than a minute, which may have none yet.
void remove_abandoned_files(const std::filesystem::path& folder);

/// Throws Error (Io) when `path` exists and may not be overwritten, is no regular file, or its folder is missing or not
/// writable: asked before long work. Removes abandoned files from that folder.
void check_writable(const std::filesystem::path& path, bool overwrite);

/// Throws Error (Io) when `folder` is there and no folder that can be written to, or is not there and cannot be made:
/// asked before long work; makes nothing.
void check_folder(const std::filesystem::path& folder);

/// Keeps other processes of this host from writing their results into a folder, if they call this too.
/// Where it cannot be locked it keeps nobody. Removes abandoned files from the folder.
class FolderLock {
 public:
  /// Throws Error (Io) when another process holds it, or there is no such folder.
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int folder_;
};

/// Tidies up after a run that ends before it wrote anything: when this goes, those folders on the way to and including
/// `folder` that were missing when it came, and are empty, are removed.
class EmptyFolders {
 public:
  explicit EmptyFolders(const std::filesystem::path& folder);
  ~EmptyFolders();
  EmptyFolders(const EmptyFolders&) = delete;
  EmptyFolders& operator=(const EmptyFolders&) = delete;

 private:
  std::vector<std::filesystem::path> missing_;  ///< the innermost first
};

/// Where temporary files go: the folder that TMPDIR names, or /tmp. Only names it.
[[nodiscard]] std::filesystem::path temporary_folder();

/// An empty file that only this user may open.
class TemporaryFile {
 public:
  /// In temporary_folder(), without a name: gone with this process, however it ends. Throws Error (Io) that names the
  /// folder, and the variable where that says which.
  TemporaryFile();
  /// In `folder`, with a name by which other hosts find it too: gone with this object, or, where this process is
  /// killed, with remove_abandoned_files(). Throws Error (Io).
  explicit TemporaryFile(const std::filesystem::path& folder);
  ~TemporaryFile();
  TemporaryFile(TemporaryFile&& other) noexcept;
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  TemporaryFile& operator=(TemporaryFile&&) = delete;

  /// The path by which other processes open the file while this object lives: those of this host where it has no name.
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  int descriptor_;
  std::filesystem::path path_;
  bool has_name_ = false;
};

/// Where HPR keeps what it could work out again: $HPR_CACHE, else hpr/ in $XDG_CACHE_HOME or ~/.cache. Made when it is
/// not there. Throws Error (Io).
[[nodiscard]] std::filesystem::path cache_folder();

}  // namespace hpr
