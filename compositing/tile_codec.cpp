#include "compositing/tile_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "compositing/kernels.h"
#include "core/error.h"

namespace hpr {
namespace {

using Word = std::uint64_t;
constexpr std::size_t kWordBits = 64;

constexpr std::size_t words_for(std::size_t tiles) {
  return (tiles + kWordBits - 1) / kWordBits;
}

/// The bytes of the counts of so many active tiles, in whole words.
constexpr std::size_t count_bytes(std::size_t active) {
  return (active * sizeof(std::uint16_t) + sizeof(Word) - 1) / sizeof(Word) * sizeof(Word);
}

[[noreturn]] void malformed(const std::string& what) {
  throw Error(ExitCode::Internal, "a message of tiles is malformed: " + what,
              "ranks of different builds cannot work together");
}

/// Whether a tile is surely full enough to travel whole: most are, or hold little.
template <typename Pixel>
bool looks_full(std::span<const Pixel, kTilePixels> tile) {
  return sampled_fraction<Pixel>(tile) * kTilePixels > static_cast<double>(kMaxPackedPixels) * 9.0 / 8.0;
}

/// Masks and pixels of packed tiles, one after the other, merged where they lie.
class PackedTiles {
 public:
  PackedTiles(std::span<const std::byte> bytes, DepthFormat depths) : next_(bytes.data()), depths_(depths) {
    HPR_CHECK(reinterpret_cast<std::uintptr_t>(next_) % alignof(Key) == 0);
  }

  void merge_next(std::span<Key> tile, std::uint16_t drawn) {
    if (drawn == 0) return;
    TileMask mask;
    std::memcpy(mask.data(), next_, sizeof mask);
    const std::byte* const packed = next_ + sizeof mask;
    if (depths_ == DepthFormat::Float32) {
      merge_packed(tile.first<kTilePixels>(), mask, {reinterpret_cast<const Key*>(packed), drawn});
    } else {
      wide_.resize(drawn);
      widen_keys(packed, depths_, wide_);
      merge_packed(tile.first<kTilePixels>(), mask, wide_);
    }
    next_ += packed_bytes(drawn, sent_bytes(depths_));
  }

 private:
  const std::byte* next_;
  DepthFormat depths_;
  std::vector<Key> wide_;
};

/// Every mask marks as many pixels as its tile announced.
void check_masks(const TileHead& head, std::size_t pixel_bytes) {
  const std::byte* next = head.packed.data();
  for (const std::uint16_t drawn : head.drawn) {
    if (packed_bytes(drawn, pixel_bytes) == 0) continue;
    TileMask mask;
    std::memcpy(mask.data(), next, sizeof mask);
    std::size_t bits = 0;
    for (const Word word : mask) bits += static_cast<std::size_t>(std::popcount(word));
    if (bits != drawn) malformed(fmt::format("{} pixels are marked as drawn, {} were announced", bits, drawn));
    next += packed_bytes(drawn, pixel_bytes);
  }
}

/// How many pixels of each tile travel packed, or all of it; masks of those that do, of tiles that hold any.
template <typename Pixel>
std::vector<std::uint16_t> choose_packed(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                         std::vector<TileMask>& masks) {
  std::vector<std::uint16_t> drawn(tiles.size(), TileHead::kInactive);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (!layer.active(tiles[i])) continue;
    const auto tile = layer.tile(tiles[i]).template first<kTilePixels>();
    drawn[i] = kWholeTile;
    if (looks_full(tile)) continue;
    TileMask mask;
    const std::size_t pixels = find_drawn(tile, mask);
    if (pixels > kMaxPackedPixels) continue;
    drawn[i] = static_cast<std::uint16_t>(pixels);
    if (pixels > 0) masks.push_back(mask);
  }
  return drawn;
}

}  // namespace

