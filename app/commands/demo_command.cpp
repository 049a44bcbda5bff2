#include <array>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "app/command.h"
#include "app/commands/wall_run.h"

namespace hpr {
namespace {

constexpr const char* kPicture = "hpr-demo.png";

bool holds_png(const char* path) {
  constexpr std::string_view kSignature = "\x89PNG\r\n\x1A\n";
  std::array<char, kSignature.size()> begin{};
  std::ifstream(path, std::ios::binary).read(begin.data(), begin.size());
  return std::string_view(begin.data(), begin.size()) == kSignature;
}

class DemoCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "demo"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a wall picture of a built-in scene: does this machine work?";
  }

  void declare(const OptionSet& options) override {
    options.option("--wall", wall_, "screens of the wall, e.g. 3x2 or 3x2@640x360")
        .show_default()
        .type("CxR")
        .last_counts();
    options.option("-o,--output", output_, "the assembled wall").show_default().type("FILE.png").last_counts();
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    WallRun run;
    run.scene = "gen:gallery";
    run.wall = wall_;
    run.picture = output_;
    run.display.output = std::filesystem::path(output_).replace_extension("").string() + "-screens";
    run.summary = true;
    // The quickest proof that a machine works is a finished picture of few samples.
    for (const auto& [name, value] :
         {std::pair("spp", "2"), {"denoise", "true"}, {"indirect", "true"}, {"photons", "50000"}}) {
      set_setting(run.settings, name, value);
    }
    // The demo's own picture may be made again and again; a name the user chose is guarded as everywhere.
    Globals own = globals;
    std::error_code error;
    own.force =
        globals.force || (output_ == kPicture && (!std::filesystem::exists(kPicture, error) || holds_png(kPicture)));
    return run_wall(make_wall_job(run, own), own);
  }

 private:
  std::string wall_ = "1x1";
  std::string output_ = kPicture;
};

}  // namespace

std::unique_ptr<Command> make_demo_command() {
  return std::make_unique<DemoCommand>();
}

}  // namespace hpr
