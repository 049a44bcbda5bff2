#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace hpr {

/// What a rank did for a frame itself, waiting for others left out.
struct RankWork {
  double ms = 0.0;
  double pass_ms = 0.0;
  std::size_t pass = 0;  ///< that took most of it; 0: the keys
};

/// A rank that works much longer for frames than the others, or did.
struct SlowRank {
  int rank = 0;
  double ratio = 1.0;    ///< its time by the median of the others'
  double seconds = 0.0;  ///< for how long
  std::size_t pass = 0;  ///< of its last slow frame
  bool is_over = false;
};

/// "rank 3 on wall02 is 6.2 times slower than the others, for 14 s so far, in raster".
[[nodiscard]] std::string describe(const SlowRank& slow, const std::string& host, const std::string& pass);

/// Finds ranks that are much slower than the others: by more than four times the median of the others and more than 50
/// ms, in ten frames in a row or for five seconds. Each is reported once it is found, again no sooner than a minute
/// later, and once it is over.
class SlowRankWatch {
 public:
  /// After a frame: per rank what it did, and what time it is, in seconds. Returns what is to be reported.
  [[nodiscard]] std::vector<SlowRank> add(std::span<const RankWork> works, double now_s);

 private:
  /// Frames in a row in which a rank was slow.
  struct Streak {
    int frames = 0;
    double since_s = 0.0;
    double last_s = 0.0;
    double ms = 0.0;         ///< summed over the frames
    double others_ms = 0.0;  ///< the medians of the others, summed
    std::size_t pass = 0;
    bool is_reported = false;
  };
  struct Rank {
    Streak streak;
    std::optional<double> reported_s;  ///< when it was last found slow
  };

  std::vector<Rank> ranks_;
};

}  // namespace hpr
