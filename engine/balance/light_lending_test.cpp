#include "engine/balance/light_lending.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <thread>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "rt/deferred_shader.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/ray_scene.h"
#include "scene/load_scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;

const Scene& cornell() {
  static const Scene scene = load_scene("gen:cornell");
  return scene;
}

View view_of(const Scene& scene) {
  return make_view(scene.cameras.front(), {300, 200}, scene.bounds);
}

/// The keys of the frame that is lit here.
const TileLayer<Key>& whole_keys() {
  static const TileLayer<Key> keys = [] {
    const Scene& scene = cornell();
    const RayScene rays(scene, RaySpace(scene), 2);
    const View view = view_of(scene);
    TileLayer<Key> layer(FrameLayout({view.size()}));
    PrimaryRays(scene, rays, 2).draw(view, 0, std::vector<Rect>{view.block}, layer);
    return layer;
  }();
  return keys;
}

struct Lit {
  TileLayer<Rgb> radiance;
  TileLayer<Rgb> normal;
};

Lit light_alone(const RaySettings& settings, const PixelMask* wanted = nullptr) {
  const View view = view_of(cornell());
  Lit lit{TileLayer<Rgb>(whole_keys().layout()), TileLayer<Rgb>(whole_keys().layout())};
  DeferredShader shader(cornell(), settings);
  const ShadedSample sample{
      std::span(&view, 1), &whole_keys(), {.radiance = &lit.radiance, .normal = &lit.normal}, {5, 1}, wanted};
  shader.shade(std::span(&sample, 1), all_tiles(whole_keys().layout()));
  return lit;
}

/// Which tiles a rank owns: rank 0 most of them.
std::vector<std::size_t> owned_by(int rank, int ranks) {
  std::vector<std::size_t> tiles;
  for (const std::size_t tile : all_tiles(whole_keys().layout())) {
    const int owner = tile % 4 == 0 ? static_cast<int>(tile / 4) % ranks : 0;
    if (owner == rank) tiles.push_back(tile);
  }
  return tiles;
}

template <typename Pixel>
void expect_equal(const TileLayer<Pixel>& a, const TileLayer<Pixel>& b, std::span<const std::size_t> tiles,
                  const PixelMask* wanted = nullptr) {
  for (const std::size_t tile : tiles) {
    EXPECT_TRUE(b.active(tile));
    const auto mask = mask_of(wanted, tile);
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      if (!mask.empty() && mask[i] == 0) continue;
      ASSERT_EQ(std::memcmp(&a.tile(tile)[i], &b.tile(tile)[i], sizeof(Pixel)), 0) << "tile " << tile << ", " << i;
    }
  }
}

/// Lights the frame by some ranks for a few rounds; returns how many pieces were lit for others.
std::size_t light_together(const LocalRanks& ranks, const RaySettings& settings, const Lit& expected,
                           const PixelMask* wanted = nullptr) {
  std::atomic<std::size_t> lent = 0;
  run_local_ranks(ranks, [&](Communicator& comm) {
    const View view = view_of(cornell());
    const std::vector<std::size_t> owned = owned_by(comm.rank(), comm.size());
    // A rank has the keys and the mask of its own tiles only.
    TileLayer<Key> keys(whole_keys().layout());
    copy_tiles(whole_keys(), keys, owned);
    PixelMask mask(whole_keys().layout());
    if (wanted != nullptr) copy_tiles(*wanted, mask, owned);
    DeferredShader shader(cornell(), settings);
    LightLending lending;
    for (int round = 0; round < 3; ++round) {
      Lit lit{TileLayer<Rgb>(keys.layout()), TileLayer<Rgb>(keys.layout())};
      const ShadedSample sample{std::span(&view, 1),
                                &keys,
                                {.radiance = &lit.radiance, .normal = &lit.normal},
                                {5, 1},
                                wanted != nullptr ? &mask : nullptr};
      ASSERT_TRUE(lending.start(comm, {keys.tiles(), 1}));
      ASSERT_TRUE(lending.shade(comm, shader, {.samples = std::span(&sample, 1), .owned = owned}));
      expect_equal(expected.radiance, lit.radiance, owned, wanted);
      expect_equal(expected.normal, lit.normal, owned, wanted);
      lent += lending.lent().size();
      for (const LentRows& rows : lending.lent()) {
        EXPECT_EQ(rows.owner, comm.rank());
        EXPECT_NE(rows.lit_by, comm.rank());
        EXPECT_NE(std::ranges::find(owned, rows.tile), owned.end());
      }
    }
  });
  return lent;
}

