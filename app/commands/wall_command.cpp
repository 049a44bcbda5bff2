#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <optional>

#include "app/command.h"
#include "app/commands/wall_run.h"
#include "core/file.h"
#include "core/text.h"
#include "image/image_io.h"
#include "walls/config/wall_file.h"
#include "walls/config/wall_keys.h"
#include "walls/drawing/plan.h"
#include "walls/manifest/manifest.h"

namespace hpr {

// The commands of walls, in the order `hpr wall --help` lists them. Each is defined in a file of its own or below.
#define HPR_FOR_EACH_WALL_COMMAND(visit)                                                                      \
  visit(init) visit(check) visit(plan) visit(expand) visit(schema) visit(pattern) visit(import) visit(script) \
      visit(run) visit(status) visit(ctl) visit(stop)

#define HPR_DECLARE_WALL_COMMAND(name) std::unique_ptr<Command> make_wall_##name##_command();
HPR_FOR_EACH_WALL_COMMAND(HPR_DECLARE_WALL_COMMAND)

namespace {

class WallPlanCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "plan"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a picture of where the screens are and who drives them";
  }

  void declare(const OptionSet& options) override {
    declare_wall(options, wall_);
    options.option("-o,--output", output_, "the picture").required().type("FILE.(svg|png)");
    const Option heat = options.option("--heat", heat_, "colour screens by what a run measured: its manifest")
                            .type("DIR/manifest.json");
    options.option("--by", heat_by_, fmt::format("of the manifest: {}", fmt::join(heat_names(), ", ")))
        .show_default()
        .needs(heat);
    declare_overrides(options, overrides_);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
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

 private:
  std::string wall_;
  std::vector<std::string> overrides_;
  std::string output_;
  std::string heat_;
  std::string heat_by_ = "ms";
};

class WallExpandCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "expand"; }
  [[nodiscard]] std::string_view summary() const override { return "the same wall as TOML with its grids written out"; }

  void declare(const OptionSet& options) override {
    declare_wall(options, wall_);
    declare_overrides(options, overrides_);
  }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    fmt::print("{}", expand_wall(load_wall(wall_, overrides_)));
    return ExitCode::Done;
  }

 private:
  std::string wall_;
  std::vector<std::string> overrides_;
};

class WallSchemaCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "schema"; }
  [[nodiscard]] std::string_view summary() const override {
    return "what a wall file may hold, as a JSON Schema (draft 2020-12)";
  }

  void declare(const OptionSet& options) override {
    options.flag("--markdown", markdown_, "the tables of keys of docs/walls.md instead");
  }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    fmt::print("{}", markdown_ ? wall_keys_markdown() : wall_schema());
    return ExitCode::Done;
  }

 private:
  bool markdown_ = false;
};

class WallCommand final : public CommandGroup {
 public:
  WallCommand() : CommandGroup("wall", "describe, check, draw or drive a wall of screens") {}
  [[nodiscard]] std::vector<std::unique_ptr<Command>> subcommands() const override {
    std::vector<std::unique_ptr<Command>> all;
#define HPR_ADD_WALL_COMMAND(name) all.push_back(make_wall_##name##_command());
    HPR_FOR_EACH_WALL_COMMAND(HPR_ADD_WALL_COMMAND)
    return all;
  }
};

}  // namespace

std::unique_ptr<Command> make_wall_plan_command() {
  return std::make_unique<WallPlanCommand>();
}

std::unique_ptr<Command> make_wall_expand_command() {
  return std::make_unique<WallExpandCommand>();
}

std::unique_ptr<Command> make_wall_schema_command() {
  return std::make_unique<WallSchemaCommand>();
}

std::unique_ptr<Command> make_wall_command() {
  return std::make_unique<WallCommand>();
}

}  // namespace hpr
