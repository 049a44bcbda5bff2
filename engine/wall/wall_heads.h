#pragma once

#include <memory>
#include <vector>

#include "cluster/transport/communicator.h"
#include "core/timing.h"
#include "walls/config/wall.h"
#include "walls/manifest/manifest.h"
#include "walls/tracking/head_path.h"
#include "walls/tracking/tracker.h"

namespace hpr {

/// Where the viewers' heads are from frame to frame: rank 0 asks their trackers and tells the others.
class WallHeads {
 public:
  /// Collective. Both outlive this.
  WallHeads(const Wall& wall, Communicator& comm);

  /// Collective. One pose per viewer, for frame `number`: recordings are asked for frame after frame at their own rate,
  /// so that a run is the same however long its frames take; what is live is asked for now.
  [[nodiscard]] std::vector<HeadPose> at(std::uint64_t number);

  /// Whether later frames have other poses because recordings go on after frame `number`.
  [[nodiscard]] bool plays_on(std::uint64_t number) const;

  /// Of at()'s last answer, those who are tracked.
  [[nodiscard]] std::vector<HeadRecord> report() const;

 private:
  const Wall& wall_;
  Communicator& comm_;
  Stopwatch since_start_;
  std::vector<std::unique_ptr<Tracker>> trackers_;  ///< per viewer, on rank 0
  std::vector<HeadPose> heads_;
  bool any_tracked_ = false;
  double recorded_frames_ = 0.0;  ///< until the longest recording has ended
};

}  // namespace hpr
