#include "cluster/distribution/balance.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <optional>

#include "cluster/distribution/area_cutting.h"
#include "core/error.h"

namespace hpr {
namespace {

using Areas = std::vector<std::vector<ScreenRect>>;

/// Each frame's part of the mean.
constexpr double kSmoothing = 0.5;
/// How far from its share a cut may stay for the sake of one straight edge: of the smaller part.
constexpr double kStraight = 0.02;

/// Sums of what tiles cost over rectangles of tiles.
class CostSums {
 public:
  CostSums(const FrameLayout& layout, std::span<const double> costs) : layout_(layout) {
    // A frame that costs nothing anywhere is shared out by number of tiles.
    const double sum = std::accumulate(costs.begin(), costs.end(), 0.0);
    const double least = sum > 0.0 ? 1e-6 * sum / static_cast<double>(costs.size()) : 1.0;
    for (const double cost : costs) costs_.push_back(cost + least);
  }

  [[nodiscard]] double of(const ScreenRect& rect) const {
    double sum = 0.0;
    for (int y = rect.pixels.y0; y < rect.pixels.y1; y += kTileSide) {
      for (int x = rect.pixels.x0; x < rect.pixels.x1; x += kTileSide) {
        sum += costs_[layout_.tile_at(rect.screen, x, y)];
      }
    }
    return sum;
  }
  [[nodiscard]] double of(std::span<const ScreenRect> rects) const {
    return std::accumulate(rects.begin(), rects.end(), 0.0,
                           [&](double sum, const ScreenRect& rect) { return sum + of(rect); });
  }

 private:
  const FrameLayout& layout_;
  std::vector<double> costs_;
};

/// Where a rectangle is to be cut so that the part before costs about `wanted`.
struct Cut {
  int whole = 0;        ///< slices that cost no more
  double before = 0.0;  ///< what they cost
  double next = 0.0;    ///< what the one after them costs
};

Cut find_cut(const CostSums& costs, const ScreenRect& rect, bool along_x, double wanted) {
  Cut cut;
  for (const int slices = slices_of(rect, along_x); cut.whole < slices; ++cut.whole) {
    cut.next = costs.of(slice(rect, along_x, cut.whole, cut.whole + 1));
    if (cut.before + cut.next > wanted) break;
    cut.before += cut.next;
  }
  return cut;
}

/// Moves about `wanted` of the cost of `rect` to `first` and the rest to `second`, by one straight cut across the
/// longer side where that comes near, else with a step in the slice it would run through.
void cut_by_cost(const CostSums& costs, const ScreenRect& rect, double wanted, std::vector<ScreenRect>& first,
                 std::vector<ScreenRect>& second) {
  const bool along_x = rect.pixels.width() >= rect.pixels.height();
  const int slices = slices_of(rect, along_x);
  const Cut cut = find_cut(costs, rect, along_x, wanted);
  const double below = wanted - cut.before;
  const double above = cut.before + cut.next - wanted;
  const double near = kStraight * std::min(wanted, costs.of(rect) - wanted);
  int straight = below <= above ? cut.whole : cut.whole + 1;
  if (std::min(below, above) > near) {
    const ScreenRect row = slice(rect, along_x, cut.whole, cut.whole + 1);
    const Cut inside = find_cut(costs, row, !along_x, below);
    const bool past = inside.before + 0.5 * inside.next < below;
    const int tiles = inside.whole + (past ? 1 : 0);
    const int all = slices_of(row, !along_x);
    if (tiles > 0 && tiles < all) {
      add_if_any(first, slice(rect, along_x, 0, cut.whole));
      add_if_any(first, slice(row, !along_x, 0, tiles));
      add_if_any(second, slice(row, !along_x, tiles, all));
      add_if_any(second, slice(rect, along_x, cut.whole + 1, slices));
      return;
    }
    straight = cut.whole + (tiles > 0 ? 1 : 0);
  }
  add_if_any(first, slice(rect, along_x, 0, straight));
  add_if_any(second, slice(rect, along_x, straight, slices));
}

/// Per area its cost by its weight: the time of a group of so many ranks.
std::vector<double> loads_of(const CostSums& costs, const Areas& areas, const std::vector<int>& weights) {
  std::vector<double> loads;
  for (std::size_t i = 0; i < areas.size(); ++i) loads.push_back(costs.of(areas[i]) / weights[i]);
  return loads;
}

}  // namespace

double slowest_over_mean(std::span<const double> work) {
  const double sum = std::accumulate(work.begin(), work.end(), 0.0);
  return sum > 0.0 ? std::ranges::max(work) * static_cast<double>(work.size()) / sum : 1.0;
}

void TileCosts::add(std::span<const double> measured) {
  HPR_CHECK(std::ranges::all_of(measured, [](double cost) { return cost >= 0.0; }));
  if (costs_.size() != measured.size()) {
    costs_.assign(measured.begin(), measured.end());
    return;
  }
  for (std::size_t i = 0; i < costs_.size(); ++i) costs_[i] += kSmoothing * (measured[i] - costs_[i]);
}

Areas assign_tiles(const FrameLayout& layout, const std::vector<int>& weights, std::span<const double> costs) {
  HPR_CHECK(!weights.empty() && std::ranges::all_of(weights, [](int weight) { return weight > 0; }));
  HPR_CHECK(costs.size() == layout.tiles());
  Areas areas(weights.size());
  const CostSums sums(layout, costs);
  share_out(
      whole_screens(layout), weights, areas, [&](const ScreenRect& rect) { return sums.of(rect); },
      [&](const ScreenRect& rect, double wanted, std::vector<ScreenRect>& first, std::vector<ScreenRect>& second) {
        cut_by_cost(sums, rect, wanted, first, second);
      });
  return areas;
}

Areas next_areas(const Areas& current, const FrameLayout& layout, const std::vector<int>& weights,
                 std::span<const double> costs) {
  Areas areas = assign_tiles(layout, weights, costs);
  if (current.size() != areas.size()) return areas;
  const CostSums sums(layout, costs);
  const std::vector<double> now = loads_of(sums, current, weights);
  const std::vector<double> then = loads_of(sums, areas, weights);
  const double mean = std::accumulate(now.begin(), now.end(), 0.0) / static_cast<double>(now.size());
  return std::ranges::max(now) - std::ranges::max(then) > kMinGain * mean ? areas : current;
}

namespace {

/// The tiles of each rank, dearest first, and what they cost together.
class OwnedTiles {
 public:
  OwnedTiles(std::span<const int> owners, std::span<const double> costs, int ranks)
      : costs_(costs), tiles_(static_cast<std::size_t>(ranks)), loads_(static_cast<std::size_t>(ranks), 0.0) {
    for (std::size_t tile = 0; tile < owners.size(); ++tile) {
      if (owners[tile] < 0) continue;
      tiles_.at(static_cast<std::size_t>(owners[tile])).push_back(tile);
      loads_[static_cast<std::size_t>(owners[tile])] += costs[tile];
    }
    mean_ = std::accumulate(loads_.begin(), loads_.end(), 0.0) / ranks;
    for (auto& list : tiles_) {  // of equal ones the later tile, so that what stays is a run
      std::ranges::sort(
          list, [&](std::size_t a, std::size_t b) { return costs[a] != costs[b] ? costs[a] > costs[b] : a > b; });
    }
  }

