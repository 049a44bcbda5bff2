#include "rt/photons/photon_tracer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "rt/photons/test_photons.h"

namespace hpr {
namespace {

using test::flux_of;
using test::PhotonRoom;
constexpr glm::dvec3 kX(1.0, 0.0, 0.0);
constexpr glm::dvec3 kZ(0.0, 0.0, 1.0);

/// A beam of one watt from the ceiling down.
PhotonSource downwards(double half) {
  return test::beam({0.0, 0.9, 0.0}, kX, kZ, half);
}

PhotonRoom diffuse_room(float albedo) {
  Scene scene;
  test::add_room(scene, test::add_material(scene, test::diffuse(glm::vec3(albedo))));
  return PhotonRoom(std::move(scene));
}

/// A room with a glass cube turned askew and a mirror on one side.
PhotonRoom furnished_room() {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.7F, 0.5F, 0.3F)));
  const std::uint32_t glass = test::add_material(scene, test::clear_glass());
  const std::uint32_t mirror = test::add_material(scene, test::mirror(0.9F));
  test::add_room(scene, white);
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(0.4, 12, glass)));
  test::place_mesh(scene,
                   test::add_mesh(scene, test::quad({-0.9F, -0.9F, -0.9F}, {1.8F, 0, 0}, {0, 1.8F, 0.3F}, mirror)));
  return PhotonRoom(std::move(scene));
}

bool same(const TracedPhotons& a, const TracedPhotons& b) {
  return a.caustic == b.caustic && a.global == b.global;
}

TEST(PhotonTracerTest, RanksThreadsAndRangesChangeNoBit) {
  const PhotonRoom room = furnished_room();
  constexpr std::uint64_t kPhotons = 9001;
  const TracedPhotons expected = room.trace(test::glowing_room(), kPhotons);
  EXPECT_GT(expected.caustic.size(), 1000U);
  EXPECT_GT(expected.global.size(), 10000U);
  EXPECT_EQ(expected.counts.sent, kPhotons);
  EXPECT_EQ(expected.counts.caustic, expected.caustic.size());
  EXPECT_EQ(expected.counts.global, expected.global.size());
  EXPECT_LT(expected.counts.lost, 5U);  // the sphere's mirror images of itself may hold one for good
  EXPECT_EQ(expected.counts.invalid, 0U);
  EXPECT_GT(expected.counts.rays, expected.caustic.size() + expected.global.size());
  EXPECT_TRUE(same(room.trace(test::glowing_room(), kPhotons, {.threads = 2}), expected));

  const PhotonTracer tracer = room.tracer(test::glowing_room());
  for (const int ranks : {1, 2, 3, 4, 7}) {
    PhotonCounts sum;
    std::mutex mutex;
    run_local_ranks(ranks, [&](Communicator& comm) {
      TracedPhotons mine = tracer.trace({}, share_of_rank({0, kPhotons}, comm.rank(), ranks), kPhotons);
      share_photons(comm, mine);
      const std::lock_guard lock(mutex);
      EXPECT_TRUE(same(mine, expected)) << "rank " << comm.rank() << " of " << ranks;
      sum += mine.counts;
    });
    EXPECT_EQ(sum, expected.counts);
  }
}

TEST(PhotonTracerTest, SharesOfRanksPartitionTheRange) {
  for (const std::uint64_t count : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{100}, std::uint64_t{1} << 62U}) {
    for (const int ranks : {1, 3, 7, 300}) {
      std::uint64_t next = 17;
      for (int rank = 0; rank < ranks; ++rank) {
        const PhotonRange range = share_of_rank({17, count}, rank, ranks);
        ASSERT_EQ(range.first, next);
        ASSERT_LE(range.count, count / static_cast<std::uint64_t>(ranks) + 1);
        next += range.count;
      }
      EXPECT_EQ(next, 17 + count);
    }
  }
}

