#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "rt/deferred_shader.h"
#include "rt/photons/test_photons.h"

namespace hpr {
namespace {

using test::furnace;

/// A furnace with all that its photons need.
struct LitFurnace : test::PhotonRoom {
  LitFurnace() : PhotonRoom(furnace(0.5F, 1.0F)), lights(scene) {}

  [[nodiscard]] PhotonMapBuilder builder(const RaySettings& settings, PhotonUse use = PhotonUse::Direct) const {
    return PhotonMapBuilder(scene, surfaces, space, rays, lights, settings, use);
  }

  LightSampler lights;
};

TEST(PhotonPass, RanksShareTheWorkAndGetTheSamePicture) {
  const Scene scene = furnace(0.5F, 1.0F);
  const View view = test::view_from({0, 0, 0.5}, {0.1, 0.2, -1}, {16, 16}, scene, 0.5);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  const RaySettings settings{.photons = 5'000, .global_photons = true};
  const SampleNumber number{.frame = 2, .sample = 3};
  TileLayer<Rgb> alone(keys.layout());
  DeferredShader one(scene, settings);
  one.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &alone}, number);
  EXPECT_GT(one.counts()[PassId::Photon], 5'000U);
  for (const int ranks : {2, 3, 7}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      DeferredShader shader(scene, settings);
      TileLayer<Rgb> lit(keys.layout());
      shader.trace_photons(comm, number);
      shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &lit}, number);
      EXPECT_LT(shader.counts()[PassId::Photon], one.counts()[PassId::Photon]);
      EXPECT_TRUE(std::ranges::equal(lit.tile(0), alone.tile(0)));
    });
  }
}

