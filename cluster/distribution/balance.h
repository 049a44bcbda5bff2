#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "image/tiles.h"

namespace hpr {

/// How the work of a frame is shared out, beside its Distribution. It decides who computes what, and no bit.
enum class Balance : std::uint8_t {
  Measured,  ///< tiles by what they took in the frames before; in the first one by an estimate
  Demand,    ///< so too, and ranks that are done light parts of the tiles of others
  Static,    ///< tiles by their number
};
inline constexpr std::array<std::string_view, 3> kBalanceNames{"measured", "demand", "static"};

/// The largest of some values by their mean; 1 where all are 0.
[[nodiscard]] double slowest_over_mean(std::span<const double> work);

/// What each tile of a frame costs, as the frames before measured it, the last one counting for half: one disturbed
/// measurement moves it by half at most.
class TileCosts {
 public:
  /// Adds a frame's costs, one per tile, not negative. Another number of tiles than before begins anew.
  void add(std::span<const double> measured);
  void clear() { costs_.clear(); }
  /// Per tile; empty before the first frame.
  [[nodiscard]] std::span<const double> costs() const { return costs_; }

 private:
  std::vector<double> costs_;
};

/// As assign_tiles() by number of tiles, but area i gets about weights[i] of the sum of `costs`, one per tile and not
/// negative: no more than 1.05 times that and what the two dearest tiles cost.
[[nodiscard]] std::vector<std::vector<ScreenRect>> assign_tiles(const FrameLayout& layout,
                                                                const std::vector<int>& weights,
                                                                std::span<const double> costs);

/// Tiles move only where that takes so much of the mean off the slowest: less is noise of the measurement, by which
/// they would go to and fro.
inline constexpr double kMinGain = 0.05;

/// The areas of the next frame: those of `costs`, or the `current` ones (empty: there are none), where these cost the
/// slowest no more than kMinGain above.
[[nodiscard]] std::vector<std::vector<ScreenRect>> next_areas(const std::vector<std::vector<ScreenRect>>& current,
                                                              const FrameLayout& layout,
                                                              const std::vector<int>& weights,
                                                              std::span<const double> costs);

/// Who is to have each tile, one of `ranks` or -1 for nobody, starting from who has it now: tiles go from the rank
/// whose cost is largest to the one whose cost is least, the fewest that bring it near the mean, until it is at most
/// kMinGain above it or no tile is small enough to help. Ranks that are near the mean keep what they have.
[[nodiscard]] std::vector<int> balance_owners(std::vector<int> owners, std::span<const double> costs, int ranks);

}  // namespace hpr
