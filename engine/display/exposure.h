#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "image/color.h"
#include "image/tone.h"
#include "scene/view.h"

namespace hpr {

class Session;
struct Frame;

/// How many pixels of a frame have which luminance: integers, so that whoever counts which pixels changes nothing.
/// Eight bins for each factor of two from 2^-20 to 2^20. What is darker counts nowhere: nothing is there, or no light.
class LuminanceHistogram {
 public:
  static constexpr int kMinStop = -20;
  static constexpr int kMaxStop = 20;
  static constexpr int kBinsPerStop = 8;
  static constexpr std::size_t kBins = std::size_t{kMaxStop - kMinStop} * kBinsPerStop;

  void add(const Rgb& radiance);
  LuminanceHistogram& operator+=(const LuminanceHistogram& other);

  [[nodiscard]] std::uint64_t pixels() const;
  /// The mean of the luminances' base-2 logarithms without the darkest and the brightest twentieth; none where nothing
  /// was counted.
  [[nodiscard]] std::optional<double> mean_stops() const;

 private:
  std::array<std::uint64_t, kBins> bins_{};
};

/// The exposure in stops that shows a frame of so much light well. A frame whose mean lies within kDarkStops below and
/// kBrightStops above a grey of 0.18 is lit as somebody meant it, and stays; others are brought to the nearer of these
/// borders. 0 where there is no light at all.
[[nodiscard]] double automatic_exposure(const LuminanceHistogram& histogram);
inline constexpr double kDarkStops = 1.5;
inline constexpr double kBrightStops = 1.0;

/// What a user may choose about display colours.
struct DisplaySettings {
  std::optional<double> exposure_stops = {};  ///< none: automatic_exposure of what is shown
  Tone tone = Tone::Neutral;
  std::string_view shows = {};  ///< see DisplayTransform
};

/// What a benchmark shows frames with, which measures no light: 0 stops where the exposure is automatic.
[[nodiscard]] inline DisplayTransform fixed_transform(const DisplaySettings& settings) {
  return {settings.exposure_stops.value_or(0.0), settings.tone, settings.shows};
}

/// Collective. The histogram of all screens' pixels, the same on all ranks; of a transparent frame what surfaces show,
/// however little they cover. `views` are the frame's; where screens are joined, what one draws of its neighbors'
/// pixels counts as theirs alone.
[[nodiscard]] LuminanceHistogram measure_luminance(Session& session, const Frame& frame, std::span<const View> views);

/// Collective. How to show a frame, the same on all ranks and for all screens.
[[nodiscard]] DisplayTransform transform_for(Session& session, const Frame& frame, std::span<const View> views,
                                             const DisplaySettings& settings);

/// The exposure of frame after frame: it follows what each one asks for by a tenth of the difference, as a camera does.
class SmoothExposure {
 public:
  /// What to show a frame with that asks for `wanted_stops`. The first one gets that.
  [[nodiscard]] double next(double wanted_stops);

 private:
  std::optional<double> stops_;
};

}  // namespace hpr
