#pragma once

#include <string>
#include <vector>

#include "app/options/option_set.h"
#include "engine/render_settings.h"
#include "walls/config/wall.h"
#include "walls/link/sender.h"

namespace hpr {

/// The options of `--display remote`: how a run reaches its displays, and how pictures are sent to them.
struct LinkOptions {
  std::vector<std::string> displays;  ///< HOST=ADDRESS
  std::string send_budget = "100ms";
  std::string swap_timeout = "100ms";
  int in_flight = 1;
  bool codec_deltas = false;

  /// The codec is one of the `settings`, which outlive parsing.
  void declare(const OptionSet& options, RenderSettings& settings);
  /// Throws Error (Usage) when one of them was given: nothing is sent to displays.
  void refuse() const;
  /// Without session, token and rank. Throws Error (Usage, Io) for what makes no sense for this wall.
  [[nodiscard]] SenderSettings settings(const Wall& wall, const LinkCodec& codec) const;

 private:
  std::vector<Option> declared_;
};

}  // namespace hpr
