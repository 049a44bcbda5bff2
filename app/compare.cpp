#include "app/compare.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>

#include "cluster/collectives.h"
#include "cluster/counting_communicator.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "core/check.h"
#include "core/hash.h"

namespace hpr {
namespace {

/// Most tiles a rank merges while speeds are measured: as many as a frame has, so that they leave the cache as it does.
constexpr std::size_t kMostProbeTiles = 512;

/// What one rank measured in one frame.
struct Sample {
  double composite_ms = 0.0;
  double collect_ms = 0.0;
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
};

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

/// One strategy under comparison on this rank.
struct Contestant {
  std::unique_ptr<CountingCommunicator> comm;
  std::unique_ptr<Compositor> compositor;
  std::vector<Sample> samples;         ///< per measured frame
  std::uint64_t differing_pixels = 0;  ///< rank 0: of the worst frame
  Image<Key> frame;                    ///< rank 0: the last one
  TileLayer<Key> own_layer;            ///< what it starts from where that is not the layer of all strategies
};

/// Makes `layer` equal to `pristine` again, in the memory it has.
void restore(TileLayer<Key>& layer, const TileLayer<Key>& pristine) {
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    if (!pristine.active(tile)) {
      layer.clear(tile);
      continue;
    }
    std::ranges::copy(pristine.tile(tile), layer.tile(tile).begin());
    layer.set_active(tile);
  }
}

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

Image<Key> wall_image(const TileLayer<Key>& layer, const CompareInput& input) {
  const Size screen = input.screen;
  Image<Key> wall(Size{screen.width * input.grid.width, screen.height * input.grid.height});
  for (std::size_t i = 0; i < layer.layout().screens(); ++i) {
    const Image<Key> part = to_image(layer, i);
    const int left = static_cast<int>(i) % input.grid.width * screen.width;
    const int top = static_cast<int>(i) / input.grid.width * screen.height;
    for (int y = 0; y < screen.height; ++y) std::ranges::copy(part.row(y), wall.row(top + y).begin() + left);
  }
  return wall;
}

/// Rank 0, after each frame: how many pixels are wrong, and the frame itself.
void inspect(const TileLayer<Key>& layer, std::span<const Key> expected, const CompareInput& input,
             Contestant& contestant) {
  contestant.differing_pixels = std::max(contestant.differing_pixels, count_differing(layer, expected));
  contestant.frame = wall_image(layer, input);
}

/// The memory frames are composited in: one where ranks of one host can merge in place, for the strategies that do so,
/// and one of this rank's own, which messages leave faster (it has large pages).
class WorkingLayers {
 public:
  /// Collective.
  WorkingLayers(Communicator& comm, const FrameLayout& layout, const std::vector<Contestant>& contestants)
      : own_(layout) {
    const bool in_place = std::ranges::any_of(
        contestants, [](const Contestant& contestant) { return contestant.compositor->merges_in_place(); });
    if (in_place) shared_ = TileLayer<Key>(layout, comm.share(TileLayer<Key>::bytes_for(layout)));
  }

  [[nodiscard]] TileLayer<Key>& of(const Compositor& compositor) {
    return compositor.merges_in_place() ? shared_ : own_;
  }
  /// For meetings; null where no strategy merges in place.
  [[nodiscard]] PeerMemory* peers() const { return shared_.peers(); }

 private:
  TileLayer<Key> own_;
  TileLayer<Key> shared_;
};

/// Collective. Where all ranks are on one host they wait asleep, so that those that come late find a core.
void wait_for_all(Communicator& comm, PeerMemory* peers) {
  bool one_host = peers != nullptr;
  for (int rank = 0; one_host && rank < comm.size(); ++rank) one_host = !peers->of(rank).empty();
  if (one_host) {
    peers->meet();
  } else {
    barrier(comm);
  }
}

/// Collective: one frame of one strategy, from the ranks' layers to the whole frame on rank 0.
Sample one_frame(Contestant& contestant, Assembler& assembler, WorkingLayers& layers,
                 std::span<const std::size_t> tiles) {
  TileLayer<Key>& layer = layers.of(*contestant.compositor);
  const std::vector<int> shown_by(layer.layout().screens(), 0);
  CountingCommunicator& comm = *contestant.comm;
  wait_for_all(comm, layers.peers());
  const std::size_t bytes_before = comm.bytes_sent();
  const std::size_t messages_before = comm.messages_sent();
  const double start = comm.seconds();
  const Composited mine = contestant.compositor->composite(comm, layer, tiles, shown_by);
  const double composited = comm.seconds();
  if (!mine.assembled) assembler.assemble(comm, layer, mine.tiles, shown_by);
  const Sample sample{(composited - start) * 1e3, (comm.seconds() - composited) * 1e3, comm.bytes_sent() - bytes_before,
                      comm.messages_sent() - messages_before};
  wait_for_all(comm, layers.peers());  // ranks that are done must not take the cores of those that are still timed
  return sample;
}

/// `ranks`: per rank its samples, one per frame.
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
  run.ms_composite = spread_of(composite).median;
  run.ms_collect = spread_of(collect).median;
  run.imbalance = spread_of(imbalance).median;
  // Every frame sends the same.
  for (const auto& samples : ranks) {
    run.bytes_total += samples.back().bytes;
    run.bytes_max_rank = std::max(run.bytes_max_rank, samples.back().bytes);
    run.messages_total += samples.back().messages;
  }
}

