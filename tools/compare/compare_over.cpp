#include "tools/compare/compare_over.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <type_traits>

#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "core/bytes.h"
#include "image/color.h"
#include "tools/compare/compare_measure.h"

namespace hpr {
namespace {

/// 64 bits of SplitMix64's finaliser (Steele, Lea and Flood 2014): an alpha per pixel and rank.
std::uint64_t mix(std::uint64_t h) {
  h = (h ^ (h >> 30U)) * 0xBF58476D1CE4E5B9U;
  h = (h ^ (h >> 27U)) * 0x94D049BB133111EBU;
  return h ^ (h >> 31U);
}

/// Full light of a channel.
template <typename Pixel>
constexpr double kOne = std::is_same_v<Pixel, Rgba8Premultiplied> ? 255.0 : 1.0;

template <typename Pixel>
std::array<double, 4> channels(Pixel pixel) {
  return {static_cast<double>(pixel.r), static_cast<double>(pixel.g), static_cast<double>(pixel.b),
          static_cast<double>(pixel.a)};
}

/// A colour of the key, or of its surface, times an alpha.
template <typename Pixel>
Pixel translucent(Key key, std::uint64_t at_random) {
  const auto word = static_cast<std::uint32_t>(key);
  const auto alpha = static_cast<std::uint32_t>(at_random & 0xFFU);
  if constexpr (std::is_same_v<Pixel, Rgba8Premultiplied>) {
    const auto times_alpha = [&](std::uint32_t channel) {
      return static_cast<std::uint8_t>(((channel & 0xFFU) * alpha + 127U) / 255U);
    };
    return {times_alpha(word), times_alpha(word >> 8U), times_alpha(word >> 16U), static_cast<std::uint8_t>(alpha)};
  } else {
    const float a = static_cast<float>(alpha) / 255.0F;
    const auto times_alpha = [&](std::uint32_t channel) { return static_cast<float>(channel & 0xFFU) / 255.0F * a; };
    return {times_alpha(word), times_alpha(word >> 8U), times_alpha(word >> 16U), a};
  }
}

template <typename Pixel>
TileLayer<Pixel> translucent_layer(const TileLayer<Key>& keys, int rank) {
  TileLayer<Pixel> layer(keys.layout());
  for (std::size_t tile = 0; tile < keys.tiles(); ++tile) {
    if (!keys.active(tile)) continue;
    layer.set_active(tile);
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      const Key key = keys.tile(tile)[i];
      const std::uint64_t pixel = tile * kTilePixels + i;
      if (key != kNoKey) layer.tile(tile)[i] = translucent<Pixel>(key, mix(pixel << 16U | static_cast<unsigned>(rank)));
    }
  }
  return layer;
}

/// front + (1 - alpha) back, as its definition says it, without the kernel.
Rgba8Premultiplied over(Rgba8Premultiplied front, Rgba8Premultiplied back) {
  const auto channel = [&](int f, int b) {
    return static_cast<std::uint8_t>(std::min(255, f + (2 * (255 - front.a) * b + 255) / 510));
  };
  return {channel(front.r, back.r), channel(front.g, back.g), channel(front.b, back.b), channel(front.a, back.a)};
}
RgbaPremultiplied over(RgbaPremultiplied front, RgbaPremultiplied back) {
  const float through = 1.0F - front.a;
  return {front.r + through * back.r, front.g + through * back.g, front.b + through * back.b,
          front.a + through * back.a};
}

/// Collective. On rank 0 all ranks' layers blended front to back, from whole layers one after the other: nothing of it
/// is shared with what is tested.
template <typename Pixel>
std::vector<Pixel> serial_over(Communicator& comm, const TileLayer<Pixel>& layer) {
  const std::span<const Pixel> mine = layer.run({0, layer.tiles()});
  if (comm.rank() != 0) {
    comm.send(std::as_bytes(mine), 0);
    return {};
  }
  std::vector<Pixel> front(mine.begin(), mine.end());
  std::vector<Pixel> back(mine.size());
  for (int from = 1; from < comm.size(); ++from) {
    comm.receive(std::as_writable_bytes(std::span(back)), from);
    for (std::size_t i = 0; i < front.size(); ++i) front[i] = over(front[i], back[i]);
  }
  return front;
}

/// One strategy under comparison on this rank.
template <typename Pixel>
struct Contestant {
  std::unique_ptr<CountingCommunicator> comm;
  std::unique_ptr<Blender<Pixel>> blender;
  std::vector<Sample> samples;         ///< per measured frame
  std::uint64_t differing_pixels = 0;  ///< rank 0: of the worst frame
  double max_error = 0.0;              ///< rank 0: of all frames, 1 is full light
  Image<Pixel> frame;                  ///< rank 0: the last one
};

/// The largest difference of a channel; the largest of all numbers where one is no number.
template <typename Pixel>
double difference(Pixel a, Pixel b) {
  const auto one = channels(a);
  const auto other = channels(b);
  double largest = 0.0;
  for (std::size_t c = 0; c < one.size(); ++c) {
    const double apart = std::abs(one.at(c) - other.at(c));
    largest = std::isfinite(apart) ? std::max(largest, apart) : std::numeric_limits<double>::max();
  }
  return largest;
}

/// Rank 0, after each frame: how far off it is.
template <typename Pixel>
void inspect(const TileLayer<Pixel>& layer, std::span<const Pixel> expected, int ranks, Contestant<Pixel>& contestant) {
  const double allowed = 2.0 * over_error_bound<Pixel>(ranks);  // either is rounded
  std::uint64_t differing = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const std::size_t tile = i / kTilePixels;
    // A colour in a tile that is not marked active would not be shown.
    const double off = difference(layer.active(tile) ? layer.tile(tile)[i % kTilePixels] : Pixel{}, expected[i]);
    contestant.max_error = std::max(contestant.max_error, off / kOne<Pixel>);
    differing += off <= allowed ? 0U : 1U;
  }
  contestant.differing_pixels = std::max(contestant.differing_pixels, differing);
}