TEST(PhotonTracerTest, PassesAndSeedsHavePhotonsOfTheirOwn) {
  const PhotonRoom room = diffuse_room(0.5F);
  const PhotonTracer tracer = room.tracer(test::glowing_room());
  const TracedPhotons first = tracer.trace({}, {0, 100}, 100);
  EXPECT_FALSE(same(tracer.trace({}, {100, 100}, 100), first));
  EXPECT_FALSE(same(tracer.trace({}, {std::uint64_t{1} << 32U, 100}, 100), first));
  EXPECT_FALSE(same(tracer.trace({.seed = 2}, {0, 100}, 100), first));
}

/// A floor whose normals lean towards a grazing light sends on seventeen times what falls on it.
TEST(PhotonTracerTest, LeaningNormalsMakeMorePhotonsAndNoneMuchBrighter) {
  constexpr std::uint64_t kPhotons = 2000;
  Scene scene;
  test::add_room(scene, test::add_material(scene, test::diffuse(glm::vec3(0.8F))));
  for (glm::vec3& normal : scene.meshes[test::kFloor].normals) normal = glm::vec3(std::sqrt(0.75F), 0.5F, 0.0F);
  const PhotonRoom room(std::move(scene));
  const TracedPhotons traced = room.trace(test::beam({0.8, -0.96, 0.0}, kZ, {-0.05, 1.0, 0.0}, 0.01), kPhotons);
  float brightest = 0.0F;
  for (const Photon& photon : traced.global) brightest = std::max(brightest, photon.flux[1]);
  EXPECT_LT(brightest, 4.0F / kPhotons);
  EXPECT_GT(flux_of(traced.global).y, 10.0) << "watts of one";
  EXPECT_TRUE(
      same(room.trace(test::beam({0.8, -0.96, 0.0}, kZ, {-0.05, 1.0, 0.0}, 0.01), kPhotons, {.threads = 2}), traced));
}

TEST(PhotonTracerTest, ALightsRangeEndsTheFirstLegOfItsPhotons) {
  const PhotonRoom room = diffuse_room(0.5F);
  const auto within = [&](double range) {
    const PhotonSource down = [=](double, const glm::dvec2&, const glm::dvec2&) {
      return std::optional(PhotonStart{.direction = {0.0, -1.0, 0.0}, .flux = glm::dvec3(1.0), .range = range});
    };
    return room.trace(down, 1000).global;
  };
  const std::vector<Photon> everywhere = within(0.0);
  ASSERT_GT(everywhere.size(), 500U);
  EXPECT_TRUE(within(0.9).empty());  // the floor lies 1 m below
  const std::vector<Photon> some = within(1.25);
  ASSERT_EQ(some.size(), everywhere.size());  // what was scattered goes on as far as it likes
  const double left = 1.0 - 0.8 * 0.8 * 0.8 * 0.8;
  for (std::size_t i = 0; i < some.size(); ++i) EXPECT_NEAR(some[i].flux[0], left * everywhere[i].flux[0], 1e-6);
}

TEST(PhotonTracerTest, MorePhotonsThanMayBeKeptAreAnError) {
  const PhotonRoom room = diffuse_room(0.5F);
  const PhotonTracer all = room.tracer(test::glowing_room());
  const std::uint64_t kept = all.trace({}, {0, 5000}, 5000).global.size();
  const PhotonTracer some = room.tracer(test::glowing_room(), {.threads = 2, .max_kept = kept});
  EXPECT_EQ(some.trace({}, {0, 5000}, 5000).global.size(), kept);
  const PhotonTracer few = room.tracer(test::glowing_room(), {.threads = 2, .max_kept = kept * 3 / 4});
  try {
    (void)few.trace({}, {0, 5000}, 5000);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit);
  }
}

/// Traces a hundred photons at once, by the CPU, and leaves out every third.
class LeavingDevice final : public PhotonDevice {
 public:
  explicit LeavingDevice(const PhotonTracer& by) : by_(by) {}

