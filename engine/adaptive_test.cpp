#include "engine/adaptive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

const FrameLayout kLayout({{150, 70}, {20, 5}});

Sampling sampling_of(std::optional<std::uint32_t> samples) {
  Sampling sampling;
  sampling.goal.samples = samples;
  sampling.adaptive = true;
  return sampling;
}

/// A picture whose left third is even, whose middle is a little noisy and whose right third is very noisy.
Rgb sample_of(std::size_t tile, std::size_t pixel, std::uint32_t number) {
  const auto u = static_cast<float>(Sampler(tile * kTilePixels + pixel, number).one());
  const float spread = tile % 3 == 0 ? 0.0F : (tile % 3 == 1 ? 0.05F : 0.8F);
  const float value = 0.5F + spread * (u - 0.5F);
  return {value, value, value};
}

/// Some samples of a film, as FrameSampler draws them: of the pixels that are due, and rubbish elsewhere.
void add_some(Film& film, std::span<const std::size_t> tiles, std::uint32_t count) {
  PixelMask due(kLayout);
  film.mark_due(tiles, due);
  const TileLayer<Key> keys(kLayout);
  const AovLayers none;
  std::vector<TileLayer<Rgb>> radiance;
  std::vector<SampleLight> lights;
  for (std::uint32_t i = 0; i < count; ++i) radiance.emplace_back(kLayout);
  for (std::uint32_t i = 0; i < count; ++i) {
    for (const std::size_t tile : tiles) {
      for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) {
        const bool wanted = due.tile(tile)[pixel] != 0;
        radiance[i].tile(tile)[pixel] = wanted ? sample_of(tile, pixel, film.samples() + i) : Rgb{1e9F, 1e9F, 1e9F};
      }
      radiance[i].set_active(tile);
    }
    lights.push_back({radiance[i], none, keys});
  }
  film.add(lights, std::vector<double>(count, 1.0), tiles, 1);
}

/// Draws until so many samples are there, `together` at most at once.
void draw(Communicator& comm, AdaptiveSampling& adaptive, Film& film, std::span<const std::size_t> tiles,
          std::uint32_t samples, std::uint32_t together) {
  while (adaptive.samples() < samples) {
    if (adaptive.is_stage_done()) adaptive.deal(comm, film, tiles, 2);
    if (adaptive.is_stage_done()) continue;
    const std::uint32_t count = std::min(adaptive.most_together(), together);
    add_some(film, tiles, count);
    adaptive.added(count, film);
  }
}

Film film_for(const Sampling& sampling) {
  return {kLayout, {{}, false, AdaptiveSampling::pilot_of(sampling)}};
}

TEST(AdaptiveSampling, EveryPixelHasSomeBeforeTheyAreDealt) {
  const std::map<std::uint32_t, std::uint32_t> pilots{{1, 1},   {15, 15}, {16, 8},   {31, 8},   {32, 8},
                                                      {64, 16}, {65, 16}, {100, 16}, {256, 16}, {1024, 16}};
  for (const auto& [samples, pilot] : pilots) {
    EXPECT_EQ(AdaptiveSampling::pilot_of(sampling_of(samples)), pilot) << samples;
  }
  EXPECT_EQ(AdaptiveSampling::pilot_of(sampling_of({})), 8U);
  Sampling mitchell = sampling_of(64);
  mitchell.filter = PixelFilter::Mitchell;
  EXPECT_EQ(AdaptiveSampling::pilot_of(mitchell), 16U);
}

/// How many samples the pixels of each third of the picture have, on average, and of the noisy two thirds together.
struct Dealt {
  std::array<double, 3> mean{};
  double noisy = 0.0;
};

Dealt dealt_in(const Film& film, std::uint32_t fewest, std::uint32_t most) {
  Dealt dealt;
  std::array<double, 3> count{};
  for (const std::size_t tile : all_tiles(kLayout)) {
    const Rect place = kLayout.place(tile).pixels;
    for (int i = 0; i < place.width() * place.height(); ++i) {
      const auto at = static_cast<std::size_t>(i / place.width() * kTileSide + i % place.width());
      const PixelSamples& pixel = film.pixel_samples().tile(tile)[at];
      EXPECT_TRUE(std::has_single_bit(pixel.taken)) << pixel.taken;
      EXPECT_GE(pixel.taken, fewest);
      EXPECT_LE(pixel.taken, most);
      EXPECT_EQ(pixel.weights[0], pixel.taken / 2.0);
      EXPECT_EQ(pixel.weights[1], pixel.taken / 2.0);
      dealt.mean[tile % 3] += pixel.taken;
      count[tile % 3] += 1.0;
    }
  }
  dealt.noisy = (dealt.mean[1] + dealt.mean[2]) / (count[1] + count[2]);
  for (std::size_t kind = 0; kind < 3; ++kind) dealt.mean[kind] /= count[kind];
  return dealt;
}

