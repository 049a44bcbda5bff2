#include "compositing/sparse.h"

#include <algorithm>
#include <array>
#include <bit>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "compositing/sparse.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
// At most 8 lanes, so that a mask's bits fill no more than a byte.
using Lanes = hn::CappedTag<Key, 8>;

std::uint64_t drawn_bits(const Key* keys) {
  const Lanes lanes;
  const auto zero = hn::Zero(lanes);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < 64; i += hn::Lanes(lanes)) {
    std::uint8_t some[8] = {};  // NOLINT(modernize-avoid-c-arrays): what Highway fills
    hn::StoreMaskBits(lanes, hn::Ne(hn::LoadU(lanes, keys + i), zero), some);
    bits |= static_cast<std::uint64_t>(some[0]) << i;
  }
  return bits;
}

std::size_t find(const Key* tile, std::uint64_t* mask) {
  std::size_t drawn = 0;
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    mask[word] = drawn_bits(tile + word * 64);
    drawn += static_cast<std::size_t>(std::popcount(mask[word]));
  }
  return drawn;
}

std::size_t pack(const Key* tile, const std::uint64_t* mask, Key* packed, const std::uint64_t* sources) {
  const Lanes lanes;
  const std::size_t step = hn::Lanes(lanes);
  const Key* const first = packed;
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    if (mask[word] == 0) continue;
    for (std::size_t i = 0; i < 64; i += step) {
      const std::size_t bits = (mask[word] >> i) & ((1U << step) - 1U);
      // By a table: Highway's own compression copies a table of its own to the stack each time.
      const auto source = hn::SetTableIndices(lanes, reinterpret_cast<const std::int64_t*>(sources + bits * 8));
      hn::StoreU(hn::TableLookupLanes(hn::LoadU(lanes, tile + word * 64 + i), source), lanes, packed);
      packed += std::popcount(bits);
    }
  }
  return static_cast<std::size_t>(packed - first);
}

/// Returns how many words of the mask are merged: the last few keys, which no whole vector can be loaded of, are left.
std::size_t merge_runs(Key* tile, const std::uint64_t* mask, const Key*& packed, const Key* end,
                       const std::uint64_t* places) {
  const Lanes lanes;
  const std::size_t step = hn::Lanes(lanes);
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    if (mask[word] == 0) continue;
    if (static_cast<std::size_t>(end - packed) < 64 + step) return word;
    for (std::size_t i = 0; i < 64; i += step) {
      const auto bits = static_cast<std::uint8_t>((mask[word] >> i) & ((1U << step) - 1U));
      if (bits == 0) continue;
      // Lane n takes the packed key that as many drawn lanes precede.
      const auto place =
          hn::SetTableIndices(lanes, reinterpret_cast<const std::int64_t*>(places + std::size_t{bits} * 8));
      const auto keys = hn::TableLookupLanes(hn::LoadU(lanes, packed), place);
      const auto drawn = hn::LoadMaskBits(lanes, &bits);
      Key* const into = tile + word * 64 + i;
      hn::StoreU(hn::Max(hn::LoadU(lanes, into), hn::IfThenElseZero(drawn, keys)), lanes, into);
      packed += std::popcount(bits);
    }
  }
  return kTilePixels / 64;
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(find);
HWY_EXPORT(pack);
HWY_EXPORT(merge_runs);

namespace {

/// 8 lanes for every byte of a mask.
using LaneTable = std::array<std::uint64_t, std::size_t{256} * 8>;

/// Per lane: how many drawn lanes stand before it, where its key stands among the packed ones.
constexpr LaneTable kPlaces = [] {
  LaneTable places{};
  for (std::size_t bits = 0; bits < 256; ++bits) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      places[bits * 8 + lane] = static_cast<std::uint64_t>(std::popcount(bits & ((std::size_t{1} << lane) - 1)));
    }
  }
  return places;
}();

/// Per place among the packed ones: the lane its key comes from; 0 past the last.
constexpr LaneTable kSources = [] {
  LaneTable sources{};
  for (std::size_t bits = 0; bits < 256; ++bits) {
    std::size_t place = 0;
    for (std::size_t lane = 0; lane < 8; ++lane) {
      if ((bits >> lane & 1U) != 0) sources[bits * 8 + place++] = lane;
    }
  }
  return sources;
}();

