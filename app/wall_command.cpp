#include "app/wall_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "app/output.h"
#include "app/wall_import.h"
#include "app/wall_remote.h"
#include "app/wall_run.h"
#include "core/file.h"
#include "core/names.h"
#include "image/image_io.h"
#include "walls/pattern.h"
#include "walls/plan.h"
#include "walls/wall_schema.h"

namespace hpr {
namespace {

class WallCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "wall"; }
  [[nodiscard]] std::string_view summary() const override { return "check, draw, expand or drive a wall of screens"; }

  void declare(CLI::App& app) override {
    app.require_subcommand(1);
    CLI::App& check = add(app, "check", "every error and oddity in a wall file");
    check.add_flag("--json", json_, "print one JSON document (hpr.wall-check/1)");
    declare_overrides(check, overrides_);
    check.callback([this] { action_ = [this](const Globals&) { return this->check(); }; });

    CLI::App& plan = add(app, "plan", "a picture of where the screens are and who drives them");
    plan.add_option("-o,--output", output_, "the picture")->required()->type_name("FILE.(svg|png)");
    plan.callback([this] { action_ = [this](const Globals& globals) { return this->plan(globals); }; });

    CLI::App& expand = add(app, "expand", "the same wall as TOML with its grids written out");
    declare_overrides(expand, overrides_);
    expand.callback([this] { action_ = [this](const Globals&) { return this->expand(); }; });

    CLI::App& schema = *app.add_subcommand("schema", "what a wall file may hold, as a JSON Schema (draft 2020-12)");
    schema.callback([this] {
      action_ = [](const Globals&) {
        fmt::print("{}", wall_schema());
        return ExitCode::Done;
      };
    });

    CLI::App& pattern = add(app, "pattern", "calibration pictures, one per screen");
    pattern.add_option("-o,--output", output_, "where <screen id>.png go")->required()->type_name("DIR");
    pattern.callback([this] { action_ = [this](const Globals& globals) { return this->pattern(globals); }; });

    CLI::App& run = *app.add_subcommand(std::string(run_->name()), std::string(run_->summary()));
    run_->declare(run);
    run.callback([this] {
      runs_ = true;
      action_ = [this](const Globals& globals) { return run_->run(globals); };
    });
    others_.push_back(make_wall_import_command());
    for (const auto& command : others_) {
      CLI::App& sub = *app.add_subcommand(std::string(command->name()), std::string(command->summary()));
      command->declare(sub);
      sub.callback(
          [this, &command] { action_ = [&command](const Globals& globals) { return command->run(globals); }; });
    }
  }

  /// Only `run` draws; the rest reads a file and answers.
  [[nodiscard]] bool collective() const override { return runs_; }
  [[nodiscard]] ExitCode run(const Globals& globals) override { return action_(globals); }

 private:
  CLI::App& add(CLI::App& app, const std::string& name, const std::string& summary) {
    CLI::App& sub = *app.add_subcommand(name, summary);
    sub.add_option("wall", wall_, "a wall file, or CxR, or CxR@WxH")->required()->type_name("WALL");
    return sub;
  }

  [[nodiscard]] ExitCode check() const {
    const WallCheck check{wall_, read_wall(wall_, overrides_)};
    if (json_) {
      fmt::print("{}", check_json(check));
    } else {
      report_findings(check);
      if (check.reading.ok()) fmt::print("{}", describe_wall(check.reading.wall));
    }
    return check.reading.ok() ? ExitCode::Done : ExitCode::BadInput;
  }

  [[nodiscard]] ExitCode plan(const Globals& globals) const {
    const std::string extension = std::filesystem::path(output_).extension().string();
    if (extension != ".svg" && extension != ".png") {
      throw Error(ExitCode::Usage, fmt::format("cannot write a plan as '{}'", printable(output_)),
                  "choose a name that ends in .svg or .png");
    }
    check_writable(output_, globals.force);
    const Wall wall = load_wall(wall_);
    if (extension == ".svg") {
      write_file_atomically(output_, wall_plan_svg(wall));
    } else {
      write_png(output_, wall_plan_image(wall));
    }
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode expand() const {
    fmt::print("{}", expand_wall(load_wall(wall_, overrides_)));
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode pattern(const Globals& globals) const {
    const Wall wall = load_wall(wall_);
    const std::filesystem::path folder(output_);
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) {
      throw Error(ExitCode::Io, fmt::format("cannot make the folder '{}': {}", folder.string(), error.message()),
                  "name a folder that can be written with -o");
    }
    const auto path_of = [&](const WallScreen& screen) { return folder / (screen.id + ".png"); };
    for (const WallScreen& screen : wall.screens) check_writable(path_of(screen), globals.force);
    for (const WallScreen& screen : wall.screens) check_size(screen.pixels, globals);
    for (std::size_t i = 0; i < wall.screens.size(); ++i) write_png(path_of(wall.screens[i]), wall_pattern(wall, i));
    return ExitCode::Done;
  }

  std::string wall_;
  std::vector<std::string> overrides_;
  std::string output_;
  bool json_ = false;
  std::unique_ptr<Command> run_ = make_wall_run_command();
  std::vector<std::unique_ptr<Command>> others_ = make_wall_remote_commands();
  bool runs_ = false;
  std::function<ExitCode(const Globals&)> action_;
};

}  // namespace

std::unique_ptr<Command> make_wall_command() {
  return std::make_unique<WallCommand>();
}

}  // namespace hpr
