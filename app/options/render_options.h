#pragma once

#include <string>
#include <vector>

#include "app/options/globals.h"
#include "app/options/option_set.h"
#include "engine/render_settings.h"
#include "engine/settings_table.h"

namespace hpr {

/// Declares an option for one setting; its value goes to `settings`, which outlives parsing.
Option declare_setting(const OptionSet& options, RenderSettings& settings, const Setting& setting);
/// Declares an option for each setting of a scope; their values go to `settings`, which outlives parsing.
std::vector<Option> declare_settings(const OptionSet& options, RenderSettings& settings, SettingScope scope);
/// Declares the settings of commands that draw one picture or run.
void declare_settings(const OptionSet& options, RenderSettings& settings);

/// What a run prints and writes about itself.
struct ReportOptions {
  bool explain = false;
  std::string stats;  ///< file for what the frame took; empty: none

  void declare(const OptionSet& options);
};

/// Loads a scene lit as the settings say, within the limits of the program's options, to be seen first in a picture of
/// this size or in this view. Throws Error as load_scene does.
[[nodiscard]] LoadedScene load_scene(const std::string& source, const RenderSettings& settings, const Globals& globals,
                                     Size size = kDefaultPictureSize);
[[nodiscard]] LoadedScene load_scene(const std::string& source, const RenderSettings& settings, const Globals& globals,
                                     const FirstViews& views);

}  // namespace hpr
