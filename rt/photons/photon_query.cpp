#include "rt/photons/photon_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "rt/photons/photon_query.cpp"
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
    const Vector center = hn::Add(hn::Mul(all(normal.y), hn::Add(y, all(0.5F - in_cell.y))),
                                  hn::Mul(all(normal.z), hn::Add(z, all(0.5F - in_cell.z))));
    const Vector one = hn::Mul(hn::Sub(all(-flat), center), all(1.0F / slope));
    const Vector other = hn::Mul(hn::Sub(all(flat), center), all(1.0F / slope));
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
      : high(search.position), low(search.position - glm::dvec3(high)), normal(search.normal) {
    radius2 = all(static_cast<float>(search.radius2));
    inverse_radius2 = all(static_cast<float>(search.inverse_radius2));
    flatness = all(static_cast<float>(search.flatness));
    min_cosine2 = all(static_cast<float>(search.min_cosine2));
    layer = hn::Set(Words(), static_cast<std::int32_t>(search.layer));
  }
  glm::vec3 high;  ///< the place: as a float, and what that leaves out
  glm::vec3 low;
  glm::vec3 normal;
  Vector radius2, inverse_radius2, flatness, min_cosine2;
  hn::Vec<Words> layer;
};

/// Whether each of the photons at `positions` counts, and its weight.
HWY_INLINE Mask judge(const Wanted& wanted, const PhotonPlace* positions, Vector& weight) {
  Vector x, y, z, packed;
  hn::LoadInterleaved4(Floats(), positions->position.data(), x, y, z, packed);
  const Vector3 offset{hn::Sub(hn::Sub(x, all(wanted.high.x)), all(wanted.low.x)),
                       hn::Sub(hn::Sub(y, all(wanted.high.y)), all(wanted.low.y)),
                       hn::Sub(hn::Sub(z, all(wanted.high.z)), all(wanted.low.z))};
  const Vector distance2 = length2(offset);
  weight = hn::Sub(all(1.0F), hn::Mul(distance2, wanted.inverse_radius2));
  const auto words = hn::BitCast(Words(), packed);
  const Vector3 facing = unpack_facing(words);
  const auto layer = hn::And(hn::ShiftRight<24>(words), hn::Set(Words(), 0xFF));
  const Mask same_layer = hn::RebindMask(Floats(), hn::Eq(layer, wanted.layer));
  const Vector cosine = dot(facing, wanted.normal);
  const Mask near =
      hn::And(hn::Lt(distance2, wanted.radius2), hn::Le(hn::Abs(dot(offset, wanted.normal)), wanted.flatness));
  const Mask turned =
      hn::And(hn::Gt(cosine, hn::Zero(Floats())), hn::Ge(square(cosine), hn::Mul(wanted.min_cosine2, length2(facing))));
  return hn::And(same_layer, hn::And(near, turned));
}

/// Implements find_photons.
void find(const PhotonSearch& search, const std::uint32_t* starts, const PhotonPlace* positions, FoundPhotons& found) {
  Rows rows;
  find_rows(search, starts, rows);
  std::size_t most = kReadBeyond;
  for (std::size_t row = 0; row < kRows; ++row) {
    most += static_cast<std::size_t>(rows.last[row] - rows.first[row]);
    __builtin_prefetch(positions + rows.first[row]);
    __builtin_prefetch(positions + rows.first[row] + 4);
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
      const Mask counts = hn::And(judge(wanted, positions + i, weights), hn::FirstN(Floats(), last - i));
      const auto numbers = hn::Iota(unsigneds, static_cast<std::uint32_t>(i));
      hn::StoreU(hn::Compress(numbers, hn::RebindMask(unsigneds, counts)), unsigneds, found.index.data() + count);
      hn::StoreU(hn::Compress(weights, counts), Floats(), found.weight.data() + count);
      count += hn::CountTrue(Floats(), counts);
    }
  }
  found.count = count;
}

static_assert(kReadBeyond >= kPlaces);

