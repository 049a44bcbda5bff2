#include "rt/trace/ray_forwarding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "rt/deferred_shader.h"
#include "rt/test_scene.h"
#include "scene/scene.h"

// A scene in parts gives the bits of a whole one.
namespace hpr {
namespace {

/// A ball, ten times in a mesh that is shared and once in one that is not, over a floor, with veils between.
Scene crowd(bool veils = true) {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.7F)));
  const std::uint32_t polished = test::add_material(scene, test::mirror(0.8F));
  Material veil = test::diffuse({0.9F, 0.3F, 0.2F});
  veil.base_color.a = 0.4F;
  veil.alpha_mode = AlphaMode::Blend;
  const std::uint32_t thin = test::add_material(scene, veil);
  const std::uint32_t lamp = test::add_material(scene, test::glowing(glm::vec3(6.0F)));
  const auto side = [&](glm::vec3 corner, glm::vec3 a, glm::vec3 b, std::uint32_t material) {
    test::place_mesh(scene, test::add_mesh(scene, test::quad(corner, a, b, material)));
  };
  side({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}, white);
  side({-3, 0, -3}, {6, 0, 0}, {0, 3, 0}, white);
  side({-1, 3, -1}, {2, 0, 0}, {0, 0, 2}, lamp);
  const std::uint32_t ball = test::add_mesh(scene, test::sphere(0.3, 24, polished));
  for (int i = 0; i < 10; ++i) {
    glm::dmat4 there(1.0);
    there[3] = {-2.0 + 0.45 * i, 0.3 + 0.1 * (i % 3), -1.0 + 0.3 * (i % 4), 1.0};
    test::place_mesh(scene, ball, there);
  }
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(0.5, 32, white)), glm::dmat4(1.3));
  if (veils) {
    side({-2, 0.2F, 0.8F}, {4, 0, 0}, {0, 0.6F, 0}, thin);
    side({-2, 0.1F, 0.9F}, {4, 0, 0}, {0, 0.5F, 0.1F}, thin);
  }
  finish_scene(scene);
  return scene;
}

std::vector<SurfaceRange> part_of(const Scene& scene, const Communicator& comm) {
  return partition_objects(scene, comm.size(), 64)[static_cast<std::size_t>(comm.rank())];
}

RayBatch random_rays(int count, unsigned int seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> coordinate(-2.0, 2.0);
  std::normal_distribution<double> normal;
  RayBatch rays;
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 origin(coordinate(random), coordinate(random), coordinate(random));
    glm::dvec3 direction = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
    if (i % 7 == 0) direction = {0.0, i % 2 == 0 ? 1.0 : -1.0, 0.0};
    if (i % 50 == 49) direction = glm::dvec3(std::nan(""));
    rays.push(origin, direction, i % 3 == 0 ? 0.7 : std::numeric_limits<double>::infinity());
  }
  return rays;
}

TEST(RayForwarding, MeetWhatTheyMeetInAWholeScene) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  const RayScene whole(scene, space, 1);
  for (const int ranks : {1, 2, 3, 8}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      const std::vector<SurfaceRange> mine = part_of(scene, comm);
      std::uint32_t triangles = 0;
      for (const SurfaceRange& range : mine) triangles += range.count();
      EXPECT_LE(triangles, scene.triangles / static_cast<std::uint32_t>(ranks) + 64);
      RayForwarding others(comm, scene, space, mine);
      RayScene part(scene, space, 1, mine);
      part.share(others);
      // Ranks have different numbers of jobs, and one has none.
      const auto jobs = static_cast<std::size_t>(comm.rank() * 5 % 13);
      part.for_each(2, jobs, [&](std::size_t job) {
        constexpr int kRays = 700;
        const RayBatch rays = random_rays(kRays, static_cast<unsigned int>(job) * 100U + 1U);
        std::vector<std::uint32_t> expected(kRays);
        std::vector<std::uint32_t> met(kRays);
        EXPECT_EQ(part.closest(rays, met), whole.closest(rays, expected));
        EXPECT_EQ(met, expected);
        std::vector<std::uint8_t> blocks(kRays);
        std::vector<std::uint8_t> blocked(kRays);
        EXPECT_EQ(part.occluded(rays, blocked), whole.occluded(rays, blocks));
        EXPECT_EQ(blocked, blocks);
        std::vector<Passed> before(kRays);
        std::vector<Passed> passed(kRays);
        for (int step = 0; step < 3; ++step) {
          (void)whole.closest(rays, before, expected);
          (void)part.closest(rays, passed, met);
          EXPECT_EQ(met, expected) << "behind " << step;
          for (std::size_t i = 0; i < kRays; ++i) {
            if (met[i] == kNoSurface) before[i] = passed[i] = {};  // from the start again
          }
        }
      });
      EXPECT_GT(part.geometries().size(), 0U);
    });
  }
}

