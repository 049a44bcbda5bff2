#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/kernels.h"
#include "core/bytes.h"
#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"

/// Tiles as messages between ranks of one run of HPR (never as files: the byte order is the machine's). A message says
/// what follows and carries the tiles that are only partly drawn; whole tiles follow it as segments, which are sent
/// from the layer they lie in and are received, where possible, in the one they go to.
///
///   8 bytes            kTileFormat, and above 32 bits the format of depths
///   8 ceil(n / 64)     one bit per tile of the list, the lowest first: is it active? The bits past the last are 0
///   2 bytes each       per active tile how many of its pixels follow, or kWholeTile; zeros up to a multiple of 8
///   then per active tile that is not whole, in order of the list, unless it has no pixels:
///     512 bytes        one bit per pixel of the tile: is it drawn?
///     8 bytes each     the drawn pixels in order (keys; others take their size), up to a multiple of 8 bytes
///   segments           the whole tiles in order of the list, keys of fewer than 32 bits of depth as narrow_keys writes
///                      them; tiles that are neighbours in the frame share one segment, up to kMaxSegmentTiles of them
///
/// The list of tiles itself does not travel: sender and receiver both know it. Scattered pixels cost 8 bytes and a bit
/// each, however they lie; a tile so full that packing saves little travels whole, since that is sent and merged
/// faster.
namespace hpr {

inline constexpr std::uint64_t kTileFormat = 4;
inline constexpr std::uint16_t kWholeTile = 0xFFFF;
/// The most pixels of a tile's 4096 that are packed. At 3/4 the packed tile takes 77 % of the whole one's bytes.
inline constexpr std::size_t kMaxPackedPixels = kTilePixels * 3 / 4;
/// The most tiles of one segment: half a megabyte of keys stays in a core's cache between arriving and being merged.
inline constexpr std::size_t kMaxSegmentTiles = 16;

/// What follows the head of a message for one tile of which so many pixels are packed; nothing for the others.
[[nodiscard]] constexpr std::size_t packed_bytes(std::uint16_t drawn, std::size_t pixel_bytes) {
  if (drawn == 0 || drawn > kMaxPackedPixels) return 0;
  return sizeof(TileMask) + (drawn * pixel_bytes + 7) / 8 * 8;
}

/// Puts the drawn pixels of one tile of a message, `packed` as that says, where they were; the others stay.
template <typename Pixel>
void unpack_tile(const std::byte* packed, std::uint16_t drawn, std::span<Pixel> tile) {
  TileMask mask;
  std::memcpy(mask.data(), packed, sizeof mask);
  unpack_drawn(std::span(reinterpret_cast<const Pixel*>(packed + sizeof mask), drawn), mask,
               tile.template first<kTilePixels>());
}

/// What a message of tiles says about itself.
struct TileHead {
  static constexpr std::uint16_t kInactive = 0xFFFE;

  std::vector<std::uint16_t> drawn;   ///< per tile of the list: kInactive, kWholeTile or how many pixels are packed
  std::span<const std::byte> packed;  ///< masks and pixels of packed tiles, one after the other
  DepthFormat depths = DepthFormat::Float32;

  [[nodiscard]] bool whole(std::size_t position) const { return drawn[position] == kWholeTile; }
};

/// The whole tiles of a list that are sent in one segment: positions [first, end), neighbours in the frame.
struct Segment {
  std::size_t first = 0;
  std::size_t end = 0;
};
/// `drawn` as in TileHead.
[[nodiscard]] std::vector<Segment> segments_of(std::span<const std::uint16_t> drawn,
                                               std::span<const std::size_t> tiles);

/// A message of tiles in the making; keeps its memory from frame to frame. What it sends of a layer must stay as it is
/// until the exchange returns.
class TileMessage {
 public:
  /// Starts a message with `prefix` (a multiple of 8 bytes), which the receiver takes off before it reads the tiles.
  void start(std::span<const std::byte> prefix = {});

  /// Adds `tiles` of `layer`; once per message. Pixels that are composited are packed where that pays, others are not.
  void add(const TileLayer<Key>& layer, std::span<const std::size_t> tiles) { add_packed(layer, tiles); }
  void add(const TileLayer<Rgba8Premultiplied>& layer, std::span<const std::size_t> tiles) { add_packed(layer, tiles); }
  void add(const TileLayer<RgbaPremultiplied>& layer, std::span<const std::size_t> tiles) { add_packed(layer, tiles); }
  template <typename Pixel>
  void add(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
    std::vector<std::uint16_t> drawn(tiles.size(), TileHead::kInactive);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (layer.active(tiles[i])) drawn[i] = kWholeTile;
    }
    add_head(drawn, DepthFormat::Float32);
    add_segments(layer, tiles, drawn);
  }

