#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/compositor.h"
#include "image/color.h"
#include "image/tiles.h"

namespace hpr {

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

  /// As of the compositor that sends the same messages.
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// Whether it can run on so many ranks.
  [[nodiscard]] virtual bool fits(int ranks) const = 0;
  /// As Compositor::merges_in_place.
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

/// As make_compositor; a strategy that does not keep the order of layers is refused by name.
template <typename Pixel>
[[nodiscard]] std::unique_ptr<Blender<Pixel>> make_blender(std::string_view name);

}  // namespace hpr
