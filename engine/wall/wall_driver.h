#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/progress.h"
#include "engine/frame_maker.h"
#include "engine/frame_retry.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/wall/run_control.h"
#include "engine/wall/slow_ranks.h"
#include "engine/wall/viewpoint.h"
#include "engine/wall/wall_displays.h"
#include "engine/wall/wall_job.h"
#include "rt/show/show.h"
#include "walls/config/wall.h"
#include "walls/displays/background_display.h"
#include "walls/displays/display.h"
#include "walls/geometry/curved.h"
#include "walls/manifest/manifest.h"
#include "walls/manifest/run_journal.h"

namespace hpr {

class WallSender;

/// Drives one wall: what stays the same from frame to frame.
class WallDriver {
 public:
  /// Collective. Both outlive this.
  WallDriver(const WallJob& job, Session& session);
  ~WallDriver();
  WallDriver(const WallDriver&) = delete;
  WallDriver& operator=(const WallDriver&) = delete;

  [[nodiscard]] const FramePlan& plan() const { return frames_->plan(); }
  /// The last frame's screens are the pictures of screen_eyes().
  [[nodiscard]] FrameMaker& frames() { return *frames_; }
  /// One line per decision, with its reason.
  [[nodiscard]] std::vector<std::string> explained() const;
  [[nodiscard]] const RunManifest& manifest() const { return manifest_; }
  /// How radiance became the colours of the last frame.
  [[nodiscard]] const DisplayTransform& transform() const { return showing_.transform; }
  [[nodiscard]] const FrameTimes& times() const { return frames_->times(); }
  [[nodiscard]] const FrameCost& last_cost() const { return last_cost_; }
  [[nodiscard]] std::optional<double> relmse() const { return frames_->relmse(); }
  /// On rank 0: what the screens show, as far as displays outside the job have reported it.
  [[nodiscard]] std::vector<ScreenState> states() const;

  /// The frame to begin with: past 0 where an earlier job of this run was lost or stopped.
  [[nodiscard]] std::uint64_t first_frame() const { return first_frame_; }
  /// Collective. Runs the commands that arrived since the last frame; false when one of them ended the run.
  [[nodiscard]] bool apply_commands();

  /// Collective. Draws one frame and shows each screen on the rank it belongs to. `progress` shows its samples. A frame
  /// that fails is drawn once more (draw_with_retry); where that fails too, the screens show their last pictures again
  /// and the frame counts as failed. Throws its error where this is the job's first frame, or kMaxFailedInARow failed.
  /// False where a sample of a resting picture was dropped, as a viewer, a command or a signal came: there is no frame.
  [[nodiscard]] bool draw(std::uint64_t number, Progress& progress);
  static constexpr int kMaxFailedInARow = 10;
  /// Of the run: earlier jobs' too.
  [[nodiscard]] const FailedFrames& failed() const { return failed_; }

  /// Collective. Moves the camera by the input of viewers on all ranks since the last call; a camera on a path stays on
  /// it. False once one of them, or a signal, ended the run.
  [[nodiscard]] bool follow_viewers();
  /// Whether a signal ended the run.
  [[nodiscard]] bool interrupted() const { return interrupted_; }
  /// On rank 0: the run ends before its last frame, and its manifest records it.
  void note_stop(int frames) { manifest_.stopped_of = frames; }
  /// Collective. Whether the next frame would be the last one again.
  [[nodiscard]] bool settled();
  /// Collective. After the last frame. False: displays outside the job were meant to show it, and none ever did.
  [[nodiscard]] bool finish();

  /// Collective. All screens' pictures of the last frame, on rank 0.
  [[nodiscard]] std::vector<Image<Rgba8>> collect_pictures();

 private:
  void start_frames();
  [[nodiscard]] std::vector<View> screens_in(std::uint64_t frame, std::span<const HeadPose> heads) const;
  [[nodiscard]] bool shows_any() const;
  void plan_frames();
  void take_over();
  void replay(const std::string& lines);
  void resume(std::vector<std::string>& frames);
  [[nodiscard]] std::string status() const;
  void show(std::uint64_t number);
  void wait_until_shown();
  [[nodiscard]] bool make_pictures(const std::vector<View>& views, std::uint64_t number, Progress& progress);
  [[nodiscard]] bool take_news();
  void apply_keys(const ViewKeys& keys);
  void change_setting(const std::string& name, const std::string& value);
  void record(std::uint64_t number, const std::optional<Error>& failure);
  void warn_of_slow_ranks(std::span<const RankWork> works);
  [[nodiscard]] std::vector<ScreenRecord> record_screens(bool of_new_frame);
  void finish_record(FrameRecord& frame);
  [[nodiscard]] std::string strategy() const;

  const WallJob& job_;
  const Wall& wall_;
  Session& session_;
  WallHeads heads_;
  WallMonitors monitors_;
  RenderSettings settings_;  ///< as changed while it runs; see WallJob::settings
  Camera start_;             ///< of the orbit, with that angle of view
  double fov_degrees_;
  OrbitCamera orbit_;  ///< where there is no path
  RunControl control_;
  std::vector<std::string> hosts_;  ///< per rank
  std::vector<int> owners_;         ///< per screen the rank that shows it
  Showing showing_;                 ///< of the pictures of screen_eyes()
  DisplaySettings display_settings_;
  SmoothExposure exposure_;  ///< of the frames that were shown
  std::optional<CurvedScreens> curved_;
  std::optional<FrameMaker> frames_;
  std::unique_ptr<Display> display_;
  std::optional<BackgroundDisplay> background_;  ///< of display_, where shows_while_drawing_
  std::unique_ptr<WallSender> remote_;           ///< in place of a display, to those outside the job
  std::shared_ptr<WallPictures> pictures_;       ///< null before the first frame
  RunManifest manifest_;
  FrameCost last_cost_;
  double shown_ms_ = 0.0;          ///< of the last frame that this rank has shown, until it had
  bool shows_while_drawing_;       ///< a frame is shown while the next one is drawn; its record follows once it is
  std::vector<ScreenCost> costs_;  ///< of the last frame that was shown
  std::size_t journaled_ = 0;      ///< frames that the journal had when this job began
  double slowest_ms_ = 0.0;        ///< of the frames since something was changed
  VerifyCounts verified_;          ///< in the last frame, all its attempts
  FailedFrames failed_;
  SlowRankWatch slow_ranks_;           ///< on rank 0
  std::optional<RunJournal> journal_;  ///< on rank 0 of a job that is started again when it is lost
  std::uint64_t first_frame_ = 0;
  bool interrupted_ = false;
  /// What came on this rank since the ranks last looked.
  struct News {
    DisplayInput input;
    bool interrupt = false;
  };
  News news_;
  bool shows_again_ = false;  ///< the last frame, whose exposure or tone was changed
  Show show_before_wireframe_ = Show::Shaded;
};

/// Collective, after the last frame. Rank 0 writes the files; all ranks throw Error (Io) where it cannot.
void write_layers(const WallLayerFiles& files, std::span<const Aov> aovs, WallDriver& driver, Session& session);

}  // namespace hpr