TEST(LightLending, RanksThatAreDoneLightTheTilesOfOthersAndTheBitsAreTheOwners) {
  const RaySettings settings{.threads = 1};
  const Lit expected = light_alone(settings);
  for (const int ranks : {1, 2, 3, 4, 5, 7, 8}) {
    const std::size_t lent = light_together(
        {.size = ranks, .hang_timeout = 60s, .disorder = static_cast<std::uint64_t>(ranks)}, settings, expected);
    EXPECT_EQ(lent > 0, ranks > 1) << ranks;
  }
}

TEST(LightLending, FiltersGetWholeTiles) {
  const RaySettings settings{.denoise = true, .threads = 2};
  EXPECT_GT(light_together({.size = 3, .hang_timeout = 60s}, settings, light_alone(settings)), 0U);
}

TEST(LightLending, PixelsThatNobodyWantsAreLeftOut) {
  PixelMask wanted(whole_keys().layout());
  for (const std::size_t tile : all_tiles(wanted.layout())) {
    if (tile == 3) continue;  // there all are wanted
    for (std::size_t i = 0; i < kTilePixels; ++i) wanted.tile(tile)[i] = tile != 1 && i * 7919 % 5 == 0 ? 1 : 0;
    wanted.set_active(tile);
  }
  const RaySettings settings{.threads = 1};
  EXPECT_GT(light_together({.size = 3, .hang_timeout = 60s}, settings, light_alone(settings, &wanted), &wanted), 0U);
}

TEST(LightLending, NothingIsLentBetweenHosts) {
  const RaySettings settings{.threads = 1};
  const Lit expected = light_alone(settings);
  EXPECT_EQ(light_together({.size = 3, .hang_timeout = 60s, .ranks_per_host = 1}, settings, expected), 0U);
  EXPECT_GT(light_together({.size = 4, .hang_timeout = 60s, .ranks_per_host = 2}, settings, expected), 0U);
}

TEST(LightLending, AnInterruptOnAnyRankEndsTheLightOfAll) {
  for (int raised_on = -1; raised_on < 3; ++raised_on) {
    run_local_ranks({.size = 3, .hang_timeout = 60s}, [&](Communicator& comm) {
      const View view = view_of(cornell());
      DeferredShader shader(cornell(), {.threads = 1});
      LightLending lending;
      for (int round = 0; round < 2; ++round) {
        TileLayer<Rgb> radiance(whole_keys().layout());
        const ShadedSample sample{std::span(&view, 1), &whole_keys(), {.radiance = &radiance}, {5, 1}};
        Interrupt interrupt([&] { return round == 0 && comm.rank() == raised_on; });
        const std::vector<std::size_t> owned = owned_by(comm.rank(), comm.size());
        ASSERT_TRUE(lending.start(comm, {radiance.tiles(), 1}));
        ASSERT_TRUE(lending.sees_all(comm));
        EXPECT_EQ(
            lending.shade(comm, shader, {.samples = std::span(&sample, 1), .owned = owned, .interrupt = &interrupt}),
            round == 1 || raised_on < 0);
      }
    });
  }
}

/// Two ranks light, the third does `instead`.
void light_without_one(const std::function<void()>& instead) {
  run_local_ranks({.size = 3, .hang_timeout = 500ms}, [&](Communicator& comm) {
    const View view = view_of(cornell());
    DeferredShader shader(cornell(), {.threads = 1});
    LightLending lending;
    TileLayer<Rgb> radiance(whole_keys().layout());
    const ShadedSample sample{std::span(&view, 1), &whole_keys(), {.radiance = &radiance}, {5, 1}};
    ASSERT_TRUE(lending.start(comm, {radiance.tiles(), 1}));
    if (comm.rank() == 2) {
      instead();
      return;
    }
    const std::vector<std::size_t> owned = owned_by(comm.rank(), comm.size());
    (void)lending.shade(comm, shader, {.samples = std::span(&sample, 1), .owned = owned, .patience = 200ms});
  });
}

TEST(LightLending, ARankThatFailsOrHangsIsTheErrorThatItIsElsewhere) {
  const auto code_of = [](const std::function<void()>& instead) {
    try {
      light_without_one(instead);
    } catch (const Error& error) {
      return error.code();
    }
    return ExitCode::Done;
  };
  EXPECT_EQ(code_of([] { throw Error(ExitCode::NoDevice, "gone"); }), ExitCode::NoDevice);
  EXPECT_EQ(code_of([] { std::this_thread::sleep_for(2s); }), ExitCode::Hang);
}

}  // namespace
}  // namespace hpr