std::vector<Segment> segments_of(std::span<const std::uint16_t> drawn, std::span<const std::size_t> tiles) {
  std::vector<Segment> segments;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (drawn[i] != kWholeTile) continue;
    const bool joins = !segments.empty() && segments.back().end == i && tiles[i] == tiles[i - 1] + 1 &&
                       i - segments.back().first < kMaxSegmentTiles;
    if (joins) {
      segments.back().end = i + 1;
    } else {
      segments.push_back({i, i + 1});
    }
  }
  return segments;
}

void TileMessage::start(std::span<const std::byte> prefix) {
  HPR_CHECK(prefix.size() % alignof(Key) == 0);
  head_.clear();
  segments_.clear();
  head_.append(prefix);
}

void TileMessage::add_head(std::span<const std::uint16_t> drawn, DepthFormat depths) {
  std::vector<Word> head(1 + words_for(drawn.size()));
  head[0] = kTileFormat | Word{static_cast<std::uint8_t>(depths)} << 32U;
  std::vector<std::uint16_t> counts;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    if (drawn[i] == TileHead::kInactive) continue;
    head[1 + i / kWordBits] |= Word{1} << (i % kWordBits);
    counts.push_back(drawn[i]);
  }
  counts.resize(count_bytes(counts.size()) / sizeof(std::uint16_t));
  head_.append(std::as_bytes(std::span(head)));
  head_.append(std::as_bytes(std::span(counts)));
}

template <typename Pixel>
void TileMessage::add_packed(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  std::vector<TileMask> masks;
  const std::vector<std::uint16_t> drawn = choose_packed(layer, tiles, masks);
  constexpr bool kHasDepth = std::is_same_v<Pixel, Key>;
  const DepthFormat depths = kHasDepth ? layer.depth_format() : DepthFormat::Float32;
  const std::size_t pixel_bytes = depths == DepthFormat::Float32 ? sizeof(Pixel) : sent_bytes(depths);
  add_head(drawn, depths);
  head_.reserve(head_.size() + masks.size() * (sizeof(TileMask) + kMaxPackedPixels * pixel_bytes) +
                kTilePixels * sizeof(Pixel));
  auto mask = masks.begin();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const std::size_t bytes = packed_bytes(drawn[i], pixel_bytes);
    if (bytes == 0) continue;
    const std::size_t at = head_.size();
    std::byte* const room = head_.extend(sizeof *mask + kTilePixels * sizeof(Pixel)).data();
    std::memcpy(room, mask->data(), sizeof *mask);
    auto* const packed = reinterpret_cast<Pixel*>(room + sizeof *mask);
    const std::size_t pixels = pack_drawn(layer.tile(tiles[i]).template first<kTilePixels>(), *mask, packed);
    HPR_CHECK(pixels == drawn[i]);
    if constexpr (kHasDepth) {
      // In place: a key is read before what is written reaches it.
      if (depths != DepthFormat::Float32) narrow_keys({packed, pixels}, depths, room + sizeof *mask);
    }
    head_.shrink(at + bytes);
    ++mask;
  }
  if constexpr (kHasDepth) {
    if (depths != DepthFormat::Float32) return add_narrow_segments(layer, tiles, drawn);
  }
  add_segments(layer, tiles, drawn);
}

void TileMessage::add_narrow_segments(const TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                                      std::span<const std::uint16_t> drawn) {
  const std::size_t tile_bytes = kTilePixels * sent_bytes(layer.depth_format());
  narrow_.clear();
  narrow_.reserve(static_cast<std::size_t>(std::ranges::count(drawn, kWholeTile)) * tile_bytes);  // so it stays put
  for (const Segment segment : segments_of(drawn, tiles)) {
    const std::size_t count = segment.end - segment.first;
    const std::span<std::byte> room = narrow_.extend(count * tile_bytes);
    narrow_keys(layer.run({tiles[segment.first], count}), layer.depth_format(), room.data());
    segments_.emplace_back(room);
  }
}