  [[nodiscard]] std::uint64_t max_photons() const override { return 100; }
  [[nodiscard]] DevicePhotons trace(const PhotonsToTrace& wanted) override {
    ++calls;
    EXPECT_LE(wanted.range.count, max_photons());
    DevicePhotons left;
    for (std::uint32_t i = 0; i < wanted.range.count; ++i) {
      if ((wanted.range.first + i) % 3 == 0) {
        left.unfinished.push_back(i);
        continue;
      }
      const TracedPhotons one = by_.trace({}, {wanted.range.first + i, 1}, kPhotons);
      for (const Photon& photon : one.caustic) left.kept.push_back({i, true, photon});
      for (const Photon& photon : one.global) left.kept.push_back({i, false, photon});
      left.counts += one.counts;
    }
    left.counts.caustic = left.counts.global = 0;
    return left;
  }
  [[nodiscard]] std::vector<PassTime> take_times() override { return {}; }

  static constexpr std::uint64_t kPhotons = 1000;
  int calls = 0;

 private:
  const PhotonTracer& by_;
};

TEST(PhotonTracerTest, WhatADeviceTracesAndWhatItLeavesAreOne) {
  constexpr std::uint64_t kPhotons = LeavingDevice::kPhotons;
  const PhotonRoom room = furnished_room();
  const PhotonTracer cpu = room.tracer(test::glowing_room());
  const TracedPhotons expected = cpu.trace({}, {0, kPhotons}, kPhotons);
  EXPECT_GT(expected.caustic.size(), 100U);
  LeavingDevice device(cpu);
  PhotonTracer tracer = room.tracer(test::glowing_room(), {.threads = 2});
  tracer.trace_on(&device);
  const TracedPhotons all = tracer.trace({}, {0, kPhotons}, kPhotons);
  EXPECT_TRUE(same(all, expected));
  EXPECT_EQ(all.counts, expected.counts);
  EXPECT_EQ(device.calls, 10);
  (void)tracer.trace({}, {0, kPhotons}, kPhotons, [&] { return device.calls >= 13; });
  EXPECT_EQ(device.calls, 13) << "goes on with photons that nobody wants";
}

TEST(PhotonTracerTest, DevicesTraceNoMoreOncePhotonsAreTooMany) {
  constexpr std::uint64_t kPhotons = LeavingDevice::kPhotons;
  const PhotonRoom room = diffuse_room(0.5F);
  const PhotonTracer cpu = room.tracer(test::glowing_room());
  const std::uint64_t kept = cpu.trace({}, {0, kPhotons}, kPhotons).global.size();
  LeavingDevice device(cpu);
  PhotonTracer tracer = room.tracer(test::glowing_room(), {.max_kept = kept});
  tracer.trace_on(&device);
  EXPECT_EQ(tracer.trace({}, {0, kPhotons}, kPhotons).global.size(), kept);
  device.calls = 0;
  tracer.set_max_kept(kept / 2);
  EXPECT_THROW((void)tracer.trace({}, {0, kPhotons}, kPhotons), Error);
  EXPECT_LE(device.calls, 7);
}

TEST(PhotonTracerTest, WhatPassesADecalFallsOnTheFloorItLiesOn) {
  // What the floor sends back to the walls of all that falls on it, in watts.
  const auto sent_back = [](std::optional<float> gap) {
    Scene scene;
    const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(1.0F)));
    Material black = test::diffuse(glm::vec3(0.0F));
    black.alpha_mode = AlphaMode::Blend;
    black.base_color.a = 0.5F;
    const std::uint32_t veil = test::add_material(scene, black);
    if (gap)
      test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1 + *gap, -1}, {0, 0, 2}, {2, 0, 0}, veil)));
    test::add_room(scene, white);
    return flux_of(PhotonRoom(std::move(scene)).trace(downwards(0.5), 4000, {.max_bounces = 1}).global).g;
  };
  const double all = sent_back(std::nullopt);
  ASSERT_GT(all, 0.5);
  // What leaves the floor starts beyond a decal so close, and meets one that lies higher.
  for (const float gap : {0.0F, 1e-7F, 2e-7F}) EXPECT_NEAR(sent_back(gap) / all, 0.5, 0.03) << gap;
  EXPECT_NEAR(sent_back(1e-3F) / all, 0.25, 0.03);
}

