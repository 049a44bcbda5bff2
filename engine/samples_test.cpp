#include "engine/samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "engine/film.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

TEST(SampleGoal, IsANumberATimeOrAnError) {
  EXPECT_EQ(parse_sample_goal("16").samples, std::uint32_t{16});
  EXPECT_TRUE(parse_sample_goal("1").one());
  const SampleGoal time = parse_sample_goal("until:1.5s");
  EXPECT_EQ(time.seconds, 1.5);
  EXPECT_FALSE(time.samples || time.relmse);
  const SampleGoal error = parse_sample_goal("until:relmse=1e-3");
  EXPECT_EQ(error.relmse, 1e-3);
  EXPECT_FALSE(error.samples || error.seconds);
  for (const char* const text : {"", "0", "-1", "1.5", "4x", "4294967295", "99999999999", "until:", "until:0s",
                                 "until:relmse=", "until:relmse=0", "until:relmse=-1", "until:relmse=nan", "until:x"}) {
    try {
      (void)parse_sample_goal(text);
      ADD_FAILURE() << text;
    } catch (const Error& refused) {
      EXPECT_EQ(refused.code(), ExitCode::Usage) << text;
    }
  }
}

TEST(Samples, OneSampleWithoutAFilterLooksThroughTheCentre) {
  const Sampling plain{parse_sample_goal("1"), {}};
  EXPECT_FALSE(plain.sums());
  EXPECT_EQ(subpixel_sample(plain, {}, 0).offset, glm::dvec2(0.0));
  const Sampling filtered{parse_sample_goal("1"), PixelFilter::Gaussian};
  EXPECT_TRUE(filtered.sums());
  EXPECT_NE(subpixel_sample(filtered, {}, 0).offset, glm::dvec2(0.0));
}

TEST(Samples, EverySixteenSamplesFallIntoEverySixteenthOfThePixel) {
  const Sampling box{parse_sample_goal("64"), {}};
  for (const std::uint64_t seed : {1U, 2U, 9U}) {
    for (std::uint32_t first = 0; first < 64; first += 16) {
      for (int columns = 1; columns <= 16; columns *= 2) {
        std::vector<int> hits(16, 0);
        for (std::uint32_t i = first; i < first + 16; ++i) {
          const glm::dvec2 u = subpixel_sample(box, {.seed = seed, .frame = 0}, i).offset + 0.5;
          const int rows = 16 / columns;
          ++hits.at(static_cast<std::size_t>(std::floor(u.x * columns) * rows + std::floor(u.y * rows)));
        }
        for (const int count : hits) EXPECT_EQ(count, 1) << seed << ' ' << first << ' ' << columns;
      }
    }
  }
}

TEST(Samples, SeedsAndFramesLookElsewhere) {
  const Sampling box{parse_sample_goal("4"), {}};
  const glm::dvec2 one = subpixel_sample(box, {.seed = 1, .frame = 0}, 0).offset;
  EXPECT_NE(subpixel_sample(box, {.seed = 2, .frame = 0}, 0).offset, one);
  EXPECT_NE(subpixel_sample(box, {.seed = 1, .frame = 1}, 0).offset, one);
  EXPECT_EQ(subpixel_sample(box, {.seed = 1, .frame = 0}, 0).offset, one);
}

TEST(Samples, MitchellsWeightsSumToMoreThanZeroFromSixteenOn) {
  const Sampling mitchell{parse_sample_goal("16"), PixelFilter::Mitchell};
  int negative = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    double sum = 0.0;
    for (std::uint32_t i = 0; i < 80; ++i) {
      const double weight = subpixel_sample(mitchell, {.seed = seed, .frame = 0}, i).weight;
      negative += weight < 0.0;
      sum += weight;
      if (i < 15) continue;
      ASSERT_GE(sum, 4.0) << seed << ' ' << i;
    }
  }
  EXPECT_GT(negative, 500) << "the filter has negative lobes";
  EXPECT_THROW(check_sampling({parse_sample_goal("15"), PixelFilter::Mitchell}), Error);
  check_sampling(mitchell);
  check_sampling({parse_sample_goal("until:1s"), PixelFilter::Mitchell});
  EXPECT_FALSE(reached({parse_sample_goal("until:1s"), PixelFilter::Mitchell}, {15, 9.0, {}}));
}

