#include "rt/photons/photon_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

namespace hpr {
namespace {

const RaySpace kRoom(Bounds{glm::dvec3(-1.0), glm::dvec3(1.0)});
constexpr glm::dvec3 kUp(0.0, 1.0, 0.0);

glm::dvec3 one(const glm::dvec3& /*from*/) {
  return glm::dvec3(1.0);
}

Photon photon_at(const glm::dvec3& position, const glm::dvec3& normal = kUp, const glm::dvec3& flux = glm::dvec3(1.0)) {
  Photon photon;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    photon.position[axis] = static_cast<float>(position[static_cast<int>(axis)]);
    photon.flux[axis] = static_cast<float>(flux[static_cast<int>(axis)]);
  }
  photon.facing = pack_facing(normal);
  photon.direction = pack_direction(normal + 0.25 * position);
  return photon;
}

/// On the faces of the room and all through it, of various brightness.
std::vector<Photon> random_photons(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  std::vector<Photon> photons;
  for (std::size_t i = 0; i < count; ++i) {
    glm::dvec3 position(side(random), side(random), side(random));
    glm::dvec3 normal(side(random), side(random), side(random));
    if (i % 4 != 0) {
      const auto axis = static_cast<int>(random() % 3);
      position[axis] = std::copysign(1.0, position[axis]);
      normal = glm::dvec3(0.0);
      normal[axis] = -position[axis];
    }
    photons.push_back(photon_at(position, normal, {1.0 + side(random), 1.0, 1e-6}));
  }
  return photons;
}

struct Gathered {
  std::size_t count = 0;
  glm::dvec3 sum{0.0};
};

/// The octahedron of 12 bits a side, folded.
glm::dvec3 facing_of(const Photon& photon) {
  const auto number = [](std::uint32_t bits) {
    return static_cast<double>(bits < 2048 ? static_cast<int>(bits) : static_cast<int>(bits) - 4096) / 2047.0;
  };
  const double x = number(photon.facing & 0xFFFU);
  const double y = number(photon.facing >> 12U & 0xFFFU);
  const double z = 1.0 - std::abs(x) - std::abs(y);
  const double fold = std::max(-z, 0.0);
  return glm::normalize(glm::dvec3(x - std::copysign(fold, x), y - std::copysign(fold, y), z));
}

/// What the map promises, photon by photon.
Gathered gather_all(std::span<const Photon> photons, const glm::dvec3& position, const glm::dvec3& normal,
                    double radius) {
  Gathered result;
  for (const Photon& photon : photons) {
    const glm::dvec3 offset = glm::dvec3(photon.position[0], photon.position[1], photon.position[2]) - position;
    const double distance = glm::length(offset);
    if (!(distance < radius)) continue;
    if (std::abs(glm::dot(offset, normal)) > PhotonMap::kFlatness * radius + 2.0 * kFloatStep) continue;
    const double cosine = glm::dot(facing_of(photon), normal);
    if (cosine < 0.5) continue;
    ++result.count;
    const double kernel = 2.0 / (std::numbers::pi * radius * radius) * (1.0 - distance * distance / (radius * radius));
    result.sum += kernel * glm::dvec3(photon.flux[0], photon.flux[1], photon.flux[2]) *
                  glm::dot(unpack_direction(photon.direction), kUp + normal);
  }
  return result;
}

TEST(PhotonMapTest, AGatherEqualsTheSumOverAllPhotons) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  std::size_t found = 0;
  for (const std::size_t photons : std::vector<std::size_t>{0, 1, 2, 257, 20000}) {
    const std::vector<Photon> all = random_photons(photons, photons + 1);
    for (const double radius : {0.003, 0.05, 0.3, 1.7}) {
      const PhotonMap map(all, kRoom, radius);
      ASSERT_EQ(map.size(), photons);
      for (int i = 0; i < 60; ++i) {
        glm::dvec3 position(side(random), side(random), side(random));
        glm::dvec3 normal = glm::normalize(glm::dvec3(side(random), side(random), side(random)));
        if (i % 3 != 0) {
          const int axis = i % 3;
          position[axis] = std::copysign(1.0, position[axis]);
          normal = glm::dvec3(0.0);
          normal[axis] = -position[axis];
        }
        const Gathered expected = gather_all(all, position, normal, radius);
        ASSERT_EQ(map.count(position, normal), expected.count) << photons << " photons, radius " << radius;
        const glm::dvec3 sum =
            map.gather(position, normal, [&](const glm::dvec3& d) { return glm::dvec3(glm::dot(d, kUp + normal)); });
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], expected.sum[c], 1e-5 * glm::length(expected.sum));
        found += expected.count;
      }
    }
  }
  EXPECT_GT(found, 100000U);
}

