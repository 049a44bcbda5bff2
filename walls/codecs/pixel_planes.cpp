#include <algorithm>
#include <array>
#include <cstddef>

#include "core/error.h"
#include "walls/codecs/coder.h"

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "walls/codecs/pixel_planes.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR  // has no lanes to move things between: the caller does all

std::size_t split(const std::uint8_t* /*pixels*/, std::size_t /*count*/, std::uint8_t* /*planes*/) {
  return 1;
}

std::size_t join(const std::uint8_t* /*planes*/, std::size_t /*count*/, std::uint8_t* /*pixels*/) {
  return 0;
}

std::size_t within(const std::uint8_t* /*a*/, const std::uint8_t* /*b*/, std::size_t /*bytes*/,
                   const std::uint8_t* /*tolerance*/) {
  return 0;
}

std::size_t scale_up(const std::uint8_t* /*steps*/, std::size_t /*bytes*/, std::uint16_t /*step*/,
                     std::uint8_t* /*levels*/) {
  return 0;
}

#else

// Sixteen bytes at a time whatever the machine: sums run on from lane to lane.
using Bytes = hn::FixedTag<std::uint8_t, 16>;
using Vector = hn::Vec<Bytes>;

struct Quad {
  Vector r, g, b, a;
};

HWY_INLINE Quad load_decorrelated(const std::uint8_t* pixels) {
  Quad q{hn::Zero(Bytes()), hn::Zero(Bytes()), hn::Zero(Bytes()), hn::Zero(Bytes())};
  hn::LoadInterleaved4(Bytes(), pixels, q.r, q.g, q.b, q.a);
  return {hn::Sub(q.r, q.g), q.g, hn::Sub(q.b, q.g), q.a};
}

/// Returns how many of `count` pixels it did.
std::size_t split(const std::uint8_t* pixels, std::size_t count, std::uint8_t* planes) {
  std::size_t i = 1;  // the first pixel has none before it
  for (; i + 16 <= count; i += 16) {
    const Quad here = load_decorrelated(pixels + 4 * i);
    const Quad before = load_decorrelated(pixels + 4 * (i - 1));
    hn::StoreU(hn::Sub(here.r, before.r), Bytes(), planes + i);
    hn::StoreU(hn::Sub(here.g, before.g), Bytes(), planes + count + i);
    hn::StoreU(hn::Sub(here.b, before.b), Bytes(), planes + 2 * count + i);
    hn::StoreU(hn::Sub(here.a, before.a), Bytes(), planes + 3 * count + i);
  }
  return i;
}

/// Sums of all lanes up to each, and `carry`, which becomes the last of them in every lane.
HWY_INLINE Vector running_sums(Vector v, Vector& carry) {
  v = hn::Add(v, hn::ShiftLeftBytes<1>(Bytes(), v));
  v = hn::Add(v, hn::ShiftLeftBytes<2>(Bytes(), v));
  v = hn::Add(v, hn::ShiftLeftBytes<4>(Bytes(), v));
  v = hn::Add(v, hn::ShiftLeftBytes<8>(Bytes(), v));
  v = hn::Add(v, carry);
  carry = hn::TableLookupBytes(v, hn::Set(Bytes(), 15));
  return v;
}

std::size_t join(const std::uint8_t* planes, std::size_t count, std::uint8_t* pixels) {
  Quad carry{hn::Zero(Bytes()), hn::Zero(Bytes()), hn::Zero(Bytes()), hn::Zero(Bytes())};
  std::size_t i = 0;
  for (; i + 16 <= count; i += 16) {
    const Vector r = running_sums(hn::LoadU(Bytes(), planes + i), carry.r);
    const Vector g = running_sums(hn::LoadU(Bytes(), planes + count + i), carry.g);
    const Vector b = running_sums(hn::LoadU(Bytes(), planes + 2 * count + i), carry.b);
    const Vector a = running_sums(hn::LoadU(Bytes(), planes + 3 * count + i), carry.a);
    hn::StoreInterleaved4(hn::Add(r, g), g, hn::Add(b, g), a, Bytes(), pixels + 4 * i);
  }
  return i;
}

/// How many bytes, of whole vectors, lie within `tolerance`: stops at the first vector with one that does not.
std::size_t within(const std::uint8_t* a, const std::uint8_t* b, std::size_t bytes, const std::uint8_t* tolerance) {
  const Vector allowed = hn::LoadU(Bytes(), tolerance);
  std::size_t i = 0;
  for (; i + 16 <= bytes; i += 16) {
    const Vector x = hn::LoadU(Bytes(), a + i);
    const Vector y = hn::LoadU(Bytes(), b + i);
    const Vector difference = hn::Sub(hn::Max(x, y), hn::Min(x, y));
    if (!hn::AllTrue(Bytes(), hn::Eq(hn::Max(difference, allowed), allowed))) break;
  }
  return i;
}

