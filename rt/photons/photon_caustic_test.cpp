#include <gtest/gtest.h>

#include <cmath>

#include "rt/photons/photon_query.h"
#include "rt/photons/test_photons.h"

namespace hpr {
namespace {

using test::PhotonRoom;

constexpr double kRadius = 0.5;
constexpr double kIndex = 1.5;
constexpr double kBeamHalf = 0.3;

/// A glass sphere about the middle of a matte room.
PhotonRoom room_with_sphere() {
  Scene scene;
  test::add_room(scene, test::add_material(scene, test::diffuse(glm::vec3(0.5F))));
  const std::uint32_t glass = test::add_material(scene, test::clear_glass());
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(kRadius, 100, glass)));
  return PhotonRoom(std::move(scene));
}

TracedPhotons lit_from_above(const PhotonRoom& room, std::uint64_t photons) {
  return room.trace(test::beam({0.0, 0.9, 0.0}, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, kBeamHalf), photons);
}

/// Of unpolarised light at a surface of index kIndex.
double reflected_share(double outside, double inside) {
  if (outside == 0.0) return std::pow((kIndex - 1.0) / (kIndex + 1.0), 2.0);
  const double s = std::sin(outside - inside) / std::sin(outside + inside);
  const double p = std::tan(outside - inside) / std::tan(outside + inside);
  return 0.5 * (s * s + p * p);
}

/// The share of the beam's light that falls on the floor within `radius` of the axis: rays through a true sphere by
/// Snell's and Fresnel's laws, counted one by one.
double focused_share(double radius) {
  constexpr int kSide = 1000;
  double sum = 0.0;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const double height = kBeamHalf * std::hypot(2.0 * (i + 0.5) / kSide - 1.0, 2.0 * (j + 0.5) / kSide - 1.0);
      const double outside = std::asin(height / kRadius);
      const double inside = std::asin(height / kRadius / kIndex);
      const double turned = 2.0 * (outside - inside);
      const double leaves_at = 2.0 * inside - outside;  // angle about the center, from straight below
      const double above_floor = 1.0 - kRadius * std::cos(leaves_at);
      const double lands_at = kRadius * std::sin(leaves_at) - above_floor * std::tan(turned);
      if (std::abs(lands_at) < radius) sum += std::pow(1.0 - reflected_share(outside, inside), 2.0);
    }
  }
  return sum / kSide / kSide;
}

TEST(PhotonCausticTest, AGlassSphereFocusesAsMuchLightAsRaysCountedOneByOne) {
  const PhotonRoom room = room_with_sphere();
  const TracedPhotons traced = lit_from_above(room, 100000);
  for (const double radius : {0.05, 0.1, 0.25}) {
    double sum = 0.0;
    for (const Photon& photon : traced.caustic) {
      const bool on_floor = photon.position[1] < -0.999F;
      if (on_floor && std::hypot(photon.position[0], photon.position[2]) < radius) sum += double{photon.flux[1]};
    }
    const double expected = focused_share(radius);
    EXPECT_GT(expected, 0.02);
    // Light reflected twice inside adds a quarter of a percent at most.
    EXPECT_NEAR(sum, expected, 0.01 * expected + 4.0 * std::sqrt(expected / 100000)) << radius;
  }
}

TEST(PhotonCausticTest, TheMapHoldsTheEnergyOfItsPhotons) {
  const PhotonRoom room = room_with_sphere();
  const TracedPhotons traced = lit_from_above(room, 30000);
  double on_floor = 0.0;
  for (const Photon& photon : traced.caustic) {
    const bool near = std::max(std::abs(photon.position[0]), std::abs(photon.position[2])) < 0.6F;
    if (photon.position[1] < -0.999F && near) on_floor += double{photon.flux[1]};
  }
  const PhotonMap map(traced.caustic, room.space, 0.03);
  constexpr int kSide = 240;
  double sum = 0.0;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const glm::dvec3 position(1.2 * (i + 0.5) / kSide - 0.6, -1.0, 1.2 * (j + 0.5) / kSide - 0.6);
      sum += map.gather(position, {0.0, 1.0, 0.0}, [](const glm::dvec3&) { return glm::dvec3(1.0); }).g;
    }
  }
  EXPECT_NEAR(sum * std::pow(1.2 / kSide, 2.0), on_floor, 0.005 * on_floor);
}

/// The lobes of one material, looked at from straight above.
bool takes(const Material& material, double cutoff) {
  Scene scene;
  test::add_room(scene, test::add_material(scene, material));
  const PhotonRoom room(std::move(scene));
  WorldTriangle triangle;
  room.surfaces.load(2 * test::kFloor, triangle);
  const SurfacePoint surface = room.surfaces.meet(triangle, {0.1, 0.5, 0.1}, {0.0, -1.0, 0.0});
  return takes_photons(Bsdf(evaluate_material(room.scene, surface), surface), cutoff);
}

TEST(PhotonGatherTest, OnlySurfacesWithALobeThatIsNotFollowedTakePhotons) {
  Material metal = test::mirror(0.9F);
  EXPECT_FALSE(takes(metal, 0.0));
  metal.roughness = 0.5F;
  EXPECT_FALSE(takes(metal, 0.6));
  EXPECT_TRUE(takes(metal, 0.5));
  EXPECT_FALSE(takes(test::clear_glass(), 0.0));
  EXPECT_TRUE(takes(test::diffuse(), 1.0));
  EXPECT_FALSE(takes(test::diffuse(glm::vec3(0.0F)), 0.0));
  Material plastic = test::diffuse();
  plastic.ior = 1.5F;
  EXPECT_TRUE(takes(plastic, 1.0)) << "the base below the followed layer";
}

}  // namespace
}  // namespace hpr
