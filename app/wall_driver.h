#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "app/camera_path.h"
#include "app/frame_maker.h"
#include "app/output.h"
#include "app/progress.h"
#include "app/screens.h"
#include "app/session.h"
#include "app/wall_run.h"
#include "walls/display.h"
#include "walls/manifest.h"
#include "walls/wall.h"

namespace hpr {

class WallSender;

/// As the run's options say, until its target error where there is one.
[[nodiscard]] Sampling sampling_of(const WallRun& run);

/// Drives one wall: what stays the same from frame to frame.
class WallDriver {
 public:
  /// Collective. All outlive this.
  WallDriver(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals,
             Session& session);
  ~WallDriver();
  WallDriver(const WallDriver&) = delete;
  WallDriver& operator=(const WallDriver&) = delete;

  [[nodiscard]] const FramePlan& plan() const { return frames_.plan(); }
  [[nodiscard]] const RunManifest& manifest() const { return manifest_; }
  [[nodiscard]] const FrameTimes& times() const { return frames_.times(); }
  [[nodiscard]] const FrameCost& last_cost() const { return last_cost_; }
  [[nodiscard]] std::optional<double> relmse() const { return frames_.relmse(); }

  /// Collective. Draws one frame and shows each screen on the rank it belongs to. `progress` is told of samples.
  void draw(std::uint64_t number, Progress& progress);

  /// Collective. After the last frame. False: displays outside the job were meant to show it, and none ever did.
  [[nodiscard]] bool finish();

  /// Collective. All screens' pictures of the last frame, on rank 0.
  [[nodiscard]] std::vector<Image<Rgba8>> collect_pictures();

 private:
  [[nodiscard]] std::vector<View> screens_in(std::uint64_t frame) const;
  [[nodiscard]] bool shows_any() const;
  void show(std::uint64_t number);
  void record(std::uint64_t number);
  [[nodiscard]] std::string strategy() const;

  const WallRun& run_;
  const Wall& wall_;
  Session& session_;
  std::optional<CameraPath> path_;
  FrameMaker frames_;
  Showing showing_;
  std::unique_ptr<Display> display_;
  std::unique_ptr<WallSender> remote_;  ///< in place of a display, to those outside the job
  std::vector<Image<Rgba8>> pictures_;  ///< per screen; empty where another rank shows it
  RunManifest manifest_;
  FrameCost last_cost_;
};

}  // namespace hpr
