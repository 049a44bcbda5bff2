#include "rt/trace/ray_forwarding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "rt/deferred_shader.h"
#include "rt/test_rays.h"
#include "rt/test_scene.h"
#include "scene/scene.h"

// A scene in parts gives the bits of a whole one.
namespace hpr {
namespace {

using test::random_rays;

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

TEST(RayForwarding, MeetWhatTheyMeetInAWholeScene) {
  const Scene scene = crowd();
  const RaySpace space(scene);
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
        (void)test::expect_same_hits(part, whole, random_rays(700, static_cast<unsigned int>(job) * 100U + 1U));
      });
      EXPECT_GT(part.geometries().size(), 0U);
    });
  }
}

TEST(RayForwarding, LightAPictureToTheBitAsRanksDoThatHaveAllOfTheScene) {
  const Scene scene = crowd();
  const View view = test::view_from({0, 1.2, 4}, {0, 0.5, 0}, {130, 70}, scene);
  enum class Light { Passes, Denoised, Reference };
  for (const Light light : {Light::Passes, Light::Denoised, Light::Reference}) {
    RaySettings settings{.photons = 3'000, .global_photons = true};
    settings.denoise = settings.filter_across_tiles = light == Light::Denoised;
    const bool reference = settings.reference = light == Light::Reference;
    const TileLayer<Key> keys = test::cast_keys(crowd(false), std::span(&view, 1));
    const FrameLayout& layout = keys.layout();
    TileLayer<Rgb> alone(layout);
    DeferredShader one(scene, settings);
    one.shade(std::span(&view, 1), keys, all_tiles(layout), {.radiance = &alone});
    for (const int ranks : {2, 5}) {
      std::atomic<std::uint64_t> shadow_rays = 0;
      std::array<std::atomic<std::uint64_t>, kRayKinds> asked{};
      run_local_ranks(ranks, [&](Communicator& comm) {
        RaySettings own = settings;
        own.part = part_of(scene, comm);
        own.threads = 2;
        RayForwarding others(comm, scene, RaySpace(scene), *own.part);
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
        for (std::size_t kind = 0; kind < kRayKinds; ++kind) asked.at(kind) += others.counts().asked.at(kind);
        EXPECT_GE(others.counts().max_generation, 1U);
      });
      EXPECT_EQ(shadow_rays, one.counts()[PassId::Shadow]);
      EXPECT_GE(asked[static_cast<std::size_t>(RayKind::Shadow)], shadow_rays);
      EXPECT_GT(asked[static_cast<std::size_t>(RayKind::Primary)], 0U);
      EXPECT_GT(asked[static_cast<std::size_t>(RayKind::Bounce)], 0U);
      EXPECT_EQ(asked[static_cast<std::size_t>(RayKind::Photon)] > 0, !reference);
      EXPECT_EQ(asked[static_cast<std::size_t>(RayKind::Triangles)], 0U);  // every rank has them all
    }
  }
}

TEST(RayForwarding, CallsWithinACallTravelTogether) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  const RayScene whole(scene, space, 1);
  run_local_ranks(3, [&](Communicator& comm) {
    const std::vector<SurfaceRange> mine = part_of(scene, comm);
    RayForwarding others(comm, scene, space, mine);
    RayScene part(scene, space, 1, mine);
    part.share(others);
    std::atomic<int> returned = 0;
    const auto trace = [&](std::size_t seed) {
      constexpr std::size_t kRays = 300;
      const RayBatch rays = random_rays(kRays, static_cast<unsigned int>(seed));
      std::vector<std::uint32_t> expected(kRays);
      std::vector<std::uint32_t> met(kRays);
      EXPECT_EQ(part.closest(rays, met), whole.closest(rays, expected));
      EXPECT_EQ(met, expected);
      ++returned;
    };
    constexpr int kCalls = 7;
    part.for_each(1, static_cast<std::size_t>(kCalls * comm.rank()), [&](std::size_t i) {
      trace(i);
      const int before = returned;
      others.for_each_within(30, [&](std::size_t j) { trace(100 * i + j); });
      EXPECT_GE(returned - before, 30);
      others.for_each_within(2, [&](std::size_t) { others.for_each_within(3, trace); });
      others.for_each_within(0, trace);
    });
    EXPECT_EQ(returned, kCalls * comm.rank() * (1 + 30 + 6));
  });
}

