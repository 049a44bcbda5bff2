#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// What each rank of a job does, in memory that its launcher on the same host sees too: so the launcher can name a rank
/// that is gone, and notice one that stands still.
namespace hpr {

/// In place of a rank that is waited for: several, who knows which.
inline constexpr int kOtherRanks = -2;

/// What a rank has last reported.
struct RankReport {
  pid_t process = 0;
  std::string host;
  std::string phase;                        ///< its innermost trace::Span; empty: none
  std::optional<std::uint64_t> frame;       ///< that it draws or drew last
  std::optional<int> awaited_rank;          ///< that it has been waiting for; may be kOtherRanks
  std::uint64_t steps = 0;                  ///< grows while it gets on
  std::chrono::nanoseconds stall_limit{0};  ///< how long no rank may get on; 0: as long as it likes
};

/// "rank 1 on wall02: composite of frame 57, waiting for rank 0".
[[nodiscard]] std::string describe(int rank, const RankReport& report);

/// The launcher's side. Where the system has no memory for it, or ranks run on other hosts, it stays empty.
class JobBoard {
 public:
  explicit JobBoard(int ranks);
  ~JobBoard();
  JobBoard(const JobBoard&) = delete;
  JobBoard& operator=(const JobBoard&) = delete;

  /// For the environment of the ranks.
  static constexpr const char* kVariable = "HPR_JOB_BOARD";
  [[nodiscard]] const std::string& address() const { return address_; }
  [[nodiscard]] int ranks() const { return ranks_; }

  /// What `rank` has last reported; none before it has started.
  [[nodiscard]] std::optional<RankReport> read(int rank) const;

 private:
  int ranks_;
  int memory_ = -1;
  void* slots_ = nullptr;
  std::string address_;
};

/// From now on the calling thread's reports below are seen by the launcher, if this process has one on this host.
void join_job_board(int rank);

/// Whether this process is to print an error: false where another rank of this host has claimed the same words.
[[nodiscard]] bool claim_error(std::string_view text);

/// The innermost trace::Span of the calling thread; "" outside of all.
[[nodiscard]] const char* current_phase();

/// Reports: a few stores to memory each. `phase`: a literal, also for current_phase().
void report_phase(const char* phase);
void report_frame(std::uint64_t frame);
/// A wait has begun to last; none: it is over.
void report_wait(std::optional<int> awaited_rank);
/// Something was finished, by any thread.
void report_step();

/// Reports a wait as long as it lives: for calls that return when others have come.
class WaitReport {
 public:
  explicit WaitReport(int awaited_rank) { report_wait(awaited_rank); }
  ~WaitReport() { report_wait(std::nullopt); }
  WaitReport(const WaitReport&) = delete;
  WaitReport& operator=(const WaitReport&) = delete;
};
/// Returns the one before.
std::chrono::nanoseconds report_stall_limit(std::chrono::nanoseconds limit);

}  // namespace hpr
