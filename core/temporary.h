#pragma once

#include <filesystem>

namespace hpr {

/// Where temporary files go: the folder that TMPDIR names, or /tmp. Only names it.
[[nodiscard]] std::filesystem::path temporary_folder();

/// An empty file there that only this user may open, without a name: gone with this process, however it ends.
class TemporaryFile {
 public:
  /// Throws Error (Io) that names the folder, and the variable where that says which.
  TemporaryFile();
  ~TemporaryFile();
  TemporaryFile(TemporaryFile&& other) noexcept;
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  TemporaryFile& operator=(TemporaryFile&&) = delete;

  /// By which processes of this host open it while this lives.
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  int descriptor_;
  std::filesystem::path path_;
};

}  // namespace hpr