/// Collective: every rank's samples on rank 0.
std::vector<std::vector<Sample>> gather_samples(Communicator& comm, const std::vector<Sample>& samples) {
  std::vector<std::vector<Sample>> all;
  for (const auto& bytes : gather(comm, std::as_bytes(std::span(samples)))) {
    all.emplace_back(bytes.size() / sizeof(Sample));
    std::memcpy(all.back().data(), bytes.data(), bytes.size());
  }
  return all;
}

std::string frame_hash(const Image<Key>& frame, bool colors) {
  if (!colors) return hex16(xxh64(std::as_bytes(frame.pixels())));
  const Image<Rgba8> picture = frame_colors(frame, colors);
  return hex16(xxh64(std::as_bytes(picture.pixels())));
}

}  // namespace

Spread spread_of(std::vector<double> values) {
  HPR_CHECK(!values.empty());
  std::ranges::sort(values);
  const std::size_t count = values.size();
  const double median = (values[(count - 1) / 2] + values[count / 2]) / 2.0;
  const auto nearest_rank = static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(count)));
  return {values.front(), median, values[nearest_rank - 1], values.back()};
}

CompareResult compare_strategies(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  HPR_CHECK(!settings.strategies.empty() && settings.frames > 0 && settings.warmup >= 0);
  const TileLayer<Key> pristine = input.layer(comm);
  std::vector<std::size_t> tiles(pristine.tiles());
  std::iota(tiles.begin(), tiles.end(), std::size_t{0});
  const std::vector<Key> expected = serial_maximum(comm, pristine);
  const bool is_root = comm.rank() == 0;

  std::vector<Contestant> contestants;
  for (const std::string& name : settings.strategies) {
    Contestant& contestant = contestants.emplace_back();
    contestant.comm = std::make_unique<CountingCommunicator>(comm);
    if (name == kSortFirst) {
      DrawnTiles drawn = input.sort_first(comm);
      contestant.compositor = std::make_unique<NothingToComposite>(std::move(drawn.tiles));
      contestant.own_layer = std::move(drawn.layer);
    } else {
      contestant.compositor = make_compositor(name);
    }
  }
  WorkingLayers layers(comm, pristine.layout(), contestants);
  Assembler assembler;
  const Load load = share_load(comm, pristine, tiles);
  const Costs costs =
      measure_costs(comm, std::clamp<std::size_t>(tiles.size(), 1, kMostProbeTiles)).with_packed(load.packed_share);

  for (int frame = -settings.warmup; frame < settings.frames; ++frame) {
    for (Contestant& contestant : contestants) {
      TileLayer<Key>& layer = layers.of(*contestant.compositor);
      restore(layer, contestant.own_layer.tiles() > 0 ? contestant.own_layer : pristine);
      const Sample sample = one_frame(contestant, assembler, layers, tiles);
      if (frame >= 0) contestant.samples.push_back(sample);
      if (is_root) inspect(layer, expected, input, contestant);
    }
  }

  CompareResult result;
  for (Contestant& contestant : contestants) {
    const auto samples = gather_samples(comm, contestant.samples);
    if (!is_root) continue;
    CompareRun run;
    run.strategy = contestant.compositor->name();
    run.ranks = comm.size();
    run.transport = comm.transport();
    run.frames = settings.frames;
    summarize(samples, run);
    run.differing_pixels = contestant.differing_pixels;
    if (const auto prediction = contestant.compositor->predict(costs, load)) {
      run.predicted_ms = prediction->collected(costs, load) * 1e3;
    }
    if (contestant.compositor->chosen() != run.strategy) run.chosen = contestant.compositor->chosen();
    run.frame_xxh64 = frame_hash(contestant.frame, input.colors);
    result.runs.push_back(std::move(run));
  }
  if (is_root) result.frame = std::move(contestants.front().frame);
  return result;
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
