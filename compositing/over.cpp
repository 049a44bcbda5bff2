#include "compositing/over.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/error.h"

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "compositing/over.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

// Without vectors: a lane is one number, which has no neighbours to share an alpha with.

void blend_bytes(const std::uint8_t* front, const std::uint8_t* back, std::uint8_t* into, std::size_t count) {
  for (std::size_t pixel = 0; pixel < count; pixel += 4) {
    const unsigned let_through = 255U - front[pixel + 3];
    for (std::size_t i = pixel; i < pixel + 4; ++i) {
      const unsigned rounded = let_through * back[i] + 128;
      into[i] = static_cast<std::uint8_t>(std::min(front[i] + ((rounded + (rounded >> 8U)) >> 8U), 255U));
    }
  }
}

bool transparent(const float* pixel) {
  std::array<std::uint32_t, 4> bits{};
  std::memcpy(bits.data(), pixel, sizeof bits);
  return (bits[0] | bits[1] | bits[2] | bits[3]) == 0;
}

void blend_floats(const float* front, const float* back, float* into, std::size_t count) {
  for (std::size_t pixel = 0; pixel < count; pixel += 4) {
    const bool only_back = transparent(front + pixel);
    const bool only_front = transparent(back + pixel);
    const float let_through = 1.0F - front[pixel + 3];
    for (std::size_t i = pixel; i < pixel + 4; ++i) {
      const float sum = front[i] + let_through * back[i];
      into[i] = only_back ? back[i] : only_front ? front[i] : sum;
    }
  }
}

#else

namespace hn = hwy::HWY_NAMESPACE;
using Bytes = hn::ScalableTag<std::uint8_t>;
using Halves = hn::Repartition<std::uint16_t, Bytes>;
using Words = hn::Repartition<std::uint32_t, Bytes>;
using Floats = hn::ScalableTag<float>;

/// x / 255 rounded to nearest, shifted up by 8 bits: 65407 at the most.
template <typename Vector>
HWY_INLINE Vector divided(Vector x) {
  const auto rounded = hn::Add(x, hn::Set(Halves(), 128));
  return hn::Add(rounded, hn::ShiftRight<8>(rounded));
}

template <typename Vector>
HWY_INLINE Vector over_bytes(Vector front, Vector back) {
  const Bytes bytes;
  const Halves halves;
  const Words words;
  const auto alpha = hn::ShiftRight<24>(hn::BitCast(words, front));
  const auto beside = hn::Sub(hn::Set(words, 255), alpha);
  const auto let_through = hn::BitCast(halves, hn::Or(beside, hn::ShiftLeft<16>(beside)));
  // Even and odd bytes apart, each with room for a product.
  const auto all = hn::BitCast(halves, back);
  const auto even = divided(hn::Mul(hn::And(all, hn::Set(halves, 0xFF)), let_through));
  const auto odd = divided(hn::Mul(hn::ShiftRight<8>(all), let_through));
  const auto behind = hn::Or(hn::ShiftRight<8>(even), hn::And(odd, hn::Set(halves, 0xFF00)));
  return hn::SaturatedAdd(front, hn::BitCast(bytes, behind));
}

/// All ones in the four lanes of every pixel whose bits are all zero.
template <typename Vector>
HWY_INLINE auto transparent(Vector pixels) {
  const hn::RebindToUnsigned<Floats> bits;
  const auto pairs = hn::Or(hn::BitCast(bits, pixels), hn::Shuffle2301(hn::BitCast(bits, pixels)));
  return hn::RebindMask(Floats(), hn::Eq(hn::Or(pairs, hn::Shuffle1032(pairs)), hn::Zero(bits)));
}

template <typename Vector>
HWY_INLINE Vector over_floats(Vector front, Vector back) {
  const Floats floats;
  const auto let_through = hn::Sub(hn::Set(floats, 1.0F), hn::Broadcast<3>(front));
  const auto sum = hn::Add(front, hn::Mul(let_through, back));
  // Where alpha is no number, or a zero is negative, the sum is not what leaving the transparent pixel out gives.
  return hn::IfThenElse(transparent(front), back, hn::IfThenElse(transparent(back), front, sum));
}

// The last pixels, too few for a vector, are padded to one, so that there is one way to blend.

void blend_bytes(const std::uint8_t* front, const std::uint8_t* back, std::uint8_t* into, std::size_t count) {
  const Bytes tag;
  const std::size_t lanes = hn::Lanes(tag);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(over_bytes(hn::LoadU(tag, front + i), hn::LoadU(tag, back + i)), tag, into + i);
  }
  if (i == count) return;
  HWY_ALIGN std::array<std::uint8_t, HWY_MAX_BYTES> a{};
  HWY_ALIGN std::array<std::uint8_t, HWY_MAX_BYTES> b{};
  std::copy(front + i, front + count, a.begin());
  std::copy(back + i, back + count, b.begin());
  hn::Store(over_bytes(hn::Load(tag, a.data()), hn::Load(tag, b.data())), tag, a.data());
  std::copy_n(a.begin(), count - i, into + i);
}

void blend_floats(const float* front, const float* back, float* into, std::size_t count) {
  const Floats tag;
  const std::size_t lanes = hn::Lanes(tag);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(over_floats(hn::LoadU(tag, front + i), hn::LoadU(tag, back + i)), tag, into + i);
  }
  if (i == count) return;
  HWY_ALIGN std::array<float, HWY_MAX_BYTES / sizeof(float)> a{};
  HWY_ALIGN std::array<float, HWY_MAX_BYTES / sizeof(float)> b{};
  std::copy(front + i, front + count, a.begin());
  std::copy(back + i, back + count, b.begin());
  hn::Store(over_floats(hn::Load(tag, a.data()), hn::Load(tag, b.data())), tag, a.data());
  std::copy_n(a.begin(), count - i, into + i);
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(blend_bytes);
HWY_EXPORT(blend_floats);

void composite_over(std::span<const Rgba8Premultiplied> front, std::span<const Rgba8Premultiplied> back,
                    std::span<Rgba8Premultiplied> into) {
  HPR_CHECK(front.size() == into.size() && back.size() == into.size());
  HWY_DYNAMIC_DISPATCH(blend_bytes)
  (reinterpret_cast<const std::uint8_t*>(front.data()), reinterpret_cast<const std::uint8_t*>(back.data()),
   reinterpret_cast<std::uint8_t*>(into.data()), into.size_bytes());
}

void composite_over(std::span<const RgbaPremultiplied> front, std::span<const RgbaPremultiplied> back,
                    std::span<RgbaPremultiplied> into) {
  HPR_CHECK(front.size() == into.size() && back.size() == into.size());
  HWY_DYNAMIC_DISPATCH(blend_floats)
  (reinterpret_cast<const float*>(front.data()), reinterpret_cast<const float*>(back.data()),
   reinterpret_cast<float*>(into.data()), into.size() * 4);
}

}  // namespace hpr
#endif
