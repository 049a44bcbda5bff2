#include "tools/compare/compare.h"

#include <algorithm>
#include <memory>

#include "compositing/compositor.h"
#include "core/bytes.h"
#include "core/error.h"
#include "tools/compare/compare_measure.h"
#include "tools/compare/compare_over.h"

namespace hpr {
namespace {

/// Most tiles a rank merges while speeds are measured: as many as a frame has, so that they leave the cache as it does.
constexpr std::size_t kMostProbeTiles = 512;

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

  [[nodiscard]] const TileLayer<Key>& start(const TileLayer<Key>& of_all) const {
    return own_layer.tiles() > 0 ? own_layer : of_all;
  }
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

/// Rank 0, after each frame: how many pixels are wrong, and the frame itself.
void inspect(const TileLayer<Key>& layer, std::span<const Key> expected, const CompareInput& input,
             Contestant& contestant) {
  contestant.differing_pixels = std::max(contestant.differing_pixels, count_differing(layer, expected));
  contestant.frame = wall_image(layer, input);
}

std::string frame_hash(const Image<Key>& frame, bool colors) {
  if (!colors) return hex16(xxh64(std::as_bytes(frame.pixels())));
  const Image<Rgba8> picture = frame_colors(frame, colors);
  return hex16(xxh64(std::as_bytes(picture.pixels())));
}

/// Collective.
std::vector<Contestant> line_up(Communicator& comm, const CompareInput& input, std::span<const std::string> names) {
  std::vector<Contestant> contestants;
  contestants.reserve(names.size());
  for (const std::string& name : names) {
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
  return contestants;
}

/// Rank 0's: all but what the frames took and who took part.
CompareRun outcome_of(const Contestant& contestant, const Costs& costs, const Load& load, bool colors) {
  CompareRun run;
  run.strategy = contestant.compositor->name();
  run.differing_pixels = contestant.differing_pixels;
  // A rank alone sends nothing, and no speeds were measured to predict with.
  const auto prediction = costs.ranks > 1 ? contestant.compositor->predict(costs, load) : std::nullopt;
  if (prediction) run.predicted_ms = prediction->collected(costs, load) * 1e3;
  if (contestant.compositor->chosen() != run.strategy) run.chosen = contestant.compositor->chosen();
  run.frame_xxh64 = frame_hash(contestant.frame, colors);
  return run;
}

}  // namespace

CompareResult compare_strategies(Communicator& comm, const CompareInput& input, const CompareSettings& settings) {
  HPR_CHECK(!settings.strategies.empty() && settings.frames > 0 && settings.warmup >= 0);
  if (settings.operation != CompareOperator::Nearest) return compare_blenders(comm, input, settings);
  const TileLayer<Key> pristine = input.layer(comm);
  const std::vector<std::size_t> tiles = all_tiles(pristine.layout());
  const std::vector<Key> expected = serial_maximum(comm, pristine);
  const bool is_root = comm.rank() == 0;

  std::vector<Contestant> contestants = line_up(comm, input, settings.strategies);
  const bool in_place = std::ranges::any_of(
      contestants, [](const Contestant& contestant) { return contestant.compositor->merges_in_place(); });
  WorkingLayers<Key> layers(comm, pristine.layout(), in_place);
  Assembler assembler;
  const Load load = share_load(comm, pristine, tiles);
  const Costs costs =
      measure_costs(comm, std::clamp<std::size_t>(tiles.size(), 1, kMostProbeTiles)).with_packed(load.packed_fraction);

  for (int frame = -settings.warmup; frame < settings.frames; ++frame) {
    for (Contestant& contestant : contestants) {
      Compositor& compositor = *contestant.compositor;
      TileLayer<Key>& layer = layers.of(compositor.merges_in_place());
      copy_tiles(contestant.start(pristine), layer, tiles);
      const Sample sample =
          measure_frame(*contestant.comm, assembler, layer, layers.peers(), [&](std::span<const int> shown_by) {
            return compositor.composite(*contestant.comm, layer, tiles, shown_by);
          });
      if (frame >= 0) contestant.samples.push_back(sample);
      if (is_root) inspect(layer, expected, input, contestant);
    }
  }

  CompareResult result;
  for (Contestant& contestant : contestants) {
    const auto samples = gather_samples(comm, contestant.samples);
    if (!is_root) continue;
    CompareRun& run = result.runs.emplace_back(outcome_of(contestant, costs, load, input.colors));
    run.ranks = comm.size();
    run.transport = comm.transport();
    run.frames = settings.frames;
    summarize(samples, run);
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
