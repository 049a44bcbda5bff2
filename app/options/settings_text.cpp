#include "app/options/settings_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstddef>
#include <string>
#include <vector>

#include "engine/render_settings.h"
#include "engine/settings_table.h"

namespace hpr {
namespace {

bool depends_on_quality(const Setting& setting) {
  return !setting.by_quality.front().empty() || !setting.finished.empty();
}

/// Under draft, good and best; in parentheses that of a finished picture.
std::vector<std::string> values_by_quality(const Setting& setting) {
  std::vector<std::string> values(setting.by_quality.begin(), setting.by_quality.end());
  for (std::string& value : values) {
    if (value.empty()) value = setting.value.write(RenderSettings());
  }
  if (!setting.finished.empty()) {
    values[static_cast<std::size_t>(Quality::Good)] += fmt::format(" ({})", setting.finished);
  }
  return values;
}

}  // namespace

std::string tradeoff_settings_text() {
  std::string text =
      "Settings that trade speed for accuracy, options of `hpr render` and `hpr wall run` alike.\n"
      "`hpr tradeoff SCENE --vary KNOB=V,V,...` measures what they cost and lose for a scene;\n"
      "for those of pictures on their way to displays (`hpr wall run`) `hpr bench codec SCENE` does.\n";
  for (const Setting& setting : all_settings()) {
    if (!setting.is_tradeoff()) continue;
    text += fmt::format("\n--{}\n  takes  {}\n  costs  {}\n  loses  {}\n", setting.name, setting.value.takes,
                        setting.costs, setting.loses);
  }
  return text;
}

std::string tradeoff_settings_markdown() {
  std::string text = "| Option | takes | costs | loses |\n|---|---|---|---|\n";
  for (const Setting& setting : all_settings()) {
    if (!setting.is_tradeoff()) continue;
    text += fmt::format("| `--{}` | {} | {} | {} |\n", setting.name, setting.value.takes, setting.costs, setting.loses);
  }
  return text;
}

std::string settings_markdown() {
  const auto cell = [](std::string text) {
    for (std::size_t at = text.find('|'); at != std::string::npos; at = text.find('|', at + 2)) {
      text.insert(at, 1, '\\');
    }
    return text;
  };
  std::string text = "| Setting | Value | Default | Meaning |\n|---|---|---|---|\n";
  for (const Setting& setting : all_settings()) {
    std::string initial(setting.initial);
    if (depends_on_quality(setting)) initial = fmt::format("{}", fmt::join(values_by_quality(setting), ", "));
    const std::string names = setting.negated.empty() ? fmt::format("--{}", setting.name)
                                                      : fmt::format("--{}, --{}", setting.name, setting.negated);
    text += fmt::format("| `{}` | {} | {} | {} |\n", names, cell(setting.value.type), initial, cell(setting.help));
  }
  return text;
}

std::string qualities_markdown() {
  std::string text = fmt::format("| Option | {} |\n|---|---|---|---|\n", fmt::join(kQualityNames, " | "));
  for (const Setting& setting : all_settings()) {
    if (!depends_on_quality(setting)) continue;
    text += fmt::format("| `--{}` | {} |\n", setting.name, fmt::join(values_by_quality(setting), " | "));
  }
  return text;
}

}  // namespace hpr
