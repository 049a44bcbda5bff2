#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/tile_codec.h"
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

/// Brings tiles to screens; keeps the memory of its messages from frame to frame.
class Assembler {
 public:
  /// Collective. Each rank passes the ascending `owned` tiles it has the result of, no tile twice among all ranks, and
  /// per screen the rank that shows it (the same list on every rank). After it, rank shown_by[s] holds in `layer` all
  /// tiles of screen s; those nobody owns are empty. Other tiles stay as they were.
  ///
  /// Cost: one message from every rank to every other rank that shows a screen, all at once; empty where nothing of it
  /// is owned, else two bits per tile of its screens and the active tiles, which whole ones among them arrive in place.
  template <typename Pixel>
  void assemble(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> owned,
                std::span<const int> shown_by) {
    HPR_CHECK(shown_by.size() == layer.layout().screens());
    HPR_CHECK(std::ranges::is_sorted(owned));
    const std::vector<std::size_t> wanted = tiles_shown(layer.layout(), shown_by, comm.rank());
    const std::vector<Outgoing> out = pieces_of(comm, layer, owned, shown_by);
    const std::vector<int> from = shows(shown_by, comm.rank()) ? others(comm) : std::vector<int>{};
    std::vector<bool> filled(layer.tiles());
    for (const std::size_t tile : owned) filled[tile] = true;
    comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
      if (message.empty()) return;
      const std::vector<std::size_t> arrived = decode_choice(wanted, message);
      for (const std::size_t tile : arrived) {
        if (filled[tile]) throw Error(ExitCode::Internal, "two ranks own one tile of a frame");
        filled[tile] = true;
      }
      reader_.replace(comm, peer, message, layer, arrived);
    });
    for (const std::size_t tile : wanted) {
      if (!filled[tile]) layer.clear(tile);
    }
  }

 private:
  [[nodiscard]] static bool shows(std::span<const int> shown_by, int rank) {
    return std::ranges::find(shown_by, rank) != shown_by.end();
  }
  /// All ranks but this one, from the next one on, so that not all send to the same one first.
  [[nodiscard]] static std::vector<int> others(const Communicator& comm) {
    std::vector<int> ranks;
    for (int step = 1; step < comm.size(); ++step) ranks.push_back((comm.rank() + step) % comm.size());
    return ranks;
  }

  /// A message for every other rank that shows a screen.
  template <typename Pixel>
  [[nodiscard]] std::vector<Outgoing> pieces_of(const Communicator& comm, const TileLayer<Pixel>& layer,
                                                std::span<const std::size_t> owned, std::span<const int> shown_by) {
    pieces_.resize(static_cast<std::size_t>(comm.size()));
    std::vector<Outgoing> out;
    for (const int to : others(comm)) {
      if (shows(shown_by, to)) out.push_back(piece_for(to, layer, owned, tiles_shown(layer.layout(), shown_by, to)));
    }
    return out;
  }

  /// What of `owned` goes onto the tiles `wanted` of a rank; an empty message when nothing does.
  template <typename Pixel>
  [[nodiscard]] Outgoing piece_for(int rank, const TileLayer<Pixel>& layer, std::span<const std::size_t> owned,
                                   std::span<const std::size_t> wanted) {
    std::vector<std::size_t> chosen;
    std::ranges::set_intersection(wanted, owned, std::back_inserter(chosen));
    if (chosen.empty()) return {rank, {}, {}};
    TileMessage& piece = pieces_[static_cast<std::size_t>(rank)];
    piece.start(encode_choice(wanted, chosen));
    piece.add(layer, chosen);
    return piece.to(rank);
  }

  std::vector<TileMessage> pieces_;  ///< per rank that shows a screen
  TileReader reader_;
};

}  // namespace hpr