TEST(RayForwarding, LightAPictureToTheBitAsRanksDoThatHaveAllOfTheScene) {
  const Scene scene = crowd();
  const View view = test::view_from({0, 1.2, 4}, {0, 0.5, 0}, {130, 70}, scene);
  for (const bool reference : {false, true}) {
    RaySettings settings{.photons = 3'000, .global_photons = true};
    settings.reference = reference;
    const TileLayer<Key> keys = test::cast_keys(crowd(false), std::span(&view, 1));
    const FrameLayout& layout = keys.layout();
    TileLayer<Rgb> alone(layout);
    DeferredShader one(scene, settings);
    one.shade(std::span(&view, 1), keys, all_tiles(layout), {.radiance = &alone});
    for (const int ranks : {2, 5}) {
      std::atomic<std::uint64_t> shadow_rays = 0;
      run_local_ranks(ranks, [&](Communicator& comm) {
        RaySettings own = settings;
        own.part = part_of(scene, comm);
        own.threads = 2;
        RayForwarding others(comm, scene, RaySpace(scene.bounds), *own.part);
        DeferredShader shader(scene, own, requirements_of(scene), {}, &others);
        std::vector<std::size_t> tiles;
        for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
          if (static_cast<int>(tile) % ranks == comm.rank()) tiles.push_back(tile);
        }
        TileLayer<Rgb> lit(layout);
        if (!reference) shader.trace_photons(comm);
        shader.shade(std::span(&view, 1), keys, tiles, {.radiance = &lit});
        for (const std::size_t tile : tiles) EXPECT_TRUE(std::ranges::equal(lit.tile(tile), alone.tile(tile))) << tile;
        shadow_rays += shader.counts()[PassId::Shadow];
      });
      EXPECT_EQ(shadow_rays, one.counts()[PassId::Shadow]);
    }
  }
}

// Every round wakes all threads that rest, for fewer cores: whoever finds none free must not miss the next one. A wait
// that misses one in a million stands still here once in sixty times.
TEST(RayForwarding, RestAndGoOnThousandsOfTimes) {
  constexpr std::size_t kJobs = 300;
  constexpr std::size_t kCalls = 10;
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  std::atomic<std::size_t> done = 0;
  // As ranks of MPI do that wait.
  std::vector<std::jthread> pollers(3);
  for (std::jthread& poller : pollers) {
    poller = std::jthread([](const std::stop_token& stop) {
      while (!stop.stop_requested()) std::this_thread::yield();
    });
  }
  run_local_ranks(3, [&](Communicator& comm) {
    const std::vector<SurfaceRange> mine = part_of(scene, comm);
    RayForwarding others(comm, scene, space, mine);
    RayScene part(scene, space, 1, mine);
    part.share(others);
    for (std::size_t call = 0; call < kCalls; ++call) {
      part.for_each(1, kJobs, [&](std::size_t job) {
        const int count = 1 << (job * 7 % 11);
        const RayBatch rays = random_rays(count, static_cast<unsigned int>(job));
        std::vector<std::uint8_t> blocked(static_cast<std::size_t>(count));
        std::vector<std::uint32_t> met(static_cast<std::size_t>(count));
        for (int round = 0; round < 4; ++round) (void)part.occluded(rays, blocked);
        (void)part.closest(rays, met);
        ++done;
      });
    }
  });
  EXPECT_EQ(done, 3 * kCalls * kJobs);
}

TEST(RayForwarding, ARankThatFailsEndsTheOthers) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  constexpr int kRanks = 3;
  std::array<std::atomic<int>, kRanks> code{};
  run_local_ranks(kRanks, [&](Communicator& comm) {
    const std::vector<SurfaceRange> mine = part_of(scene, comm);
    RayForwarding others(comm, scene, space, mine);
    RayScene part(scene, space, 1, mine);
    part.share(others);
    try {
      part.for_each(1, 20, [&](std::size_t job) {
        const RayBatch rays = random_rays(100, static_cast<unsigned int>(job));
        std::vector<std::uint32_t> met(100);
        (void)part.closest(rays, met);
        if (comm.rank() == 1 && job == 3) throw Error(ExitCode::Limit, "enough", "ask for less");
        (void)part.closest(rays, met);
      });
    } catch (const Error& error) {
      code.at(static_cast<std::size_t>(comm.rank())) = static_cast<int>(error.code());
    }
    // Nothing is left over for whoever asks next.
    std::atomic<int> done = 0;
    part.for_each(1, 2, [&](std::size_t /*job*/) {
      const RayBatch rays = random_rays(10, 1);
      std::vector<std::uint32_t> met(10);
      (void)part.closest(rays, met);
      ++done;
    });
    EXPECT_EQ(done, 2);
  });
  EXPECT_EQ(code[1], static_cast<int>(ExitCode::Limit));
  for (const std::size_t rank : {0U, 2U}) EXPECT_EQ(code.at(rank), static_cast<int>(ExitCode::Lost));
}

}  // namespace
}  // namespace hpr