TEST(RayForwarding, ThatManyCallsTravelTogetherMakesRoundsFew) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  std::array<std::atomic<std::uint64_t>, 2> messages{};
  for (const bool within : {false, true}) {
    run_local_ranks(2, [&](Communicator& local) {
      CountingCommunicator comm(local);
      const std::vector<SurfaceRange> mine = part_of(scene, comm);
      RayForwarding others(comm, scene, space, mine);
      RayScene part(scene, space, 1, mine);
      part.share(others);
      const std::uint64_t before = comm.messages_sent();
      const auto trace = [&](std::size_t seed) {
        const RayBatch rays = random_rays(100, static_cast<unsigned int>(seed));
        std::vector<std::uint32_t> met(100);
        (void)part.closest(rays, met);
      };
      part.for_each(1, 1, [&](std::size_t) {
        trace(100);  // by then the other threads have nothing to do
        if (within) {
          others.for_each_within(10, trace);
        } else {
          for (std::size_t i = 0; i < 10; ++i) trace(i);
        }
      });
      messages.at(within ? 1 : 0) += comm.messages_sent() - before;
    });
  }
  EXPECT_LT(3 * messages[1], messages[0]);
}

TEST(RayForwarding, LaterGenerationsGoOnFirstAndBeforeNewCalls) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  constexpr std::size_t kTogether = RayForwarding::kThreadsEach;
  std::vector<std::string> expected;
  for (std::size_t i = kTogether; i-- > 0;) expected.push_back("goes on " + std::to_string(i));
  for (std::size_t i = 0; i < 4; ++i) expected.push_back("begins " + std::to_string(kTogether + i));
  run_local_ranks(2, [&](Communicator& comm) {
    const std::vector<SurfaceRange> mine = part_of(scene, comm);
    RayForwarding others(comm, scene, space, mine);
    RayScene part(scene, space, 1, mine);
    part.share(others);
    std::vector<std::string> events;  // one core: one thread at a time
    const std::size_t jobs = comm.rank() == 0 ? kTogether + 4 : 0;
    part.for_each(
        1, jobs,
        [&](std::size_t job) {
          if (job >= kTogether) {
            events.push_back("begins " + std::to_string(job));
            return;
          }
          RayBatch rays = random_rays(100, 1);
          rays.purpose = {RayKind::Bounce, static_cast<std::uint16_t>(job)};
          std::vector<std::uint32_t> met(100);
          (void)part.closest(rays, met);
          events.push_back("goes on " + std::to_string(job));
        },
        CallMemory::Small);
    if (comm.rank() != 0) return;
    EXPECT_EQ(events, expected);
    EXPECT_EQ(others.counts().max_generation, kTogether - 1);
  });
}

// One core: one thread at a time counts.
TEST(RayForwarding, TwoLargeCallsAreUnderWayForEachCore) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  for (const CallMemory memory : {CallMemory::Small, CallMemory::Large}) {
    run_local_ranks(2, [&](Communicator& comm) {
      const std::vector<SurfaceRange> mine = part_of(scene, comm);
      RayForwarding others(comm, scene, space, mine);
      RayScene part(scene, space, 1, mine);
      part.share(others);
      int under_way = 0;
      int most = 0;
      const auto trace = [&](std::size_t seed) {
        const RayBatch rays = random_rays(100, static_cast<unsigned int>(seed));
        std::vector<std::uint32_t> met(100);
        (void)part.closest(rays, met);
      };
      const auto body = [&](std::size_t job) {
        most = std::max(most, ++under_way);
        trace(job);
        others.for_each_within(3, trace);
        --under_way;
      };
      part.for_each(1, 40, body, memory);
      EXPECT_EQ(most, memory == CallMemory::Large ? 2 : RayForwarding::kThreadsEach);
    });
  }
}

