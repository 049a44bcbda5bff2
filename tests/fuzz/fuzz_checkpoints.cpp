#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "cluster/transport/local_communicator.h"
#include "core/bytes.h"
#include "core/error.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/film.h"
#include "engine/samples.h"
#include "image/tiles.h"
#include "tests/fuzz/fuzz.h"

// Checkpoints of strangers, read and gone on from as a run does.
namespace hpr::fuzz {
namespace {

const RunIdentity kIdentity{{"scene", "0123"}, {"way to keys", "by rays"}};
constexpr const char* kName = "a.checkpoint";
constexpr std::size_t kHash = 8;  ///< bytes
constexpr std::uint32_t kPilot = 8;

/// The films the inputs are read into: what is in a file must not matter to a film of another kind.
enum class Kind { Plain, Layers, Adaptive };
constexpr std::array kKinds{Kind::Plain, Kind::Layers, Kind::Adaptive};

Film make_film(Kind kind) {
  const FrameLayout layout({{9, 70}});  // two tiles
  if (kind == Kind::Plain) return {layout, {}};
  if (kind == Kind::Adaptive) return {layout, {{}, false, kPilot}};
  return {layout, {{Aov::Id, Aov::Direct, Aov::Rank, Aov::Cost, Aov::Coverage}, true, 0}};
}

Sampling sampling_of(Kind kind) {
  Sampling sampling;
  sampling.goal.samples = 64;
  sampling.adaptive = kind == Kind::Adaptive;
  return sampling;
}

/// What is done with a film that was read, of which nothing may fail.
void go_on(Kind kind, Film& film, const SampleProgress& progress) {
  const std::vector<std::size_t> tiles = all_tiles(film.layout());
  (void)film.squared_errors(tiles, 1);
  if (kind == Kind::Adaptive) {
    run_local_ranks(1, [&](Communicator& comm) {
      AdaptiveSampling adaptive(sampling_of(kind));
      adaptive.resume(comm, progress, film, tiles);
      (void)adaptive.samples();
      if (adaptive.is_stage_done()) adaptive.start_stage(comm, film, tiles, 1);
    });
    PixelMask due(film.layout());
    film.mark_due(tiles, due);
  }
  const auto [even, odd] = film.counters().weights;
  if (!reached(sampling_of(kind), progress) || even + odd == 0.0) return;  // refused by FrameSampler
  TileLayer<Rgb> radiance(film.layout());
  const std::vector<Aov> aovs{Aov::Direct, Aov::Rank, Aov::Cost, Aov::Coverage};
  AovLayers layers(film.layout(), kind == Kind::Layers ? std::span<const Aov>(aovs) : std::span<const Aov>());
  film.resolve(tiles, 1, radiance, layers);
}

bool reads(Kind kind, std::span<const std::byte> input) {
  try {
    const RunIdentity found = identity_in(input, kName);
    (void)primary_of(found);
    Film film = make_film(kind);
    const SampleProgress progress = decode_checkpoint(input, kName, found, film);
    // What was read is written as what reads back to the same.
    const std::vector<std::byte> written = encode_checkpoint(found, film, progress);
    Film again = make_film(kind);
    const SampleProgress second = decode_checkpoint(written, kName, found, again);
    HPR_CHECK(encode_checkpoint(found, again, second) == written);
    go_on(kind, film, progress);
    return true;
  } catch (const Error& error) {
    HPR_CHECK(error.code() == ExitCode::BadInput);
    return false;
  }
}

}  // namespace

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const Kind kind : kKinds) {
    Film film = make_film(kind);
    film.set_counters({12, {6.0, 6.0}});
    all.push_back(encode_checkpoint(kIdentity, film, {12, 3.5, 0.25, 16}));
    film.each_layer([](auto& layer) {
      if (layer.tiles() > 0) layer.set_active(0);
    });
    const std::span<PixelSamples> pixels =
        kind == Kind::Adaptive ? film.pixel_samples().tile(0) : std::span<PixelSamples>();
    std::ranges::fill(pixels, PixelSamples{{5.0, 4.0}, 2.0, 9, 16});
    film.set_counters({64, {32.0, 32.0}});
    all.push_back(encode_checkpoint(kIdentity, film, {64, 3.5, {}, 64}));
  }
  return all;
}

bool run(std::span<const std::byte> input) {
  bool good = false;
  for (const Kind kind : kKinds) good |= reads(kind, input);
  return good;
}

Bytes repaired(Bytes input) {
  if (input.size() < kHash) return input;
  const std::uint64_t sum = xxh64(std::span<const std::byte>(input).first(input.size() - kHash));
  std::memcpy(input.data() + input.size() - kHash, &sum, sizeof sum);
  return input;
}

}  // namespace hpr::fuzz
