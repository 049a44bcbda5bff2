#include <gtest/gtest.h>

#include <bit>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "compositing/model/synthetic.h"
#include "compositing/strategies/radix_k.h"
#include "compositing/test_layers.h"
#include "core/error.h"

// What each strategy sends, held to what its paper says: messages exactly, bytes up to the head of a message.
namespace hpr {
namespace {

constexpr std::size_t kTileBytes = kTilePixels * sizeof(Key);
const Size kFrame{1024, 512};  // 128 whole tiles

struct Sent {
  std::size_t messages = 0;
  std::size_t tiles = 0;  ///< whole ones
  std::size_t owned = 0;
};

/// One object per strategy and rank, which one run after the other uses: what it keeps must not show.
Compositor& instance(std::string_view strategy, int rank) {
  static std::mutex mutex;
  static std::map<std::pair<std::string, int>, std::unique_ptr<Compositor>> instances;
  const std::lock_guard lock(mutex);
  auto& own = instances[{std::string(strategy), rank}];
  if (!own) own = make_compositor(strategy);
  return *own;
}

/// Per rank, for dense layers, without the activity that is shared first.
std::vector<Sent> traffic(std::string_view strategy, int ranks, bool shares_activity) {
  std::vector<Sent> sent(static_cast<std::size_t>(ranks));
  run_local_ranks(ranks, [&](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Key> layer = synthetic_layer(SyntheticKind::Dense, comm.rank(), kFrame, 1);
    const std::vector<std::size_t> tiles = all_tiles(layer.layout());
    const Composited mine = instance(strategy, comm.rank()).composite(counting, layer, tiles);
    const std::size_t sharing =
        shares_activity ? static_cast<std::size_t>(std::bit_width(static_cast<unsigned>(ranks - 1))) : 0;
    Sent& own = sent[static_cast<std::size_t>(comm.rank())];
    own = {counting.messages_sent() - sharing, counting.bytes_sent() / kTileBytes, mine.tiles.size()};
    // Heads, and per rank a bit and half a byte for each of 128 tiles, and how many bytes that is.
    EXPECT_LE(counting.bytes_sent() % kTileBytes, own.messages * 512 + static_cast<std::size_t>(ranks) * 88);
  });
  return sent;
}

// Ma et al. 1994, section 3: log2 P messages and N (1 - 1/P) pixels sent per rank; ranks past a power of two fold.
TEST(Strategies, BinarySwapSendsWhatThePaperSays) {
  for (int ranks = 2; ranks <= 17; ++ranks) {
    const auto members = std::bit_floor(static_cast<unsigned>(ranks));
    const auto sent = traffic("binary-swap", ranks, true);
    for (int rank = 0; rank < ranks; ++rank) {
      const Sent& own = sent[static_cast<std::size_t>(rank)];
      const bool folded = rank % 2 == 1 && rank < 2 * (ranks - static_cast<int>(members));
      if (folded) {
        EXPECT_EQ(own.messages, 1U);
        EXPECT_EQ(own.tiles, 128U);
        EXPECT_EQ(own.owned, 0U);
      } else {
        EXPECT_EQ(own.messages, std::bit_width(members) - 1U);
        EXPECT_EQ(own.tiles, 128U - own.owned);
        EXPECT_EQ(own.owned, 128U / members);
      }
    }
  }
}

// Peterka et al. 2009, section 3: in round i every rank sends k_i - 1 messages; N (1 - 1/P) pixels in all.
TEST(Strategies, RadixKSendsWhatThePaperSays) {
  EXPECT_EQ(radix_factors(1), std::vector<int>{});
  EXPECT_EQ(radix_factors(8), std::vector<int>{8});
  EXPECT_EQ(radix_factors(12), (std::vector<int>{6, 2}));
  EXPECT_EQ(radix_factors(17), std::vector<int>{17});
  EXPECT_EQ(radix_factors(512), (std::vector<int>{8, 8, 8}));
  for (int ranks = 2; ranks <= 17; ++ranks) {
    std::size_t messages = 0;
    for (const int factor : radix_factors(ranks)) messages += static_cast<std::size_t>(factor) - 1;
    for (const Sent& own : traffic("radix-k", ranks, true)) {
      EXPECT_EQ(own.messages, messages);
      EXPECT_EQ(own.tiles, 128U - own.owned);
      EXPECT_NEAR(static_cast<double>(own.owned), 128.0 / ranks, 1.0);
    }
  }
}

TEST(Strategies, RadixKTakesFactorsAndRefusesOthers) {
  EXPECT_EQ(make_compositor("radix-k:4,2")->name(), "radix-k:4,2");
  EXPECT_TRUE(make_compositor("radix-k:4,2")->fits(8));
  EXPECT_FALSE(make_compositor("radix-k:4,2")->fits(6));
  EXPECT_FALSE(make_compositor("radix-k:65536,65536,65536")->fits(1));
  for (const std::string_view bad : {"", ",", "4,", "1", "4,,2", "-2", "2x", "4 2", "99999999999"}) {
    EXPECT_THROW((void)make_compositor(std::string("radix-k:") + std::string(bad)), Error) << bad;
  }
}

// Hsu 1993: every rank sends one message to every other; N (1 - 1/P) pixels.
TEST(Strategies, DirectSendSendsEveryOtherRankItsPiece) {
  for (int ranks = 2; ranks <= 17; ++ranks) {
    for (const Sent& own : traffic("direct-send", ranks, true)) {
      EXPECT_EQ(own.messages, static_cast<std::size_t>(ranks) - 1);
      EXPECT_EQ(own.tiles, 128U - own.owned);
      EXPECT_NEAR(static_cast<double>(own.owned), 128.0 / ranks, 1.0);
    }
  }
}

TEST(Strategies, RingHandsOnAllPiecesButOne) {
  for (int ranks = 2; ranks <= 17; ++ranks) {
    const auto sent = traffic("ring", ranks, true);
    for (std::size_t rank = 0; rank < sent.size(); ++rank) {
      EXPECT_EQ(sent[rank].messages, static_cast<std::size_t>(ranks) - 1);
      EXPECT_EQ(sent[rank].tiles, 128U - sent[rank].owned);
      EXPECT_NEAR(static_cast<double>(sent[rank].owned), 128.0 / ranks, 1.0);
    }
  }
}

TEST(Strategies, SerialAndTreeSendEveryLayerOnce) {
  for (int ranks = 2; ranks <= 17; ++ranks) {
    for (const char* const strategy : {"serial", "tree"}) {
      const auto sent = traffic(strategy, ranks, false);
      for (std::size_t rank = 0; rank < sent.size(); ++rank) {
        EXPECT_EQ(sent[rank].messages, rank == 0 ? 0U : 1U);
        EXPECT_EQ(sent[rank].tiles, rank == 0 ? 0U : 128U);
        EXPECT_EQ(sent[rank].owned, rank == 0 ? 128U : 0U);
      }
    }
  }
}

TEST(Strategies, SharedMemorySendsNoPixelsOnOneHost) {
  run_local_ranks(5, [](Communicator& comm) {
    CountingCommunicator counting(comm);
    const auto strategy = make_compositor("shared-memory");
    for (int frame = 0; frame < 3; ++frame) {
      TileLayer<Key> layer = synthetic_layer(SyntheticKind::Dense, comm.rank(), kFrame, 1);
      (void)strategy->composite(counting, layer, all_tiles(layer.layout()));
    }
    EXPECT_LT(counting.bytes_sent(), 1000U);  // who is where, once
  });
}

TEST(Strategies, EmptyTilesCostABitAndDirectSendSendsNothingOfThem) {
  run_local_ranks(4, [](Communicator& comm) {
    TileLayer<Key> layer(FrameLayout({{4096, 2048}}));
    const std::vector<std::size_t> tiles = all_tiles(layer.layout());
    CountingCommunicator swap(comm);
    (void)make_compositor("binary-swap")->composite(swap, layer, tiles);
    const std::size_t sharing = 3 * (8 + tiles.size() / 8);  // one rank's bits, then two ranks', each with its size
    EXPECT_EQ(swap.bytes_sent(), sharing + 8 + 1024 / 8 + 8 + 512 / 8);
    CountingCommunicator direct(comm);
    (void)make_compositor("direct-send")->composite(direct, layer, tiles);
    EXPECT_EQ(direct.bytes_sent(), sharing);
    EXPECT_EQ(direct.messages_sent(), 2U);
  });
}

/// A layer with something in one screen's tiles only.
TileLayer<Key> layer_on_screen(const FrameLayout& layout, std::size_t screen, int rank) {
  TileLayer<Key> layer(layout);
  const TileRun run = layout.tiles_of(screen);
  for (std::size_t tile = run.first; tile < run.end(); ++tile) {
    layer.set_active(tile);
    std::ranges::fill(layer.tile(tile), make_key(0.5F, static_cast<std::uint32_t>(rank)));
  }
  return layer;
}

TEST(Strategies, PiecesGoStraightToTheirScreensWhereThoseShareTheWorkEvenly) {
  const FrameLayout layout({{256, 128}, {256, 128}, {256, 128}, {256, 128}});
  const std::vector<int> shown_by{2, 0, 3, 1};
  for (const char* const strategy : {"direct-send", "shared-memory"}) {
    run_local_ranks(4, [&](Communicator& comm) {
      TileLayer<Key> layer = test::random_layer(comm.rank(), layout);
      const Composited mine = instance(strategy, comm.rank()).composite(comm, layer, all_tiles(layout), shown_by);
      EXPECT_TRUE(mine.assembled);
      for (const std::size_t tile : mine.tiles) EXPECT_EQ(shown_by[layout.place(tile).screen], comm.rank());
      EXPECT_EQ(mine.tiles.size(), 8U);
    });
  }
}

TEST(Strategies, DirectSendDoesNotPileTheWorkOnARankThatShowsEverything) {
  const FrameLayout layout({{512, 256}});
  run_local_ranks(4, [&](Communicator& comm) {
    TileLayer<Key> layer = test::random_layer(comm.rank(), layout);
    const Composited mine =
        make_compositor("direct-send")->composite(comm, layer, all_tiles(layout), std::vector<int>{0});
    EXPECT_FALSE(mine.assembled);
    EXPECT_NEAR(static_cast<double>(mine.tiles.size()), 8.0, 4.0);
  });
}

TEST(Strategies, ARankTakesNoPartWhereItDrewNothing) {
  const FrameLayout layout({{256, 128}, {256, 128}, {256, 128}});
  run_local_ranks(3, [&](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Key> layer = layer_on_screen(layout, static_cast<std::size_t>(comm.rank()), comm.rank());
    const Composited mine =
        make_compositor("direct-send")->composite(counting, layer, all_tiles(layout), std::vector<int>{0, 1, 2});
    EXPECT_TRUE(mine.assembled);
    EXPECT_EQ(counting.messages_sent(), 2U);  // activity alone
  });
}

}  // namespace
}  // namespace hpr
