#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "compositing/test_layers.h"

// Random sets of layers, each composited by every strategy on ranks that delay and reorder their messages. The
// environment variable HPR_RANDOM_SETS says how many (150 by default; the ctest `compositing_random_layers` takes
// 10 000).
namespace hpr {
namespace {

/// One set: who draws what, where, and how the ranks behave.
struct Case {
  explicit Case(std::uint64_t seed) : random(seed) {
    const auto upto = [&](int most) { return 1 + static_cast<int>(random() % static_cast<std::uint64_t>(most)); };
    ranks.size = upto(9);
    ranks.ranks_per_host = random() % 2 == 0 ? 0 : upto(4);
    ranks.disorder = random() % 3 == 0 ? seed + 1 : 0;
    std::vector<Size> screens;
    for (int screen = upto(3); screen > 0; --screen) screens.push_back({upto(150), upto(150)});
    layout = FrameLayout(screens);
    const std::uint64_t keeps = random() % 4;
    for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
      if (keeps == 0 || random() % 8 >= keeps) tiles.push_back(tile);
    }
    for (std::size_t screen = 0; screen < layout.screens(); ++screen) shown_by.push_back(upto(ranks.size) - 1);
    for (int rank = 0; rank < ranks.size; ++rank) layers.push_back(layer());
  }

  /// Pixels drawn with a probability of its own in every tile: none, few, half, nearly all, all.
  TileLayer<Key> layer() {
    TileLayer<Key> drawn(layout);
    const std::uint64_t style = random() % 6;
    for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
      const std::uint64_t per_mille =
          std::array<std::uint64_t, 6>{0, 2, 500, 740, 990, 1000}.at(style == 5 ? random() % 6 : style);
      if (per_mille == 0 && random() % 2 == 0) continue;
      drawn.set_active(tile);  // perhaps without a pixel
      for (Key& key : drawn.tile(tile)) {
        if (random() % 1000 < per_mille)
          key = make_key(test::awkward_depth(random), static_cast<std::uint32_t>(random() % 4));
      }
    }
    return drawn;
  }

  [[nodiscard]] std::vector<Key> expected() const {
    std::vector<Key> nearest(layout.tiles() * kTilePixels, kNoKey);
    for (const TileLayer<Key>& each : layers) {
      const auto keys = each.run({0, each.tiles()});
      for (std::size_t i = 0; i < nearest.size(); ++i) nearest[i] = std::max(nearest[i], keys[i]);
    }
    return nearest;
  }

  std::mt19937_64 random;
  LocalRanks ranks;
  FrameLayout layout;
  std::vector<std::size_t> tiles;
  std::vector<int> shown_by;
  std::vector<TileLayer<Key>> layers;
};

/// `auto` measures the machine for every new set of ranks, which under sanitizers takes longer than all else together:
/// it takes part in one set of so many.
constexpr std::uint64_t kSetsPerAuto = 16;

/// Composites the case by every strategy and brings each frame to its screens; returns what is wrong.
std::string faults(const Case& one, bool with_auto) {
  const std::vector<Key> expected = one.expected();
  std::string wrong;
  std::mutex mutex;
  run_local_ranks(one.ranks, [&](Communicator& comm) {
    const auto memory = comm.share(TileLayer<Key>::bytes_for(one.layout));
    Assembler assembler;
    for (const auto& compositor : all_compositors()) {
      if (compositor->name() == "auto" && !with_auto) continue;
      TileLayer<Key> layer(one.layout, memory);
      copy_tiles(one.layers[static_cast<std::size_t>(comm.rank())], layer, all_tiles(one.layout));
      const Composited mine = compositor->composite(comm, layer, one.tiles, one.shown_by);
      if (!mine.assembled) assembler.assemble(comm, layer, mine.tiles, one.shown_by);
      for (const std::size_t tile : one.tiles) {
        if (one.shown_by[one.layout.place(tile).screen] != comm.rank()) continue;
        const auto want = std::span(expected).subspan(tile * kTilePixels, kTilePixels);
        const bool empty = std::ranges::all_of(want, [](Key key) { return key == kNoKey; });
        const bool right = layer.active(tile) ? std::ranges::equal(layer.tile(tile), want) : empty;
        if (right) continue;
        const std::lock_guard lock(mutex);
        wrong += std::string(compositor->name()) + " tile " + std::to_string(tile) + "; ";
      }
    }
  });
  return wrong;
}

TEST(RandomLayers, EveryStrategyGivesTheNearestKeysOfEverySet) {
  const char* const sets = std::getenv("HPR_RANDOM_SETS");  // NOLINT(concurrency-mt-unsafe): nothing sets variables
  const std::uint64_t count = sets != nullptr ? std::stoull(sets) : 150;
  for (std::uint64_t seed = 0; seed < count; ++seed) {
    const Case one(seed);
    ASSERT_EQ(faults(one, seed % kSetsPerAuto == 0), "") << "seed " << seed << ", " << one.ranks.size << " ranks";
  }
}

}  // namespace
}  // namespace hpr
