#include "app/commands/wall_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>

#include "app/commands/wall_import.h"
#include "app/commands/wall_init.h"
#include "app/commands/wall_pattern.h"
#include "app/commands/wall_remote.h"
#include "app/commands/wall_run.h"
#include "app/commands/wall_script.h"
#include "core/file.h"
#include "core/names.h"
#include "engine/output.h"
#include "image/image_io.h"
#include "walls/config/wall_schema.h"
#include "walls/drawing/heat.h"
#include "walls/drawing/plan.h"

namespace hpr {
namespace {

class WallCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "wall"; }
  [[nodiscard]] std::string_view summary() const override { return "describe, check, draw or drive a wall of screens"; }

  void declare(CLI::App& app) override {
    app.require_subcommand(1);
    add(app, make_wall_init_command());
    CLI::App& check = add(app, "check", "every error and oddity in a wall file");
    check.add_flag("--json", json_, "print one JSON document (hpr.wall-check/1)");
    declare_overrides(check, overrides_);
    check.callback([this] { action_ = [this](const Globals&) { return this->check(); }; });

    CLI::App& plan = add(app, "plan", "a picture of where the screens are and who drives them");
    plan.add_option("-o,--output", output_, "the picture")->required()->type_name("FILE.(svg|png)");
    plan.add_option("--heat", heat_, "colour screens by what a run measured: its manifest")
        ->type_name("DIR/manifest.json");
    plan.add_option("--by", heat_by_, fmt::format("of the manifest: {}", fmt::join(heat_names(), ", ")))
        ->capture_default_str()
        ->needs("--heat");
    declare_overrides(plan, overrides_);
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

    add(app, make_wall_pattern_command());
    add(app, make_wall_import_command());
    add(app, make_wall_script_command());
    add(app, make_wall_run_command());
    for (auto& command : make_wall_remote_commands()) add(app, std::move(command));
  }

  /// As what is asked for is.
  [[nodiscard]] bool collective() const override { return collective_; }
  [[nodiscard]] ExitCode run(const Globals& globals) override { return action_(globals); }

 private:
  /// A subcommand in a file of its own.
  void add(CLI::App& app, std::unique_ptr<Command> command) {
    Command* const its = command.get();
    others_.push_back(std::move(command));
    CLI::App& sub = *app.add_subcommand(std::string(its->name()), std::string(its->summary()));
    its->declare(sub);
    sub.callback([this, its] {
      collective_ = its->collective();
      action_ = [its](const Globals& globals) { return its->run(globals); };
    });
  }

  CLI::App& add(CLI::App& app, const std::string& name, const std::string& summary) {
    CLI::App& sub = *app.add_subcommand(name, summary);
    sub.add_option("wall", wall_, "a wall file, or CxR, or CxR@WxH")->required()->type_name("WALL");
    return sub;
  }

  /// With --json, what cannot be read at all is a finding too.
  [[nodiscard]] WallReading read() const {
    try {
      return read_wall(wall_, overrides_);
    } catch (const Error& error) {
      WallFinding finding;
      finding.what = error.what();
      finding.line = error.line();
      finding.hint = error.hint();
      if (json_) fmt::print("{}", check_json({wall_, {{}, {finding}}}));
      throw;
    }
  }

  [[nodiscard]] ExitCode check() const {
    const WallCheck check{wall_, read()};
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
    const Wall wall = load_wall(wall_, overrides_);
    std::optional<WallHeat> heat;
    if (!heat_.empty()) {
      const std::string file =
          std::filesystem::is_directory(heat_) ? (std::filesystem::path(heat_) / "manifest.json").string() : heat_;
      heat = wall_heat(wall, load_manifest(file), file, heat_by_);
    }
    const WallHeat* const colors = heat ? &*heat : nullptr;
    if (extension == ".svg") {
      write_file_atomically(output_, wall_plan_svg(wall, colors));
    } else {
      write_png(output_, wall_plan_image(wall, colors));
    }
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode expand() const {
    fmt::print("{}", expand_wall(load_wall(wall_, overrides_)));
    return ExitCode::Done;
  }

  std::string wall_;
  std::vector<std::string> overrides_;
  std::string output_;
  std::string heat_;
  std::string heat_by_ = "ms";
  bool json_ = false;
  std::vector<std::unique_ptr<Command>> others_;
  bool collective_ = false;
  std::function<ExitCode(const Globals&)> action_;
};

}  // namespace

std::unique_ptr<Command> make_wall_command() {
  return std::make_unique<WallCommand>();
}

}  // namespace hpr