TEST(RayForwarding, OfSurfacesThatCoincideTheLowestIsMetWhoeverHoldsIt) {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.7F)));
  const std::uint32_t side = test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, white));
  for (int i = 0; i < 3; ++i) test::place_mesh(scene, side);
  finish_scene(scene);
  const RaySpace space(scene);
  RayBatch rays;
  for (int i = 0; i < 100; ++i) rays.push({-0.9 + 0.018 * i, 0.3, 2.0}, {0.0, 0.0, -1.0}, 10.0);
  std::vector<std::uint32_t> expected(rays.size());
  (void)RayScene(scene, space, 1).closest(rays, expected);
  for (const std::uint32_t surface : expected) EXPECT_LT(surface, 2U);  // of the first
  constexpr std::array<std::uint32_t, 3> kFirst{4, 0, 2};               // surface of each rank
  run_local_ranks(3, [&](Communicator& comm) {
    const std::uint32_t first = kFirst.at(static_cast<std::size_t>(comm.rank()));
    const std::vector<SurfaceRange> mine{{first, first + 2}};
    RayForwarding others(comm, scene, space, mine);
    RayScene part(scene, space, 1, mine);
    part.share(others);
    part.for_each(1, 2, [&](std::size_t) {
      std::vector<std::uint32_t> met(rays.size());
      (void)part.closest(rays, met);
      EXPECT_EQ(met, expected);
    });
  });
}

TEST(RayForwarding, WhatWaitsIsNoMoreThanWhatCallsUnderWayAskFor) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  run_local_ranks(3, [&](Communicator& comm) {
    const std::vector<SurfaceRange> mine = part_of(scene, comm);
    RayForwarding others(comm, scene, space, mine);
    RayScene part(scene, space, 1, mine);
    part.share(others);
    constexpr std::uint64_t kRays = 60;
    constexpr std::uint64_t kJobs = 100;
    constexpr std::uint16_t kGenerations = 5;
    constexpr int kThreads = 2;
    part.for_each(
        kThreads, kJobs,
        [&](std::size_t job) {
          std::vector<std::uint8_t> blocked(kRays);
          RayBatch rays = random_rays(static_cast<int>(kRays), static_cast<unsigned int>(job));
          for (std::uint16_t generation = 0; generation < kGenerations; ++generation) {
            rays.purpose = {RayKind::Shadow, generation};
            (void)part.occluded(rays, blocked);
          }
        },
        CallMemory::Small);
    const ForwardingCounts& counts = others.counts();
    EXPECT_EQ(counts.asked[static_cast<std::size_t>(RayKind::Shadow)], kRays * kJobs * kGenerations);
    EXPECT_LE(counts.max_waiting, kRays * kThreads * RayForwarding::kThreadsEach);
    EXPECT_GT(counts.max_waiting, kRays);
    // As many rounds as bulks of that size take, not as many as there are calls.
    EXPECT_LT(counts.rounds, 2 * kGenerations * (kJobs / (kThreads * RayForwarding::kThreadsEach) + 1));
  });
}

/// How many of the boxes' ranks but `own` a ray has to visit, by slabs that are wider by `slack`, in double.
int ranks_met(const RayBatch::Ray& ray, double reach, const std::vector<std::vector<RayBox>>& boxes, int own,
              double slack) {
  int count = 0;
  for (int rank = 0; rank < static_cast<int>(boxes.size()); ++rank) {
    if (rank == own) continue;
    const auto meets = [&](const RayBox& box) {
      double from = 0.0;
      double to = reach + slack;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double low = static_cast<double>(box.low[axis]) - slack - static_cast<double>(ray.origin[axis]);
        const double high = static_cast<double>(box.high[axis]) + slack - static_cast<double>(ray.origin[axis]);
        const auto along = static_cast<double>(ray.direction[axis]);
        if (along == 0.0) {
          if (low > 0.0 || high < 0.0) return false;
          continue;
        }
        from = std::max(from, std::min(low / along, high / along));
        to = std::min(to, std::max(low / along, high / along));
      }
      return from <= to;
    };
    if (std::ranges::any_of(boxes[static_cast<std::size_t>(rank)], meets)) ++count;
  }
  return count;
}