std::uint32_t bits_of(Rgba8Premultiplied pixel) {
  return std::bit_cast<std::uint32_t>(pixel);
}
std::uint64_t bits_of(RgbaPremultiplied pixel) {
  const auto halves = std::bit_cast<std::array<std::uint64_t, 2>>(pixel);
  return halves[0] | halves[1];
}

template <typename Pixel>
std::size_t find_colored(std::span<const Pixel, kTilePixels> tile, TileMask& mask) {
  std::size_t drawn = 0;
  for (std::size_t word = 0; word < mask.size(); ++word) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < 64; ++i) bits |= std::uint64_t{bits_of(tile[word * 64 + i]) != 0} << i;
    mask[word] = bits;
    drawn += static_cast<std::size_t>(std::popcount(bits));
  }
  return drawn;
}

template <typename Pixel>
std::size_t pack_colored(std::span<const Pixel, kTilePixels> tile, const TileMask& mask, Pixel* packed) {
  std::size_t count = 0;
  for (std::size_t word = 0; word < mask.size(); ++word) {
    if (mask[word] == 0) continue;
    // No branch on a pixel: an undrawn one is written and then written over.
    for (std::size_t i = 0; i < 64; ++i) {
      packed[count] = tile[word * 64 + i];
      count += mask[word] >> i & 1U;
    }
  }
  return count;
}

template <typename Pixel>
void unpack_colored(std::span<const Pixel> packed, const TileMask& mask, std::span<Pixel, kTilePixels> tile) {
  const Pixel* next = packed.data();
  for (std::size_t word = 0; word < mask.size(); ++word) {
    for (std::uint64_t rest = mask[word]; rest != 0; rest &= rest - 1) {
      tile[word * 64 + static_cast<std::size_t>(std::countr_zero(rest))] = *next++;
    }
  }
}

}  // namespace

std::size_t find_drawn(std::span<const Key, kTilePixels> tile, TileMask& mask) {
  return HWY_DYNAMIC_DISPATCH(find)(tile.data(), mask.data());
}

std::size_t pack_drawn(std::span<const Key, kTilePixels> tile, const TileMask& mask, Key* packed) {
  return HWY_DYNAMIC_DISPATCH(pack)(tile.data(), mask.data(), packed, kSources.data());
}

void merge_packed(std::span<Key, kTilePixels> tile, const TileMask& mask, std::span<const Key> packed) {
  const Key* next = packed.data();
  const Key* const end = next + packed.size();
  std::size_t word = HWY_DYNAMIC_DISPATCH(merge_runs)(tile.data(), mask.data(), next, end, kPlaces.data());
  for (; word < mask.size(); ++word) {
    for (std::uint64_t rest = mask[word]; rest != 0; rest &= rest - 1) {
      Key& key = tile[word * 64 + static_cast<std::size_t>(std::countr_zero(rest))];
      key = std::max(key, *next++);
    }
  }
}

std::size_t find_drawn(std::span<const Rgba8Premultiplied, kTilePixels> tile, TileMask& mask) {
  return find_colored(tile, mask);
}
std::size_t find_drawn(std::span<const RgbaPremultiplied, kTilePixels> tile, TileMask& mask) {
  return find_colored(tile, mask);
}
std::size_t pack_drawn(std::span<const Rgba8Premultiplied, kTilePixels> tile, const TileMask& mask,
                       Rgba8Premultiplied* packed) {
  return pack_colored(tile, mask, packed);
}
std::size_t pack_drawn(std::span<const RgbaPremultiplied, kTilePixels> tile, const TileMask& mask,
                       RgbaPremultiplied* packed) {
  return pack_colored(tile, mask, packed);
}
void unpack_drawn(std::span<const Rgba8Premultiplied> packed, const TileMask& mask,
                  std::span<Rgba8Premultiplied, kTilePixels> tile) {
  unpack_colored(packed, mask, tile);
}
void unpack_drawn(std::span<const RgbaPremultiplied> packed, const TileMask& mask,
                  std::span<RgbaPremultiplied, kTilePixels> tile) {
  unpack_colored(packed, mask, tile);
}

}  // namespace hpr
#endif