TEST(PhotonMapTest, AGatherFromLessFarIsThatOfAMapSoNarrow) {
  const std::vector<Photon> all = random_photons(20000, 5);
  const PhotonMap wide(all, kRoom, 0.5);
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  for (const double radius : {0.02, 0.11, 0.5}) {
    const PhotonMap narrow(all, kRoom, radius);
    EXPECT_EQ(wide.density(radius), narrow.density(narrow.radius()));
    std::size_t met = 0;
    for (int i = 0; i < 200; ++i) {
      const glm::dvec3 position(side(random), -1.0, side(random));
      FoundPhotons from_wide;
      FoundPhotons from_narrow;
      wide.find(position, kUp, 0, radius, from_wide);
      narrow.find(position, kUp, 0, from_narrow);
      EXPECT_EQ(from_wide.count, from_narrow.count);
      const auto sum = [](const FoundPhotons& found) {
        return std::accumulate(found.weight.begin(), found.weight.begin() + static_cast<std::ptrdiff_t>(found.count),
                               0.0);
      };
      EXPECT_NEAR(sum(from_wide), sum(from_narrow), 1e-4 * static_cast<double>(from_wide.count));
      met += from_wide.count;
    }
    EXPECT_GT(met, 100U) << radius;
  }
}

TEST(PhotonMapTest, SparsePhotonsAreThoseWithFewOthersAboutThatFaceAsTheyDo) {
  std::vector<Photon> photons;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> within(0.01, 0.24);
  const auto add = [&](int count, const glm::dvec3& corner, const glm::dvec3& normal) {
    for (int i = 0; i < count; ++i) {
      photons.push_back(photon_at(corner + glm::dvec3(within(random), 0.1, within(random)), normal,
                                  glm::dvec3(static_cast<double>(photons.size()))));
    }
  };
  add(5, {0.0, 0.0, 0.0}, kUp);
  add(4, {0.0, 0.0, 0.0}, -kUp);  // the other side of a thin floor
  add(4, {0.25, 0.0, 0.0}, kUp);
  add(1, {-0.5, 0.0, -0.25}, {1.0, 0.0, 0.0});
  add(900, {-0.25, 0.0, -0.25}, glm::normalize(glm::dvec3(0.2, 1.0, -0.3)));
  const auto numbers = [](std::span<const Photon> of) {
    std::vector<int> found;
    for (const Photon& photon : of) found.push_back(static_cast<int>(photon.flux[0]));
    return found;
  };
  std::vector<Photon> dense = photons;
  const std::vector<int> sparse = numbers(extract_sparse(dense, kRoom, 0.25, 5));
  EXPECT_EQ(sparse, (std::vector<int>{5, 6, 7, 8, 9, 10, 11, 12, 13}));
  std::vector<int> others{0, 1, 2, 3, 4};
  for (int i = 14; i < 914; ++i) others.push_back(i);
  EXPECT_EQ(numbers(dense), others);

  std::vector<Photon> none;
  EXPECT_TRUE(extract_sparse(none, kRoom, 0.25, 5).empty());
  std::vector<Photon> odd(3, photon_at({std::numeric_limits<double>::quiet_NaN(), 0.0, 1e30}));
  EXPECT_EQ(extract_sparse(odd, kRoom, 0.25, 5).size() + odd.size(), 3U);
}

TEST(PhotonMapTest, SparsePhotonsAreLookedUpAsFarAsARaysFootprintGoes) {
  const std::vector<Photon> photons = random_photons(10, 1);
  PhotonMaps maps;
  maps.global = PhotonMap(photons, kRoom, 0.01);
  maps.footprint = 0.25;
  const PhotonMap& sparse = maps.sparse[1] = PhotonMap(photons, kRoom, 0.08);
  const double even = 1.0 / std::numbers::pi;  // straight off a matte surface
  EXPECT_NEAR(maps.sparse_radius(sparse, 0.2, even), 0.05, 1e-12);
  EXPECT_NEAR(maps.sparse_radius(sparse, 0.2, 0.0), 0.05, 1e-12);
  EXPECT_NEAR(maps.sparse_radius(sparse, 0.2, 0.1 * even), 0.05, 1e-12);
  EXPECT_NEAR(maps.sparse_radius(sparse, 0.2, 4.0 * even), 0.025, 1e-12) << "of a narrow lobe";
  EXPECT_EQ(maps.sparse_radius(sparse, 100.0, even), sparse.radius());
  EXPECT_EQ(maps.sparse_radius(sparse, 1e-3, even), maps.global.radius());
}