/// Bytes of whole pixels times `step`, at most 255; every fourth one stays.
std::size_t scale_up(const std::uint8_t* steps, std::size_t bytes, std::uint16_t step, std::uint8_t* levels) {
  using Words = hn::FixedTag<std::uint16_t, 8>;
  using Half = hn::FixedTag<std::uint8_t, 8>;
  HWY_ALIGN constexpr std::uint8_t kAlpha[8] = {0, 0, 0, 255, 0, 0, 0, 255};
  const auto alpha = hn::Load(Half(), kAlpha);
  const auto factor = hn::Set(Words(), step);
  const auto most = hn::Set(Words(), 255);
  std::size_t i = 0;
  for (; i + 8 <= bytes; i += 8) {
    const auto v = hn::LoadU(Half(), steps + i);
    const auto scaled = hn::Min(hn::Mul(hn::PromoteTo(Words(), v), factor), most);
    const auto levels8 = hn::DemoteTo(Half(), hn::BitCast(hn::FixedTag<std::int16_t, 8>(), scaled));
    hn::StoreU(hn::Or(hn::And(alpha, v), hn::AndNot(alpha, levels8)), Half(), levels + i);
  }
  return i;
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(split);
HWY_EXPORT(join);
HWY_EXPORT(within);
HWY_EXPORT(scale_up);

namespace {

const std::uint8_t* bytes_of(std::span<const Rgba8> pixels) {
  return reinterpret_cast<const std::uint8_t*>(pixels.data());
}

std::uint8_t modulo(int value) {
  return static_cast<std::uint8_t>(value & 0xFF);
}

Rgba8 decorrelated(Rgba8 p) {
  return {modulo(p.r - p.g), p.g, modulo(p.b - p.g), p.a};
}

}  // namespace

void split_planes(std::span<const Rgba8> pixels, std::span<std::uint8_t> planes) {
  const std::size_t count = pixels.size();
  HPR_CHECK(planes.size() == 4 * count);
  if (count == 0) return;
  Rgba8 before{};
  const auto put = [&](std::size_t i) {
    const Rgba8 p = decorrelated(pixels[i]);
    planes[i] = modulo(p.r - before.r);
    planes[count + i] = modulo(p.g - before.g);
    planes[2 * count + i] = modulo(p.b - before.b);
    planes[3 * count + i] = modulo(p.a - before.a);
    before = p;
  };
  put(0);
  const std::size_t done = HWY_DYNAMIC_DISPATCH(split)(bytes_of(pixels), count, planes.data());
  before = decorrelated(pixels[done - 1]);
  for (std::size_t i = done; i < count; ++i) put(i);
}

void join_planes(std::span<const std::uint8_t> planes, std::span<Rgba8> pixels) {
  const std::size_t count = pixels.size();
  HPR_CHECK(planes.size() == 4 * count);
  const std::size_t done =
      HWY_DYNAMIC_DISPATCH(join)(planes.data(), count, reinterpret_cast<std::uint8_t*>(pixels.data()));
  Rgba8 sum = done > 0 ? decorrelated(pixels[done - 1]) : Rgba8{};
  for (std::size_t i = done; i < count; ++i) {
    sum = {modulo(sum.r + planes[i]), modulo(sum.g + planes[count + i]), modulo(sum.b + planes[2 * count + i]),
           modulo(sum.a + planes[3 * count + i])};
    pixels[i] = {modulo(sum.r + sum.g), sum.g, modulo(sum.b + sum.g), sum.a};
  }
}

void quantize(std::span<const Rgba8> pixels, int error, std::span<Rgba8> steps) {
  HPR_CHECK(pixels.size() == steps.size());
  std::array<std::uint8_t, 256> table{};
  for (int level = 0; level < 256; ++level) {
    table[static_cast<std::size_t>(level)] = static_cast<std::uint8_t>((level + error) / (2 * error + 1));
  }
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const Rgba8 p = pixels[i];
    steps[i] = {table[p.r], table[p.g], table[p.b], p.a};
  }
}

void dequantize(std::span<const Rgba8> steps, int error, std::span<Rgba8> pixels) {
  HPR_CHECK(pixels.size() == steps.size());
  const auto step = static_cast<std::uint16_t>(2 * error + 1);
  const std::size_t bytes = HWY_DYNAMIC_DISPATCH(scale_up)(bytes_of(steps), steps.size_bytes(), step,
                                                           reinterpret_cast<std::uint8_t*>(pixels.data()));
  const auto level = [step](std::uint8_t number) { return static_cast<std::uint8_t>(std::min(255, number * step)); };
  for (std::size_t i = bytes / sizeof(Rgba8); i < steps.size(); ++i) {
    const Rgba8 p = steps[i];
    pixels[i] = {level(p.r), level(p.g), level(p.b), p.a};
  }
}

bool all_within(std::span<const Rgba8> a, std::span<const Rgba8> b, int error) {
  HPR_CHECK(a.size() == b.size());
  std::array<std::uint8_t, 16> tolerance{};
  for (std::size_t i = 0; i < tolerance.size(); ++i) {
    tolerance[i] = i % 4 == 3 ? std::uint8_t{0} : static_cast<std::uint8_t>(error);
  }
  const std::uint8_t* const x = bytes_of(a);
  const std::uint8_t* const y = bytes_of(b);
  for (std::size_t i = HWY_DYNAMIC_DISPATCH(within)(x, y, a.size_bytes(), tolerance.data()); i < a.size_bytes(); ++i) {
    if (std::max(x[i], y[i]) - std::min(x[i], y[i]) > tolerance[i % tolerance.size()]) return false;
  }
  return true;
}

}  // namespace hpr
#endif
