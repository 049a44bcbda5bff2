#include "rt/photons/photon_search.h"

#include <cmath>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "rt/photons/photon_search.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

#include "rt/denoise/packed_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

/// Rows about a place: kRows of kPlaces are used.
constexpr std::size_t kRows = 9;
constexpr std::array<float, kPlaces> kRowY{-1, 0, 1, -1, 0, 1, -1, 0, 1};
constexpr std::array<float, kPlaces> kRowZ{-1, -1, -1, 0, 0, 0, 1, 1, 1};

struct Rows {
  alignas(64) std::array<std::int32_t, kPlaces> first;  ///< of the places' photons
  alignas(64) std::array<std::int32_t, kPlaces> last;   ///< exclusive; not above `first` where a row has none
};

/// From a place in its cell to the nearest point of the cell one step on.
HWY_INLINE Vector gap(Vector step, float in_cell) {
  const Vector aside = hn::IfThenElse(hn::Lt(step, hn::Zero(Floats())), all(in_cell), all(1.0F - in_cell));
  return hn::IfThenZeroElse(hn::Eq(step, hn::Zero(Floats())), aside);
}

/// Lengths are in cells here, and a little too long, so that no rounding loses a photon.
HWY_INLINE void find_rows(const PhotonSearch& search, const std::uint32_t* starts, Rows& rows) {
  constexpr float kSlack = 4e-6F;
  const Floats floats;
  const Words words;
  const glm::vec3 in_cell(search.in_cell);
  const glm::vec3 normal(search.normal);
  const float slope = std::abs(normal.x) < kSlack ? kSlack : normal.x;
  const float flat = static_cast<float>(search.flatness * search.cells_per_unit) +
                     0.5F * (std::abs(normal.y) + std::abs(normal.z)) + 4.0F * kSlack;
  const auto* const begins = reinterpret_cast<const std::int32_t*>(starts);
  for (std::size_t i = 0; i < kPlaces; i += hn::Lanes(floats)) {
    const Vector y = hn::LoadU(floats, &kRowY[i]);
    const Vector z = hn::LoadU(floats, &kRowZ[i]);
    const Vector width2 = hn::Sub(hn::Sub(all(1.0F), square(gap(y, in_cell.y))), square(gap(z, in_cell.z)));
    const Vector width = hn::Sqrt(hn::Max(width2, hn::Zero(floats)));
    // How far along x the row's box may touch the slab about the plane.
    const Vector middle = hn::Add(hn::Mul(all(normal.y), hn::Add(y, all(0.5F - in_cell.y))),
                                  hn::Mul(all(normal.z), hn::Add(z, all(0.5F - in_cell.z))));
    const Vector one = hn::Mul(hn::Sub(all(-flat), middle), all(1.0F / slope));
    const Vector other = hn::Mul(hn::Sub(all(flat), middle), all(1.0F / slope));
    const Vector low = hn::Max(hn::Neg(width), hn::Min(one, other));
    const Vector high = hn::Min(width, hn::Max(one, other));
    const Mask touches = hn::And(hn::Gt(width2, hn::Zero(floats)), hn::Le(low, high));
    // 0, 1 or 2 of the three cells about the place: truncation rounds down what is positive.
    const auto first = hn::ConvertTo(words, hn::Add(low, all(1.0F + in_cell.x)));
    const auto last = hn::ConvertTo(words, hn::Add(high, all(1.0F + in_cell.x)));
    const auto ahead =
        hn::Add(hn::Mul(hn::ConvertTo(words, y), hn::Set(words, static_cast<std::int32_t>(search.row_step))),
                hn::Mul(hn::ConvertTo(words, z), hn::Set(words, static_cast<std::int32_t>(search.layer_step))));
    const auto unwrapped = hn::Add(hn::Set(words, static_cast<std::int32_t>(search.cell - 1)), hn::Add(ahead, first));
    const auto in_words = hn::RebindMask(words, touches);
    const auto slot =
        hn::IfThenElseZero(in_words, hn::And(unwrapped, hn::Set(words, static_cast<std::int32_t>(search.last_slot))));
    const auto cells = hn::IfThenElseZero(in_words, hn::Add(hn::Sub(last, first), hn::Set(words, 1)));
    hn::StoreU(hn::GatherIndex(words, begins, slot), words, &rows.first[i]);
    hn::StoreU(hn::GatherIndex(words, begins, hn::Add(slot, cells)), words, &rows.last[i]);
  }
}