// To compare with: every ray to every rank, one question and one answer each, as in the thesis (two transmissions).
TEST(RayForwarding, BoxesSpareHopsAndNoHits) {
  const Scene scene = crowd();
  const RaySpace space(scene.bounds);
  for (const int ranks : {2, 5, 8}) {
    std::array<std::atomic<std::uint64_t>, 2> hops{};
    run_local_ranks(ranks, [&](Communicator& comm) {
      constexpr std::size_t kRays = 2000;
      const std::vector<SurfaceRange> mine = part_of(scene, comm);
      const RayBatch rays = random_rays(kRays, static_cast<unsigned int>(comm.rank()) + 5U);
      const RayScene own(scene, space, 1, mine);
      std::vector<std::uint32_t> local(kRays);
      std::vector<Passed> before(kRays);
      (void)own.closest(rays, before, local);
      std::vector<std::vector<RayBox>> boxes;
      for (const auto& part : partition_objects(scene, ranks, 64)) boxes.push_back(enclosing_boxes(scene, space, part));
      int least = 0;
      int most = 0;
      std::uint64_t traceable = 0;
      for (std::size_t i = 0; i < kRays; ++i) {
        const RayBatch::Ray ray = rays.ray(i);
        if (!is_traceable(ray)) continue;
        ++traceable;
        double reach = ray.reach;
        if (local[i] != kNoSurface) reach = std::min(reach, static_cast<double>(before[i].distance));
        least += ranks_met(ray, reach, boxes, comm.rank(), 0.0);
        most += ranks_met(ray, reach, boxes, comm.rank(), 2e-3);
      }
      std::array<std::vector<std::uint32_t>, 2> met;
      for (const Routing routing : {Routing::ByBoxes, Routing::ToAll}) {
        const auto which = static_cast<std::size_t>(routing);
        RayForwarding others(comm, scene, space, mine, routing);
        RayScene part(scene, space, 1, mine);
        part.share(others);
        met.at(which).resize(kRays);
        part.for_each(1, 1, [&](std::size_t) { (void)part.closest(rays, met.at(which)); });
        const std::uint64_t sent = others.counts().hops[static_cast<std::size_t>(RayKind::Primary)];
        hops.at(which) += sent;
        if (routing == Routing::ToAll) {
          EXPECT_EQ(sent, traceable * static_cast<std::uint64_t>(ranks - 1));
          continue;
        }
        EXPECT_GE(sent, static_cast<std::uint64_t>(least));
        EXPECT_LE(sent, static_cast<std::uint64_t>(most));
      }
      EXPECT_EQ(met[0], met[1]);
    });
    EXPECT_LT(2 * hops[0], hops[1]) << ranks;
  }
}

// Every round wakes all threads that rest, for fewer cores: whoever finds none free must not miss the next one. A wait
// that misses one in a million stands still here once in sixty times.
TEST(RayForwarding, RestAndGoOnThousandsOfTimes) {
  constexpr std::size_t kJobs = 300;
  constexpr std::size_t kCalls = 10;
  const Scene scene = crowd();
  const RaySpace space(scene);
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
  const RaySpace space(scene);
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
        others.for_each_within(5, [&](std::size_t within) {
          std::vector<std::uint32_t> found(100);
          (void)part.closest(rays, found);
          if (comm.rank() == 1 && job == 3 && within == 2) throw Error(ExitCode::Limit, "enough", "ask for less");
        });
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
