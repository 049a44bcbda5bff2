#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"

namespace hpr {

class Communicator;

/// Collective. Runs `draw`, which draws a frame, and once more where that fails by what may be about this frame alone
/// (Internal, NoDevice, Limit, CheckFailed) and all ranks throw alike (AgreedError; a single rank always agrees).
/// Returns what the second one failed by, too; none: the frame is drawn. Other errors are thrown at once. `what`: names
/// the frame in rank 0's warning.
[[nodiscard]] std::optional<Error> draw_with_retry(Communicator& comm, const std::string& what,
                                                   const std::function<void()>& draw);

/// The frames of a run that could not be drawn.
class FailedFrames {
 public:
  /// The next frame that was drawn, or failed.
  void add_drawn() { in_a_row_ = 0; }
  void add_failed(std::uint64_t frame);

  [[nodiscard]] std::size_t count() const { return count_; }
  /// How many failed since the last one was drawn.
  [[nodiscard]] int in_a_row() const { return in_a_row_; }
  /// "2 frames failed: 57, 90": no more than ten by number.
  [[nodiscard]] std::string describe() const;

 private:
  std::vector<std::uint64_t> first_;  ///< a few of them
  std::size_t count_ = 0;
  int in_a_row_ = 0;
};

}  // namespace hpr
