#include "tools/compare/compare.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <type_traits>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator_wrappers.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/timing.h"

namespace hpr {
namespace {

/// Tiles that a rank merges while speeds are measured: at most as many as a frame has, so that they leave the cache as
/// its tiles do.
constexpr std::size_t kMaxProbeTiles = 512;

/// What one rank measured in one frame.
struct Sample {
  double composite_ms = 0.0;
  double collect_ms = 0.0;
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
};

/// The screens side by side.
template <typename Pixel>
Image<Pixel> wall_image(const TileLayer<Pixel>& layer, const CompareInput& input) {
  const Size screen = input.screen;
  Image<Pixel> wall(Size{screen.width * input.grid.width, screen.height * input.grid.height});
  for (std::size_t i = 0; i < layer.layout().screens(); ++i) {
    const int left = static_cast<int>(i) % input.grid.width * screen.width;
    const int top = static_cast<int>(i) / input.grid.width * screen.height;
    paste(to_image(layer, i), left, top, wall);
  }
  return wall;
}

/// Collective. Where all ranks are on one host they wait asleep, so that those that come late find a core.
void wait_for_all(Communicator& comm, PeerMemory* peers) {
  if (peers != nullptr && shared_by_all(*peers, comm.size())) {
    peers->meet();
  } else {
    barrier(comm);
  }
}

/// Collective: one frame of one strategy, from the ranks' layers to the whole frame on rank 0. `composite` is given who
/// shows which screen.
template <typename Pixel>
Sample measure_frame(CountingCommunicator& comm, Assembler& assembler, TileLayer<Pixel>& layer, PeerMemory* peers,
                     const std::function<Composited(std::span<const int>)>& composite) {
  const std::vector<int> shown_by(layer.layout().screens(), 0);
  wait_for_all(comm, peers);
  const std::size_t bytes_before = comm.bytes_sent();
  const std::size_t messages_before = comm.messages_sent();
  const double start = comm.seconds();
  const Composited mine = [&] {
    const trace::Span span("composite");
    return composite(shown_by);
  }();
  const double composited = comm.seconds();
  const trace::Span span("collect");
  if (!mine.assembled) assembler.assemble(comm, layer, mine.tiles, shown_by);
  const Sample sample{(composited - start) * 1e3, (comm.seconds() - composited) * 1e3, comm.bytes_sent() - bytes_before,
                      comm.messages_sent() - messages_before};
  wait_for_all(comm, peers);  // ranks that are done must not take the cores of those that are still timed
  return sample;
}

/// The memory frames are composited in: one where ranks of one host can merge in place, for the strategies that do so,
/// and one of this rank's own, which messages leave faster (it has large pages).
template <typename Pixel>
class WorkingLayers {
 public:
  /// Collective. `in_place`: any strategy merges in place.
  WorkingLayers(Communicator& comm, const FrameLayout& layout, bool in_place) : own_(layout) {
    if (in_place) shared_ = TileLayer<Pixel>(layout, comm.share(TileLayer<Pixel>::bytes_for(layout)));
  }

  [[nodiscard]] TileLayer<Pixel>& of(bool merges_in_place) { return merges_in_place ? shared_ : own_; }
  /// For meetings; null where no strategy merges in place.
  [[nodiscard]] PeerMemory* peers() const { return shared_.peers(); }

