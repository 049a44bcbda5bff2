#include "compositing/model/synthetic.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/bytes.h"
#include "core/error.h"

namespace hpr {
namespace {

struct KnownFrame {
  SyntheticKind kind;
  Size size;
  int ranks;
  std::uint32_t seed;
  std::uint64_t xxh64;  ///< of the composited RGBA8 frame, by the definition's own program
};

const std::vector<KnownFrame> kKnownFrames{
    {SyntheticKind::Dense, {64, 48}, 1, 1, 0xa61fe60b106ff9f2},
    {SyntheticKind::Dense, {64, 48}, 2, 1, 0xfdff8ab16a744b83},
    {SyntheticKind::Dense, {64, 48}, 4, 1, 0x1e95c9a95922e3bd},
    {SyntheticKind::Dense, {64, 48}, 8, 1, 0x9deb41459e533a3d},
    {SyntheticKind::Half, {64, 48}, 1, 1, 0xc903ed825d4b47ce},
    {SyntheticKind::Half, {64, 48}, 2, 1, 0x910266fe2ab2c3f0},
    {SyntheticKind::Half, {64, 48}, 4, 1, 0x5e488a3e8407222e},
    {SyntheticKind::Half, {64, 48}, 8, 1, 0xdf90d59d8851214e},
    {SyntheticKind::Sparse, {64, 48}, 1, 1, 0x501590d808105930},
    {SyntheticKind::Sparse, {64, 48}, 2, 1, 0x710a288b14765ed8},
    {SyntheticKind::Sparse, {64, 48}, 4, 1, 0x0bc784fb7ab4a3b8},
    {SyntheticKind::Sparse, {64, 48}, 8, 1, 0xf8ad1ac9f53ad864},
    {SyntheticKind::Scatter, {64, 48}, 1, 1, 0xde5551e6e5cca848},
    {SyntheticKind::Scatter, {64, 48}, 2, 1, 0x2d14768a32d731c0},
    {SyntheticKind::Scatter, {64, 48}, 4, 1, 0xf80a4f765f1f79f5},
    {SyntheticKind::Scatter, {64, 48}, 8, 1, 0x10b3a8fcee88f17e},
    {SyntheticKind::Checker, {64, 48}, 1, 1, 0x3c2bf2fafa01ee16},
    {SyntheticKind::Checker, {64, 48}, 2, 1, 0x617cf21cd75403e0},
    {SyntheticKind::Checker, {64, 48}, 4, 1, 0x0c7cd8831ddd9cc0},
    {SyntheticKind::Checker, {64, 48}, 8, 1, 0x0f7f56f8689d3ea2},
    {SyntheticKind::Dense, {333, 217}, 1, 1, 0xa83afd4778344dde},
    {SyntheticKind::Dense, {333, 217}, 3, 1, 0x543c766d56a1a398},
    {SyntheticKind::Dense, {333, 217}, 8, 1, 0x7e37d517cae2450a},
    {SyntheticKind::Half, {333, 217}, 1, 1, 0x41f94ab102caa99a},
    {SyntheticKind::Half, {333, 217}, 3, 1, 0xb9eb89a77f4a8e08},
    {SyntheticKind::Half, {333, 217}, 8, 1, 0xa9072dae0e720396},
    {SyntheticKind::Sparse, {333, 217}, 1, 1, 0x8b3ad7d55f920eb4},
    {SyntheticKind::Sparse, {333, 217}, 3, 1, 0xa630ccfafee78285},
    {SyntheticKind::Sparse, {333, 217}, 8, 1, 0x92826f3c1426c914},
    {SyntheticKind::Scatter, {333, 217}, 1, 1, 0xc199bd7e032c0216},
    {SyntheticKind::Scatter, {333, 217}, 3, 1, 0xac47d148acf4c574},
    {SyntheticKind::Scatter, {333, 217}, 8, 1, 0x4fef400098b88349},
    {SyntheticKind::Checker, {333, 217}, 1, 1, 0x324e6650f14fd8c3},
    {SyntheticKind::Checker, {333, 217}, 3, 1, 0x25bd4dd2e4f2a921},
    {SyntheticKind::Checker, {333, 217}, 8, 1, 0xd969efc199e06334},
};

/// The nearest key of all ranks per pixel, row by row.
Image<Key> composited(const KnownFrame& frame) {
  Image<Key> nearest(frame.size);
  for (int rank = 0; rank < frame.ranks; ++rank) {
    const Image<Key> keys = to_image(synthetic_layer(frame.kind, rank, frame.size, frame.seed), 0);
    for (std::size_t i = 0; i < keys.pixels().size(); ++i) {
      nearest.pixels()[i] = std::max(nearest.pixels()[i], keys.pixels()[i]);
    }
  }
  return nearest;
}

std::uint64_t color_hash(const Image<Key>& keys) {
  std::vector<std::uint32_t> colors;
  for (const Key key : keys.pixels()) colors.push_back(key_rgba(key));
  return xxh64(std::as_bytes(std::span(colors)));
}

TEST(Synthetic, FramesHaveTheirPublishedHashes) {
  for (const KnownFrame& frame : kKnownFrames) {
    EXPECT_EQ(hex16(color_hash(composited(frame))), hex16(frame.xxh64))
        << name_of(frame.kind) << " " << frame.size.width << "x" << frame.size.height << " " << frame.ranks << " ranks";
  }
}

TEST(Synthetic, AWallShowsTheOnePictureInParts) {
  constexpr Size kScreen{70, 33};
  constexpr Size kGrid{3, 2};
  for (const SyntheticKind kind : all_synthetic_kinds()) {
    const Image<Key> whole = to_image(synthetic_layer(kind, 2, {210, 66}, 5), 0);
    const TileLayer<Key> wall = synthetic_wall(kind, 2, kScreen, kGrid, 5);
    std::size_t wrong = 0;
    for (int y = 0; y < whole.height(); ++y) {
      for (int x = 0; x < whole.width(); ++x) {
        const auto screen = static_cast<std::size_t>(y / kScreen.height * kGrid.width + x / kScreen.width);
        wrong += wall.at(screen, x % kScreen.width, y % kScreen.height) == whole.at(x, y) ? 0U : 1U;
      }
    }
    EXPECT_EQ(wrong, 0U) << name_of(kind);
  }
}

// The colours of a frame hardly show the depth's low bits, which keep ranks from tying; other ranks' layers do.
TEST(Synthetic, DepthsCarryTheTagOfTheirRank) {
  for (const int rank : {0, 1, 7, 254}) {
    const Image<Key> keys = to_image(synthetic_layer(SyntheticKind::Dense, rank, {130, 70}, 1), 0);
    for (const Key key : keys.pixels()) {
      const float depth = (1.0F - key_depth(key)) * 16777216.0F;
      ASSERT_EQ(static_cast<int>(depth) % 256, 1 + (rank * 37 + 11) % 255);
    }
  }
}

TEST(Synthetic, TilesWithoutAKeyAreEmpty) {
  const TileLayer<Key> sparse = synthetic_layer(SyntheticKind::Sparse, 0, {1920, 1080}, 1);
  EXPECT_LT(sparse.active_tiles(), sparse.tiles() / 5);
  EXPECT_GT(sparse.active_tiles(), sparse.tiles() / 10);
  const TileLayer<Key> dense = synthetic_layer(SyntheticKind::Dense, 0, {1920, 1080}, 1);
  EXPECT_EQ(dense.active_tiles(), dense.tiles());
}

TEST(Synthetic, AnUnknownKindNamesTheNearest) {
  EXPECT_EQ(parse_synthetic_kind("checker"), SyntheticKind::Checker);
  try {
    (void)parse_synthetic_kind("dens");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_EQ(error.hint(), "did you mean 'dense'? choices: dense, half, sparse, scatter, checker");
  }
}

}  // namespace
}  // namespace hpr
