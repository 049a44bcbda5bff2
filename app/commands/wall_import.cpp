#include <fmt/format.h>

#include <filesystem>

#include "app/command.h"
#include "core/file.h"
#include "core/text.h"
#include "walls/config/import/importer.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

constexpr std::uint64_t kLargestFile = std::uint64_t{4} << 20U;

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
    const std::vector<std::byte> bytes = read_file(file_, kLargestFile);
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
