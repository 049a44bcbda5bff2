#pragma once

#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/drawing/assemble.h"

namespace hpr {

/// The operators' monitors of a wall, made of the screens' pictures where those are: only what a monitor shows of them
/// is sent.
class WallMonitors {
 public:
  /// `wall` must outlive this.
  explicit WallMonitors(const Wall& wall);

  [[nodiscard]] bool any() const { return !layouts_.empty(); }

  /// Collective. One picture per monitor, on rank 0; empty elsewhere. `pictures`: per screen, on the rank `shown_by`
  /// says.
  [[nodiscard]] std::vector<Image<Rgba8>> draw(Communicator& comm, std::span<const Image<Rgba8>> pictures,
                                               std::span<const int> shown_by) const;

 private:
  const Wall& wall_;
  std::vector<MonitorLayout> layouts_;
};

}  // namespace hpr
