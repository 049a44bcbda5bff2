#include "rt/denoise/joint_bilateral_filter.h"

#include <algorithm>
#include <cmath>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "rt/denoise/joint_bilateral_filter.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

#include "rt/denoise/packed_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
/// Sums are taken in an order that does not depend on the width of vectors.
namespace HWY_NAMESPACE {

static_assert(TapWeights<float>::kPlaces == kPlaces);

/// Lanes of one element type, at most kMaxLanes, and what the filter loads into them.
template <typename T, std::size_t kMaxLanes>
struct FilterLanes {
  using D = hn::CappedTag<T, kMaxLanes>;
  using Words = hn::RebindToSigned<D>;
  using V = hn::Vec<D>;
  using M = hn::Mask<D>;

  static HWY_INLINE V all(T value) { return hn::Set(D(), value); }
  static HWY_INLINE VectorOf<V> load(const TapVectors<T>& from, std::size_t i) {
    return {hn::LoadU(D(), &from.x[i]), hn::LoadU(D(), &from.y[i]), hn::LoadU(D(), &from.z[i])};
  }
  static HWY_INLINE VectorOf<V> less(const VectorOf<V>& a, const glm::vec<3, T>& b) {
    return {hn::Sub(a.x, all(b.x)), hn::Sub(a.y, all(b.y)), hn::Sub(a.z, all(b.z))};
  }
  /// What the taps' light is multiplied by; clears the mask where the two scatter too different fractions.
  static HWY_INLINE V ratio(const FilterCenter<T>& center, T weight, V theirs, M& accepted) {
    const V own = all(weight);
    const V quotient = hn::IfThenElse(hn::Eq(own, theirs), all(T{1}), hn::Div(own, theirs));
    accepted =
        hn::And(accepted, hn::And(hn::Le(quotient, all(center.max_ratio)), hn::Ge(quotient, all(center.min_ratio))));
    return quotient;
  }
};

/// The weight of taps in the columns `column`, of a row `down` from the center, by their distance from it and how alike
/// they are; clears the mask where they are out of reach. Of the center's own row the center weighs 1.
template <typename Lanes, typename T>
HWY_INLINE typename Lanes::V spatial_weight(const FilterCenter<T>& center, typename Lanes::V column,
                                            typename Lanes::V down, typename Lanes::V alike, bool is_own_row,
                                            typename Lanes::M& accepted) {
  const typename Lanes::D d;
  const auto right = hn::Sub(column, Lanes::all(static_cast<T>(center.offset.x)));
  const auto off2 = hn::Add(square(right), square(down));
  const auto spatial = hn::Sub(Lanes::all(T{1}), hn::Mul(off2, Lanes::all(T{1} / (center.reach * center.reach))));
  accepted = hn::And(accepted, hn::Gt(spatial, hn::Zero(d)));
  const auto weight = hn::Mul(hn::Mul(Lanes::all(center.neighbor_weight), spatial), square(alike));
  if (!center.is_pixel || !is_own_row) return weight;
  return hn::IfThenElse(hn::Eq(column, hn::Zero(d)), Lanes::all(T{1}), weight);
}

/// What the light of the taps from `i` on is multiplied by, for each term of the center; 1 where it has none.
template <typename Lanes, typename T>
HWY_INLINE auto scattering_ratios(const NeighborFeatures<T>& taps, const FilterCenter<T>& center, std::size_t i,
                                  typename Lanes::M& accepted) {
  std::array<VectorOf<typename Lanes::V>, FilterCenter<T>::kMaxTerms> ratios;
  ratios[0] = {Lanes::all(T{1}), Lanes::all(T{1}), Lanes::all(T{1})};
  for (std::size_t term = 0; term < center.term_count; ++term) {
    const ScatteringTerm<T>& scattering = center.terms[term];
    const auto theirs = Lanes::load(taps.scattering[scattering.plane], i);
    ratios[term].x = Lanes::ratio(center, scattering.own.x, theirs.x, accepted);
    ratios[term].y = Lanes::ratio(center, scattering.own.y, theirs.y, accepted);
    ratios[term].z = Lanes::ratio(center, scattering.own.z, theirs.z, accepted);
  }
  return ratios;
}

/// Implements joint_bilateral_weights.
template <std::size_t kMaxLanes, typename T>
HWY_INLINE void weigh(const NeighborFeatures<T>& taps, const FilterCenter<T>& center, TapWeights<T>& weights) {
  using Lanes = FilterLanes<T, kMaxLanes>;
  using V = typename Lanes::V;
  const typename Lanes::D d;
  const typename Lanes::Words words;
  const auto all = [](T value) { return Lanes::all(value); };
  const FilterWindow& window = center.window;
  using Kind = typename NeighborFeatures<T>::Kind;
  const auto center_kind = hn::Set(words, Kind{tap_kind(center.material, !center.is_pixel || center.separate_diffuse)});
  const TapVectors<T>& normals = center.is_pixel ? taps.shading_normal : taps.normal;
  weights.first = TapPlanes::index(window.first.x, window.first.y);
  weights.columns = static_cast<std::size_t>(window.columns);
  weights.rows = static_cast<std::size_t>(window.rows);
  const int columns_off = window.first.x - center.pixel.x;
  std::array<T, kPlaces> sums{};
  for (std::size_t row = 0; row < weights.rows; ++row) {
    const int rows_off = window.first.y + static_cast<int>(row) - center.pixel.y;
    const V down = all(static_cast<T>(rows_off) - static_cast<T>(center.offset.y));
    for (std::size_t lane = 0; lane < weights.columns; lane += hn::Lanes(d)) {
      const std::size_t i = weights.first + row * TapPlanes::kStride + lane;
      const V column = hn::Iota(d, static_cast<T>(columns_off + static_cast<int>(lane)));
      const VectorOf<V> offset = Lanes::less(Lanes::load(taps.position, i), center.position);
      const V distance2 = length2(offset);
      const V bend = dot(offset, Lanes::load(taps.normal, i));
      const VectorOf<V> turned = Lanes::less(Lanes::load(normals, i), center.normal);
      V sharpness = all(center.sharpness);
      if (!center.is_pixel) sharpness = hn::Mul(sharpness, hn::LoadU(d, &taps.sharpness[i]));
      const V alike = hn::Sub(all(T{1}), hn::Mul(length2(turned), sharpness));
      auto kind = hn::LoadU(words, &taps.kinds[i]);
      if (!center.is_pixel) kind = hn::Or(kind, hn::Set(words, Kind{1}));
      auto accepted = hn::RebindMask(d, hn::Eq(kind, center_kind));
      accepted = hn::And(accepted, hn::Lt(column, all(static_cast<T>(columns_off + window.columns))));
      accepted = hn::And(accepted, hn::Gt(alike, hn::Zero(d)));
      accepted = hn::And(accepted, hn::And(hn::Le(distance2, all(center.max_distance2)),
                                           hn::Le(square(bend), hn::Mul(all(center.max_bend2), distance2))));
      V weight = all(T{1});
      if (!center.is_box) weight = spatial_weight<Lanes>(center, column, down, alike, rows_off == 0, accepted);
      const auto ratios = scattering_ratios<Lanes>(taps, center, i, accepted);
      weight = hn::IfThenElseZero(accepted, weight);
      const std::size_t at = row * kPlaces + lane;
      for (std::size_t term = 0; term < std::max<std::size_t>(center.term_count, 1); ++term) {
        auto& channels = weights.terms[term];
        hn::StoreU(hn::IfThenElseZero(accepted, hn::Mul(weight, ratios[term].x)), d, &channels.red[at]);
        hn::StoreU(hn::IfThenElseZero(accepted, hn::Mul(weight, ratios[term].y)), d, &channels.green[at]);
        hn::StoreU(hn::IfThenElseZero(accepted, hn::Mul(weight, ratios[term].z)), d, &channels.blue[at]);
      }
      hn::StoreU(hn::Add(hn::LoadU(d, &sums[lane]), weight), d, &sums[lane]);
    }
  }
  weights.sum = 0;
  for (const T sum : sums) weights.sum += sum;
}

void weigh_floats(const NeighborFeatures<float>& taps, const FilterCenter<float>& center, TapWeights<float>& weights) {
  weigh<kPlaces>(taps, center, weights);
}
void weigh_doubles(const NeighborFeatures<double>& taps, const FilterCenter<double>& center,
                   TapWeights<double>& weights) {
  // The windows of half resolution are two taps wide: wider vectors would divide for nothing.
  constexpr std::size_t kNarrow = 2;
  if (center.window.columns <= static_cast<int>(kNarrow)) {
    weigh<kNarrow>(taps, center, weights);
  } else {
    weigh<kPlaces>(taps, center, weights);
  }
}

HWY_INLINE double sum_of(const TapWeights<float>& weights, const TapWeights<float>::Rows& of, const double* light) {
  const hn::CappedTag<double, kPlaces> doubles;
  const hn::Rebind<float, hn::CappedTag<double, kPlaces>> floats;
  std::array<double, kPlaces> sums{};
  for (std::size_t lane = 0; lane < weights.columns; lane += hn::Lanes(doubles)) {
    auto sum = hn::Zero(doubles);
    for (std::size_t row = 0; row < weights.rows; ++row) {
      const auto weight = hn::PromoteTo(doubles, hn::LoadU(floats, &of[row * kPlaces + lane]));
      const auto tap = hn::LoadU(doubles, light + weights.first + row * TapPlanes::kStride + lane);
      sum = hn::Add(sum, hn::Mul(weight, tap));
    }
    hn::StoreU(sum, doubles, &sums[lane]);
  }
  double sum = 0.0;
  for (const double each : sums) sum += each;
  return sum;
}

/// Implements filtered_mean.
void mean(const TapWeights<float>& weights, const TapVectors<double>& light, glm::dvec3& found) {
  const auto& channels = weights.terms[0];
  found = glm::dvec3(sum_of(weights, channels.red, light.x.data()), sum_of(weights, channels.green, light.y.data()),
                     sum_of(weights, channels.blue, light.z.data())) /
          static_cast<double>(weights.sum);
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(weigh_floats);
HWY_EXPORT(weigh_doubles);
HWY_EXPORT(mean);

FilterWindow window_about(const glm::ivec2& pixel, const glm::vec2& offset, int radius) {
  // Taps farther outside the tile have no weight either.
  const auto inside = [&](int center) {
    const int most = TapPlanes::kMargin - radius;
    return std::clamp(center, -most, kTileSide - 1 + most) - radius;
  };
  const glm::ivec2 shift(std::lround(offset.x), std::lround(offset.y));
  const int side = 2 * radius + 1;
  return {{inside(pixel.x + shift.x), inside(pixel.y + shift.y)}, side, side};
}

void joint_bilateral_weights(const NeighborFeatures<float>& taps, const FilterCenter<float>& center,
                             TapWeights<float>& weights) {
  HWY_DYNAMIC_DISPATCH(weigh_floats)(taps, center, weights);
}

void joint_bilateral_weights(const NeighborFeatures<double>& taps, const FilterCenter<double>& center,
                             TapWeights<double>& weights) {
  HWY_DYNAMIC_DISPATCH(weigh_doubles)(taps, center, weights);
}

glm::dvec3 filtered_mean(const TapWeights<float>& weights, const TapVectors<double>& light) {
  glm::dvec3 found;
  HWY_DYNAMIC_DISPATCH(mean)(weights, light, found);
  return found;
}

}  // namespace hpr
#endif
