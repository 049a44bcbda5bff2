#include "rt/denoise/lenders.h"

#include <algorithm>
#include <cmath>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "rt/denoise/lenders.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

#include "rt/denoise/packed_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
/// Sums are taken in an order that does not depend on the width of vectors.
namespace HWY_NAMESPACE {

using Doubles = hn::CappedTag<double, kPlaces>;
static_assert(LenderWeights::kPlaces == kPlaces);

HWY_INLINE Vector3 load(const LenderVectors<float>& from, std::size_t i) {
  return {hn::LoadU(Floats(), &from.x[i]), hn::LoadU(Floats(), &from.y[i]), hn::LoadU(Floats(), &from.z[i])};
}

HWY_INLINE Vector3 less(const Vector3& a, const glm::vec3& b) {
  return {hn::Sub(a.x, all(b.x)), hn::Sub(a.y, all(b.y)), hn::Sub(a.z, all(b.z))};
}

HWY_INLINE Vector3 weight_of(const LenderSights& sights, Lent lent, std::size_t i) {
  if (lent == Lent::Matte) return load(sights.matte, i);
  const Vector3 mirrored = load(sights.mirrored, i);
  if (lent == Lent::Mirrored) return mirrored;
  const Vector3 matte = load(sights.matte, i);
  return {hn::Add(mirrored.x, matte.x), hn::Add(mirrored.y, matte.y), hn::Add(mirrored.z, matte.z)};
}

/// What the lenders' light is multiplied by; clears the mask where the two scatter too different shares.
HWY_INLINE Vector make_up(const Borrower& borrower, float weight, Vector theirs, Mask& lends) {
  const Vector own = all(weight);
  const Vector ratio = hn::IfThenElse(hn::Eq(own, theirs), all(1.0F), hn::Div(own, theirs));
  lends = hn::And(
      lends, hn::And(hn::Le(ratio, all(borrower.most_brighter)), hn::Ge(ratio, all(1.0F / borrower.most_brighter))));
  return ratio;
}

/// As weigh_lenders.
void weigh(const LenderSights& sights, const Borrower& borrower, LenderWeights& weights) {
  const Floats floats;
  const glm::ivec2 shift = glm::ivec2(std::lround(borrower.way.x), std::lround(borrower.way.y));
  const int side = 2 * borrower.radius + 1;
  // What lies farther outside the tile lends nothing either.
  const auto inside = [&](int middle) {
    const int most = LenderPlanes::kMargin - borrower.radius;
    return std::clamp(middle, -most, kTileSide - 1 + most) - borrower.radius;
  };
  const int x0 = inside(borrower.pixel.x + shift.x);
  const int y0 = inside(borrower.pixel.y + shift.y);
  const float reach = static_cast<float>(borrower.radius) + 1.0F;
  const Vector inverse_reach2 = all(1.0F / (reach * reach));
  const auto borrower_kind =
      hn::Set(Words(), kind_of_lender(borrower.material, !borrower.is_pixel || borrower.is_split));
  const LenderVectors<float>& normals = borrower.is_pixel ? sights.mapped : sights.normal;
  weights.first = LenderPlanes::index(x0, y0);
  weights.rows = static_cast<std::size_t>(side);
  std::array<float, kPlaces> sums{};
  for (std::size_t row = 0; row < weights.rows; ++row) {
    const int columns_off = x0 - borrower.pixel.x;
    const int rows_off = y0 + static_cast<int>(row) - borrower.pixel.y;
    const Vector down = all(static_cast<float>(rows_off) - borrower.way.y);
    for (std::size_t lane = 0; lane < weights.rows; lane += hn::Lanes(floats)) {
      const std::size_t i = weights.first + row * LenderPlanes::kStride + lane;
      const Vector column = hn::Iota(floats, static_cast<float>(columns_off + static_cast<int>(lane)));
      const Vector right = hn::Sub(column, all(borrower.way.x));
      const Vector off2 = hn::Add(square(right), square(down));
      const Vector spatial = hn::Sub(all(1.0F), hn::Mul(off2, inverse_reach2));
      const Vector3 way = less(load(sights.place, i), borrower.place);
      const Vector way2 = length2(way);
      const Vector bent = dot(way, load(sights.normal, i));
      const Vector3 turned = less(load(normals, i), borrower.normal);
      Vector sharpness = all(borrower.sharpness);
      if (!borrower.is_pixel) sharpness = hn::Mul(sharpness, hn::LoadU(floats, &sights.sharpness[i]));
      const Vector alike = hn::Sub(all(1.0F), hn::Mul(length2(turned), sharpness));
      auto lender = hn::LoadU(Words(), &sights.lends[i]);
      if (!borrower.is_pixel) lender = hn::Or(lender, hn::Set(Words(), 1));
      Mask lends = hn::RebindMask(floats, hn::Eq(lender, borrower_kind));
      lends = hn::And(lends, hn::Lt(column, all(static_cast<float>(columns_off + side))));
      lends = hn::And(lends, hn::And(hn::Gt(spatial, hn::Zero(floats)), hn::Gt(alike, hn::Zero(floats))));
      lends = hn::And(lends, hn::And(hn::Le(way2, all(borrower.most_apart2)),
                                     hn::Le(square(bent), hn::Mul(all(borrower.most_bent2), way2))));
      Vector weight = hn::Mul(hn::Mul(all(borrower.others), spatial), square(alike));
      Vector red = all(1.0F);
      Vector green = red;
      Vector blue = red;
      if (borrower.is_pixel) {
        const Vector3 theirs = weight_of(sights, borrower.lent, i);
        red = make_up(borrower, borrower.weight.x, theirs.x, lends);
        green = make_up(borrower, borrower.weight.y, theirs.y, lends);
        blue = make_up(borrower, borrower.weight.z, theirs.z, lends);
        if (rows_off == 0) weight = hn::IfThenElse(hn::Eq(column, hn::Zero(floats)), all(1.0F), weight);
      }
      weight = hn::IfThenElseZero(lends, weight);
      const std::size_t at = row * kPlaces + lane;
      hn::StoreU(hn::IfThenElseZero(lends, hn::Mul(weight, red)), floats, &weights.red[at]);
      hn::StoreU(hn::IfThenElseZero(lends, hn::Mul(weight, green)), floats, &weights.green[at]);
      hn::StoreU(hn::IfThenElseZero(lends, hn::Mul(weight, blue)), floats, &weights.blue[at]);
      hn::StoreU(hn::Add(hn::LoadU(floats, &sums[lane]), weight), floats, &sums[lane]);
    }
  }
  weights.sum = 0.0F;
  for (const float sum : sums) weights.sum += sum;
}

HWY_INLINE double sum_of(const LenderWeights& weights, const LenderWeights::Rows& of, const double* light) {
  const Doubles doubles;
  const hn::Rebind<float, Doubles> floats;
  std::array<double, kPlaces> sums{};
  for (std::size_t lane = 0; lane < weights.rows; lane += hn::Lanes(doubles)) {
    auto sum = hn::Zero(doubles);
    for (std::size_t row = 0; row < weights.rows; ++row) {
      const auto weight = hn::PromoteTo(doubles, hn::LoadU(floats, &of[row * kPlaces + lane]));
      const auto lent = hn::LoadU(doubles, light + weights.first + row * LenderPlanes::kStride + lane);
      sum = hn::Add(sum, hn::Mul(weight, lent));
    }
    hn::StoreU(sum, doubles, &sums[lane]);
  }
  double sum = 0.0;
  for (const double each : sums) sum += each;
  return sum;
}

/// As mean_of.
void mean(const LenderWeights& weights, const LenderVectors<double>& light, glm::dvec3& found) {
  found = glm::dvec3(sum_of(weights, weights.red, light.x.data()), sum_of(weights, weights.green, light.y.data()),
                     sum_of(weights, weights.blue, light.z.data())) /
          static_cast<double>(weights.sum);
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(weigh);
HWY_EXPORT(mean);

void weigh_lenders(const LenderSights& sights, const Borrower& borrower, LenderWeights& weights) {
  HWY_DYNAMIC_DISPATCH(weigh)(sights, borrower, weights);
}

glm::dvec3 mean_of(const LenderWeights& weights, const LenderVectors<double>& light) {
  glm::dvec3 found;
  HWY_DYNAMIC_DISPATCH(mean)(weights, light, found);
  return found;
}

}  // namespace hpr
#endif