/// The wall as it is shown on black.
template <typename Pixel>
Image<Rgba8> shown(const Image<Pixel>& frame) {
  Image<Rgba8> picture(frame.size());
  std::ranges::transform(frame.pixels(), picture.pixels().begin(), [](Pixel pixel) {
    const auto level = [](double channel) {
      return static_cast<std::uint8_t>(std::lround(std::clamp(channel / kOne<Pixel>, 0.0, 1.0) * 255.0));
    };
    return Rgba8{level(pixel.r), level(pixel.g), level(pixel.b), 255};
  });
  return picture;
}

template <typename Pixel>
CompareRun run_of(Contestant<Pixel>& contestant, Communicator& comm, int frames,
                  const std::vector<std::vector<Sample>>& samples) {
  CompareRun run;
  run.strategy = contestant.blender->name();
  run.ranks = comm.size();
  run.transport = comm.transport();
  run.frames = frames;
  summarize(samples, run);
  run.differing_pixels = contestant.differing_pixels;
  run.max_error = contestant.max_error;
  run.frame_xxh64 = hex16(xxh64(std::as_bytes(contestant.frame.pixels())));
  return run;
}

template <typename Pixel>
CompareResult compare(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  const TileLayer<Pixel> pristine = translucent_layer<Pixel>(input.layer(comm), comm.rank());
  const std::vector<std::size_t> tiles = all_tiles(pristine.layout());
  std::vector<int> order(static_cast<std::size_t>(comm.size()));
  std::iota(order.begin(), order.end(), 0);
  const std::vector<Pixel> expected = serial_over(comm, pristine);
  const bool is_root = comm.rank() == 0;

  std::vector<Contestant<Pixel>> contestants;
  for (const std::string& name : settings.strategies) {
    contestants.push_back({std::make_unique<CountingCommunicator>(comm), make_blender<Pixel>(name), {}, 0, 0.0, {}});
  }
  const bool in_place =
      std::ranges::any_of(contestants, [](const auto& contestant) { return contestant.blender->merges_in_place(); });
  WorkingLayers<Pixel> layers(comm, pristine.layout(), in_place);
  Assembler assembler;
  for (int frame = -settings.warmup; frame < settings.frames; ++frame) {
    for (Contestant<Pixel>& contestant : contestants) {
      Blender<Pixel>& blender = *contestant.blender;
      TileLayer<Pixel>& layer = layers.of(blender.merges_in_place());
      copy_tiles(pristine, layer, tiles);
      const Sample sample =
          measure_frame(*contestant.comm, assembler, layer, layers.peers(), [&](std::span<const int> shown_by) {
            return blender.blend(*contestant.comm, layer, tiles, order, shown_by);
          });
      if (frame >= 0) contestant.samples.push_back(sample);
      if (is_root) inspect<Pixel>(layer, expected, comm.size(), contestant);
      if (is_root) contestant.frame = wall_image(layer, input);
    }
  }

  CompareResult result;
  for (Contestant<Pixel>& contestant : contestants) {
    const auto samples = gather_samples(comm, contestant.samples);
    if (is_root) result.runs.push_back(run_of(contestant, comm, settings.frames, samples));
  }
  if (is_root) result.picture = shown(contestants.front().frame);
  return result;
}

}  // namespace

CompareResult compare_blenders(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  return settings.operation == CompareOperator::Over8 ? compare<Rgba8Premultiplied>(comm, input, settings)
                                                      : compare<RgbaPremultiplied>(comm, input, settings);
}

}  // namespace hpr
