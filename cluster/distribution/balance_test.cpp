#include "cluster/distribution/balance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace hpr {
namespace {

using Areas = std::vector<std::vector<ScreenRect>>;

/// Per tile the area it lies in; fails where it lies in none or in two, or is cut.
std::vector<int> owners_of(const FrameLayout& layout, const Areas& areas) {
  std::vector<int> owners(layout.tiles(), -1);
  for (std::size_t area = 0; area < areas.size(); ++area) {
    for (const ScreenRect& rect : areas[area]) {
      EXPECT_FALSE(rect.pixels.empty());
      for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
        const TilePlace location = layout.place(tile);
        const Rect shared = intersection(location.pixels, rect.pixels);
        if (location.screen != rect.screen || shared.empty()) continue;
        EXPECT_EQ(shared, location.pixels) << "a tile is cut";
        EXPECT_EQ(owners[tile], -1);
        owners[tile] = static_cast<int>(area);
      }
    }
  }
  EXPECT_EQ(std::ranges::count(owners, -1), 0);
  return owners;
}

std::vector<double> loads_of(const std::vector<int>& owners, std::span<const double> costs, int ranks) {
  std::vector<double> loads(static_cast<std::size_t>(ranks), 0.0);
  for (std::size_t tile = 0; tile < owners.size(); ++tile) {
    if (owners[tile] >= 0) loads[static_cast<std::size_t>(owners[tile])] += costs[tile];
  }
  return loads;
}

/// Costs like those of pictures: most tiles cheap, some of them up to `dearest` times as dear.
std::vector<double> strewn_costs(std::size_t tiles, double dearest, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<double> costs;
  for (std::size_t i = 0; i < tiles; ++i) {
    const double unit = static_cast<double>(random() % 1000) / 1000.0;
    costs.push_back(0.5 + unit + (random() % 8 == 0 ? unit * dearest : 0.0));
  }
  return costs;
}

/// A layout with a spot in the corner of its first screen where tiles are ten times as dear.
std::vector<double> spot(const FrameLayout& layout, double dearness = 10.0) {
  std::vector<double> costs;
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
    const TilePlace location = layout.place(tile);
    costs.push_back(location.screen == 0 && location.pixels.x0 < 320 && location.pixels.y0 < 256 ? dearness : 1.0);
  }
  return costs;
}

const std::vector<std::vector<Size>> kLayouts{
    {{333, 217}}, {{1920, 1080}}, {{3000, 65}}, {{63, 2000}}, {{640, 360}, {640, 360}, {100, 50}, {1000, 900}}};

TEST(BalancedAreas, CoverEveryTileOnceAndNoneIsFarAboveItsShareOfTheCosts) {
  for (const auto& screens : kLayouts) {
    const FrameLayout layout(screens);
    for (int ranks = 1; ranks <= 17; ++ranks) {
      for (const double dearest : {0.0, 3.0, 30.0}) {
        const std::vector<double> costs = strewn_costs(layout.tiles(), dearest, static_cast<std::uint32_t>(ranks));
        const std::vector<int> weights(static_cast<std::size_t>(ranks), 1);
        const std::vector<int> owners = owners_of(layout, assign_tiles(layout, weights, costs));
        const double sum = std::accumulate(costs.begin(), costs.end(), 0.0);
        const double bound = 1.05 * sum / ranks + 2.0 * std::ranges::max(costs);
        EXPECT_LE(std::ranges::max(loads_of(owners, costs, ranks)), bound) << ranks << " ranks, " << dearest;
      }
    }
  }
}

TEST(BalancedAreas, ASpotOfDearTilesIsSharedOut) {
  const FrameLayout layout({{1920, 1080}});
  const std::vector<double> costs = spot(layout);
  for (const int ranks : {2, 3, 4, 8, 16}) {
    const std::vector<int> weights(static_cast<std::size_t>(ranks), 1);
    const auto by_count = loads_of(owners_of(layout, assign_tiles(layout, weights)), costs, ranks);
    const auto by_cost = loads_of(owners_of(layout, assign_tiles(layout, weights, costs)), costs, ranks);
    EXPECT_GT(slowest_over_mean(by_count), 1.2) << ranks;
    EXPECT_LE(slowest_over_mean(by_cost), 1.0 + 0.025 * ranks) << ranks;
  }
}

TEST(BalancedAreas, FollowTheirWeights) {
  const FrameLayout layout({{1920, 1080}});
  const std::vector<double> costs = spot(layout);
  const std::vector<int> weights{1, 2, 5, 2};
  const auto loads = loads_of(owners_of(layout, assign_tiles(layout, weights, costs)), costs, 4);
  const double sum = std::accumulate(costs.begin(), costs.end(), 0.0);
  for (std::size_t i = 0; i < loads.size(); ++i)
    EXPECT_NEAR(loads[i], 0.1 * weights[i] * sum, 0.06 * sum * 0.1 * weights[i] + 5.0);
}

TEST(BalancedAreas, TilesThatCostNothingAreSharedOutByTheirNumber) {
  const FrameLayout layout({{640, 640}});
  const std::vector<double> nothing(layout.tiles(), 0.0);
  const auto owners = owners_of(layout, assign_tiles(layout, {1, 1, 1, 1}, nothing));
  EXPECT_EQ(loads_of(owners, std::vector<double>(layout.tiles(), 1.0), 4), (std::vector<double>{25, 25, 25, 25}));
}