TEST(PhotonMapTest, AnEvenlyLitPlaneHasItsFluxOverItsArea) {
  std::vector<Photon> photons;
  constexpr int kSide = 400;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j)
      photons.push_back(photon_at({2.0 * (i + 0.5) / kSide - 1.0, 0.25, 2.0 * (j + 0.5) / kSide - 1.0}));
  }
  const PhotonMap map(photons, kRoom, 0.08);
  const double expected = static_cast<double>(photons.size()) / 4.0;
  for (const glm::dvec3& position : {glm::dvec3(0.0, 0.25, 0.0), glm::dvec3(0.513, 0.25, -0.377)})
    EXPECT_NEAR(map.gather(position, kUp, one).g, expected, 2e-3 * expected);
}

TEST(PhotonMapTest, ACornersOtherWallAndAThinWallsOtherSideDoNotCount) {
  const std::vector<Photon> photons{photon_at({0.0, 0.0, 0.0}), photon_at({0.0, 0.01, 0.0}, {1.0, 0.0, 0.0}),
                                    photon_at({0.0, -0.01, 0.0}, {0.0, -1.0, 0.0}), photon_at({0.0, 0.03, 0.0}),
                                    photon_at({0.09, 0.0, 0.0}, glm::dvec3(0.8, 0.6, 0.0))};
  for (const double scale : {1.0, 0x1p-30, 0x1p40}) {
    RaySpace space = kRoom;
    space.scale = 1.0 / scale;
    const PhotonMap map(photons, space, 0.1 * scale);
    EXPECT_EQ(map.count(glm::dvec3(0.0), kUp), 2U);
    EXPECT_EQ(map.count({0.0, 0.03 * scale, 0.0}, kUp), 1U);
  }
}

TEST(PhotonMapTest, ScalingBySomePowerOfTwoChangesNoBit) {
  const std::vector<Photon> photons = random_photons(5000, 3);
  const PhotonMap map(photons, kRoom, 0.3);
  RaySpace large;
  large.scale = 0x1p-20;
  const PhotonMap scaled(photons, large, 0.3 * 0x1p20);
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  for (int i = 0; i < 100; ++i) {
    const glm::dvec3 position(side(random), -1.0, side(random));
    const glm::dvec3 sum = map.gather(position, kUp, one);
    EXPECT_EQ(scaled.gather(position * 0x1p20, kUp, one), sum * 0x1p-40);
  }
}

TEST(PhotonMapTest, SumsKeepThePhotonsOrderWithinACell) {
  // Cells meet at 0, so this changes the order of photons, but inside no cell.
  const std::vector<Photon> photons = random_photons(20000, 5);
  std::vector<Photon> sorted = photons;
  std::ranges::stable_sort(sorted, {}, [](const Photon& p) { return p.position[0] >= 0.0F; });
  ASSERT_FALSE(std::ranges::equal(photons, sorted));
  std::vector<Photon> shuffled = photons;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937_64(6));
  // 0.31 lies on no border of cells in general; so cells are made as wide as the room's half and places kept clear of
  // it.
  const PhotonMap map(photons, kRoom, 0.1);
  const PhotonMap same(sorted, kRoom, 0.1);
  const PhotonMap other(shuffled, kRoom, 0.1);
  int differing = 0;
  for (int i = 0; i < 50; ++i) {
    const glm::dvec3 position(-0.5 + 0.02 * i, -1.0, 0.5);
    const glm::dvec3 sum = map.gather(position, kUp, one);
    EXPECT_EQ(same.gather(position, kUp, one), sum);
    differing += other.gather(position, kUp, one) == sum ? 0 : 1;
  }
  EXPECT_GT(differing, 0) << "the order given would not matter at all";
}

TEST(PhotonMapTest, EmptyMapsFarPlacesAndWhatIsNotANumberGiveNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<Photon> photons = random_photons(1000, 8);
  EXPECT_EQ(PhotonMap().gather(glm::dvec3(0.0), kUp, one), glm::dvec3(0.0));
  for (const double radius : {0.0, -1.0, nan, infinity}) EXPECT_EQ(PhotonMap(photons, kRoom, radius).size(), 0U);

  const PhotonMap map(photons, kRoom, 0.5);
  for (const double far : {1e3, 1e9, -1e9, 1e300, nan, infinity}) {
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 position(0.0);
      position[axis] = far;
      EXPECT_EQ(map.gather(position, kUp, one), glm::dvec3(0.0));
    }
  }
  EXPECT_EQ(map.gather(glm::dvec3(0.0), glm::dvec3(nan), one), glm::dvec3(0.0));
  EXPECT_EQ(map.gather(glm::dvec3(0.0), glm::dvec3(0.0), one), glm::dvec3(0.0));

  std::vector<Photon> bad = photons;
  bad[10].position[1] = std::numeric_limits<float>::quiet_NaN();
  bad[20].flux[2] = std::numeric_limits<float>::infinity();
  bad[30].position[0] = 1e30F;
  EXPECT_EQ(PhotonMap(bad, kRoom, 0.5).size(), photons.size() - 3);
}