TEST(PhotonTracerTest, NoPhotonsOneNoLightAndAnEmptySceneAreFine) {
  const PhotonRoom room = diffuse_room(0.5F);
  EXPECT_TRUE(same(room.trace(test::glowing_room(), 0), {}));
  EXPECT_EQ(room.trace(test::glowing_room(), 1).counts.sent, 1U);
  const PhotonSource dark = [](double, const glm::dvec2&, const glm::dvec2&) { return std::optional<PhotonStart>(); };
  EXPECT_EQ(room.trace(dark, 1000).counts, PhotonCounts{});
  const PhotonSource bad = [](double, const glm::dvec2& u, const glm::dvec2&) {
    const double nan = std::nan("");
    PhotonStart start{.origin = {}, .direction = {0.0, 1.0, 0.0}, .flux = glm::dvec3(1.0)};
    if (u.x < 0.5) start.flux.g = nan;
    if (u.x > 0.3) start.origin.x = nan;
    return std::optional(start);
  };
  EXPECT_TRUE(same(room.trace(bad, 1000), {}));
  const PhotonRoom nothing{Scene{}};
  EXPECT_TRUE(same(nothing.trace(downwards(0.1), 100), {}));
}

class FurnaceTest : public ::testing::TestWithParam<double> {};

/// The photons of a closed white room that glows: radiance is 1 / (1 - rho) everywhere, of which photons bring all but
/// what is emitted and what that lights directly.
TEST_P(FurnaceTest, PhotonsBringTheIndirectLightOfAClosedRoom) {
  const double albedo = static_cast<double>(static_cast<float>(GetParam()));
  const std::uint64_t photons = albedo > 0.95 ? 20000 : albedo > 0.8 ? 60000 : 200000;
  const PhotonRoom room = diffuse_room(static_cast<float>(albedo));
  const TracedPhotons traced = room.trace(test::glowing_room(), photons, {.max_bounces = 10000});
  EXPECT_EQ(traced.counts.lost, 0U);
  EXPECT_TRUE(traced.caustic.empty());

  // Bounces after the first three are geometrically distributed, of deviation sqrt(rho) / (1 - rho) and weight rho^3.
  const double expected = albedo / (1.0 - albedo);
  const double error = std::pow(albedo, 3.5) / (1.0 - albedo) / std::sqrt(static_cast<double>(photons));
  const double power = std::numbers::pi * test::kRoomArea;
  EXPECT_NEAR(flux_of(traced.global).g / power, expected, 4.0 * error);

  const PhotonMap map(traced.global, room.space, 0.2);
  double sum = 0.0;
  int positions = 0;
  for (int wall = 0; wall < 6; ++wall) {
    for (int i = 0; i < 36; ++i) {
      const int axis = wall / 2;
      glm::dvec3 position(0.0);
      position[(axis + 1) % 3] = (i % 6 - 2.5) * 0.3;
      position[(axis + 2) % 3] = (i / 6 - 2.5) * 0.3;
      position[axis] = wall % 2 == 0 ? -1.0 : 1.0;
      glm::dvec3 normal(0.0);
      normal[axis] = -position[axis];
      sum += map.gather(position, normal, [](const glm::dvec3&) { return glm::dvec3(1.0); }).g;
      ++positions;
    }
  }
  // The places take in most of the walls; so what they see varies little more than the whole.
  EXPECT_NEAR(sum / positions / std::numbers::pi, expected, 4.0 * 1.5 * error + 0.005 * expected);
}
INSTANTIATE_TEST_SUITE_P(Albedos, FurnaceTest, ::testing::Values(0.5, 0.9, 0.99));

TEST(PhotonTracerTest, PathsCutShortAreCountedAsLost) {
  const PhotonRoom room = diffuse_room(1.0F);
  const TracedPhotons traced = room.trace(test::glowing_room(), 500, {.max_bounces = 20});
  EXPECT_EQ(traced.counts.lost, 500U);
  EXPECT_EQ(traced.global.size(), 500U * 20);
  EXPECT_NEAR(flux_of(traced.global).r, 20.0 * std::numbers::pi * test::kRoomArea, 1e-3);
}