  /// Sends `tiles` of `layer` as a message of their own.
  template <typename Pixel>
  void send(Communicator& comm, const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles, int rank) {
    start();
    add(layer, tiles);
    const Outgoing out = to(rank);
    comm.exchange({&out, 1}, {}, {});
  }

  [[nodiscard]] Outgoing to(int rank) const { return {rank, head_.bytes(), segments_}; }
  [[nodiscard]] std::span<const std::byte> head() const { return head_.bytes(); }

 private:
  template <typename Pixel>
  void add_packed(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles);
  void add_head(std::span<const std::uint16_t> drawn, DepthFormat depths);
  void add_narrow_segments(const TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                           std::span<const std::uint16_t> drawn);
  template <typename Pixel>
  void add_segments(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                    std::span<const std::uint16_t> drawn) {
    for (const Segment segment : segments_of(drawn, tiles))
      segments_.push_back(std::as_bytes(layer.run({tiles[segment.first], segment.end - segment.first})));
  }

  ByteBuffer head_;
  std::vector<std::span<const std::byte>> segments_;
  ByteBuffer narrow_;  ///< the segments where they are not sent from the layer
};

/// Checks the format, the bits, the counts and the length of a message for a list of `tiles` tiles. `packs`: whether
/// tiles may be packed, in pixels of so many bytes. Throws Error (Internal): a rank that sends nonsense is a fault of
/// the program.
[[nodiscard]] TileHead parse_head(std::span<const std::byte> message, std::size_t tiles, bool packs,
                                  std::size_t pixel_bytes = sizeof(Key));

/// Reads messages of tiles inside the call an exchange makes for each; keeps its memory from frame to frame.
class TileReader {
 public:
  /// Merges the tiles of a message of keys into `layer`: the nearer surface stays. Reports the work to `comm`.
  void merge(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Key>& layer,
             std::span<const std::size_t> tiles);

  /// Makes `tiles` of `layer` what they were at the sender; tiles that were empty there become empty.
  void replace(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Key>& layer,
               std::span<const std::size_t> tiles);
  void replace(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Rgba8Premultiplied>& layer,
               std::span<const std::size_t> tiles);
  void replace(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<RgbaPremultiplied>& layer,
               std::span<const std::size_t> tiles);
  template <typename Pixel>
  void replace(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Pixel>& layer,
               std::span<const std::size_t> tiles) {
    receive_whole(comm, from, parse_head(message, tiles.size(), false), layer, tiles);
  }

 private:
  template <typename Pixel>
  static void replace_packed(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Pixel>& layer,
                             std::span<const std::size_t> tiles);

  /// Receives the segments into the layer and empties the tiles that were empty at the sender.
  template <typename Pixel>
  static void receive_whole(Communicator& comm, int from, const TileHead& head, TileLayer<Pixel>& layer,
                            std::span<const std::size_t> tiles) {
    for (const Segment segment : segments_of(head.drawn, tiles)) {
      comm.receive(std::as_writable_bytes(layer.run({tiles[segment.first], segment.end - segment.first})), from);
    }
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (head.whole(i)) {
        layer.set_active(tiles[i]);
      } else {
        layer.clear(tiles[i]);
      }
    }
  }

  /// Merges packed tiles and segments of keys into a layer; returns the bytes it went through.
  std::size_t merge_tiles(Communicator& comm, int from, const TileHead& head, TileLayer<Key>& layer,
                          std::span<const std::size_t> tiles);

  ByteBuffer segment_;
  std::vector<Key> wide_;
};

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
  /// Leaves the result in `into`. False when nothing was added.
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
  /// Inside the call an exchange makes for a message: takes it with its segments.
  void take(Communicator& comm, int from, std::span<const std::byte> message, std::span<const std::size_t> tiles);

  [[nodiscard]] std::size_t bytes() const { return bytes_.size(); }
  [[nodiscard]] bool drawn(std::size_t position) const { return drawn_[position]; }
  /// The pixels of a drawn tile: where they arrived, or unpacked into `room`.
  [[nodiscard]] std::span<const Pixel> pixels(std::size_t position, std::span<Pixel> room) const;

 private:
  ByteBuffer bytes_;                   ///< segments, then packed tiles
  std::vector<std::uint16_t> counts_;  ///< as in TileHead
  std::vector<bool> drawn_;
  std::vector<std::size_t> offsets_;  ///< per tile of the list where it starts
};

/// Sends and merges what layers hold of some tiles; keeps its memory from frame to frame. This is the one place where
/// the operators differ, and the kind of pixel says which operator it is: the nearest of two keys, or one premultiplied
/// colour over another.
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
