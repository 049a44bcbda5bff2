#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "cluster/transport/communicator.h"
#include "compositing/activity.h"
#include "image/key.h"
#include "image/tiles.h"

/// What compositing costs before it is done: a machine's speeds and a frame's load, from which every strategy predicts
/// its own time (Compositor::predict). Times are seconds.
namespace hpr {

/// How fast these ranks are on their hosts, oversubscribed as they may be.
struct Costs {
  int ranks = 1;
  int hosts = 1;              ///< that share memory each
  double message = 0.0;       ///< one small message in flight while every rank has one
  double pull_byte = 0.0;     ///< a byte sent, received and merged by one rank while the others wait
  double swap_byte = 0.0;     ///< the same per byte of each rank, while all ranks send and receive at once
  double collect_byte = 0.0;  ///< a byte sent to and received by one rank, not merged
  double packing_byte = 0.0;  ///< what a byte of packed tiles takes more than one of whole tiles
  double reduce_byte = 0.0;   ///< of the communicator's own reduction, per byte of the frame
  double meet = 0.0;          ///< a meeting of the ranks of a host
  /// A byte merged in place by the ranks of a host together; none where memory is not shared.
  std::optional<double> read_byte = {};

  /// The costs for layers of which `fraction` of the tiles is packed.
  [[nodiscard]] Costs with_packed(double fraction) const;

  /// A byte sent, received and merged by each of `receivers` ranks at once: between pull_byte and swap_byte.
  [[nodiscard]] double byte(double receivers) const;
};

/// Collective: measures what this communicator can do with layers of `tiles` tiles, in a few dozen messages. The same
/// on every rank.
[[nodiscard]] Costs measure_costs(Communicator& comm, std::size_t tiles = 64);

/// What a frame's layers hold, in bytes as they travel. The same on every rank.
struct Load {
  int ranks = 1;
  double frame = 0.0;            ///< all tiles of the list, whole
  double mean_layer = 0.0;       ///< of a rank's layer, as it travels
  double packed_fraction = 0.0;  ///< of those bytes
  double drawn_tiles = 0.0;      ///< of all ranks' active tiles, whole
  double area = 0.0;             ///< tiles any rank has drawn into, whole

  /// What is drawn after so many layers were merged, if they cover the area independently of each other.
  [[nodiscard]] double merged(double layers) const;
};

/// Collective: 2 ceil(log2 P) messages, of a bit per tile and 16 bytes per rank.
[[nodiscard]] Load share_load(Communicator& comm, const TileLayer<Key>& layer, std::span<const std::size_t> tiles);

/// What a strategy expects.
struct Prediction {
  double composite = 0.0;
  bool spread = true;  ///< pieces end up on all ranks, else the frame on one

  /// The time until the whole frame is on one rank.
  [[nodiscard]] double collected(const Costs& costs, const Load& load) const;
};

/// The messages that share activity before pieces are cut, and ceil(log2 ranks) itself.
[[nodiscard]] double sharing_cost(const Costs& costs);
[[nodiscard]] int rounds_of(int ranks);

/// Swap rounds with these factors over all ranks, without sharing_cost.
[[nodiscard]] double swap_rounds_cost(const Costs& costs, const Load& load, std::span<const int> factors,
                                      double layers_before = 1.0, double part = 1.0);

}  // namespace hpr
