#pragma once

#include <filesystem>

#include "engine/checkpoint/checkpoint.h"

namespace hpr {

/// Where the checkpoint before the one at `path` stands.
[[nodiscard]] std::filesystem::path previous_checkpoint(const std::filesystem::path& path);

/// The bytes of a whole checkpoint.
struct StoredCheckpoint {
  std::filesystem::path path;
  std::vector<std::byte> bytes;
  std::string problem;  ///< why it is the previous one; empty: it is not
};

/// The checkpoint at `path`, or the previous one where the former is missing, cut short or damaged. Throws Error
/// (BadInput) with both reasons where neither is whole, or where one is of another format, and Io where there is none.
[[nodiscard]] StoredCheckpoint read_checkpoint(const std::filesystem::path& path);

/// The checkpoints of one run: the newest at a path and, where wanted, the one before it. However the process ends,
/// one of them is whole once there was one. What they are for decides how long they stay: those that nobody asked for
/// are of no use once the run has reached its goal.
class CheckpointFile {
 public:
  /// `keeps_previous`: a new checkpoint does not replace the one before it.
  CheckpointFile(std::filesystem::path path, bool keeps_previous);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// Fills `film` by what read_checkpoint() finds; warns where that is the previous one. Throws Error as that does and
  /// as decode_checkpoint().
  [[nodiscard]] SampleProgress read(const RunIdentity& identity, Film& film);

  /// `asked_for`: by the user, not by the clock. Throws Error (Io); what stood there before is whole still.
  void write(const RunIdentity& identity, Film& film, const SampleProgress& progress, bool asked_for);

  /// Once the run's results are written: removes what was read or written here, but for the newest checkpoint where
  /// one of them was asked for.
  void remove_unasked();

 private:
  std::filesystem::path path_;
  bool keeps_previous_;
  bool whole_ = false;      ///< what stands at the path
  bool used_ = false;       ///< read or written
  bool asked_for_ = false;  ///< one of those
};

}  // namespace hpr