TEST(Samples, MilestonesAreQuartersOfPowersOfTwo) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t i = 0; i <= 40; ++i) {
    if (is_milestone(i)) found.push_back(i);
  }
  EXPECT_EQ(found, (std::vector<std::uint32_t>{1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40}));
}

TEST(Samples, GoalsAreReachedAndTheRestIsGuessed) {
  const Sampling count{parse_sample_goal("8"), {}};
  EXPECT_FALSE(reached(count, {7, 100.0, 0.0}));
  EXPECT_TRUE(reached(count, {8, 0.0, {}}));
  EXPECT_DOUBLE_EQ(remaining_seconds(count.goal, {2, 3.0, {}}).value(), 9.0);
  const Sampling time{parse_sample_goal("until:2s"), {}};
  EXPECT_FALSE(reached(time, {1, 1.9, {}}));
  EXPECT_TRUE(reached(time, {1, 2.0, {}}));
  EXPECT_DOUBLE_EQ(remaining_seconds(time.goal, {1, 0.5, {}}).value(), 1.5);
  const Sampling error{parse_sample_goal("until:relmse=0.01"), {}};
  EXPECT_FALSE(reached(error, {32, 0.0, {}}));
  EXPECT_FALSE(reached(error, {32, 0.0, 0.02}));
  EXPECT_FALSE(reached(error, {8, 0.0, 0.001})) << "so few samples are not believed";
  EXPECT_TRUE(reached(error, {32, 0.0, 0.01}));
  EXPECT_DOUBLE_EQ(remaining_seconds(error.goal, {32, 5.0, 0.04}).value(), 15.0);
  EXPECT_FALSE(remaining_seconds(error.goal, {32, 5.0, {}}));
}

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
    if (adaptive.is_stage_done()) adaptive.start_stage(comm, film, tiles, 2);
    if (adaptive.is_stage_done()) continue;
    const std::uint32_t count = std::min(adaptive.max_batch(), together);
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
    const Rect rect = kLayout.place(tile).pixels;
    for (int i = 0; i < rect.width() * rect.height(); ++i) {
      const auto at = static_cast<std::size_t>(i / rect.width() * kTileSide + i % rect.width());
      const PixelSamples& pixel = film.pixel_samples().tile(tile)[at];
      EXPECT_TRUE(std::has_single_bit(pixel.sample_count)) << pixel.sample_count;
      EXPECT_GE(pixel.sample_count, fewest);
      EXPECT_LE(pixel.sample_count, most);
      EXPECT_EQ(pixel.weights[0], pixel.sample_count / 2.0);
      EXPECT_EQ(pixel.weights[1], pixel.sample_count / 2.0);
      dealt.mean[tile % 3] += pixel.sample_count;
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
      const std::uint32_t sample_count = film.pixel_samples().tile(tile)[pixel].sample_count;
      double sum = 0.0;
      for (std::uint32_t i = 0; i < sample_count; ++i) sum += static_cast<double>(sample_of(tile, pixel, i).g);
      EXPECT_NEAR(radiance.tile(tile)[pixel].g, sum / sample_count, 1e-6);
    }
  }
}

/// Films that were drawn in other ways.
TEST(AdaptiveSampling, RanksRoundsAndBreaksChangeNothing) {
  const Sampling sampling = sampling_of(64);
  const auto taken_of = [](const Film& film, std::size_t tile) {
    std::vector<std::uint32_t> sample_count;
    for (const PixelSamples& pixel : film.pixel_samples().tile(tile)) sample_count.push_back(pixel.sample_count);
    return sample_count;
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
        if (adaptive.is_stage_done()) adaptive.start_stage(comm, film, mine, 1);
        const std::uint32_t count = std::min(adaptive.max_batch(), 3U);
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
          EXPECT_EQ(other.max_batch(), adaptive.max_batch());
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
      const std::uint32_t sample_count = film.pixel_samples().at(0, 0, 0).sample_count;
      EXPECT_LE(sample_count, std::max(samples / 4, AdaptiveSampling::pilot_of(sampling)));
      EXPECT_GE(sample_count, std::max(samples / 8, 8U));
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
