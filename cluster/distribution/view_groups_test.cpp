#include "cluster/distribution/view_groups.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "cluster/distribution/balance.h"

namespace hpr {
namespace {

/// Chunks all over the screens, from a few pixels to whole screens, `large` in a hundred of them.
std::vector<ScreenChunk> scattered(const FrameLayout& layout, std::uint32_t count, std::uint32_t seed, int large = 2) {
  std::mt19937 random(seed);
  const auto below = [&](int end) { return static_cast<int>(random() % static_cast<unsigned>(std::max(end, 1))); };
  std::vector<ScreenChunk> chunks;
  for (std::size_t screen = 0; screen < layout.screens(); ++screen) {
    const Size size = layout.size(screen);
    for (std::uint32_t i = 0; i < count; ++i) {
      ScreenChunk chunk;
      chunk.surfaces = {i * 100, i * 100 + 1 + static_cast<std::uint32_t>(below(100))};
      chunk.screen = static_cast<std::uint32_t>(screen);
      const int side = below(100) < large ? std::max(size.width, size.height) : 1 + below(90);
      const int x = below(size.width);
      const int y = below(size.height);
      chunk.pixels = {x, y, std::min(size.width, x + side), std::min(size.height, y + side)};
      chunk.covered = 0.5F * static_cast<float>(chunk.pixels.area());
      if (below(4) != 0) chunks.push_back(chunk);  // others are out of sight
    }
  }
  return chunks;
}

/// Moves all chunks by so many pixels, as far as the screen goes.
std::vector<ScreenChunk> moved(std::vector<ScreenChunk> chunks, const FrameLayout& layout, int by) {
  for (ScreenChunk& chunk : chunks) {
    const Size size = layout.size(chunk.screen);
    chunk.pixels.x0 = std::clamp(chunk.pixels.x0 + by, 0, size.width - 1);
    chunk.pixels.x1 = std::clamp(chunk.pixels.x1 + by, chunk.pixels.x0 + 1, size.width);
  }
  return chunks;
}

/// Fails unless every tile that a chunk may touch is that of a part of it, of a rank that knows that it draws there,
/// and is owned by one that does.
void expect_complete(const ViewGroups& groups, const FrameLayout& layout, std::span<const ScreenChunk> chunks) {
  ASSERT_EQ(groups.owners.size(), layout.tiles());
  std::vector<std::vector<bool>> covered(chunks.size(), std::vector<bool>(layout.tiles(), false));
  std::vector<std::vector<bool>> draws(groups.parts.size(), std::vector<bool>(layout.tiles(), false));
  std::vector<bool> touched(layout.tiles(), false);
  for (std::size_t rank = 0; rank < groups.parts.size(); ++rank) {
    EXPECT_TRUE(std::ranges::is_sorted(groups.parts[rank], {}, &ViewGroups::Part::chunk));
    EXPECT_TRUE(std::ranges::is_sorted(groups.tiles[rank]));
    for (const std::size_t tile : groups.tiles[rank]) draws[rank][tile] = true;
    for (const ViewGroups::Part& part : groups.parts[rank]) {
      for (int y = part.tiles.y0; y < part.tiles.y1; ++y) {
        for (int x = part.tiles.x0; x < part.tiles.x1; ++x) {
          const std::size_t tile = layout.tile_at(chunks[part.chunk].screen, x * kTileSide, y * kTileSide);
          covered[part.chunk][tile] = true;
          EXPECT_TRUE(draws[rank][tile]);
        }
      }
    }
  }
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
      const TilePlace location = layout.place(tile);
      if (location.screen != chunks[i].screen || intersection(location.pixels, chunks[i].pixels).empty()) continue;
      EXPECT_TRUE(covered[i][tile]) << "chunk " << i << ", tile " << tile;
      touched[tile] = true;
    }
  }
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
    ASSERT_GE(groups.owners[tile], 0);
    ASSERT_LT(groups.owners[tile], static_cast<int>(groups.parts.size()));
    EXPECT_TRUE(!touched[tile] || draws[static_cast<std::size_t>(groups.owners[tile])][tile]) << tile;
  }
}

const std::vector<std::vector<Size>> kLayouts{
    {{1, 1}}, {{640, 480}}, {{1920, 1080}}, {{63, 900}}, {{320, 200}, {320, 200}, {100, 700}}};

TEST(ViewGroups, EveryChunkIsDrawnWhereverItMayShowAndTilesAreOwnedByWhoDrawsThere) {
  for (const auto& sizes : kLayouts) {
    const FrameLayout layout(sizes);
    for (const int ranks : {1, 2, 3, 5, 8, 17}) {
      for (const DrawSpeeds& speeds : {DrawSpeeds{}, DrawSpeeds{.triangle = 0.5}, DrawSpeeds{.merge = 0.01}}) {
        const auto chunks = scattered(layout, 150, 7);
        expect_complete(group_by_view(layout, chunks, ranks, speeds), layout, chunks);
      }
    }
  }
  const FrameLayout layout({{640, 480}});
  expect_complete(group_by_view(layout, {}, 4, {}), layout, {});
}

