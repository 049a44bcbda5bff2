#include "engine/verification.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <functional>
#include <mutex>

#include "cluster/transport/local_communicator.h"
#include "engine/frame_sampler.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "engine/settings_table.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

constexpr std::chrono::seconds kLimit{20};

/// Eight tiles, some of them cut by the screens' edges.
FrameLayout layout() {
  return FrameLayout({{130, 70}, {64, 100}});
}

/// Draws pixels that are their own position: the truth.
void draw_truth(std::size_t tile, std::uint64_t sample, TileLayer<Key>& keys, TileLayer<Rgb>& radiance) {
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    keys.tile(tile)[i] = tile << 40U | sample << 20U | (i + 1);
    radiance.tile(tile)[i] = {static_cast<float>(tile), static_cast<float>(i), static_cast<float>(sample)};
  }
  keys.set_active(tile);
  radiance.set_active(tile);
}

void flip(float& value) {
  value = std::bit_cast<float>(std::bit_cast<std::uint32_t>(value) ^ 1U);
}

/// What goes wrong where: called with what a rank has drawn of its tiles and how often it has drawn; 0: the frame.
using Fault =
    std::function<void(int rank, int drawing, std::size_t tile, TileLayer<Key>& keys, TileLayer<Rgb>& radiance)>;

struct Outcome {
  VerifyCounts counts;
  bool is_true = true;  ///< all tiles of the frame are as they should be
  std::string warnings;
};

/// Verifies all tiles of two samples; rank r owns the tiles t with t % ranks == r.
Outcome verify_with(int ranks, const Fault& fault) {
  Outcome outcome;
  std::mutex mutex;
  testing::internal::CaptureStderr();
  run_local_ranks(
      ranks,
      [&](Communicator& comm) {
        std::array<TileLayer<Key>, 2> keys{TileLayer<Key>(layout()), TileLayer<Key>(layout())};
        std::vector<Frame> frames(2);
        for (std::size_t sample = 0; sample < 2; ++sample) {
          frames[sample].keys = &keys[sample];
          frames[sample].radiance = TileLayer<Rgb>(layout());
          for (const std::size_t tile : all_tiles(layout())) {
            if (static_cast<int>(tile) % ranks != comm.rank()) continue;
            frames[sample].owned.push_back(tile);
            draw_truth(tile, sample, keys[sample], frames[sample].radiance);
            if (sample == 1) fault(comm.rank(), 0, tile, keys[sample], frames[sample].radiance);
          }
        }
        int drawing = 0;
        const auto draw = [&](std::span<const std::size_t> tiles, const PixelMask* wanted) {
          EXPECT_EQ(wanted, nullptr);
          ++drawing;
          std::vector<TileDrawing> drawings;
          for (std::size_t sample = 0; sample < 2; ++sample) {
            drawings.push_back({TileLayer<Key>(layout()), TileLayer<Rgb>(layout())});
            for (const std::size_t tile : tiles) {
              draw_truth(tile, sample, drawings[sample].keys, drawings[sample].radiance);
              if (sample == 1) fault(comm.rank(), drawing, tile, drawings[sample].keys, drawings[sample].radiance);
            }
          }
          return drawings;
        };
        const VerifiedSamples samples{.percent = 100.0, .random = {.seed = 1, .frame = 57}, .first_sample = 8};
        const VerifyCounts counts = verify_tiles(comm, "host" + std::to_string(comm.rank()), samples, frames, draw);
        const std::lock_guard lock(mutex);
        if (comm.rank() == 0) outcome.counts = counts;
        TileLayer<Key> true_keys(layout());
        TileLayer<Rgb> true_radiance(layout());
        for (const std::size_t tile : frames[1].owned) {
          draw_truth(tile, 1, true_keys, true_radiance);
          outcome.is_true =
              outcome.is_true && std::ranges::equal(keys[1].tile(tile), true_keys.tile(tile)) &&
              std::ranges::equal(std::as_bytes(frames[1].radiance.tile(tile)), std::as_bytes(true_radiance.tile(tile)));
        }
      },
      kLimit);
  outcome.warnings = testing::internal::GetCapturedStderr();
  return outcome;
}

TEST(Verification, ChoosesAsManyTilesAsAskedForAndOthersInOtherFrames) {
  std::size_t some = 0;
  std::size_t both = 0;
  for (std::size_t tile = 0; tile < 10'000; ++tile) {
    EXPECT_FALSE(is_verified(0.0, {1, 2}, tile));
    EXPECT_TRUE(is_verified(100.0, {1, 2}, tile));
    some += is_verified(10.0, {1, 2}, tile) ? 1U : 0U;
    both += is_verified(10.0, {1, 2}, tile) && is_verified(10.0, {1, 3}, tile) ? 1U : 0U;
  }
  EXPECT_NEAR(static_cast<double>(some), 1000.0, 120.0);  // four standard deviations
  EXPECT_NEAR(static_cast<double>(both), 100.0, 40.0);
}

