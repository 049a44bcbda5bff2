#pragma once

#include <span>
#include <string>
#include <string_view>

#include "app/options/render_options.h"

namespace hpr {

/// A setting that trades speed for accuracy: an option of the commands that draw a scene, and what `hpr tradeoff` can
/// vary.
struct Knob {
  std::string_view name;    ///< of the option, without its dashes
  std::string_view range;   ///< the values it takes
  std::string_view costs;   ///< what a better value takes
  std::string_view loses;   ///< what a worse value gives away
  bool on_the_way = false;  ///< of wall run alone: what finished pictures go through on their way to displays
};

/// Every knob there is, those that move most first.
[[nodiscard]] std::span<const Knob> all_knobs();

/// One that `hpr tradeoff` can vary. Throws Error (Usage) with the choices and the nearest one.
[[nodiscard]] const Knob& find_knob(const std::string& name);

/// Sets the option `knob` of `options` as the command line would. A list within the value is written with + in place
/// of its commas. Throws Error (Usage) for values the option refuses.
void set_knob(RenderOptions& options, const std::string& knob, const std::string& value);

/// What `hpr help knobs` prints, and with --markdown: the table of docs/knobs.md.
[[nodiscard]] std::string knobs_text();
[[nodiscard]] std::string knobs_markdown();

}  // namespace hpr
