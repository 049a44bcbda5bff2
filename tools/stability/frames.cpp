#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <mutex>

#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30U;

/// Sixty-four bits that look random (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
std::uint64_t mix_bits(std::uint64_t bits) {
  bits = (bits ^ (bits >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  bits = (bits ^ (bits >> 27U)) * 0x94D049BB133111EBULL;
  return bits ^ (bits >> 31U);
}

/// Places of a screen at which arithmetic would go wrong first: at its corners, in its middle, and scattered.
std::vector<std::array<int, 2>> test_positions(Size size, std::uint64_t seed) {
  const int right = size.width - 1;
  const int bottom = size.height - 1;
  std::vector<std::array<int, 2>> all{{0, 0}, {right, 0}, {0, bottom}, {right, bottom}, {right / 2, bottom / 2}};
  for (std::uint64_t i = 0; i < 200; ++i) {
    const std::uint64_t bits = mix_bits(seed * 1000 + i);
    all.push_back({static_cast<int>(bits % static_cast<std::uint64_t>(size.width)),
                   static_cast<int>((bits >> 32U) % static_cast<std::uint64_t>(size.height))});
  }
  return all;
}

/// A frame of `screens` screens of 65536 x 32768 pixels, 2^31 each: places whose tile is not the one the definition of
/// the layout names, or that the tile does not name again.
std::size_t wrong_tiles(std::size_t screens) {
  constexpr Size kScreen{65536, 32768};
  constexpr std::uint64_t kColumns = 65536 / kTileSide;
  constexpr std::uint64_t kTiles = kColumns * (32768 / kTileSide);
  const FrameLayout layout(std::vector<Size>(screens, kScreen));
  std::size_t wrong = layout.tiles() == kTiles * screens ? 0U : 1U;
  const std::uint64_t bytes = TileLayer<Key>::bytes_for(layout);
  wrong += bytes >= kTiles * screens * kTilePixels * sizeof(Key) &&
                   bytes < kTiles * screens * (kTilePixels * sizeof(Key) + 2) + 64
               ? 0U
               : 1U;
  for (std::size_t screen = 0; screen < screens; ++screen) {
    for (const auto& [x, y] : test_positions(kScreen, screen)) {
      const auto column = static_cast<std::uint64_t>(x) / kTileSide;
      const auto row = static_cast<std::uint64_t>(y) / kTileSide;
      const std::size_t tile = layout.tile_at(screen, x, y);
      const TilePlace tile_place = layout.place(tile);
      const bool named = tile == screen * kTiles + row * kColumns + column;
      const bool names = tile_place.screen == screen && tile_place.pixels.x0 == static_cast<int>(column) * kTileSide &&
                         tile_place.pixels.y0 == static_cast<int>(row) * kTileSide;
      wrong += named && names ? 0U : 1U;
    }
  }
  return wrong;
}

StabilityFinding layout_arithmetic() {
  StabilityFinding finding =
      make_finding("frames/layout", "frames of 2^31 .. 2^36 pixels: tiles by place, places by tile, bytes of a layer",
                   0.0, "wrong answers", "All of it counts in 64 bits.");
  finding.curve.x = "pixels of the frame";
  for (std::size_t screens = 1; screens <= 32; screens *= 2) {
    const auto wrong = static_cast<double>(wrong_tiles(screens));
    finding.curve.points.emplace_back(static_cast<double>(screens) * 0x1p31, wrong);
    finding.measured += wrong;
  }
  return finding;
}

/// Any key, another one for every rank and pixel.
Key far_key(int rank, std::size_t tile, std::size_t pixel) {
  return mix_bits((tile * kTilePixels + pixel) * 2 + static_cast<std::size_t>(rank));
}

/// Keys of the tiles two ranks composite that are not the larger one of theirs. Tiles nobody came to own: a whole
/// tile's.
double wrong_composites(const FrameLayout& layout, const std::vector<std::size_t>& tiles, const std::string& strategy) {
  std::size_t owned = 0;
  std::size_t wrong = 0;
  std::mutex mutex;
  run_local_ranks(2, [&](Communicator& comm) {
    TileLayer<Key> layer(layout);
    for (const std::size_t tile : tiles) {
      for (std::size_t i = 0; i < kTilePixels; ++i) layer.tile(tile)[i] = far_key(comm.rank(), tile, i);
      layer.set_active(tile);
    }
    const Composited mine = make_compositor(strategy)->composite(comm, layer, tiles);
    const std::lock_guard lock(mutex);
    owned += mine.tiles.size();
    for (const std::size_t tile : mine.tiles) {
      for (std::size_t i = 0; i < kTilePixels; ++i) {
        wrong += layer.tile(tile)[i] == std::max(far_key(0, tile, i), far_key(1, tile, i)) ? 0U : 1U;
      }
    }
  });
  return static_cast<double>(owned == tiles.size() ? wrong : wrong + kTilePixels);
}

/// Two ranks composite a few tiles of a frame of 2^32 bytes, the last ones among them; the others stay untouched
/// memory.
StabilityFinding composited_far_out() {
  const FrameLayout layout(std::vector<Size>(2, Size{16384, 16384}));
  std::vector<std::size_t> tiles;
  for (const std::size_t index_of_64 : {0U, 1U, 31U, 32U, 33U, 63U}) tiles.push_back(layout.tiles() / 64 * index_of_64);
  tiles.push_back(layout.tiles() - 1);
  StabilityFinding finding = make_finding(
      "frames/composited",
      fmt::format("tiles from the first to the last of a layer of {} bytes, 2 ranks, all strategies that send messages",
                  TileLayer<Key>::bytes_for(layout)),
      0.0, "wrong keys", "Tiles are found by 64-bit offsets.");
  for (const auto& each : all_compositors()) {
    // Those that merge in shared memory would touch as much of it as the layers are large.
    if (each->fits(2) && !each->merges_in_place()) {
      finding.measured += wrong_composites(layout, tiles, std::string(each->name()));
    }
  }
  return finding;
}

/// Bytes of memory that the system reports as available.
std::uint64_t available_memory() {
  std::ifstream meminfo("/proc/meminfo");
  std::string name;
  std::uint64_t kib = 0;
  while (meminfo >> name >> kib) {
    if (name == "MemAvailable:") return kib << 10U;
    std::getline(meminfo, name);
  }
  return 0;
}

/// One message of more bytes than 31 bits count, from a rank to another.
StabilityFinding long_message() {
  const std::uint64_t wanted = 2 * kGiB + (std::uint64_t{1} << 20U);
  // Two copies of it live at once.
  const std::uint64_t bytes = std::min(wanted, available_memory() / 4) / sizeof(std::uint64_t) * sizeof(std::uint64_t);
  const std::size_t words = bytes / sizeof(std::uint64_t);
  const auto word_of = [](std::size_t i) { return i * 0x9E3779B97F4A7C15ULL + 1; };
  std::size_t wrong = 0;
  run_local_ranks(2, [&](Communicator& comm) {
    if (comm.rank() == 0) {
      std::vector<std::uint64_t> message(words);
      for (std::size_t i = 0; i < words; ++i) message[i] = word_of(i);
      comm.send(std::as_bytes(std::span(message)), 1);
    } else {
      const std::vector<std::byte> message = comm.receive(0);
      if (message.size() != bytes) {
        wrong = words;
        return;
      }
      for (std::size_t i = 0; i < words; ++i) {
        std::uint64_t word = 0;
        std::memcpy(&word, message.data() + i * sizeof word, sizeof word);
        wrong += word == word_of(i) ? 0U : 1U;
      }
    }
  });
  StabilityFinding finding =
      make_finding("frames/message",
                   fmt::format("a message of {} bytes between two ranks, threads of one process{}", bytes,
                               bytes < wanted ? "; memory is too short for more than 2^31" : ""),
                   0.0, "wrong words of 8 bytes", "Sizes of messages are 64-bit throughout.");
  finding.measured = static_cast<double>(wrong);
  return finding;
}

std::vector<StabilityFinding> measure_frames(const Globals& /*globals*/) {
  return {layout_arithmetic(), composited_far_out(), long_message()};
}

}  // namespace

StabilityCase frames_case() {
  return {"frames", "frames and messages past 2^31 bytes", measure_frames};
}

}  // namespace hpr::stability
