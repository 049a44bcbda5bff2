#include "rt/photons/photon_reflection.h"

#include <numbers>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "rt/photons/photon_reflection.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

#include "rt/denoise/packed_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

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

HWY_EXPORT(add_reflected);

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

}  // namespace hpr
#endif