 private:
  TileLayer<Pixel> own_;
  TileLayer<Pixel> shared_;
};

/// Collective: on rank 0 every rank's samples, one per frame.
std::vector<std::vector<Sample>> gather_samples(Communicator& comm, const std::vector<Sample>& samples) {
  std::vector<std::vector<Sample>> all;
  for (const auto& bytes : gather(comm, std::as_bytes(std::span(samples)))) {
    all.emplace_back(bytes.size() / sizeof(Sample));
    std::memcpy(all.back().data(), bytes.data(), bytes.size());
  }
  return all;
}

/// Sets the times of a run and what was sent. `ranks`: per rank its samples, one per frame.
void summarize(const std::vector<std::vector<Sample>>& ranks, CompareRun& run) {
  const std::size_t frames = ranks.front().size();
  std::vector<double> total(frames);
  std::vector<double> composite(frames);
  std::vector<double> collect(frames);
  std::vector<double> imbalance(frames);
  for (std::size_t frame = 0; frame < frames; ++frame) {
    double sum = 0.0;
    for (const auto& samples : ranks) {
      const Sample& sample = samples[frame];
      total[frame] = std::max(total[frame], sample.composite_ms + sample.collect_ms);
      composite[frame] = std::max(composite[frame], sample.composite_ms);
      collect[frame] = std::max(collect[frame], sample.collect_ms);
      sum += sample.composite_ms;
    }
    const double mean = sum / static_cast<double>(ranks.size());
    imbalance[frame] = mean > 0.0 ? composite[frame] / mean : 1.0;
  }
  run.ms = spread_of(total);
  run.ms_composite = median(composite);
  run.ms_collect = median(collect);
  run.imbalance = median(imbalance);
  // Every frame sends the same.
  for (const auto& samples : ranks) {
    run.bytes_total += samples.back().bytes;
    run.bytes_max_rank = std::max(run.bytes_max_rank, samples.back().bytes);
    run.messages_total += samples.back().messages;
  }
}

/// One strategy under comparison on this rank.
template <typename Pixel>
struct Contestant {
  /// Composites `layer`. `shown_by`: the rank that shows each screen.
  using Composite = std::function<Composited(Communicator&, TileLayer<Pixel>& layer, std::span<const int> shown_by)>;

  std::unique_ptr<CountingCommunicator> comm;
  bool in_place = false;  ///< it merges in memory that ranks of a host share
  Composite composite;
  TileLayer<Pixel> own_layer = {};   ///< what it starts from where that is not the layer of all strategies
  std::vector<Sample> samples = {};  ///< per measured frame
  CompareRun run = {};               ///< rank 0
  Image<Pixel> frame = {};           ///< rank 0: the last one
};

/// Collective: measures all contestants, frame after frame in turns. On rank 0 `check(layer, run)` is called after each
/// frame, and the contestants' runs are complete but for what only their strategies know.
template <typename Pixel, typename Check>
void run_contest(Communicator& comm, const CompareInput& input, const CompareSettings& settings,
                 const TileLayer<Pixel>& pristine, std::vector<Contestant<Pixel>>& contestants, const Check& check) {
  const bool is_root = comm.rank() == 0;
  const std::vector<std::size_t> tiles = all_tiles(pristine.layout());
  WorkingLayers<Pixel> layers(comm, pristine.layout(), std::ranges::any_of(contestants, &Contestant<Pixel>::in_place));
  Assembler assembler;
  std::uint64_t frame = 0;
  measure_in_turns(contestants.size(), settings.frames, [&](std::size_t index, bool counts) {
    comm.begin_frame(++frame);
    Contestant<Pixel>& contestant = contestants[index];
    TileLayer<Pixel>& layer = layers.of(contestant.in_place);
    copy_tiles(contestant.own_layer.tiles() > 0 ? contestant.own_layer : pristine, layer, tiles);
    const Sample sample = measure_frame(
        *contestant.comm, assembler, layer, layers.peers(),
        [&](std::span<const int> shown_by) { return contestant.composite(*contestant.comm, layer, shown_by); });
    if (counts) contestant.samples.push_back(sample);
    if (!is_root) return;
    check(layer, contestant.run);
    contestant.frame = wall_image(layer, input);
  });
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    const auto samples = gather_samples(comm, contestants[i].samples);
    if (!is_root) continue;
    CompareRun& run = contestants[i].run;
    run.ranks = comm.size();
    run.transport = comm.transport();
    run.frames = settings.frames.measured;
    summarize(samples, run);
  }
}

/// Sort-first beside the strategies: every rank has drawn tiles of its own, and nothing is composited.
class NothingToComposite final : public Compositor {
 public:
  explicit NothingToComposite(std::vector<std::size_t> drawn) : drawn_(std::move(drawn)) {}