/// Cosines of light that falls on the true surface count as this much at the least.
constexpr float kGrazing = 1e-3F;

/// As unpack_direction.
HWY_INLINE Vector3 unpack(hn::Vec<Words> packed) {
  const Vector3 d = unpack_unscaled(packed);
  return scaled(d, hn::Div(all(1.0F), hn::Sqrt(length2(d))));
}

/// As fresnel_exact in bsdf.cpp.
HWY_INLINE Vector fresnel_exact(Vector cosine, float eta) {
  const Vector sine2 = hn::Mul(hn::Sub(all(1.0F), square(cosine)), all(1.0F / (eta * eta)));
  const Vector refracted = hn::Sqrt(hn::Max(hn::Sub(all(1.0F), sine2), hn::Zero(Floats())));
  const auto quotient = [](Vector a, Vector b) { return square(hn::Div(hn::Sub(a, b), hn::Add(a, b))); };
  const Vector parallel = quotient(hn::Mul(all(eta), cosine), refracted);
  const Vector perpendicular = quotient(cosine, hn::Mul(all(eta), refracted));
  const Vector reflected = hn::Mul(all(0.5F), hn::Add(parallel, perpendicular));
  return hn::IfThenElse(hn::Lt(sine2, all(1.0F)), reflected, all(1.0F));
}

/// What a photon's direction has of f; in a channel: diffuse * of the base + grey + tint * tinted.
struct Reflected {
  Vector diffuse;
  Vector grey;
  Vector tinted;
};

/// As Bsdf::reflected, and what gather_photons says of leaning normals.
HWY_INLINE Reflected reflect(const ReflectionTerms& terms, bool leans, const Vector3& light) {
  const Vector normal_light = dot(light, terms.normal);
  const Vector falls = dot(light, terms.geometric_normal);
  const Mask lit = hn::And(hn::Gt(normal_light, all(terms.edge_on)), hn::Gt(falls, hn::Zero(Floats())));
  const Vector3 sum{hn::Add(light.x, all(terms.view.x)), hn::Add(light.y, all(terms.view.y)),
                    hn::Add(light.z, all(terms.view.z))};
  const Vector length = hn::Sqrt(length2(sum));
  const Vector half_cosine = hn::Min(hn::Mul(all(0.5F), length), all(1.0F));
  const Vector m = hn::Sub(all(1.0F), half_cosine);
  const Vector m5 = hn::Mul(square(square(m)), m);
  Vector dielectric = hn::Add(all(terms.f0), hn::Mul(all(terms.rise), m5));
  Vector below = hn::Sub(all(1.0F), dielectric);
  if (terms.eta > 0.0F) {
    dielectric = fresnel_exact(half_cosine, terms.eta);
    below = hn::Sub(all(1.0F), fresnel_exact(hn::Min(normal_light, all(1.0F)), terms.eta));
  }
  Vector scale = all(1.0F);
  if (leans) scale = hn::Div(normal_light, hn::Max(falls, all(kGrazing)));
  Reflected result{hn::IfThenElseZero(lit, hn::Mul(scale, below)), hn::Zero(Floats()), hn::Zero(Floats())};
  if (!terms.specular) return result;

  // As Bsdf::distribution and Bsdf::shadowing.
  const Vector3 half = scaled(sum, hn::Div(all(1.0F), length));
  const glm::vec3& n = terms.normal;
  const Vector3 across{hn::Sub(hn::Mul(all(n.y), half.z), hn::Mul(all(n.z), half.y)),
                       hn::Sub(hn::Mul(all(n.z), half.x), hn::Mul(all(n.x), half.z)),
                       hn::Sub(hn::Mul(all(n.x), half.y), hn::Mul(all(n.y), half.x))};
  const Vector alpha2 = all(terms.alpha2);
  const Vector spread = hn::Add(length2(across), hn::Mul(alpha2, square(dot(half, n))));
  const Vector light_smith = hn::Sqrt(hn::Add(alpha2, hn::Mul(all(1.0F - terms.alpha2), square(normal_light))));
  const Vector smith =
      hn::Add(hn::Mul(normal_light, all(terms.view_smith)), hn::Mul(all(terms.normal_view), light_smith));
  // D is divided twice, as the square of a narrow lobe's spread may be too small for a float.
  const Vector distribution = hn::Div(hn::Div(alpha2, spread), spread);
  const Vector facets =
      hn::Mul(scale, hn::Div(hn::Mul(distribution, all(0.5F * std::numbers::inv_pi_v<float>)), smith));
  const Vector reflects = hn::Add(hn::Mul(all(1.0F - terms.metallic), dielectric), hn::Mul(all(terms.metallic), m5));
  result.grey = hn::IfThenElseZero(lit, hn::Mul(facets, reflects));
  result.tinted = hn::IfThenElseZero(lit, hn::Mul(facets, hn::Sub(all(1.0F), m5)));
  return result;
}

