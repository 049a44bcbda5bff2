#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/model/cost_model.h"
#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"

namespace hpr {

/// What compositing leaves a rank with.
struct Composited {
  std::vector<std::size_t> tiles;  ///< the frame's tiles it owns, ascending
  /// Whether every tile is owned by the rank that shows it, so that nothing is left to assemble; equal on all ranks.
  bool assembled = false;
};

/// Combines one layer of keys per rank into one frame: sort-last, the nearest surface wins.
///
/// The result of a pixel is the largest key any rank has there. That maximum does not depend on the order of merging,
/// so every compositor returns the same bits for the same layers.
///
/// A compositor keeps scratch memory from frame to frame and belongs to one rank.
class Compositor {
 public:
  virtual ~Compositor() = default;

  /// The name used on the command line and in reports.
  [[nodiscard]] virtual std::string_view name() const = 0;

  /// Whether it can run on so many ranks.
  [[nodiscard]] virtual bool fits(int ranks) const { return ranks >= 1; }

  /// Whether it merges layers that live in the memory of a communicator's share() where they lie. All ranks' layers
  /// live there then, or none.
  [[nodiscard]] virtual bool merges_in_place() const { return false; }

  /// What it expects to take (cost_model.h); nothing when it cannot say.
  [[nodiscard]] virtual std::optional<Prediction> predict(const Costs& costs, const Load& load) const {
    (void)costs;
    (void)load;
    return std::nullopt;
  }

  /// The strategy at work: another one's name when it chooses among them.
  [[nodiscard]] virtual std::string_view chosen() const { return name(); }

  /// Collective: every rank of `comm` calls it with layers of one layout and the same ascending list `tiles` of tiles
  /// of the frame, which take part; other tiles are left alone. The tiles all ranks end up owning partition the list:
  /// only those of `layer` hold the result, the other listed ones are scratch (and still zero where inactive).
  ///
  /// `shown_by`: per screen the rank that shows it, the same on all ranks; empty where nobody does. A strategy may put
  /// tiles straight where they are shown; else bringing them there is assemble's business.
  [[nodiscard]] virtual Composited composite(Communicator& comm, TileLayer<Key>& layer,
                                             std::span<const std::size_t> tiles, std::span<const int> shown_by) = 0;

  /// Collective: composites and leaves every tile on the rank where that costs least.
  [[nodiscard]] Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles) {
    return composite(comm, layer, tiles, {});
  }
};

/// The part of a list of tiles a run names.
[[nodiscard]] inline std::span<const std::size_t> part_of(std::span<const std::size_t> tiles, TileRun run) {
  return tiles.subspan(run.first, run.count);
}
/// A run of a list of tiles, to be owned.
[[nodiscard]] inline Composited owning(std::span<const std::size_t> tiles, TileRun run) {
  const auto part = part_of(tiles, run);
  return {{part.begin(), part.end()}, false};
}

using MakeCompositor = std::function<std::unique_ptr<Compositor>()>;

/// Adds a strategy to those all_compositors and make_compositor know: before ranks start. Throws Error (BadInput) when
/// its name is taken, empty, or holds a comma, a colon or a space, which lists of strategies are written with.
void register_compositor(MakeCompositor make);

/// One of every strategy, in the order reports list them; registered ones are the last.
[[nodiscard]] std::vector<std::unique_ptr<Compositor>> all_compositors();

/// Whether make_compositor knows a strategy of this name; parameters after a colon are not checked.
[[nodiscard]] bool has_compositor(std::string_view name);

/// `name` may carry what a strategy is to be set to after a colon: "radix-k:4,2". Throws Error (Usage) with the choices
/// and the nearest one when there is no strategy of that name.
[[nodiscard]] std::unique_ptr<Compositor> make_compositor(std::string_view name);

/// The name of the strategy that predicts the least time; strategies that choose among others are left out. `collects`:
/// to have the frame on one rank. `in_place`: layers live where strategies that merge in place can do so.
[[nodiscard]] std::string cheapest_compositor(const Costs& costs, const Load& load, bool collects, bool in_place);

/// Combines one translucent layer per rank into one frame: `over`, in a given order of visibility. Pixel is
/// Rgba8Premultiplied or RgbaPremultiplied.
///
/// `over` is associative but not commutative: a strategy merges only what is next to each other in the order, by the
/// same messages as the compositor of its name. Rounding depends on how the strategy associates (docs/numerics.md has
/// the bounds), and on nothing else: not on arrival, host, transport or what is packed. `serial`, `direct-send` and, on
/// one host, `shared-memory` blend front to back, ((a over b) over c) over ..., and so give the same bits.
///
/// A blender keeps scratch memory from frame to frame and belongs to one rank.
template <typename Pixel>
class Blender {
 public:
  virtual ~Blender() = default;

  /// The name, equal to that of the compositor that sends the same messages.
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// Whether it can run on so many ranks.
  [[nodiscard]] virtual bool fits(int ranks) const = 0;
  /// Whether it merges where layers lie: see Compositor::merges_in_place.
  [[nodiscard]] virtual bool merges_in_place() const = 0;

  /// Collective, with layers, `tiles` and `shown_by` as for Compositor::composite. `order`: the ranks from the
  /// frontmost to the last, the same on all ranks; it may change from frame to frame. Throws Error (Internal) when it
  /// does not name every rank once.
  ///
  /// Strategies that leave the frame with one rank leave it with the frontmost.
  [[nodiscard]] virtual Composited blend(Communicator& comm, TileLayer<Pixel>& layer,
                                         std::span<const std::size_t> tiles, std::span<const int> order,
                                         std::span<const int> shown_by) = 0;
};

/// One of every strategy that keeps an order, in the order reports list them.
template <typename Pixel>
[[nodiscard]] std::vector<std::unique_ptr<Blender<Pixel>>> all_blenders();

/// Makes the blender of a strategy, by a name as make_compositor takes it. Throws Error (Usage) for a strategy that
/// does not keep the order of layers.
template <typename Pixel>
[[nodiscard]] std::unique_ptr<Blender<Pixel>> make_blender(std::string_view name);

}  // namespace hpr
