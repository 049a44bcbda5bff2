#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/render_settings.h"

namespace hpr {

/// How a setting's value is written as text.
struct SettingValue {
  std::string type;   ///< as help shows it: "INT in [1 - 64]"; empty for flags
  std::string takes;  ///< the values, for people: "1 to 64"
  bool is_flag = false;
  /// Throws Error (Usage) for a text that is no value.
  std::function<void(RenderSettings&, const std::string&)> parse;
  std::function<std::string(const RenderSettings&)> write;
  std::function<void(const RenderSettings& from, RenderSettings& to)> copy;
};

/// A setting that has an effect only together with a value of another one.
struct Dependency {
  std::string_view on;  ///< the other setting
  std::function<bool(const RenderSettings&)> is_met;
};

/// Who offers a setting.
enum class SettingScope {
  Pictures,  ///< every command that draws a scene
  Single,    ///< those that draw one picture or run, not the measuring ones that draw many
  Wall,      ///< walls alone: it is about finished pictures that are sent to displays
};

/// One setting: a row of the table that the command line, the console, `--vary`, checkpoints and docs come from.
struct Setting {
  std::string_view name;  ///< of its option, without dashes
  std::string help;
  SettingValue value;
  std::string_view initial = {};                    ///< as help shows it; empty: nothing is shown
  std::array<std::string_view, 3> by_quality = {};  ///< its value under draft, good and best; empty: always the same
  std::string_view finished = {};                   ///< its value in a finished picture, see RenderSettings::finishes
  std::string_view costs = {};                      ///< what a better value takes; empty: it trades nothing
  std::string_view loses = {};                      ///< what a worse value gives away
  bool decides_bits = true;                         ///< of a picture's radiance, keys or layers
  bool limits_reference = false;                    ///< a rendered reference of a sweep is made without it
  bool fixed_in_session = false;                    ///< cannot be changed while a scene is resident
  SettingScope scope = SettingScope::Pictures;
  std::string_view negated = {};  ///< the flag that is its opposite, without dashes
  std::vector<Dependency> used_with = {};

  [[nodiscard]] bool is_tradeoff() const { return !costs.empty(); }
};

/// Every setting, in the order of help.
[[nodiscard]] std::span<const Setting> all_settings();

/// Null where there is none of this name.
[[nodiscard]] const Setting* find_setting(std::string_view name);

/// Sets one setting from text. Throws Error (Usage) that names the option; for an unknown name with the choices and the
/// nearest one.
void set_setting(RenderSettings& settings, std::string_view name, const std::string& value);
/// Resets a setting to its value when it is not given.
void reset_setting(RenderSettings& settings, std::string_view name);

/// The setting of this name, one that trades speed for accuracy and that a sweep can vary. Throws Error (Usage) with
/// the choices and the nearest one.
[[nodiscard]] const Setting& find_tradeoff_setting(const std::string& name);

}  // namespace hpr
