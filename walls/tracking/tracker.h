#pragma once

#include <memory>

#include "walls/config/wall.h"
#include "walls/tracking/head_path.h"

namespace hpr {

/// Where a head is.
class Tracker {
 public:
  virtual ~Tracker() = default;

  /// The head at `time`, in seconds since the run began: of the recording, or of a clock. Times never fall. Never
  /// waits.
  [[nodiscard]] virtual HeadPose sample(double time) = 0;
  /// Seconds after which a recording has nothing new; 0: it is none.
  [[nodiscard]] virtual double ends_at() const { return 0.0; }
};

/// Makes the tracker of a viewer; `rest` is the head's pose before anything is known. Throws Error: Io and BadInput for
/// a recording that cannot be read, Io for a port that cannot be listened at.
[[nodiscard]] std::unique_ptr<Tracker> make_tracker(const WallTracker& tracker, const HeadPose& rest);

}  // namespace hpr
