#include "compositing/assembly.h"

namespace hpr {

std::vector<std::size_t> tiles_shown(const FrameLayout& layout, std::span<const int> shown_by, int rank) {
  std::vector<std::size_t> tiles;
  for (std::size_t screen = 0; screen < layout.screens(); ++screen) {
    if (shown_by[screen] != rank) continue;
    const TileRun run = layout.tiles_of(screen);
    for (std::size_t tile = run.first; tile < run.end(); ++tile) tiles.push_back(tile);
  }
  return tiles;
}

std::vector<std::byte> encode_choice(std::span<const std::size_t> wanted, std::span<const std::size_t> chosen) {
  std::vector<std::byte> bits((wanted.size() + 63) / 64 * 8);  // whole words keep what follows aligned
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (std::ranges::binary_search(chosen, wanted[i])) bits[i / 8] |= std::byte{1} << (i % 8);
  }
  return bits;
}

std::vector<std::size_t> decode_choice(std::span<const std::size_t> wanted, std::span<const std::byte>& bytes) {
  const std::size_t size = (wanted.size() + 63) / 64 * 8;
  if (bytes.size() < size) throw Error(ExitCode::Internal, "a message of tiles is malformed: no list of its tiles");
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < size * 8; ++i) {
    if ((bytes[i / 8] >> (i % 8) & std::byte{1}) == std::byte{0}) continue;
    if (i >= wanted.size())
      throw Error(ExitCode::Internal, "a message of tiles is malformed: it names a tile too many");
    chosen.push_back(wanted[i]);
  }
  bytes = bytes.subspan(size);
  return chosen;
}

}  // namespace hpr