/// What is the same for every photon, in all lanes.
struct Wanted {
  explicit Wanted(const PhotonSearch& search)
      : high(search.place), low(search.place - glm::dvec3(high)), normal(search.normal) {
    radius2 = all(static_cast<float>(search.radius2));
    inverse_radius2 = all(static_cast<float>(search.inverse_radius2));
    flatness = all(static_cast<float>(search.flatness));
    least_cosine2 = all(static_cast<float>(search.least_cosine2));
    layer = hn::Set(Words(), static_cast<std::int32_t>(search.layer));
  }
  glm::vec3 high;  ///< the place: as a float, and what that leaves out
  glm::vec3 low;
  glm::vec3 normal;
  Vector radius2, inverse_radius2, flatness, least_cosine2;
  hn::Vec<Words> layer;
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
  const auto words = hn::BitCast(Words(), packed);
  const Vector3 facing = unpack_facing(words);
  const auto layer = hn::And(hn::ShiftRight<24>(words), hn::Set(Words(), 0xFF));
  const Mask same_layer = hn::RebindMask(Floats(), hn::Eq(layer, wanted.layer));
  const Vector cosine = dot(facing, wanted.normal);
  const Mask near =
      hn::And(hn::Lt(distance2, wanted.radius2), hn::Le(hn::Abs(dot(way, wanted.normal)), wanted.flatness));
  const Mask turned = hn::And(hn::Gt(cosine, hn::Zero(Floats())),
                              hn::Ge(square(cosine), hn::Mul(wanted.least_cosine2, length2(facing))));
  return hn::And(same_layer, hn::And(near, turned));
}

/// As find_photons.
void find(const PhotonSearch& search, const std::uint32_t* starts, const PhotonPlace* places, FoundPhotons& found) {
  Rows rows;
  find_rows(search, starts, rows);
  std::size_t most = kReadBeyond;
  for (std::size_t row = 0; row < kRows; ++row) {
    most += static_cast<std::size_t>(rows.last[row] - rows.first[row]);
    __builtin_prefetch(places + rows.first[row]);
    __builtin_prefetch(places + rows.first[row] + 4);
  }
  if (found.index.size() < most) {
    found.index.resize(2 * most);
    found.weight.resize(2 * most);
  }
  const Wanted wanted(search);
  const hn::RebindToUnsigned<Floats> unsigneds;
  std::size_t count = 0;
  for (std::size_t row = 0; row < kRows; ++row) {
    const auto last = static_cast<std::size_t>(rows.last[row]);
    for (auto i = static_cast<std::size_t>(rows.first[row]); i < last; i += hn::Lanes(Floats())) {
      Vector weights;
      const Mask counts = hn::And(judge(wanted, places + i, weights), hn::FirstN(Floats(), last - i));
      const auto numbers = hn::Iota(unsigneds, static_cast<std::uint32_t>(i));
      hn::StoreU(hn::Compress(numbers, hn::RebindMask(unsigneds, counts)), unsigneds, found.index.data() + count);
      hn::StoreU(hn::Compress(weights, counts), Floats(), found.weight.data() + count);
      count += hn::CountTrue(Floats(), counts);
    }
  }
  found.count = count;
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(find);

void find_photons(const PhotonSearch& search, const std::uint32_t* starts, const PhotonPlace* places,
                  FoundPhotons& found) {
  HWY_DYNAMIC_DISPATCH(find)(search, starts, places, found);
}

}  // namespace hpr
#endif