TEST(BalancedAreas, StayWhereOtherOnesWouldGainLittle) {
  const FrameLayout layout({{1920, 1080}});
  const std::vector<int> weights(4, 1);
  std::vector<double> costs = spot(layout);
  const Areas areas = next_areas({}, layout, weights, costs);
  std::mt19937 random(3);
  int others = 0;
  for (int frame = 0; frame < 20; ++frame) {  // each tile's cost is up to an eighth off
    std::vector<double> noisy = costs;
    for (double& cost : noisy) cost *= 0.88 + 0.24 * static_cast<double>(random() % 1000) / 1000.0;
    others += assign_tiles(layout, weights, noisy) != areas ? 1 : 0;
    EXPECT_EQ(next_areas(areas, layout, weights, noisy), areas) << frame;
  }
  EXPECT_GT(others, 2);
  std::ranges::reverse(costs);  // the spot is elsewhere now
  EXPECT_NE(next_areas(areas, layout, weights, costs), areas);
}

TEST(TileCosts, OneDisturbedFrameMovesThemByHalfAtMost) {
  TileCosts costs;
  EXPECT_TRUE(costs.costs().empty());
  costs.add(std::vector<double>{4.0, 8.0});
  costs.add(std::vector<double>{4.0, 80.0});
  EXPECT_EQ(costs.costs()[0], 4.0);
  EXPECT_EQ(costs.costs()[1], 44.0);
  for (int i = 0; i < 20; ++i) costs.add(std::vector<double>{4.0, 8.0});
  EXPECT_NEAR(costs.costs()[1], 8.0, 1e-3);
  costs.add(std::vector<double>{1.0});
  EXPECT_EQ(costs.costs().size(), 1U);
}

TEST(BalancedOwners, SlowestIsNearTheMeanAndFewTilesMove) {
  for (int ranks = 2; ranks <= 17; ++ranks) {
    const std::size_t tiles = 40 * static_cast<std::size_t>(ranks);
    const std::vector<double> costs = strewn_costs(tiles, 3.0, static_cast<std::uint32_t>(ranks));
    std::vector<int> before;
    for (std::size_t tile = 0; tile < tiles; ++tile) {  // a rank has more, the further down it stands
      before.push_back(static_cast<int>(std::sqrt(static_cast<double>(tile) / static_cast<double>(tiles)) * ranks));
    }
    const std::vector<int> owners = balance_owners(before, costs, ranks);
    EXPECT_GT(slowest_over_mean(loads_of(before, costs, ranks)), 1.15);
    EXPECT_LE(slowest_over_mean(loads_of(owners, costs, ranks)), 1.0 + kMinGain + 1e-9) << ranks;
    double moved = 0.0;
    double too_much = 0.0;
    const double mean = std::accumulate(costs.begin(), costs.end(), 0.0) / ranks;
    for (std::size_t tile = 0; tile < tiles; ++tile) moved += owners[tile] != before[tile] ? costs[tile] : 0.0;
    for (const double load : loads_of(before, costs, ranks)) too_much += std::max(load - mean, 0.0);
    EXPECT_LE(moved, 1.1 * too_much) << ranks;
  }
}

TEST(BalancedOwners, RanksNearTheMeanKeepTheirTiles) {
  const std::vector<int> owners{0, 0, 1, 1, -1};
  EXPECT_EQ(balance_owners(owners, std::vector<double>{1.0, 1.03, 1.0, 1.0, 9.0}, 2), owners);
}

TEST(BalancedOwners, ATileThatIsTooDearToHelpStays) {
  const std::vector<int> owners{0, 1, 1};
  EXPECT_EQ(balance_owners(owners, std::vector<double>{10.0, 1.0, 1.0}, 2), owners);
  // What lies beside it goes.
  EXPECT_EQ(balance_owners({0, 0, 1, 1}, std::vector<double>{10.0, 1.0, 1.0, 1.0}, 2), (std::vector<int>{0, 1, 1, 1}));
}

TEST(BalancedOwners, ARankWhoseTilesAreTooDearKeepsNoOtherFromGivingSomeAway) {
  const std::vector<double> costs{5.0, 1.5, 1.5, 1.5};
  const auto loads = loads_of(balance_owners({0, 1, 1, 1}, costs, 3), costs, 3);
  EXPECT_EQ(loads[0], 5.0);
  EXPECT_EQ(std::ranges::max(loads[1], loads[2]), 3.0);
}

TEST(BalancedOwners, ADearTileGoesWhereThatHelps) {
  const std::vector<int> owners = balance_owners({0, 0, 0}, std::vector<double>{5.0, 5.0, 5.0}, 3);
  EXPECT_EQ(loads_of(owners, std::vector<double>{5.0, 5.0, 5.0}, 3), (std::vector<double>{5.0, 5.0, 5.0}));
}

TEST(SlowestOverMean, IsOneWhereNobodyWorks) {
  EXPECT_EQ(slowest_over_mean(std::vector<double>{0.0, 0.0}), 1.0);
  EXPECT_EQ(slowest_over_mean(std::vector<double>{3.0, 1.0}), 1.5);
}

}  // namespace
}  // namespace hpr