  [[nodiscard]] std::string_view name() const override { return kSortFirst; }
  using Compositor::composite;
  Composited composite(Communicator& /*comm*/, TileLayer<Key>& /*layer*/, std::span<const std::size_t> /*tiles*/,
                       std::span<const int> /*shown_by*/) override {
    return {drawn_, false};
  }
  [[nodiscard]] std::optional<Prediction> predict(const Costs& /*costs*/, const Load& /*load*/) const override {
    return Prediction{};
  }

 private:
  std::vector<std::size_t> drawn_;
};

/// Collective. On rank 0 the largest key per pixel over all ranks' layers, from whole layers merged one after the other
/// by comparing keys: nothing of it is shared with what is tested.
std::vector<Key> serial_maximum(Communicator& comm, const TileLayer<Key>& layer) {
  const std::span<const Key> mine = layer.run({0, layer.tiles()});
  if (comm.rank() != 0) {
    comm.send(std::as_bytes(mine), 0);
    return {};
  }
  std::vector<Key> nearest(mine.begin(), mine.end());
  std::vector<Key> other(mine.size());
  for (int from = 1; from < comm.size(); ++from) {
    comm.receive(std::as_writable_bytes(std::span(other)), from);
    for (std::size_t i = 0; i < nearest.size(); ++i) {
      if (other[i] > nearest[i]) nearest[i] = other[i];
    }
  }
  return nearest;
}

std::uint64_t count_differing(const TileLayer<Key>& layer, std::span<const Key> expected) {
  std::uint64_t differing = 0;
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    const std::span<const Key> want = expected.subspan(tile * kTilePixels, kTilePixels);
    const std::span<const Key> have = layer.tile(tile);
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      // A key in a tile that is not marked active would not be shown.
      const Key shown = layer.active(tile) ? have[i] : kNoKey;
      differing += shown == want[i] ? 0U : 1U;
    }
  }
  return differing;
}

std::string frame_hash(const Image<Key>& frame, bool colors) {
  if (!colors) return hex16(xxh64(std::as_bytes(frame.pixels())));
  const Image<Rgba8> picture = frame_colors(frame, colors);
  return hex16(xxh64(std::as_bytes(picture.pixels())));
}

CompareResult compare_nearest(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  const TileLayer<Key> pristine = input.layer(comm);
  const std::vector<std::size_t> tiles = all_tiles(pristine.layout());
  const std::vector<Key> expected = serial_maximum(comm, pristine);

  std::vector<std::unique_ptr<Compositor>> compositors;
  std::vector<Contestant<Key>> contestants;
  for (const std::string& name : settings.strategies) {
    TileLayer<Key> own_layer;
    if (name == kSortFirst) {
      DrawnTiles drawn = input.sort_first(comm);
      compositors.push_back(std::make_unique<NothingToComposite>(std::move(drawn.tiles)));
      own_layer = std::move(drawn.layer);
    } else {
      compositors.push_back(make_compositor(name));
    }
    Compositor& compositor = *compositors.back();
    contestants.push_back({std::make_unique<CountingCommunicator>(comm), compositor.merges_in_place(),
                           [&](Communicator& counting, TileLayer<Key>& layer, std::span<const int> shown_by) {
                             return compositor.composite(counting, layer, tiles, shown_by);
                           },
                           std::move(own_layer)});
  }
  const Load load = share_load(comm, pristine, tiles);
  const Costs costs =
      measure_costs(comm, std::clamp<std::size_t>(tiles.size(), 1, kMaxProbeTiles)).with_packed(load.packed_fraction);

  run_contest(comm, input, settings, pristine, contestants, [&](const TileLayer<Key>& layer, CompareRun& run) {
    run.differing_pixels = std::max(run.differing_pixels, count_differing(layer, expected));
  });
  CompareResult result;
  if (comm.rank() != 0) return result;
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    CompareRun& run = result.runs.emplace_back(std::move(contestants[i].run));
    const Compositor& compositor = *compositors[i];
    run.strategy = compositor.name();
    // A rank alone sends nothing, and no speeds were measured to predict with.
    const auto prediction = costs.ranks > 1 ? compositor.predict(costs, load) : std::nullopt;
    if (prediction) run.predicted_ms = prediction->collected(costs, load) * 1e3;
    if (compositor.chosen() != run.strategy) run.chosen = compositor.chosen();
    run.frame_xxh64 = frame_hash(contestants[i].frame, input.colors);
  }
  result.frame = std::move(contestants.front().frame);
  return result;
}

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