TEST(PhotonPass, RanksOfAHostShareItsMemory) {
  const Scene scene = furnace(0.5F, 1.0F);
  const View view = test::view_from({0, 0, 0.5}, {0.1, 0.2, -1}, {4, 4}, scene, 0.5);
  RaySettings settings{.photons = 5'000, .global_photons = true};
  const auto lights = [&] {
    try {
      (void)test::shade(scene, view, settings);
      return ExitCode::Done;
    } catch (const Error& error) {
      return error.code();
    }
  };
  EXPECT_EQ(lights(), ExitCode::Done);
  settings.host_ranks = 1 << 30;  // so many leave none of them the memory for a thousand
  EXPECT_EQ(lights(), ExitCode::Limit);
}

TEST(PhotonPass, EveryRankKeepsItsShareOfWhatItsMemoryHolds) {
  const LitFurnace furnace;
  RaySettings settings{.photons = 40'000, .global_photons = true};
  PhotonMapBuilder whole = furnace.builder(settings);
  const auto kept = static_cast<double>(whole.build({}, nullptr).global.size());
  // As much memory as holds three quarters of them: all ranks get all.
  const double memory = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  settings.host_ranks = static_cast<int>(memory / (128.0 * 0.75 * kept));
  for (const int ranks : {1, 2}) {
    EXPECT_THROW(run_local_ranks(ranks,
                                 [&](Communicator& comm) {
                                   PhotonMapBuilder builder = furnace.builder(settings);
                                   (void)builder.build({}, &comm);
                                 }),
                 Error)
        << ranks;
  }
}

TEST(PhotonPass, RadiiAndNumbersFollowWhatAPixelCovers) {
  const LitFurnace furnace;  // every photon is kept twice in the mean, on 24 square metres
  const auto map_of = [&](double footprint, bool fits, Communicator* comm = nullptr) {
    const RaySettings settings{
        .photons = 100'000, .global_photons = true, .photon_footprint = footprint, .fits_photons = fits};
    PhotonMapBuilder builder = furnace.builder(settings);
    const PhotonMap& map = builder.build({}, comm).global;
    return std::pair(map.radius(), static_cast<double>(map.size()));
  };
  const auto expected = [](double radius) { return 4.0 * 24.0 / (std::numbers::pi * radius * radius); };
  for (const double footprint : {0.02, 0.04}) {
    const auto [radius, photons] = map_of(footprint, true);
    EXPECT_NEAR(radius, 2.0 * footprint, 1e-9);
    EXPECT_NEAR(photons, expected(radius), 0.2 * expected(radius));
    EXPECT_NEAR(map_of(footprint, false).second, 200'000, 5'000);
    run_local_ranks(3, [&](Communicator& comm) {
      EXPECT_EQ(map_of(footprint, true, &comm), std::pair(radius, photons)) << "ranks";
    });
  }
  const double wide = map_of(0.0, false).first;
  EXPECT_NEAR(wide, std::sqrt(50.0 * 24.0 / (std::numbers::pi * 200'000)), 0.1 * wide);
  EXPECT_EQ(map_of(1.0, false).first, wide) << "far off fifty photons are enough";
  EXPECT_NEAR(map_of(1e-6, true).first, std::sqrt(4.0 / 50.0) * wide, 1e-9) << "at the least four photons";
}

TEST(PhotonPass, GatheredPhotonsAreSparseByTheFirstSamplesRadiusAndLookedUpByTheirOwn) {
  const LitFurnace furnace;
  const auto check = [&](std::uint32_t photons, PhotonUse use, auto&& of_maps) {
    const RaySettings settings{.photons = photons, .global_photons = true, .photon_footprint = 0.01};
    PhotonMapBuilder builder = furnace.builder(settings, use);
    double first = 0.0;
    for (const std::uint32_t sample : {0U, 60U}) {
      const PhotonMaps& maps = builder.build({.sample = sample}, nullptr);
      if (sample == 0) first = maps.near;
      of_maps(maps, maps.near / first);
    }
  };
  check(20'000, PhotonUse::Gathered, [](const PhotonMaps& maps, double shrunk) {
    EXPECT_LT(maps.sparse[0].size() + maps.sparse[1].size(), 200U) << "none lie but by corners where few do";
    EXPECT_GT(maps.global.size(), 30'000U);
    EXPECT_NEAR(maps.footprint, 0.25 * shrunk, 1e-9);
  });
  // Seven on each wall: few in all cells.
  check(20, PhotonUse::Gathered, [](const PhotonMaps& maps, double shrunk) {
    EXPECT_EQ(maps.global.size() + maps.sparse[0].size(), 0U);
    EXPECT_GT(maps.sparse[1].size(), 20U);
    EXPECT_NEAR(maps.sparse[1].radius(), 32.0 * maps.near, 1e-9);
    EXPECT_NEAR(maps.footprint, 0.25 * shrunk, 1e-9);
  });
  check(20, PhotonUse::Direct, [](const PhotonMaps& maps, double /*shrunk*/) {
    EXPECT_GT(maps.global.size(), 20U);
    EXPECT_EQ(maps.sparse[0].size() + maps.sparse[1].size(), 0U) << "where the eye sees blur";
  });
}

TEST(PhotonPass, PhotonsOvertakenOnAnyRankAreDroppedOnAllAndTracedAgainWithTheSameBits) {
  const LitFurnace furnace;
  const SampleNumber number{.frame = 0, .sample = 2};
  const auto lights_of = [](const PhotonMap& map) {
    std::vector<std::array<float, 3>> fluxes;
    for (std::size_t i = 0; i < map.size(); ++i) fluxes.push_back(map.lights()[i].flux);
    return std::pair(map.radius(), fluxes);
  };
  for (const bool fits : {false, true}) {
    const RaySettings settings{
        .photons = 60'000, .global_photons = true, .photon_footprint = fits ? 0.004 : 0.0, .fits_photons = fits};
    PhotonMapBuilder undisturbed = furnace.builder(settings);
    const auto expected = lights_of(undisturbed.build(number, nullptr).global);
    for (const int ranks : {1, 3}) {
      const int raised_on = ranks - 1;
      // In the pilot, if there is one, the photons that radii are chosen by, and the sample's own.
      for (const int raised_at : {1, 6, 11}) {
        run_local_ranks(ranks, [&](Communicator& comm) {
          PhotonMapBuilder builder = furnace.builder(settings);
          int polls = 0;
          EXPECT_FALSE(builder.build_while_wanted(number, comm,
                                                  [&] { return ++polls >= raised_at && comm.rank() == raised_on; }));
          EXPECT_TRUE(ranks == 1 || raised_at > 1 || polls <= 5) << "the other ranks trace one round in vain";
          EXPECT_TRUE(builder.build_while_wanted(number, comm, [] { return false; }));
          const PhotonMap& again = builder.build(number, &comm).global;
          EXPECT_TRUE(lights_of(again) == expected) << ranks << ' ' << raised_at << ' ' << fits;
        });
      }
    }
  }
}

TEST(PhotonPass, LightOfAnyStrengthAndSizeIsTheSameButForItsUnit) {
  test::expect_light_of_any_strength_and_size();
}

TEST(PhotonPass, SendsNothingWhereNobodyAsksAndNoCausticsWhereNothingBundlesLight) {
  const Scene scene = furnace(0.5F, 1.0F);
  const View view = test::view_from({0, 0, 0.5}, {0.1, 0.2, -1}, {4, 4}, scene, 0.5);
  EXPECT_EQ(test::shade(scene, view).counts[PassId::Photon], 0U);
  EXPECT_EQ(test::shade(scene, view, {.photons = 1'000}).counts[PassId::Photon], 0U);
  EXPECT_GT(test::shade(scene, view, {.photons = 1'000, .global_photons = true}).counts[PassId::Photon], 1'000U);
  EXPECT_EQ(test::shade(scene, view, {.passes = {PassId::Photon}}).counts[PassId::Photon], 0U)
      << "no caustics in a matte box";
}

}  // namespace
}  // namespace hpr
