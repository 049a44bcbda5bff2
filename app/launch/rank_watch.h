#pragma once

#include <poll.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "core/job_board.h"

namespace hpr {

/// Follows the ranks of a job on this host: who went first, and whether they get on.
class RankWatch {
 public:
  explicit RankWatch(const JobBoard& board);
  ~RankWatch();
  RankWatch(const RankWatch&) = delete;
  RankWatch& operator=(const RankWatch&) = delete;

  /// Reads the board again. `passed`: since the last time.
  void update(std::chrono::nanoseconds passed);
  /// For poll(): each becomes readable when a rank ends.
  void add_to(std::vector<pollfd>& waited) const;
  /// After that poll().
  void note_ends(const std::vector<pollfd>& waited);

  /// Whether all ranks are on this host, and have come to start MPI.
  [[nodiscard]] bool knows_all() const;
  /// The rank of this host that ended first, and in doing what; a rank of another host may have ended before it. None:
  /// no rank of this host is known to have ended.
  [[nodiscard]] std::optional<std::string> first_known_to_end() const;
  /// The rank that ended first and in doing what; where several had ended when it was noticed, all of those. None:
  /// none is known to have ended, or it may be one of another host.
  [[nodiscard]] std::optional<std::string> first_to_end() const;
  /// How long no rank may get on, as they report it, longer where some are on other hosts; 0: as long as they like.
  [[nodiscard]] std::chrono::nanoseconds stall_limit() const;
  /// Whether no rank has got on for longer than that.
  [[nodiscard]] bool stalled() const;
  /// What each rank was last doing, at most a few of them: those first that wait for nobody. Empty where none is known.
  [[nodiscard]] std::string roll_call() const;

 private:
  struct Rank {
    int process = -1;  ///< a descriptor of it; -1: not known, or gone
    std::optional<RankReport> report = {};
  };
  const JobBoard& board_;
  std::vector<Rank> ranks_;
  std::vector<int> first_;  ///< to end
  std::chrono::nanoseconds still_{0};
};

}  // namespace hpr
