#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cluster/communicator.h"
#include "image/key.h"
#include "image/tiles.h"

namespace hpr {

/// Combines one layer of keys per rank into one frame: sort-last, the nearest surface wins.
///
/// The result of a pixel is the largest key any rank has there. That maximum does not depend on the order of merging,
/// so every compositor returns the same bits for the same layers.
class Compositor {
 public:
  virtual ~Compositor() = default;

  /// The name used on the command line and in reports.
  [[nodiscard]] virtual std::string_view name() const = 0;

  /// Whether it can run on so many ranks.
  [[nodiscard]] virtual bool fits(int ranks) const { return ranks >= 1; }

  /// Collective: every rank of `comm` calls it with layers of one layout and the same ascending list `tiles` of tiles
  /// of the frame, which take part; other tiles are left alone. Returns the positions in `tiles` this rank ends up
  /// owning: only those tiles of `layer` hold the result, the other listed ones are scratch (and still zero where
  /// inactive). The runs of all ranks partition [0, tiles.size()). Bringing them onto a screen is assemble's business.
  virtual TileRun composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles) const = 0;
};

/// One of every strategy, in the order reports list them.
[[nodiscard]] std::vector<std::unique_ptr<Compositor>> all_compositors();

/// Throws Error (Usage) with the choices and the nearest one when there is no strategy of that name.
[[nodiscard]] std::unique_ptr<Compositor> make_compositor(std::string_view name);

}  // namespace hpr