TEST(AdaptiveSampling, NoisyPixelsGetMoreAndAllTogetherAsManyAsAreAskedFor) {
  for (const auto filter : {PixelFilter::Box, PixelFilter::Mitchell}) {
    for (const std::uint32_t samples : {16U, 17U, 64U, 100U, 256U}) {
      Sampling sampling = sampling_of(samples);
      sampling.filter = filter;
      const std::uint32_t pilot = AdaptiveSampling::pilot_of(sampling);
      Film film = film_for(sampling);
      AdaptiveSampling adaptive(sampling);
      run_local_ranks(1, [&](Communicator& comm) { draw(comm, adaptive, film, all_tiles(kLayout), samples, 16); });
      EXPECT_EQ(adaptive.samples(), samples);
      const Dealt dealt = dealt_in(film, samples / 8, 4 * samples);
      EXPECT_LE(dealt.mean[0], std::max(samples / 2, pilot)) << "even pixels";
      EXPECT_LE(dealt.noisy, samples * 1.001) << samples;
      EXPECT_GT(dealt.noisy, samples * 0.6) << samples;
      if (samples >= 2 * pilot) {
        EXPECT_GT(dealt.mean[2], 1.5 * dealt.mean[1]) << samples;
      }
    }
  }
}

TEST(AdaptiveSampling, MeansAreOfTheSamplesAPixelHas) {
  const std::vector<std::size_t> tiles = all_tiles(kLayout);
  const Sampling sampling = sampling_of(64);
  Film film = film_for(sampling);
  AdaptiveSampling adaptive(sampling);
  run_local_ranks(1, [&](Communicator& comm) { draw(comm, adaptive, film, tiles, 64, 16); });
  TileLayer<Rgb> radiance(kLayout);
  AovLayers none;
  film.resolve(tiles, 2, radiance, none);
  for (const std::size_t tile : tiles) {
    for (std::size_t pixel = 0; pixel < kTilePixels; pixel += 37) {
      const std::uint32_t taken = film.pixel_samples().tile(tile)[pixel].taken;
      double sum = 0.0;
      for (std::uint32_t i = 0; i < taken; ++i) sum += static_cast<double>(sample_of(tile, pixel, i).g);
      EXPECT_NEAR(radiance.tile(tile)[pixel].g, sum / taken, 1e-6);
    }
  }
}

/// Films that were drawn in other ways.
TEST(AdaptiveSampling, RanksRoundsAndBreaksChangeNothing) {
  const Sampling sampling = sampling_of(64);
  const auto taken_of = [](const Film& film, std::size_t tile) {
    std::vector<std::uint32_t> taken;
    for (const PixelSamples& pixel : film.pixel_samples().tile(tile)) taken.push_back(pixel.taken);
    return taken;
  };
  Film expected = film_for(sampling);
  run_local_ranks(1, [&](Communicator& comm) {
    AdaptiveSampling adaptive(sampling);
    draw(comm, adaptive, expected, all_tiles(kLayout), 64, 16);
  });
  for (const int ranks : {1, 3}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      std::vector<std::size_t> mine;
      for (std::size_t tile = 0; tile < kLayout.tiles(); ++tile) {
        if (static_cast<int>(tile) % ranks == comm.rank()) mine.push_back(tile);
      }
      Film film = film_for(sampling);
      AdaptiveSampling adaptive(sampling);
      std::uint32_t last = 0;
      while (adaptive.samples() < 64) {
        if (adaptive.is_stage_done()) adaptive.deal(comm, film, mine, 1);
        const std::uint32_t count = std::min(adaptive.most_together(), 3U);
        add_some(film, mine, count);
        adaptive.added(count, film);
        EXPECT_GE(adaptive.samples(), last);
        last = adaptive.samples();
        // As a run that was stopped here goes on.
        SampleProgress reached;
        reached.samples = adaptive.samples();
        reached.budget = adaptive.budget();
        AdaptiveSampling other(sampling);
        other.resume(comm, reached, film, mine);
        EXPECT_EQ(other.samples(), adaptive.samples());
        EXPECT_EQ(other.is_stage_done(), adaptive.is_stage_done());
        if (!adaptive.is_stage_done()) {
          EXPECT_EQ(other.most_together(), adaptive.most_together());
        }
        adaptive = other;
      }
      for (const std::size_t tile : mine) EXPECT_EQ(taken_of(film, tile), taken_of(expected, tile)) << tile;
    });
  }
}

/// Stages in which no pixel wants more are passed over; at the end nothing is left to draw.
TEST(AdaptiveSampling, PicturesWithoutNoiseComeToAnEnd) {
  const std::vector<std::size_t> calm{0, 3};
  for (const auto filter : {PixelFilter::Box, PixelFilter::Mitchell}) {
    for (const std::uint32_t samples : {16U, 17U, 31U, 32U, 64U, 256U}) {
      Sampling sampling = sampling_of(samples);
      sampling.filter = filter;
      Film film = film_for(sampling);
      AdaptiveSampling adaptive(sampling);
      run_local_ranks(1, [&](Communicator& comm) { draw(comm, adaptive, film, calm, samples, 16); });
      EXPECT_EQ(adaptive.samples(), samples);
      const std::uint32_t taken = film.pixel_samples().at(0, 0, 0).taken;
      EXPECT_LE(taken, std::max(samples / 4, AdaptiveSampling::pilot_of(sampling)));
      EXPECT_GE(taken, std::max(samples / 8, 8U));
      EXPECT_GE(film.samples(), film.pilot()) << "a checkpoint of it would be taken for one of the pilot";
    }
  }
}

TEST(AdaptiveSampling, WithoutAGoalStagesGoOn) {
  const Sampling sampling = sampling_of({});
  Film film = film_for(sampling);
  AdaptiveSampling adaptive(sampling);
  run_local_ranks(1, [&](Communicator& comm) { draw(comm, adaptive, film, all_tiles(kLayout), 32, 16); });
  EXPECT_EQ(adaptive.samples(), 32U);
  EXPECT_TRUE(adaptive.is_stage_done());
}

}  // namespace
}  // namespace hpr
