#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cluster/transport/communicator.h"
#include "image/color.h"
#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"
#include "tools/sweep.h"

namespace hpr {

/// Tiles one rank has drawn all of.
struct DrawnTiles {
  TileLayer<Key> layer;
  std::vector<std::size_t> tiles;  ///< ascending
};

/// The name under which compare_strategies runs CompareInput::sort_first, beside the strategies' own.
inline constexpr const char* kSortFirst = "sort-first";

/// What is composited: one layer of keys per rank over a wall of equal screens.
struct CompareInput {
  std::string name;    ///< "dense", or the scene as the user wrote it
  Size screen;         ///< pixels of one screen
  Size grid{1, 1};     ///< screens of the wall, in the order of grid_layout
  bool colors = true;  ///< the keys' low words are RGBA8 (synthetic layers, local shading), not surfaces
  /// Collective: this rank's layer, laid out by grid_layout(screen, grid).
  std::function<TileLayer<Key>(Communicator&)> layer;
  /// Collective, where the input can also be drawn sort-first: the tiles that are this rank's, drawn whole.
  std::function<DrawnTiles(Communicator&)> sort_first = nullptr;
};

/// How the pixels of two layers become one.
enum class CompareOperator {
  Nearest,   ///< the larger key
  Over8,     ///< premultiplied RGBA8 `over`
  OverFloat  ///< premultiplied float RGBA `over`
};

struct CompareSettings {
  std::vector<std::string> strategies;  ///< names; each must fit the number of ranks
  Repetitions frames{2, 10};
  CompareOperator operation = CompareOperator::Nearest;
};

/// One strategy on one number of ranks.
struct CompareRun {
  std::string strategy;
  int ranks = 1;
  std::string transport;
  int frames = 0;
  Spread ms;                  ///< over frames: composite and collect on rank 0, slowest rank of each
  double ms_composite = 0.0;  ///< median of the slowest rank's
  double ms_collect = 0.0;
  std::uint64_t bytes_total = 0;     ///< sent in one frame by all ranks
  std::uint64_t bytes_max_rank = 0;  ///< by the rank that sends most
  std::uint64_t messages_total = 0;
  double imbalance = 1.0;              ///< composite: slowest rank / mean of ranks, median over frames
  std::uint64_t differing_pixels = 0;  ///< of the worst frame, against the serial result of the same layers:
                                       ///< other keys, or colours further off than rounding explains
  std::optional<double> max_error;  ///< `over`: largest difference of a channel to the serial result, 1 is full light
  std::optional<double> predicted_ms;  ///< what the strategy expected of `ms`
  std::string chosen;                  ///< the strategy at work, where `strategy` chose another
  std::string frame_xxh64;             ///< of the RGBA8 frame where keys are colours, else of the keys
};

struct CompareResult {
  std::vector<CompareRun> runs;  ///< in order of settings.strategies
  Image<Key> frame;              ///< the wall as the first strategy composited it; empty for `over`
  Image<Rgba8> picture;          ///< `over`: the first strategy's wall as it is shown on black
};

/// Collective. Composites the same layers with every strategy, frame after frame in turns so that what disturbs the
/// machine disturbs all alike, and collects each frame on rank 0, where every frame is checked key by key against a
/// maximum computed without merge kernel, codec and strategies. The result stands on rank 0; elsewhere it is empty.
///
/// For `over` the layers are made from the keys: their colours, with an alpha from a hash of pixel and rank, ranks
/// being in order of visibility. Frames are checked against blending front to back, within the bounds of
/// docs/numerics.md.
[[nodiscard]] CompareResult compare_strategies(Communicator& comm, const CompareInput& input,
                                               const CompareSettings& settings);

/// The wall in colours: those the keys carry, or where they carry surfaces one per surface. Background is 0, 0, 0, 0.
[[nodiscard]] Image<Rgba8> frame_colors(const Image<Key>& frame, bool colors);

}  // namespace hpr
