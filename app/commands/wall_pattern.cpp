#include <chrono>
#include <numeric>
#include <optional>
#include <span>
#include <thread>

#include "app/command.h"
#include "app/commands/wall_run.h"
#include "app/options/display_options.h"
#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "core/signals.h"
#include "engine/wall/wall_displays.h"
#include "walls/config/wall_file.h"
#include "walls/drawing/pattern.h"
#include "walls/link/hosts.h"
#include "walls/link/sender.h"

namespace hpr {
namespace {

/// Shows the patterns of all screens, by a display of this process or those of other hosts.
class PatternShow {
 public:
  PatternShow(const Wall& wall, std::span<const std::size_t> screens, Communicator& comm, const DisplayFlags& flags,
              const std::optional<SenderSettings>& link, const Globals& globals)
      : comm_(comm) {
    for (const std::size_t screen : screens) patterns_.push_back(wall_pattern(wall, screen));
    for (std::size_t i = 0; i < screens.size(); ++i) pictures_.push_back({screens[i], patterns_[i]});
    if (link) {
      fail_on_ = link->fail_on;
      sender_ = connect_displays(comm, wall, std::vector<int>(wall.screens.size(), 0), *link);
      return;
    }
    DisplayOptions options = flags.options(globals);
    options.screens.emplace(screens.begin(), screens.end());
    display_ = flags.kind().make(wall, options);
  }

  /// False once somebody closed what shows them.
  [[nodiscard]] bool show(std::uint64_t frame, bool counts) {
    if (counts) {
      for (Image<Rgba8>& pattern : patterns_) draw_frame_counter(pattern, frame);
    }
    if (sender_) {
      sender_->show({frame, pictures_});
      constexpr std::uint64_t kAskedAbout = 100;
      if (frame > kAskedAbout) sender_->forget_before(frame - kAskedAbout);
      return true;
    }
    display_->show({frame, pictures_});
    return !display_->take_input().stop;
  }

  /// Whether anybody saw it.
  [[nodiscard]] bool finish() {
    RunManifest nothing;
    if (sender_) return end_displays(comm_, *sender_, fail_on_, nothing);
    display_->finish();
    return true;
  }

 private:
  Communicator& comm_;
  std::vector<Image<Rgba8>> patterns_;
  std::vector<ScreenPicture> pictures_;
  std::unique_ptr<WallSender> sender_;
  MissedPictures fail_on_ = MissedPictures::Unseen;
  std::unique_ptr<Display> display_;
};

class WallPatternCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "pattern"; }
  [[nodiscard]] std::string_view summary() const override { return "calibration pictures: in files, or on the wall"; }

  [[nodiscard]] bool opens_windows() const override { return true; }

  void declare(const OptionSet& options) override {
    declare_wall(options, wall_);
    declare_overrides(options, overrides_);
    options.option("--host", host_, "only the screens of this host of the wall file, or node's id").type("NAME");
    display_.declare(options);
    options.option("--frames", frames_, "how many (default: 1; window, web and remote: until they are closed)")
        .range(1, 1'000'000);
    options.option("--fps", frames_per_second_, "how many a second, at most").range(1e-3, 1e3).show_default();
    options.option("--scale", scale_, "of the screens' pixels, e.g. 0.25").range(1e-6, 1e6).show_default();
    link_.declare(options, settings_);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    Wall wall = load_wall(wall_, overrides_);
    if (scale_ != 1.0) wall = scale_wall(std::move(wall), scale_);
    for (const WallScreen& screen : wall.screens) check_size(screen.pixels, globals.picture_limits());
    if (!host_.empty() && (display_.remote() || display_.kind().whole_wall)) {
      throw Error(ExitCode::Usage, "--host is about windows and files: other displays show the whole wall",
                  "leave it out, or use --display window");
    }
    if (!host_.empty()) (void)find_host(wall, host_);
    const bool endless = !frames_ && (display_.kind().interactive || display_.remote());
    const DisplayOptions options = display_.options(globals);
    std::optional<SenderSettings> link;
    if (display_.remote()) {
      link = link_.settings(wall, settings_.codec);
    } else {
      link_.refuse();
    }
    if (display_.remote() && !display_.output.empty()) {
      throw Error(ExitCode::Usage, "patterns that other processes show leave no files", "leave -o out");
    }
    display_.kind().check(wall, options);
    endless ? watch_interrupts() : watch_requests();
    ExitCode code = ExitCode::Done;
    // Which process draws what is no question here: one does.
    run_local_ranks(
        1, [&](Communicator& comm) { code = show(wall, comm, link, endless, globals); }, globals.hang_limit());
    return code;
  }

 private:
  [[nodiscard]] ExitCode show(const Wall& wall, Communicator& comm, const std::optional<SenderSettings>& link,
                              bool endless, const Globals& globals) const {
    using Clock = std::chrono::steady_clock;
    const std::uint64_t frames = endless ? 0 : static_cast<std::uint64_t>(frames_.value_or(1));
    std::vector<std::size_t> screens(wall.screens.size());
    std::iota(screens.begin(), screens.end(), std::size_t{0});
    if (!host_.empty()) screens = find_host(wall, host_).screens;
    PatternShow patterns(wall, screens, comm, display_, link, globals);
    const auto pace =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / frames_per_second_));
    Progress progress(globals.verbosity < 0 ? "none" : globals.progress, "frame", frames, Progress::Pace{});
    Clock::time_point next = Clock::now();
    // A picture that is to be looked at later has nothing to count.
    const bool counts = endless || frames > 1;
    for (std::uint64_t frame = 0; endless || frame < frames; ++frame) {
      if (!patterns.show(frame, counts) || take_request() == Request::Stop) break;
      progress.step("");
      next = std::max(next + pace, Clock::now());
      if (endless || frame + 1 < frames) std::this_thread::sleep_until(next);
    }
    return patterns.finish() ? ExitCode::Done : ExitCode::Lost;
  }

  std::string wall_;
  std::vector<std::string> overrides_;
  std::string host_;
  DisplayFlags display_;
  LinkOptions link_;
  RenderSettings settings_;  ///< of which the codec counts
  std::optional<int> frames_;
  double frames_per_second_ = 30.0;
  double scale_ = 1.0;
};

}  // namespace

/// `hpr wall pattern WALL -o DIR`, or `--display NAME`: calibration pictures in files, or on the wall with a counter.
std::unique_ptr<Command> make_wall_pattern_command() {
  return std::make_unique<WallPatternCommand>();
}

}  // namespace hpr
