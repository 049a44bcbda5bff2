#include "compositing/piece_merger.h"

#include <algorithm>

#include "compositing/over.h"

namespace hpr {

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
  places_.assign(tiles.size(), 0);
  drawn_.assign(tiles.size(), false);
  bytes_.clear();
  for (const Body body : bodies_of(head.drawn, tiles)) {
    for (std::size_t i = body.first; i < body.end; ++i) {
      places_[i] = bytes_.size() + (i - body.first) * kTilePixels * sizeof(Pixel);
    }
    comm.receive(bytes_.extend((body.end - body.first) * kTilePixels * sizeof(Pixel)), from);
  }
  std::size_t place = bytes_.size();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    drawn_[i] = head.drawn[i] != TileHead::kInactive && head.drawn[i] != 0;
    const std::size_t packed = packed_bytes(head.drawn[i], sizeof(Pixel));
    if (packed > 0) places_[i] = place;
    place += packed;
  }
  bytes_.append(head.packed);
  counts_ = std::move(head.drawn);
}

template <typename Pixel>
std::span<const Pixel> HeldTiles<Pixel>::pixels(std::size_t position, std::span<Pixel> room) const {
  const std::byte* const place = bytes_.bytes().data() + places_[position];
  if (counts_[position] == kWholeTile) return {reinterpret_cast<const Pixel*>(place), kTilePixels};
  std::ranges::fill(room, Pixel{});
  unpack_tile(place, counts_[position], room);
  return room;
}

template <typename Pixel>
void PieceMerger<Pixel>::exchange(Communicator& comm, std::span<const Outgoing> out, std::span<const int> from,
                                  TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  std::vector<int> front_to_back(from.begin(), from.end());
  std::ranges::sort(front_to_back);
  const auto place_of = [&](int rank) {
    return static_cast<std::size_t>(std::ranges::lower_bound(front_to_back, rank) - front_to_back.begin());
  };
  const std::size_t own = place_of(comm.rank());
  // Who is in front of all it hears from, and has nobody waiting for what it sends, takes one after the other: so one
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
    held_[place_of(sender)].take(comm, sender, message, tiles);
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
    for (std::size_t place = 0; place <= arrived.size(); ++place) {
      if (place == own && among) fold_.add(into);
      if (place == arrived.size() || !arrived[place].drawn(i)) continue;
      fold_.add(arrived[place].pixels(i, fold_.room()));
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
