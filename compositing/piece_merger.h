#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/tile_codec.h"
#include "core/bytes.h"
#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"

/// What a schedule of messages does with the pieces that come: the one place where the operators differ. The kind of
/// pixel says which operator it is: the nearest of two keys, or one premultiplied colour over another.
namespace hpr {

/// Blends the contents one tile has in several layers, front to back: ((a over b) over c) over ...
template <typename Pixel>
class TileFold {
 public:
  /// The result goes to `into`. `among`: what stands there is one of the contents, and will be added in its turn.
  void start(std::span<Pixel> into, bool among);
  /// The next content behind those added so far; kept as it is until its turn when it is that of `into`.
  void add(std::span<const Pixel> content);
  /// 4096 pixels of room to unpack the next content in.
  [[nodiscard]] std::span<Pixel> room() { return front_.empty() ? blended_ : next_; }
  /// Leaves the result in its place. False when nothing was added.
  bool finish();

 private:
  std::vector<Pixel> blended_ = std::vector<Pixel>(kTilePixels);
  std::vector<Pixel> next_ = std::vector<Pixel>(kTilePixels);
  std::span<Pixel> into_;
  bool in_use_ = false;  ///< `into` still has to be added as it is
  std::span<const Pixel> front_;
};

/// The tiles of one message, kept until it is their turn.
template <typename Pixel>
class HeldTiles {
 public:
  /// Inside the call an exchange makes for a message: takes it with its bodies.
  void take(Communicator& comm, int from, std::span<const std::byte> message, std::span<const std::size_t> tiles);

  [[nodiscard]] std::size_t bytes() const { return bytes_.size(); }
  [[nodiscard]] bool drawn(std::size_t position) const { return drawn_[position]; }
  /// The pixels of a drawn tile: where they arrived, or unpacked into `room`.
  [[nodiscard]] std::span<const Pixel> pixels(std::size_t position, std::span<Pixel> room) const;

 private:
  ByteBuffer bytes_;                   ///< bodies, then packed tiles
  std::vector<std::uint16_t> counts_;  ///< as in TileHead
  std::vector<bool> drawn_;
  std::vector<std::size_t> places_;  ///< per tile of the list where it starts
};

/// Sends and merges what layers hold of some tiles; keeps its memory from frame to frame.
///
/// Colours: ranks must be numbered from front to back, and what this rank and those of `from` hold must be neighbours
/// in that order. Whatever the order of arrival, the frontmost is blended with the next one behind it, and so on.
template <typename Pixel>
class PieceMerger {
 public:
  /// One exchange of messages (TileMessage). What `layer` has of `tiles`, with all that comes, replaces it.
  void exchange(Communicator& comm, std::span<const Outgoing> out, std::span<const int> from, TileLayer<Pixel>& layer,
                std::span<const std::size_t> tiles);

 private:
  /// `own`: how many of `arrived` are in front of this rank.
  void fold(Communicator& comm, std::span<const HeldTiles<Pixel>> arrived, std::size_t own, TileLayer<Pixel>& layer,
            std::span<const std::size_t> tiles);

  std::vector<HeldTiles<Pixel>> held_;
  TileFold<Pixel> fold_;
};

/// Keys are merged as they come.
template <>
class PieceMerger<Key> {
 public:
  void exchange(Communicator& comm, std::span<const Outgoing> out, std::span<const int> from, TileLayer<Key>& layer,
                std::span<const std::size_t> tiles) {
    comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
      reader_.merge(comm, peer, message, layer, tiles);
    });
  }

 private:
  TileReader reader_;
};

}  // namespace hpr