HWY_INLINE Vector channel(const Reflected& reflected, float diffuse, float tint) {
  const Vector colored = hn::Add(hn::Mul(reflected.diffuse, all(diffuse)), hn::Mul(reflected.tinted, all(tint)));
  return hn::Add(colored, reflected.grey);
}

/// `count` is a multiple of kPlaces; `sums` has kPlaces places for each channel.
void add_reflected(const ReflectionTerms& terms, bool leans, const PhotonLight* lights, const std::uint32_t* index,
                   const float* weight, std::size_t count, float* sums) {
  constexpr std::size_t kLanes = hn::MaxLanes(Floats());
  constexpr std::size_t kVectors = kPlaces / kLanes;
  constexpr int kWords = sizeof(PhotonLight) / sizeof(float);
  const Floats floats;
  const Words words;
  const auto* const numbers = reinterpret_cast<const std::int32_t*>(index);
  const float* const flux = lights->flux.data();
  std::array<Vector3, kVectors> kept;
  for (Vector3& sum : kept) sum = {hn::Zero(floats), hn::Zero(floats), hn::Zero(floats)};
  for (std::size_t first = 0; first < count; first += kPlaces) {
    for (std::size_t i = 0; i < kVectors; ++i) {
      const std::size_t at = first + i * kLanes;
      const auto where = hn::Mul(hn::LoadU(words, numbers + at), hn::Set(words, kWords));
      const auto packed = hn::GatherIndex(words, reinterpret_cast<const std::int32_t*>(&lights->direction), where);
      const Reflected reflected = reflect(terms, leans, unpack(packed));
      const Vector weights = hn::LoadU(floats, weight + at);
      const auto add = [&](Vector& sum, int c) {
        const Vector weighed = hn::Mul(weights, hn::GatherIndex(floats, flux + c, where));
        sum = hn::Add(sum, hn::Mul(weighed, channel(reflected, terms.diffuse[c], terms.tint[c])));
      };
      add(kept[i].x, 0);
      add(kept[i].y, 1);
      add(kept[i].z, 2);
    }
  }
  for (std::size_t i = 0; i < kVectors; ++i) {
    hn::StoreU(kept[i].x, floats, sums + i * kLanes);
    hn::StoreU(kept[i].y, floats, sums + kPlaces + i * kLanes);
    hn::StoreU(kept[i].z, floats, sums + 2 * kPlaces + i * kLanes);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(find);
HWY_EXPORT(add_reflected);

void find_photons(const PhotonSearch& search, const std::uint32_t* starts, const PhotonPlace* positions,
                  FoundPhotons& found) {
  HWY_DYNAMIC_DISPATCH(find)(search, starts, positions, found);
}

glm::dvec3 reflect_photons(const ReflectionTerms& terms, bool leans, const PhotonLight* lights, FoundPhotons& found) {
  constexpr std::size_t kPlaces = HWY_NAMESPACE::kPlaces;
  std::size_t padded = found.count;
  for (; padded % kPlaces != 0; ++padded) {
    found.index[padded] = found.index[0];
    found.weight[padded] = 0.0F;
  }
  std::array<float, 3 * kPlaces> sums;
  HWY_DYNAMIC_DISPATCH(add_reflected)
  (terms, leans, lights, found.index.data(), found.weight.data(), padded, sums.data());
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < kPlaces; ++i) sum += glm::dvec3(sums[i], sums[kPlaces + i], sums[2 * kPlaces + i]);
  return sum;
}

bool follows_reflections(const Requirements& scene, double glossy_cutoff) {
  return scene.min_roughness < std::max(glossy_cutoff, Bsdf::kDeltaRoughness);
}

bool may_take_photons(const Requirements& scene, double glossy_cutoff) {
  return scene.ambient_occlusion.needed || scene.max_roughness >= std::max(glossy_cutoff, Bsdf::kDeltaRoughness);
}

bool takes_photons(const Bsdf& bsdf, double glossy_cutoff) {
  return std::ranges::any_of(bsdf.lobes(),
                             [&](Lobe lobe) { return bsdf.present(lobe) && !is_followed(bsdf, lobe, glossy_cutoff); });
}

namespace {

/// As reflect_photons, in double precision and one by one, by the lobes of a surface with extensions.
glm::dvec3 reflect_photons_by_lobes(std::span<const Lobe> lobes, const Bsdf& bsdf, const SurfacePoint& surface,
                                    const glm::dvec3& shading_normal, const PhotonLight* lights,
                                    const FoundPhotons& found) {
  constexpr double kGrazing = 1e-3;
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < found.count; ++i) {
    const PhotonLight& light = lights[found.index[i]];
    const glm::dvec3 direction = unpack_direction(light.direction);
    const double falls = glm::dot(direction, surface.geometric_normal);
    if (!(falls > 0.0)) continue;
    const double cosine = glm::dot(direction, shading_normal) / std::max(falls, kGrazing);
    glm::dvec3 value(0.0);
    for (const Lobe lobe : lobes) value += bsdf.value(lobe, direction);
    sum += (static_cast<double>(found.weight[i]) * cosine) * value *
           glm::dvec3(light.flux[0], light.flux[1], light.flux[2]);
  }
  return sum;
}

}  // namespace