TEST(ViewGroups, TheyDoSoWhereTheViewMoves) {
  for (const auto& sizes : kLayouts) {
    const FrameLayout layout(sizes);
    for (const int ranks : {1, 2, 5, 8}) {
      auto before = scattered(layout, 150, 3, 10);
      ViewGroups groups = group_by_view(layout, before, ranks, {});
      for (int frame = 0; frame < 6; ++frame) {
        // Some leave, some come, some move a little and some far.
        auto chunks = frame == 3 ? scattered(layout, 150, 4, 10) : moved(before, layout, 37 * frame);
        groups = follow_view(groups, before, layout, chunks, {});
        expect_complete(groups, layout, chunks);
        before = std::move(chunks);
      }
    }
  }
}

TEST(ViewGroups, WorkIsEvenAndOwnersAreBalanced) {
  const FrameLayout layout({{1920, 1080}});
  const auto chunks = scattered(layout, 4000, 1, 0);
  for (const int ranks : {2, 3, 8, 16}) {
    const ViewGroups groups = group_by_view(layout, chunks, ranks, {});
    EXPECT_LT(slowest_over_mean(groups.draw_ns), 1.15) << ranks;
    EXPECT_LT(slowest_over_mean(groups.light_ns), ranks <= 8 ? 1.2 : 1.3) << ranks;  // of few tiles each
    EXPECT_LT(groups.overlap, ranks == 2 ? 1.2 : 2.2) << ranks;
  }
}

TEST(ViewGroups, ChunksThatSpanTheScreenAreDrawnByAllWhoseTilesTheyTouchWhereThatTakesLess) {
  const FrameLayout layout({{1024, 1024}});
  std::vector<ScreenChunk> chunks;
  for (std::uint32_t i = 0; i < 16; ++i) chunks.push_back({{2 * i, 2 * i + 2}, 0, {0, 0, 1024, 1024}, 600'000.0F});
  EXPECT_DOUBLE_EQ(group_by_view(layout, chunks, 8, {}).overlap, 1.0);
  for (const auto& parts : group_by_view(layout, chunks, 8, {}).parts) EXPECT_EQ(parts.size(), chunks.size());
  const ViewGroups merged = group_by_view(layout, chunks, 8, {.triangle = 1e9});
  for (const auto& parts : merged.parts) EXPECT_EQ(parts.size(), 2U);
}

TEST(ViewGroups, AViewThatMovesALittleLeavesChunksWithTheirRanks) {
  const FrameLayout layout({{1920, 1080}});
  const auto before = scattered(layout, 3000, 5, 0);
  const ViewGroups groups = group_by_view(layout, before, 8, {});
  const auto after = moved(before, layout, 3);
  const ViewGroups followed = follow_view(groups, before, layout, after, {});
  std::vector<std::vector<std::size_t>> had(before.size());
  std::vector<std::vector<std::size_t>> has(before.size());
  for (std::size_t rank = 0; rank < 8; ++rank) {
    for (const ViewGroups::Part& part : groups.parts[rank]) had[part.chunk].push_back(rank);
    for (const ViewGroups::Part& part : followed.parts[rank]) has[part.chunk].push_back(rank);
  }
  std::size_t single = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (had[i].size() != 1) continue;  // of several ranks, each draws its own tiles of it
    EXPECT_EQ(had[i], has[i]) << i;
    ++single;
  }
  EXPECT_GT(single, before.size() / 2);
}

TEST(ViewGroups, TheyAreMadeAnewWhereOneRankWouldDrawMost) {
  const FrameLayout layout({{1920, 1080}});
  const auto before = scattered(layout, 3000, 5, 0);
  const ViewGroups groups = group_by_view(layout, before, 8, {});
  // What the others draw has left.
  std::vector<ScreenChunk> after;
  for (const ViewGroups::Part& part : groups.parts[3]) after.push_back(before[part.chunk]);
  const ViewGroups followed = follow_view(groups, before, layout, after, {});
  EXPECT_LT(slowest_over_mean(followed.draw_ns), 1.5);
  expect_complete(followed, layout, after);
}

TEST(ViewGroups, ARankKnowsItsSurfacesAndItsAreaOfEachScreen) {
  const FrameLayout layout({{200, 100}, {300, 300}});
  const std::vector<ScreenChunk> chunks{{{0, 5}, 0, {0, 0, 200, 100}, 9.0F},
                                        {{5, 8}, 0, {70, 10, 80, 20}, 9.0F},
                                        {{20, 30}, 0, {0, 0, 9, 9}, 9.0F},
                                        {{5, 8}, 1, {130, 70, 140, 299}, 9.0F}};
  const ViewGroups groups = group_by_view(layout, chunks, 1, {});
  EXPECT_EQ(drawn_surfaces(groups, chunks, 0, 0), (std::vector<SurfaceRange>{{0, 8}, {20, 30}}));
  EXPECT_EQ(drawn_surfaces(groups, chunks, 0, 1), (std::vector<SurfaceRange>{{5, 8}}));
  EXPECT_EQ(drawn_area(groups, layout, chunks, 0, 0), (Rect{0, 0, 200, 100}));
  EXPECT_EQ(drawn_area(groups, layout, chunks, 0, 1), (Rect{128, 64, 192, 300}));
}

}  // namespace
}  // namespace hpr
