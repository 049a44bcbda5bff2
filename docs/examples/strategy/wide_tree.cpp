#include <algorithm>
#include <vector>

#include "compositing/compositor.h"
#include "compositing/plugin.h"
#include "compositing/tile_codec.h"

namespace {

/// A tree whose nodes have up to three children: in each round groups of four ranks hand their layers to the first of
/// them. Half as many rounds as in a binary tree, in which the receivers have three times as much to merge.
///
/// Cost: ceil(log4 P) rounds; every rank but 0 sends its layer of N keys once.
class WideTree final : public hpr::Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "wide-tree"; }

  using hpr::Compositor::composite;
  hpr::Composited composite(hpr::Communicator& comm, hpr::TileLayer<hpr::Key>& layer,
                            std::span<const std::size_t> tiles, std::span<const int> /*shown_by*/) override {
    for (int step = 1; step < comm.size(); step *= kWidth) {
      const int first = comm.rank() / (step * kWidth) * (step * kWidth);
      if (comm.rank() != first) {
        message_.send(comm, layer, tiles, first);
        return {};
      }
      std::vector<int> children;
      for (int child = first + step; child < std::min(first + step * kWidth, comm.size()); child += step) {
        children.push_back(child);
      }
      // Whichever layer comes first is merged while the others are under way.
      comm.exchange({}, children, [&](int from, std::span<const std::byte> message) {
        reader_.merge(comm, from, message, layer, tiles);
      });
    }
    return hpr::owning(tiles, {0, tiles.size()});
  }

 private:
  static constexpr int kWidth = 4;

  hpr::TileMessage message_;  // both keep their memory from frame to frame
  hpr::TileReader reader_;
};

}  // namespace

HPR_COMPOSITOR_PLUGIN(WideTree)