glm::dvec3 gather_photons(const PhotonMap& map, double radius, const SurfacePoint& surface, const Bsdf& bsdf,
                          const glm::dvec3& shading_normal, double glossy_cutoff, FoundPhotons& found) {
  if (map.size() == 0) return glm::dvec3(0.0);
  // Transmission is always followed, so photons count on the viewer's side alone.
  const auto gathers = [&](Lobe lobe) { return bsdf.present(lobe) && !is_followed(bsdf, lobe, glossy_cutoff); };
  const bool diffuse = gathers(Lobe::Diffuse);
  const bool specular = gathers(Lobe::Reflection);
  const bool coat = gathers(Lobe::Coat);
  if (!diffuse && !specular && !coat) return glm::dvec3(0.0);
  map.find(surface.position, surface.geometric_normal, surface.layer, radius, found);
  if (found.count == 0) return glm::dvec3(0.0);
  const bool leans = shading_normal != surface.geometric_normal;
  glm::dvec3 reflected(0.0);
  if (bsdf.is_extended()) {
    std::array<Lobe, kLobes.size()> lobes{};
    const auto end = std::ranges::copy_if(kLobes, lobes.begin(), gathers).out;
    reflected =
        reflect_photons_by_lobes(std::span(lobes.begin(), end), bsdf, surface, shading_normal, map.lights(), found);
  } else {
    reflected = reflect_photons(bsdf.reflection_terms(diffuse, specular), leans, map.lights(), found);
  }
  const glm::dvec3 light = map.density(radius) * reflected;
  const double sum = light.r + light.g + light.b;
  return std::isfinite(sum) ? light : glm::dvec3(0.0);
}

}  // namespace hpr
#endif
