// No include guard of the usual kind: this is compiled once per instruction set.
#if defined(HPR_RT_PACKED_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef HPR_RT_PACKED_LANES_INL_H
#undef HPR_RT_PACKED_LANES_INL_H
#else
#define HPR_RT_PACKED_LANES_INL_H
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <glm/vec3.hpp>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
/// Vectors of three, many at a time, mostly in single precision. Only operations that every processor rounds alike.
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Numbers that are worked on together stand in so many places whatever the width of vectors.
constexpr std::size_t kPlaces = 16;

using Floats = hn::CappedTag<float, kPlaces>;
using Words = hn::RebindToSigned<Floats>;
using Vector = hn::Vec<Floats>;
using Mask = hn::Mask<Floats>;

template <typename V>
struct VectorOf {
  V x, y, z;
};
using Vector3 = VectorOf<Vector>;

HWY_INLINE Vector all(float value) {
  return hn::Set(Floats(), value);
}

template <typename V>
HWY_INLINE V square(V a) {
  return hn::Mul(a, a);
}

HWY_INLINE Vector dot(const Vector3& a, const glm::vec3& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, all(b.x)), hn::Mul(a.y, all(b.y))), hn::Mul(a.z, all(b.z)));
}

template <typename V>
HWY_INLINE V dot(const VectorOf<V>& a, const VectorOf<V>& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}

template <typename V>
HWY_INLINE V length2(const VectorOf<V>& a) {
  return hn::Add(hn::Add(square(a.x), square(a.y)), square(a.z));
}

HWY_INLINE Vector3 scaled(const Vector3& a, Vector by) {
  return {hn::Mul(a.x, by), hn::Mul(a.y, by), hn::Mul(a.z, by)};
}

/// A direction, not of unit length, from where it lies on the unfolded octahedron, in steps of 1 / `most`.
HWY_INLINE Vector3 fold(hn::Vec<Words> x, hn::Vec<Words> y, float most) {
  const Floats floats;
  Vector3 d;
  d.x = hn::Mul(hn::ConvertTo(floats, x), all(1.0F / most));
  d.y = hn::Mul(hn::ConvertTo(floats, y), all(1.0F / most));
  d.z = hn::Sub(hn::Sub(all(1.0F), hn::Abs(d.x)), hn::Abs(d.y));
  const Vector fold = hn::Max(hn::Neg(d.z), hn::Zero(floats));
  d.x = hn::Sub(d.x, hn::CopySign(fold, d.x));
  d.y = hn::Sub(d.y, hn::CopySign(fold, d.y));
  return d;
}

/// As unpack_unscaled in photon_map.h.
HWY_INLINE Vector3 unpack_unscaled(hn::Vec<Words> packed) {
  return fold(hn::ShiftRight<16>(hn::ShiftLeft<16>(packed)), hn::ShiftRight<16>(packed), 32767.0F);
}

/// Of pack_facing.
HWY_INLINE Vector3 unpack_facing(hn::Vec<Words> packed) {
  return fold(hn::ShiftRight<20>(hn::ShiftLeft<20>(packed)), hn::ShiftRight<20>(hn::ShiftLeft<8>(packed)), 2047.0F);
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#endif