TEST(Verification, EqualDrawingsChangeNothing) {
  for (const int ranks : {1, 2, 3, 5}) {
    const Outcome outcome = verify_with(ranks, [](auto&&...) {});
    EXPECT_EQ(outcome.counts, (VerifyCounts{.tiles = 2 * layout().tiles()}));
    EXPECT_TRUE(outcome.is_true);
    EXPECT_EQ(outcome.warnings, "");
  }
}

TEST(Verification, AFlippedBitOfTheFrameIsNamedAndMended) {
  for (const int ranks : {1, 2, 3, 5}) {
    for (const bool of_key : {true, false}) {
      const auto fault = [&](int, int drawing, std::size_t tile, TileLayer<Key>& keys, TileLayer<Rgb>& radiance) {
        if (drawing != 0 || tile != 4) return;
        if (of_key) keys.tile(tile)[3 * kTileSide + 1] ^= 1U;
        if (!of_key) flip(radiance.tile(tile)[3 * kTileSide + 1].g);
      };
      const Outcome outcome = verify_with(ranks, fault);
      EXPECT_EQ(outcome.counts, (VerifyCounts{.tiles = 2 * layout().tiles(), .mismatches = 1}));
      EXPECT_TRUE(outcome.is_true) << ranks;
      const std::string owner = std::to_string(4 % ranks);
      // Tile 4 is the second of the second row of screen 0.
      for (const std::string& part :
           {std::string("frame 57"), std::string("tile 4 of screen 0"), std::string("pixel 65,67 of sample 9"),
            "otherwise than rank " + owner + " on host" + owner, std::string("agrees with the former")}) {
        EXPECT_NE(outcome.warnings.find(part), std::string::npos) << part << "\n" << outcome.warnings;
      }
      const bool by_owner = outcome.warnings.find("rank " + owner + " on host" + owner + " drew") != std::string::npos;
      EXPECT_EQ(by_owner, ranks == 1) << outcome.warnings;
      EXPECT_EQ(std::ranges::count(outcome.warnings, '\n'), 1) << outcome.warnings;
    }
  }
}

TEST(Verification, AFlippedBitOfTheSecondDrawingLeavesTheFrameAsItIs) {
  for (const int ranks : {1, 2, 3, 5}) {
    const Outcome outcome =
        verify_with(ranks, [](int, int drawing, std::size_t tile, TileLayer<Key>& keys, TileLayer<Rgb>&) {
          if (drawing == 1 && tile == 2) keys.tile(tile)[0] ^= Key{1} << 63U;
        });
    EXPECT_EQ(outcome.counts, (VerifyCounts{.tiles = 2 * layout().tiles(), .mismatches = 1}));
    EXPECT_TRUE(outcome.is_true);
    EXPECT_NE(outcome.warnings.find("agrees with the latter"), std::string::npos) << outcome.warnings;
  }
}

TEST(Verification, ThreeDifferentDrawingsAreNotMended) {
  for (const int ranks : {1, 3}) {
    const Outcome outcome =
        verify_with(ranks, [](int, int drawing, std::size_t tile, TileLayer<Key>& keys, TileLayer<Rgb>&) {
          if (drawing != 1 && tile == 0) keys.tile(tile)[5] ^= Key{1} << static_cast<unsigned>(drawing);
        });
    EXPECT_EQ(outcome.counts, (VerifyCounts{.tiles = 2 * layout().tiles(), .mismatches = 1, .unmended = 1}));
    EXPECT_FALSE(outcome.is_true);
    EXPECT_NE(outcome.warnings.find("agrees with neither"), std::string::npos) << outcome.warnings;
  }
}