/// front + (1 - alpha) back by its definition, without the kernel.
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

/// Compares a composited layer with the serial result, within what rounding explains.
template <typename Pixel>
void check_blended(const TileLayer<Pixel>& layer, std::span<const Pixel> expected, int ranks, CompareRun& run) {
  const double allowed = 2.0 * over_error_bound<Pixel>(ranks);  // either is rounded
  std::uint64_t differing = 0;
  double max_error = run.max_error.value_or(0.0);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const std::size_t tile = i / kTilePixels;
    // A color in a tile that is not marked active would not be shown.
    const double off = difference(layer.active(tile) ? layer.tile(tile)[i % kTilePixels] : Pixel{}, expected[i]);
    max_error = std::max(max_error, off / kOne<Pixel>);
    differing += off <= allowed ? 0U : 1U;
  }
  run.max_error = max_error;
  run.differing_pixels = std::max(run.differing_pixels, differing);
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
CompareResult compare_over(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  const TileLayer<Pixel> pristine = translucent_layer<Pixel>(input.layer(comm), comm.rank());
  const std::vector<std::size_t> tiles = all_tiles(pristine.layout());
  std::vector<int> order(static_cast<std::size_t>(comm.size()));
  std::iota(order.begin(), order.end(), 0);
  const std::vector<Pixel> expected = serial_over(comm, pristine);

  std::vector<std::unique_ptr<Blender<Pixel>>> blenders;
  std::vector<Contestant<Pixel>> contestants;
  for (const std::string& name : settings.strategies) {
    Blender<Pixel>& blender = *blenders.emplace_back(make_blender<Pixel>(name));
    contestants.push_back({std::make_unique<CountingCommunicator>(comm), blender.merges_in_place(),
                           [&](Communicator& counting, TileLayer<Pixel>& layer, std::span<const int> shown_by) {
                             return blender.blend(counting, layer, tiles, order, shown_by);
                           }});
  }
  run_contest(comm, input, settings, pristine, contestants, [&](const TileLayer<Pixel>& layer, CompareRun& run) {
    check_blended<Pixel>(layer, expected, comm.size(), run);
  });
  CompareResult result;
  if (comm.rank() != 0) return result;
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    CompareRun& run = result.runs.emplace_back(std::move(contestants[i].run));
    run.strategy = blenders[i]->name();
    run.frame_xxh64 = hex16(xxh64(std::as_bytes(contestants[i].frame.pixels())));
  }
  result.picture = shown(contestants.front().frame);
  return result;
}

}  // namespace

CompareResult compare_strategies(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  HPR_CHECK(!settings.strategies.empty() && settings.frames.measured > 0 && settings.frames.warmup >= 0);
  switch (settings.operation) {
    case CompareOperator::Nearest:
      break;
    case CompareOperator::Over8:
      return compare_over<Rgba8Premultiplied>(comm, input, settings);
    case CompareOperator::OverFloat:
      return compare_over<RgbaPremultiplied>(comm, input, settings);
  }
  return compare_nearest(comm, input, settings);
}

Image<Rgba8> frame_colors(const Image<Key>& frame, bool colors) {
  Image<Rgba8> picture(frame.size());
  std::ranges::transform(frame.pixels(), picture.pixels().begin(), [&](Key key) {
    if (key == kNoKey) return Rgba8{};
    if (colors) return from_word(key_rgba(key));
    // Neighbouring ids get unlike colours: the top bits of a multiplication by the golden ratio.
    return from_word(0xFF000000U | (key_surface(key) * 0x9E3779B1U) >> 8U);
  });
  return picture;
}

}  // namespace hpr