template void TileMessage::add_packed(const TileLayer<Key>&, std::span<const std::size_t>);
template void TileMessage::add_packed(const TileLayer<Rgba8Premultiplied>&, std::span<const std::size_t>);
template void TileMessage::add_packed(const TileLayer<RgbaPremultiplied>&, std::span<const std::size_t>);

TileHead parse_head(std::span<const std::byte> message, std::size_t tiles, bool packs, std::size_t pixel_bytes) {
  std::vector<Word> head(1 + words_for(tiles));
  const std::size_t head_bytes = head.size() * sizeof(Word);
  if (message.size() < head_bytes) {
    malformed(
        fmt::format("{} bytes cannot hold the head of {} tiles, which takes {}", message.size(), tiles, head_bytes));
  }
  std::memcpy(head.data(), message.data(), head_bytes);
  const Word depths = head[0] >> 32U;
  if ((head[0] & 0xFFFFFFFFU) != kTileFormat) malformed(fmt::format("unknown format {}", head[0]));
  if (depths >= kDepthFormatNames.size() || (depths > 0 && !(packs && pixel_bytes == sizeof(Key)))) {
    malformed(fmt::format("pixels of these do not have depths of format {}", depths));
  }
  if (tiles % kWordBits != 0 && head.back() >> (tiles % kWordBits) != 0) {
    malformed(fmt::format("a tile past the {} of the list is said to be active", tiles));
  }

  TileHead parsed{std::vector<std::uint16_t>(tiles, TileHead::kInactive), {}, static_cast<DepthFormat>(depths)};
  if (depths > 0) pixel_bytes = sent_bytes(parsed.depths);
  std::size_t active = 0;
  for (std::size_t i = 0; i < words_for(tiles); ++i) active += static_cast<std::size_t>(std::popcount(head[1 + i]));
  if (message.size() < head_bytes + count_bytes(active)) malformed("no counts of pixels");
  const std::byte* count = message.data() + head_bytes;
  std::size_t expected = 0;
  for (std::size_t i = 0; i < tiles; ++i) {
    if ((head[1 + i / kWordBits] >> (i % kWordBits) & 1U) == 0) continue;
    std::uint16_t& drawn = parsed.drawn[i];
    std::memcpy(&drawn, count, sizeof drawn);
    count += sizeof drawn;
    if (drawn != kWholeTile && !(packs && drawn <= kMaxPackedPixels)) {
      malformed(fmt::format("tile {} of {} is said to have {} pixels", i, tiles, drawn));
    }
    expected += packed_bytes(drawn, pixel_bytes);
  }
  parsed.packed = message.subspan(head_bytes + count_bytes(active));
  if (parsed.packed.size() != expected) {
    malformed(fmt::format("packed tiles take {} bytes, {} came", expected, parsed.packed.size()));
  }
  check_masks(parsed, pixel_bytes);
  return parsed;
}

void TileReader::merge(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Key>& layer,
                       std::span<const std::size_t> tiles) {
  comm.worked(merge_tiles(comm, from, parse_head(message, tiles.size(), true), layer, tiles));
}

