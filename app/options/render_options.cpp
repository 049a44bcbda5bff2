#include "app/options/render_options.h"

#include <fmt/format.h>

namespace hpr {

Option declare_setting(const OptionSet& options, RenderSettings& settings, const Setting& setting) {
  const std::string name = fmt::format("--{}", setting.name);
  if (setting.value.is_flag) {
    const std::string names = setting.negated.empty() ? name : fmt::format("{},!--{}", name, setting.negated);
    return options
        .flag(
            names,
            [&settings, &setting](bool is_set) { set_setting(settings, setting.name, is_set ? "true" : "false"); },
            setting.help)
        .group(kSettingsGroup);
  }
  const Option option = options.option(
      name, [&settings, &setting](const std::string& value) { set_setting(settings, setting.name, value); },
      setting.help);
  if (!setting.initial.empty()) option.default_text(std::string(setting.initial));
  return option.type(setting.value.type).group(kSettingsGroup);
}

std::vector<Option> declare_settings(const OptionSet& options, RenderSettings& settings, SettingScope scope) {
  std::vector<Option> declared;
  for (const Setting& setting : all_settings()) {
    if (setting.scope == scope) declared.push_back(declare_setting(options, settings, setting));
  }
  return declared;
}

void declare_settings(const OptionSet& options, RenderSettings& settings) {
  (void)declare_settings(options, settings, SettingScope::Pictures);
  (void)declare_settings(options, settings, SettingScope::Single);
}

void ReportOptions::declare(const OptionSet& options) {
  options.flag("--explain", explain, "print the plan of the frame and why");
  options.option("--stats", stats, "write what the frame took as JSON").type("FILE.json");
}

LoadedScene load_scene(const std::string& source, const RenderSettings& settings, const Globals& globals, Size size) {
  return load_scene(source, settings, globals, first_view(settings, size));
}

LoadedScene load_scene(const std::string& source, const RenderSettings& settings, const Globals& globals,
                       const FirstViews& views) {
  return load_scene(source, settings, globals.scene_limits(), globals.picture_limits(), views);
}

}  // namespace hpr