TEST(Verification, PixelsPastAScreensEdgeAndOnesThatAreNotWantedDoNotCount) {
  // Pixel (0, 10) of the last tile of screen 0, which is 6 rows high.
  const Outcome outcome = verify_with(3, [](int, int drawing, std::size_t tile, TileLayer<Key>& keys, TileLayer<Rgb>&) {
    if (drawing == 0 && tile == 5) keys.tile(tile)[10 * kTileSide] ^= 1U;
  });
  EXPECT_EQ(outcome.counts.mismatches, 0U);

  std::atomic<int> checked = 0;
  run_local_ranks(
      2,
      [&](Communicator& comm) {
        const std::vector<std::size_t> owned{comm.rank() == 0 ? std::size_t{1} : std::size_t{6}};
        TileLayer<Key> keys(layout());
        PixelMask wanted(layout());
        std::vector<Frame> frames(1);
        frames[0].keys = &keys;
        frames[0].radiance = TileLayer<Rgb>(layout());
        frames[0].owned = owned;
        draw_truth(owned[0], 0, keys, frames[0].radiance);
        wanted.tile(owned[0])[7] = 1;
        wanted.set_active(owned[0]);
        const auto draw = [&](std::span<const std::size_t> tiles, const PixelMask* mask) {
          std::vector<TileDrawing> drawings;
          drawings.push_back({TileLayer<Key>(layout()), TileLayer<Rgb>(layout())});
          for (const std::size_t tile : tiles) {
            TileLayer<Key> all(layout());
            draw_truth(tile, 0, all, drawings[0].radiance);
            for (std::size_t i = 0; i < kTilePixels; ++i) {
              if (mask->active(tile) && mask->tile(tile)[i] != 0) drawings[0].keys.tile(tile)[i] = all.tile(tile)[i];
            }
            checked += static_cast<int>(std::ranges::count(mask->tile(tile), std::uint8_t{1}));
          }
          return drawings;
        };
        const VerifiedSamples samples{.percent = 100.0, .random = {}, .wanted = &wanted};
        EXPECT_EQ(verify_tiles(comm, "host", samples, frames, draw), (VerifyCounts{.tiles = 2}));
      },
      kLimit);
  EXPECT_EQ(checked, 2);
}

/// A frame of gen:cornell, verified as the settings say after `fault` changed what a rank had.
VerifyCounts verify_frame(int ranks, const std::vector<std::pair<std::string, std::string>>& chosen,
                          const std::function<void(int rank, Frame&)>& fault) {
  VerifyCounts counts;
  run_local_ranks(
      ranks,
      [&](Communicator& comm) {
        Session session(comm, {.threads = 1}, [] { return load_scene("gen:cornell"); });
        RenderSettings settings;
        for (const auto& [name, value] : chosen) set_setting(settings, name, value);
        settings = resolve(settings, 1);
        const View view =
            make_view(choose_camera(settings.camera, session.scene()), {150, 130}, session.scene().bounds);
        FramePlan plan = plan_frame(session, settings.frame, std::span(&view, 1));
        const JitteredViews jittered{{view}, {{3, 0}, nullptr, nullptr, nullptr}};
        Frame frame = make_frame(session, plan, jittered.views, nullptr, jittered.sample);
        fault(comm.rank(), frame);
        plan.verify_percent = 100.0;
        const VerifyCounts found = verify(session, plan, std::span(&jittered, 1), std::span(&frame, 1));
        if (comm.rank() == 0) counts = found;
      },
      kLimit);
  return counts;
}

TEST(Verification, EveryWayToDrawAFrameGivesOtherRanksTheSameBits) {
  using Chosen = std::vector<std::pair<std::string, std::string>>;
  for (const Distribution distribution : kDistributions) {
    const std::string name(name_of(distribution));
    for (const char* const primary : {"raster", "rays"}) {
      const Chosen chosen{{"distribute", name}, {"primary", primary}};
      EXPECT_EQ(verify_frame(3, chosen, [](int, Frame&) {}), (VerifyCounts{.tiles = 9})) << name << primary;
    }
  }
  for (const Chosen& chosen :
       {Chosen{{"reference", "true"}}, Chosen{{"denoise", "true"}}, Chosen{{"half-resolution", "shadow"}},
        Chosen{{"indirect", "true"}}, Chosen{{"depth-format", "16"}, {"distribute", "sort-last"}}}) {
    EXPECT_EQ(verify_frame(2, chosen, [](int, Frame&) {}), (VerifyCounts{.tiles = 9})) << chosen.front().first;
  }
}

TEST(Verification, ABitThatFlipsAfterAFrameWasDrawnIsFound) {
  testing::internal::CaptureStderr();
  const VerifyCounts counts = verify_frame(3, {{"distribute", "sort-last"}}, [](int rank, Frame& frame) {
    if (rank == 1) flip(frame.radiance.tile(frame.owned.front())[0].r);
    if (rank == 2) frame.keys->tile(frame.owned.back())[0] ^= 1U;
  });
  const std::string warnings = testing::internal::GetCapturedStderr();
  EXPECT_EQ(counts, (VerifyCounts{.tiles = 9, .mismatches = 2})) << warnings;
}

}  // namespace
}  // namespace hpr