TEST(PhotonMapTest, AllPhotonsInOnePlaceAreFoundOnce) {
  for (const double x : {-1.0, 0.0, 0.999, 1.0}) {
    const std::vector<Photon> photons(3000, photon_at({x, x, x}));
    for (const double radius : {1e-30, 1e-6, 0.1, 5.0}) {
      const PhotonMap map(photons, kRoom, radius);
      EXPECT_EQ(map.count(glm::dvec3(static_cast<float>(x)), kUp), photons.size());
    }
  }
}

TEST(PhotonMapTest, PackedDirectionsAreWithin7e5Radians) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 100000; ++i) {
    const glm::dvec3 direction = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
    ASSERT_LT(glm::length(glm::cross(direction, unpack_direction(pack_direction(direction)))), 7e-5);
    ASSERT_GT(glm::dot(direction, unpack_direction(pack_direction(direction))), 0.0);
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      glm::dvec3 direction(0.0);
      direction[axis] = sign;
      EXPECT_EQ(unpack_direction(pack_direction(direction)), direction);
    }
  }
  EXPECT_EQ(unpack_direction(pack_direction(glm::dvec3(0.0))), glm::dvec3(0.0, 0.0, 1.0));
  EXPECT_EQ(unpack_direction(pack_direction(glm::dvec3(std::nan("")))), glm::dvec3(0.0, 0.0, 1.0));
}

TEST(PhotonRadiusTest, ProgressiveRadiiSumUpAsTheGammaFunctionSays) {
  // sum_{i<n} r_i^2 / r_0^2 = (Gamma(n + 1 + a) / (Gamma(1 + a) n!) - 1) / a, by telescoping.
  constexpr double kAlpha = 2.0 / 3.0;
  double sum = 0.0;
  for (std::uint64_t n = 1; n <= 300; ++n) {
    const double radius = progressive_radius(3.0, n - 1) / 3.0;
    sum += radius * radius;
    const auto count = static_cast<double>(n);
    const double gammas =
        std::exp(std::lgamma(count + 1.0 + kAlpha) - std::lgamma(1.0 + kAlpha) - std::lgamma(count + 1.0));
    ASSERT_NEAR(sum, (gammas - 1.0) / kAlpha, 1e-10 * sum) << n;
  }
  EXPECT_EQ(progressive_radius(0.7, 0), 0.7);
  EXPECT_DOUBLE_EQ(progressive_radius(1.0, 1), std::sqrt((1.0 + kAlpha) / 2.0));
}

TEST(PhotonRadiusTest, TheFirstRadiusTakesInAsManyPhotonsAsWanted) {
  std::mt19937_64 random(10);
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  for (const std::size_t count : std::vector<std::size_t>{20000, 300000}) {
    std::vector<Photon> photons;
    for (std::size_t i = 0; i < count; ++i) photons.push_back(photon_at({side(random), 0.0, side(random)}));
    const double expected = std::sqrt(50.0 * 4.0 / (std::numbers::pi * static_cast<double>(count)));
    EXPECT_NEAR(first_radius(photons, kRoom), expected, 0.1 * expected);
    RaySpace large;
    large.scale = 0x1p-10;
    EXPECT_EQ(first_radius(photons, large), 1024.0 * first_radius(photons, kRoom));
  }
}

TEST(PhotonRadiusTest, FewPhotonsOrAllInOnePlaceGetATenthOfTheScene) {
  EXPECT_DOUBLE_EQ(first_radius({}, kRoom), 0.1);
  for (const std::size_t count : std::vector<std::size_t>{1, 2, 3, 1000})
    EXPECT_DOUBLE_EQ(first_radius(std::vector<Photon>(count, photon_at({0.5, 0.5, 0.5})), kRoom), 0.1);
}

TEST(PhotonRadiusTest, TheTenthIsOfTheSceneWhateverPowerOfTwoIsNearItsSize) {
  for (const double radius : {1.0, 1.3, 1.9, 3.0, 1e-6, 7e5}) {
    EXPECT_DOUBLE_EQ(first_radius({}, RaySpace({glm::dvec3(-radius), glm::dvec3(radius)})), 0.1 * radius);
  }
}

}  // namespace
}  // namespace hpr
