#include "rt/photon_search.h"

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "rt/photon_search.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

#include "rt/packed_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

/// What is the same for every photon, in all lanes.
struct Wanted {
  explicit Wanted(const PhotonSearch& search)
      : high(search.place), low(search.place - glm::dvec3(high)), normal(search.normal) {
    radius2 = all(static_cast<float>(search.radius2));
    inverse_radius2 = all(static_cast<float>(search.inverse_radius2));
    flatness = all(static_cast<float>(search.flatness));
    least_cosine2 = all(static_cast<float>(search.least_cosine2));
  }
  glm::vec3 high;  ///< the place: as a float, and what that leaves out
  glm::vec3 low;
  glm::vec3 normal;
  Vector radius2, inverse_radius2, flatness, least_cosine2;
};

/// Whether each of the photons at `places` counts, and its weight.
HWY_INLINE Mask judge(const Wanted& wanted, const PhotonPlace* places, Vector& weight) {
  Vector x, y, z, packed;
  hn::LoadInterleaved4(Floats(), places->position.data(), x, y, z, packed);
  const Vector3 way{hn::Sub(hn::Sub(x, all(wanted.high.x)), all(wanted.low.x)),
                    hn::Sub(hn::Sub(y, all(wanted.high.y)), all(wanted.low.y)),
                    hn::Sub(hn::Sub(z, all(wanted.high.z)), all(wanted.low.z))};
  const Vector distance2 = length2(way);
  weight = hn::Sub(all(1.0F), hn::Mul(distance2, wanted.inverse_radius2));
  const Vector3 facing = unpack_unscaled(hn::BitCast(Words(), packed));
  const Vector cosine = dot(facing, wanted.normal);
  const Mask near =
      hn::And(hn::Lt(distance2, wanted.radius2), hn::Le(hn::Abs(dot(way, wanted.normal)), wanted.flatness));
  const Mask turned = hn::And(hn::Gt(cosine, hn::Zero(Floats())),
                              hn::Ge(square(cosine), hn::Mul(wanted.least_cosine2, length2(facing))));
  return hn::And(near, turned);
}

/// There is room for all photons of the rows, and a vector more.
std::size_t collect(const PhotonSearch& search, const PhotonRow* rows, std::size_t row_count, const PhotonPlace* places,
                    std::uint32_t* index, float* weight) {
  const Wanted wanted(search);
  const hn::RebindToUnsigned<Floats> unsigneds;
  const std::size_t lanes = hn::Lanes(Floats());
  std::size_t count = 0;
  for (std::size_t row = 0; row < row_count; ++row) {
    for (std::size_t i = rows[row].first; i < rows[row].last; i += lanes) {
      Vector weights;
      const Mask counts = hn::And(judge(wanted, places + i, weights), hn::FirstN(Floats(), rows[row].last - i));
      const auto numbers = hn::Iota(unsigneds, static_cast<std::uint32_t>(i));
      hn::StoreU(hn::Compress(numbers, hn::RebindMask(unsigneds, counts)), unsigneds, index + count);
      hn::StoreU(hn::Compress(weights, counts), Floats(), weight + count);
      count += hn::CountTrue(Floats(), counts);
    }
  }
  return count;
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(collect);

void find_photons(const PhotonSearch& search, std::span<const PhotonRow> rows, const PhotonPlace* places,
                  FoundPhotons& found) {
  std::size_t most = kReadBeyond;
  for (const PhotonRow& row : rows) most += row.last - row.first;
  if (found.index.size() < most) {
    found.index.resize(2 * most);
    found.weight.resize(2 * most);
  }
  found.count =
      HWY_DYNAMIC_DISPATCH(collect)(search, rows.data(), rows.size(), places, found.index.data(), found.weight.data());
}

}  // namespace hpr
#endif