TEST(PhotonTracerTest, ClearGlassLosesNoLight) {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.5F)));
  const std::uint32_t glass = test::add_material(scene, test::clear_glass());
  test::add_room(scene, white);
  Scene cube;
  test::add_room(cube, glass);
  // Seen from outside: turned inside out.
  for (Mesh& wall : cube.meshes) {
    for (glm::uvec3& triangle : wall.triangles) std::swap(triangle.x, triangle.y);
    for (glm::vec3& normal : wall.normals) normal = -normal;
    glm::dmat4 to_world(0.3 * look_at({0.3, 0.2, 0.5}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 1.0).axes);
    to_world[3] = {0.05, 0.1, 0.0, 1.0};
    test::place_mesh(scene, test::add_mesh(scene, wall), to_world);
  }
  const PhotonRoom room(std::move(scene));
  const TracedPhotons traced = room.trace(downwards(0.1), 20000);
  EXPECT_EQ(traced.counts.lost, 0U);
  EXPECT_NEAR(flux_of(traced.caustic).g, 1.0, 1e-5);
  EXPECT_EQ(traced.caustic.size(), 20000U);
  EXPECT_GT(traced.global.size(), 1000U);
}

/// What a horizontal pane, half a metre thick, lets through to the floor of a matte room. Light reaches the pane by a
/// mirror, so that the floor's is indirect.
TracedPhotons through_pane(const Material& upper, const Material& lower, std::uint64_t photons) {
  Scene scene;
  test::add_room(scene, test::add_material(scene, test::diffuse(glm::vec3(0.5F))));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, 0.25F, -1}, {0, 0, 2}, {2, 0, 0},
                                                           test::add_material(scene, upper))));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -0.25F, -1}, {2, 0, 0}, {0, 0, 2},
                                                           test::add_material(scene, lower))));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-0.5F, 0.5F, -0.5F}, {1, 0, 0}, {0, 0.5F, 0.5F},
                                                           test::add_material(scene, test::mirror(1.0F)))));
  const PhotonRoom room(std::move(scene));
  // Against z, until the mirror turns it down.
  return room.trace(test::beam({0.0, 0.75, 0.9}, -kX, {0.0, 1.0, 0.0}, 0.1), photons);
}

double caustic_on_floor(const TracedPhotons& traced) {
  double sum = 0.0;
  for (const Photon& photon : traced.caustic) sum += photon.position[1] < -0.9F ? double{photon.flux[1]} : 0.0;
  return sum;
}

TEST(PhotonTracerTest, SurfacesOfPartialCoverageLetTheRestPass) {
  Material half = test::diffuse(glm::vec3(0.0F));
  half.alpha_mode = AlphaMode::Blend;
  half.base_color.a = 0.25F;
  constexpr std::uint64_t kPhotons = 40000;
  const TracedPhotons traced = through_pane(half, half, kPhotons);
  EXPECT_NEAR(caustic_on_floor(traced), 0.75 * 0.75, 4.0 * std::sqrt(0.5625 * 0.4375 / kPhotons));
}

TEST(PhotonTracerTest, LightStaysDirectWhenItPassesASurface) {
  Material half = test::diffuse(glm::vec3(0.0F));
  half.alpha_mode = AlphaMode::Blend;
  half.base_color.a = 0.25F;
  Scene scene;
  test::add_room(scene, test::add_material(scene, test::diffuse(glm::vec3(0.5F))));
  test::place_mesh(
      scene, test::add_mesh(scene, test::quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, test::add_material(scene, half))));
  const PhotonRoom room(std::move(scene));
  const TracedPhotons traced = room.trace(downwards(0.5), 10000);
  EXPECT_TRUE(traced.caustic.empty());
  EXPECT_GT(traced.global.size(), 5000U);
}

TEST(PhotonTracerTest, SolidsAbsorbByBeersLaw) {
  // An index of almost one: nothing is reflected or bent.
  Material tinted = test::clear_glass();
  tinted.ior = 1.0F;
  tinted.attenuation_distance = 0.5F;
  tinted.attenuation_color = {0.8F, 0.4F, 0.2F};
  const TracedPhotons traced = through_pane(tinted, tinted, 500);
  EXPECT_NEAR(caustic_on_floor(traced), static_cast<double>(0.4F), 1e-5);
}

}  // namespace
}  // namespace hpr
