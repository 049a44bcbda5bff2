#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>
#include <vector>

#include "cluster/communicator.h"
#include "compositing/tile_codec.h"
#include "core/check.h"
#include "core/error.h"
#include "image/tiles.h"

namespace hpr {

/// The tiles of every screen that `rank` shows, in ascending order.
[[nodiscard]] std::vector<std::size_t> tiles_shown(const FrameLayout& layout, std::span<const int> shown_by, int rank);

/// One bit per tile of `wanted`: is it in `chosen`? Both ascend. `assemble` sends it before the tiles.
[[nodiscard]] std::vector<std::byte> encode_choice(std::span<const std::size_t> wanted,
                                                   std::span<const std::size_t> chosen);
/// The tiles chosen from `wanted`, and the rest of `bytes`. Throws Error (Internal) on malformed input.
[[nodiscard]] std::vector<std::size_t> decode_choice(std::span<const std::size_t> wanted,
                                                     std::span<const std::byte>& bytes);

/// What of `owned` goes onto the tiles `wanted` elsewhere, as a message; empty when nothing does.
template <typename Pixel>
[[nodiscard]] std::vector<std::byte> encode_piece(const TileLayer<Pixel>& layer, std::span<const std::size_t> owned,
                                                  std::span<const std::size_t> wanted) {
  std::vector<std::size_t> chosen;
  std::ranges::set_intersection(wanted, owned, std::back_inserter(chosen));
  if (chosen.empty()) return {};
  std::vector<std::byte> bytes = encode_choice(wanted, chosen);
  append_tiles(bytes, layer, std::span<const std::size_t>(chosen));
  return bytes;
}

/// Puts the tiles of a message of encode_piece into `layer` and marks them in `filled`, where none of them may be yet.
template <typename Pixel>
void decode_piece(TileLayer<Pixel>& layer, std::span<const std::size_t> wanted, std::span<const std::byte> message,
                  std::vector<bool>& filled) {
  if (message.empty()) return;
  const std::vector<std::size_t> arrived = decode_choice(wanted, message);
  for (const std::size_t tile : arrived) {
    if (filled[tile]) throw Error(ExitCode::Internal, "two ranks own one tile of a frame");
    filled[tile] = true;
  }
  decode_tiles(layer, std::span<const std::size_t>(arrived), message);
}

/// Collective. Brings the tiles to the screens: each rank passes the ascending `owned` tiles it has the result of, no
/// tile twice among all ranks, and per screen the rank that shows it (the same list on every rank). After it, rank
/// shown_by[s] holds in `layer` all tiles of screen s; those nobody owns are empty. Other tiles stay as they were.
///
/// Cost: one message from every rank to every other rank that shows a screen, empty where nothing of it is owned,
/// else two bits per tile of its screens and the active tiles.
template <typename Pixel>
void assemble(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> owned,
              std::span<const int> shown_by) {
  const FrameLayout& layout = layer.layout();
  HPR_CHECK(shown_by.size() == layout.screens());
  HPR_CHECK(std::ranges::is_sorted(owned));
  const auto shows = [&](int rank) { return std::ranges::find(shown_by, rank) != shown_by.end(); };
  const auto piece_for = [&](int to) { return encode_piece(layer, owned, tiles_shown(layout, shown_by, to)); };
  const int rank = comm.rank();
  const bool shows_here = shows(rank);
  const std::vector<std::size_t> wanted = tiles_shown(layout, shown_by, rank);
  std::vector<bool> filled(layer.tiles());
  for (const std::size_t tile : owned) filled[tile] = true;

  // In round r the ranks whose numbers add up to r, modulo their count, meet: every two meet once, nobody waits for two
  // at a time, and so ranks that send large pieces to each other cannot lock.
  for (int round = 0; round < comm.size(); ++round) {
    const int peer = (round - rank + comm.size()) % comm.size();
    if (peer == rank) continue;
    if (shows(peer) && shows_here) {
      decode_piece(layer, wanted, comm.exchange(piece_for(peer), peer), filled);
    } else if (shows(peer)) {
      comm.send(piece_for(peer), peer);
    } else if (shows_here) {
      decode_piece(layer, wanted, comm.receive(peer), filled);
    }
  }

  for (const std::size_t tile : wanted) {
    if (!filled[tile]) layer.clear(tile);
  }
}

}  // namespace hpr
