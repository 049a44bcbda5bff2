#include "compositing/model/recorded_frame.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

constexpr std::size_t kTileBytes = kTilePixels * sizeof(Key);

RecordedFrame record(std::string_view strategy, const LocalRanks& ranks) {
  return record_frame([&] { return make_compositor(strategy); }, ranks);
}

struct Arrow {
  int round;
  int from;
  int to;
  std::size_t tiles;

  bool operator==(const Arrow&) const = default;
};

/// Messages that carry tiles, in rounds counted from the first of them.
std::vector<Arrow> arrows(const Schedule& schedule) {
  std::vector<Arrow> arrows;
  for (const Transfer& transfer : schedule.transfers) {
    const std::size_t tiles = transfer.bytes / kTileBytes;
    if (tiles > 0) arrows.push_back({transfer.round, transfer.from, transfer.to, tiles});
  }
  const int first = arrows.empty() ? 0 : arrows.front().round;
  for (Arrow& arrow : arrows) arrow.round -= first;
  return arrows;
}

// Ma et al. 1994, figure 3: first neighbours swap halves, then ranks two apart swap quarters.
TEST(RecordedFrame, BinarySwapOfFourRanksIsWhatThePaperDraws) {
  const RecordedFrame frame = record("binary-swap", {.size = 4});
  EXPECT_EQ(frame.tiles, 64U);
  EXPECT_EQ(arrows(frame.composite), (std::vector<Arrow>{{0, 0, 1, 32},
                                                         {0, 1, 0, 32},
                                                         {0, 2, 3, 32},
                                                         {0, 3, 2, 32},
                                                         {1, 0, 2, 16},
                                                         {1, 1, 3, 16},
                                                         {1, 2, 0, 16},
                                                         {1, 3, 1, 16}}));
  EXPECT_EQ(arrows(frame.collect), (std::vector<Arrow>{{0, 1, 0, 16}, {0, 2, 0, 16}, {0, 3, 0, 16}}));
}

TEST(RecordedFrame, AFoldedRankGivesItsLayerAwayBeforeTheSwaps) {
  EXPECT_EQ(arrows(record("binary-swap", {.size = 3}).composite),
            (std::vector<Arrow>{{0, 1, 0, 64}, {1, 0, 2, 32}, {1, 2, 0, 32}}));
}

TEST(RecordedFrame, TheTreeHalvesItsRanksInEveryRound) {
  EXPECT_EQ(
      arrows(record("tree", {.size = 7}).composite),
      (std::vector<Arrow>{{0, 1, 0, 64}, {0, 3, 2, 64}, {0, 5, 4, 64}, {1, 2, 0, 64}, {1, 6, 4, 64}, {2, 4, 0, 64}}));
}

TEST(RecordedFrame, TheRingHandsOnToTheNextRank) {
  const auto found = arrows(record("ring", {.size = 4}).composite);
  ASSERT_EQ(found.size(), 12U);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const int from = static_cast<int>(i % 4);
    EXPECT_EQ(found[i], (Arrow{static_cast<int>(i / 4), from, (from + 1) % 4, 16}));
  }
}

TEST(RecordedFrame, SharedMemoryMeetsMergesInPlaceAndMeets) {
  const RecordedFrame frame = record("shared-memory", {.size = 4});
  EXPECT_TRUE(frame.composite.transfers.empty());
  EXPECT_EQ(frame.composite.barriers, (std::vector<Barrier>{{0, {0, 1, 2, 3}}, {2, {0, 1, 2, 3}}}));
  // Three of four layers are read into the one that is shown.
  EXPECT_EQ(frame.composite.works, (std::vector<InPlaceWork>{{1, {0, 1, 2, 3}, 3 * 64 * kTileBytes}}));
  EXPECT_TRUE(frame.collect.transfers.empty());
}

TEST(RecordedFrame, BetweenHostsSharedMemorySendsWhatItsRanksHaveMerged) {
  const RecordedFrame frame = record("shared-memory", {.size = 4, .ranks_per_host = 2});
  EXPECT_EQ(frame.composite.works.size(), 2U);
  EXPECT_EQ(arrows(frame.composite), (std::vector<Arrow>{{0, 0, 2, 16}, {0, 1, 3, 16}, {0, 2, 0, 16}, {0, 3, 1, 16}}));
  EXPECT_EQ(arrows(frame.collect).size(), 3U);
}

TEST(RecordedFrame, TheSameStrategyGivesTheSameRecord) {
  for (const auto& compositor : all_compositors()) {
    const RecordedFrame one = record(compositor->name(), {.size = 6});
    const RecordedFrame other = record(compositor->name(), {.size = 6, .disorder = 7});
    EXPECT_EQ(one.composite.transfers, other.composite.transfers) << compositor->name();
    EXPECT_EQ(one.composite.barriers, other.composite.barriers) << compositor->name();
    EXPECT_EQ(one.composite.works, other.composite.works) << compositor->name();
    EXPECT_EQ(one.collect.transfers, other.collect.transfers) << compositor->name();
    EXPECT_EQ(one.composite.rounds, other.composite.rounds) << compositor->name();
  }
}

}  // namespace
}  // namespace hpr
