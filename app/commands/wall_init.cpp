#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>

#include "app/command.h"
#include "app/results.h"
#include "core/file.h"
#include "core/log.h"
#include "core/text.h"
#include "walls/config/import/importer.h"
#include "walls/config/wall_file.h"
#include "walls/config/wall_template.h"

namespace hpr {
namespace {

std::optional<double> metres_of(std::string_view text) {
  double metres = 0.0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), metres);
  if (failed != std::errc() || end != text.data() + text.size() || !std::isfinite(metres)) return std::nullopt;
  return metres;
}

/// "1.018x0.573", or with `one_is_both` also "0.0055".
glm::dvec2 metres_pair(const std::string& option, const std::string& text, bool one_is_both) {
  const std::size_t cross = text.find('x');
  const auto first = metres_of(std::string_view(text).substr(0, cross));
  const auto second = cross == std::string::npos ? first : metres_of(std::string_view(text).substr(cross + 1));
  if (first && second && (one_is_both || cross != std::string::npos)) return {*first, *second};
  throw Error(ExitCode::Usage, fmt::format("{}: '{}' is no two lengths in metres", option, printable(text)),
              fmt::format("write e.g. {} {}", option, one_is_both ? "0.0055, or 0.0055x0.004" : "1.018x0.573"));
}

class WallInitCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "init"; }
  [[nodiscard]] std::string_view summary() const override { return "a wall file to begin with"; }

  void declare(const OptionSet& options) override {
    options.option("--cols", wall_.columns, "screens beside each other").required();
    options.option("--rows", wall_.rows, "screens above each other").required();
    options.option("--hosts", hosts_, "as Slurm writes them: wall0[1-9] or a[01-03,07],b2 (default: this machine)")
        .type("LIST");
    options.option("--tiles-per-host", wall_.tiles_per_host, "neighbours each drives (default: shared out evenly)")
        .range(1, kMaxScreens);
    options.option("--ranks-per-host", wall_.ranks_per_host, "render processes on each").range(1, 4096).show_default();
    options.option("--tile-pixels", pixels_, "of a screen (default: 1920x1080; on this machine 640x360)").type("WxH");
    options.option("--tile-size-m", size_, "a screen's lit area in metres (default: of a 46 inch panel)").type("WxH");
    options.option("--gap-m", gap_, "metres from lit edge to lit edge (default: 0.0055; negative: overlap)")
        .type("GAP|XxY");
    options.option("-o,--output", output_, "instead of standard output").type("FILE");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    WallTemplate wall = wall_;
    if (!hosts_.empty()) wall.hosts = parse_host_list(hosts_);
    if (hosts_.empty() && wall.tiles_per_host) {
      throw Error(ExitCode::Usage, "--tiles-per-host needs hosts", "name them, e.g. --hosts wall0[1-9]");
    }
    if (!pixels_.empty()) {
      const auto extent = parse_extent(pixels_);
      if (!extent) {
        throw Error(ExitCode::Usage, fmt::format("--tile-pixels: '{}' is no size of a screen", printable(pixels_)),
                    "write e.g. 1920x1080");
      }
      wall.tile_pixels = Size{extent->first, extent->second};
    }
    if (!size_.empty()) wall.tile_size_m = metres_pair("--tile-size-m", size_, false);
    if (!gap_.empty()) wall.gap_m = metres_pair("--gap-m", gap_, true);
    wall.command = "hpr " + shell_line(globals.args);
    const std::string text = write_wall_template(wall);
    for (const WallFinding& finding : parse_wall(text, "the new wall").findings) {
      if (finding.error) throw Error(ExitCode::Usage, finding.what, finding.hint, finding.line);
      log::warning("{} ({})", finding.what, finding.hint);
    }
    write_or_print(text, output_, globals.force);
    return ExitCode::Done;
  }

 private:
  WallTemplate wall_;
  std::string hosts_;
  std::string pixels_;
  std::string size_;
  std::string gap_;
  std::string output_;
};

}  // namespace

/// `hpr wall init --cols C --rows R [--hosts LIST] ...`: a commented wall file to begin with, on stdout or in a file.
std::unique_ptr<Command> make_wall_init_command() {
  return std::make_unique<WallInitCommand>();
}

namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{4} << 20U;

std::string kinds() {
  std::string text;
  for (const WallImporter& importer : all_importers()) {
    text += fmt::format("{}{} ({})", text.empty() ? "" : "; ", importer.name, importer.summary);
  }
  return text;
}

class WallImportCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "import"; }
  [[nodiscard]] std::string_view summary() const override { return "another system's wall file as one of ours"; }

  void declare(const OptionSet& options) override {
    options.option("file", file_, "the other system's file").required().type("FILE");
    options.option("--from", kind_, kinds()).required().type("KIND");
    options.option("--pixels", pixels_, "of a screen, where the file does not tell").show_default().type("WxH");
    options.option("--pitch", pitch_mm_, "millimetres from pixel to pixel, where the file counts in pixels only")
        .range(1e-3, 1e3)
        .show_default()
        .type("MM");
  }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    const auto extent = parse_extent(pixels_);
    if (!extent || extent->first > kMaxScreenSide || extent->second > kMaxScreenSide) {
      throw Error(ExitCode::Usage, fmt::format("--pixels: '{}' is no size of a screen", pixels_),
                  "write e.g. 1920x1080");
    }
    const ImportSettings settings{{extent->first, extent->second}, 1e-3 * pitch_mm_};
    const std::vector<std::byte> bytes = read_file(file_, kMaxFileBytes);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    fmt::print("{}", import_wall(text, file_, kind_, settings));
    return ExitCode::Done;
  }

 private:
  std::string file_;
  std::string kind_;
  std::string pixels_ = "1920x1080";
  double pitch_mm_ = 0.25;
};

}  // namespace

/// `hpr wall import FILE --from KIND`: another system's wall file as one of ours, on stdout.
std::unique_ptr<Command> make_wall_import_command() {
  return std::make_unique<WallImportCommand>();
}

}  // namespace hpr
