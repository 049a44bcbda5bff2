#include <fmt/format.h>

#include "app/command.h"
#include "app/commands/wall_run.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/text.h"
#include "walls/displays/display.h"

namespace hpr {
namespace {

class ViewCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "view"; }
  [[nodiscard]] std::string_view summary() const override { return "look around in a scene: in windows or a browser"; }

  [[nodiscard]] bool opens_windows() const override { return true; }

  void declare(const OptionSet& options) override {
    options.option("scene", run_.scene, "a .gltf or .glb file, or gen:NAME?key=value").required();
    const Option wall = options.option("--wall", run_.wall, "a wall file, or CxR, or CxR@WxH").show_default();
    options.option("--size", size_, "pixels of a single window").type("WxH").excludes(wall);
    options.flag("--web", address_, "=ADDR:PORT: in a browser instead of windows; by default on loopback, a free port");
    options.option("--frames", run_.frames, "end after so many frames (default: when it is closed)")
        .range(1, 1'000'000);
    declare_target_ms(options, run_.target_ms, "what a frame may take while the camera moves (default: 50)");
    declare_settings(options, run_.settings);
    run_.settings.finishes = true;
    run_.report.declare(options);
    options.declared("--aov").hidden();  // it writes no files, and refuses layers
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    run_.display.display = display();
    if (!size_.empty()) {
      if (!parse_extent(size_)) {
        throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", printable(size_)), "write e.g. 1280x720");
      }
      run_.wall = "1x1@" + size_;
    }
    return run_wall(make_wall_job(run_, globals), globals);
  }

 private:
  /// By the command line and, on rank 0, whether there is a desktop; the other ranks take rank 0's.
  [[nodiscard]] std::string display() const {
    if (address_.empty()) return launched_rank() == 0 && has_desktop() ? "window" : "web";
    return address_ == "true" ? "web" : "web=" + address_;  // a flag without a value is true
  }

  WallRun run_ = first_view();
  std::string address_;
  std::string size_;

  [[nodiscard]] static WallRun first_view() {
    WallRun run;
    run.wall = "1x1@1280x720";
    return run;
  }
};

}  // namespace

/// `hpr view SCENE`: a wall in windows, or in a browser where there is no desktop.
std::unique_ptr<Command> make_view_command() {
  return std::make_unique<ViewCommand>();
}

}  // namespace hpr