std::size_t TileReader::merge_tiles(Communicator& comm, int from, const TileHead& head, TileLayer<Key>& layer,
                                    std::span<const std::size_t> tiles) {
  PackedTiles packed(head.packed, head.depths);
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (head.drawn[i] == TileHead::kInactive || head.whole(i)) continue;
    packed.merge_next(layer.tile(tiles[i]), head.drawn[i]);  // an inactive tile is zero, which any key beats
    layer.set_active(tiles[i]);
    bytes += kTilePixels * sizeof(Key);  // it goes through all of the tile
  }
  const bool narrow = head.depths != DepthFormat::Float32;
  for (const Segment segment : segments_of(head.drawn, tiles)) {
    const auto part = tiles.subspan(segment.first, segment.end - segment.first);
    const std::span<Key> into = layer.run({part.front(), part.size()});
    const bool fresh = std::ranges::none_of(part, [&](std::size_t tile) { return layer.active(tile); });
    if (fresh && !narrow) {
      comm.receive(std::as_writable_bytes(into), from);
    } else {
      segment_.clear();
      const std::span<std::byte> arrived = segment_.extend(into.size() * sent_bytes(head.depths));
      comm.receive(arrived, from);
      if (fresh) {
        widen_keys(arrived.data(), head.depths, into);
      } else if (narrow) {
        wide_.resize(into.size());
        widen_keys(arrived.data(), head.depths, wide_);
        merge_keys(into, wide_);
      } else {
        merge_keys(into, {reinterpret_cast<const Key*>(arrived.data()), into.size()});
      }
    }
    for (const std::size_t tile : part) layer.set_active(tile);
    bytes += into.size_bytes();
  }
  return bytes;
}

void TileReader::replace(Communicator& comm, int from, std::span<const std::byte> message, TileLayer<Key>& layer,
                         std::span<const std::size_t> tiles) {
  const TileHead head = parse_head(message, tiles.size(), true);
  if (head.depths != DepthFormat::Float32) {
    for (const std::size_t tile : tiles) layer.clear(tile);
    (void)merge_tiles(comm, from, head, layer, tiles);
    return;
  }
  receive_whole(comm, from, head, layer, tiles);
  PackedTiles packed(head.packed, head.depths);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (head.drawn[i] == TileHead::kInactive || head.whole(i)) continue;
    packed.merge_next(layer.tile(tiles[i]), head.drawn[i]);
    layer.set_active(tiles[i]);
  }
}

template <typename Pixel>
void TileReader::replace_packed(Communicator& comm, int from, std::span<const std::byte> message,
                                TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  const TileHead head = parse_head(message, tiles.size(), true, sizeof(Pixel));
  receive_whole(comm, from, head, layer, tiles);
  const std::byte* next = head.packed.data();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (head.drawn[i] == TileHead::kInactive || head.whole(i)) continue;
    if (head.drawn[i] > 0) unpack_tile(next, head.drawn[i], layer.tile(tiles[i]));
    layer.set_active(tiles[i]);
    next += packed_bytes(head.drawn[i], sizeof(Pixel));
  }
}

void TileReader::replace(Communicator& comm, int from, std::span<const std::byte> message,
                         TileLayer<Rgba8Premultiplied>& layer, std::span<const std::size_t> tiles) {
  replace_packed(comm, from, message, layer, tiles);
}
void TileReader::replace(Communicator& comm, int from, std::span<const std::byte> message,
                         TileLayer<RgbaPremultiplied>& layer, std::span<const std::size_t> tiles) {
  replace_packed(comm, from, message, layer, tiles);
}

template <typename Pixel>
void TileFold<Pixel>::start(std::span<Pixel> into, bool among) {
  into_ = into;
  in_use_ = among;
  front_ = {};
}

template <typename Pixel>
void TileFold<Pixel>::add(std::span<const Pixel> content) {
  if (content.data() == into_.data()) in_use_ = false;
  if (front_.empty()) {
    front_ = content;
    return;
  }
  const std::span<Pixel> target = in_use_ ? std::span<Pixel>(blended_) : into_;
  composite_over(front_, content, target);
  front_ = target;
}

template <typename Pixel>
bool TileFold<Pixel>::finish() {
  if (front_.empty()) return false;
  if (front_.data() != into_.data()) std::ranges::copy(front_, into_.begin());
  return true;
}