  [[nodiscard]] const std::vector<double>& loads() const { return loads_; }
  [[nodiscard]] double mean() const { return mean_; }

  /// The tile that is to go from one rank to another: the dearest that leaves neither on the other side of the mean,
  /// else the cheapest, if that helps at all.
  [[nodiscard]] std::optional<std::size_t> choose(std::size_t from, std::size_t to) const {
    const double wanted = std::min(loads_[from] - mean_, mean_ - loads_[to]);
    const auto& list = tiles_[from];
    const auto fits = std::ranges::find_if(list, [&](std::size_t tile) { return costs_[tile] <= wanted; });
    if (fits != list.end() && costs_[*fits] > 0.0) return *fits;
    const auto costly =
        std::ranges::find_if(list.rbegin(), list.rend(), [&](std::size_t tile) { return costs_[tile] > 0.0; });
    const double room = loads_[from] - loads_[to] - kMinGain * mean_;
    if (costly == list.rend() || costs_[*costly] >= room) return std::nullopt;
    return *costly;
  }

  void move(std::size_t tile, std::size_t from, std::size_t to) {
    std::erase(tiles_[from], tile);
    auto& list = tiles_[to];
    list.insert(
        std::ranges::lower_bound(list, costs_[tile], std::greater<>(), [&](std::size_t each) { return costs_[each]; }),
        tile);
    loads_[from] -= costs_[tile];
    loads_[to] += costs_[tile];
  }

 private:
  std::span<const double> costs_;
  std::vector<std::vector<std::size_t>> tiles_;
  std::vector<double> loads_;
  double mean_ = 0.0;
};

}  // namespace

std::vector<int> balance_owners(std::vector<int> owners, std::span<const double> costs, int ranks) {
  HPR_CHECK(owners.size() == costs.size() && ranks > 0);
  OwnedTiles owned(owners, costs, ranks);
  std::vector<double> movable = owned.loads();  // 0 of ranks none of whose tiles can go
  while (true) {
    const auto from = static_cast<std::size_t>(std::ranges::max_element(movable) - movable.begin());
    const auto to = static_cast<std::size_t>(std::ranges::min_element(owned.loads()) - owned.loads().begin());
    if (movable[from] <= (1.0 + kMinGain) * owned.mean()) return owners;
    const std::optional<std::size_t> tile = owned.choose(from, to);
    if (!tile) {
      movable[from] = 0.0;
      continue;
    }
    owned.move(*tile, from, to);
    owners[*tile] = static_cast<int>(to);
    movable[from] = owned.loads()[from];
    movable[to] = owned.loads()[to];
  }
}

}  // namespace hpr