template <typename Pixel>
void HeldTiles<Pixel>::take(Communicator& comm, int from, std::span<const std::byte> message,
                            std::span<const std::size_t> tiles) {
  TileHead head = parse_head(message, tiles.size(), true, sizeof(Pixel));
  offsets_.assign(tiles.size(), 0);
  drawn_.assign(tiles.size(), false);
  bytes_.clear();
  for (const Segment segment : segments_of(head.drawn, tiles)) {
    for (std::size_t i = segment.first; i < segment.end; ++i) {
      offsets_[i] = bytes_.size() + (i - segment.first) * kTilePixels * sizeof(Pixel);
    }
    comm.receive(bytes_.extend((segment.end - segment.first) * kTilePixels * sizeof(Pixel)), from);
  }
  std::size_t offset = bytes_.size();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    drawn_[i] = head.drawn[i] != TileHead::kInactive && head.drawn[i] != 0;
    const std::size_t packed = packed_bytes(head.drawn[i], sizeof(Pixel));
    if (packed > 0) offsets_[i] = offset;
    offset += packed;
  }
  bytes_.append(head.packed);
  counts_ = std::move(head.drawn);
}

template <typename Pixel>
std::span<const Pixel> HeldTiles<Pixel>::pixels(std::size_t position, std::span<Pixel> room) const {
  const std::byte* const start = bytes_.bytes().data() + offsets_[position];
  if (counts_[position] == kWholeTile) return {reinterpret_cast<const Pixel*>(start), kTilePixels};
  std::ranges::fill(room, Pixel{});
  unpack_tile(start, counts_[position], room);
  return room;
}

template <typename Pixel>
void PieceMerger<Pixel>::exchange(Communicator& comm, std::span<const Outgoing> out, std::span<const int> from,
                                  TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  std::vector<int> front_to_back(from.begin(), from.end());
  std::ranges::sort(front_to_back);
  const auto index_of = [&](int rank) {
    return static_cast<std::size_t>(std::ranges::lower_bound(front_to_back, rank) - front_to_back.begin());
  };
  const std::size_t own = index_of(comm.rank());
  // A rank in front of all it receives from, which sends nothing, takes one message after the other: so one
  // layer's memory is enough for the rank that collects all layers.
  if (out.empty() && own == 0) {
    held_.resize(std::max<std::size_t>(held_.size(), 1));
    for (const int peer : front_to_back) {
      comm.exchange({}, {&peer, 1}, [&](int sender, std::span<const std::byte> message) {
        held_.front().take(comm, sender, message, tiles);
      });
      fold(comm, std::span(held_).first(1), 0, layer, tiles);
    }
    return;
  }
  if (held_.size() < from.size()) held_.resize(from.size());
  comm.exchange(out, from, [&](int sender, std::span<const std::byte> message) {
    held_[index_of(sender)].take(comm, sender, message, tiles);
  });
  fold(comm, std::span(held_).first(from.size()), own, layer, tiles);
}

template <typename Pixel>
void PieceMerger<Pixel>::fold(Communicator& comm, std::span<const HeldTiles<Pixel>> arrived, std::size_t own,
                              TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const bool among = layer.active(tiles[i]);
    const std::span<Pixel> into = layer.tile(tiles[i]);
    fold_.start(into, among);
    for (std::size_t layer_index = 0; layer_index <= arrived.size(); ++layer_index) {
      if (layer_index == own && among) fold_.add(into);
      if (layer_index == arrived.size() || !arrived[layer_index].drawn(i)) continue;
      fold_.add(arrived[layer_index].pixels(i, fold_.room()));
    }
    if (fold_.finish()) layer.set_active(tiles[i]);
  }
  std::size_t bytes = 0;
  for (const HeldTiles<Pixel>& held : arrived) bytes += held.bytes();
  comm.worked(bytes);
}

template class TileFold<Rgba8Premultiplied>;
template class TileFold<RgbaPremultiplied>;
template class HeldTiles<Rgba8Premultiplied>;
template class HeldTiles<RgbaPremultiplied>;
template class PieceMerger<Rgba8Premultiplied>;
template class PieceMerger<RgbaPremultiplied>;

}  // namespace hpr
