#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/options/globals.h"
#include "engine/session.h"
#include "image/image.h"
#include "tools/tradeoff/tradeoff.h"

namespace hpr {

/// How a sweep is measured.
struct TradeoffMeasurement {
  Size size;
  std::string reference = "auto";  ///< auto, path, passes, or a picture's file
  std::uint32_t reference_spp = 1024;
  int frames = 3;  ///< measured of each point; fewer where they take long
  std::vector<std::string> metrics;
};

/// The truth a sweep is held against.
struct ReferencePicture {
  TradeoffReference about;
  Image<Rgb> radiance;  ///< on rank 0
  bool linear = true;   ///< false: display values of a PNG
};

/// Collective. Reads or renders the truth. Rendered ones are kept in `cache` under a name that depends on what they
/// show, and gone on with where they have too few samples; where they have more, all count. None when a signal stopped
/// it: its samples are in `cache` then. Throws Error: Usage, Io, BadInput for a picture of another size.
[[nodiscard]] std::optional<ReferencePicture> find_reference(Session& session, const RenderSettings& settings,
                                                             const TradeoffMeasurement& how, const Globals& globals,
                                                             const std::filesystem::path& cache);

/// The part of a picture a report shows: of `side` pixels a side, where `picture` has most detail.
[[nodiscard]] Rect most_detail(const Image<Rgb>& picture, int side);

/// Collective. Draws a point of the sweep, several times, and compares it. On rank 0 everything is filled in, on the
/// others only what they took.
[[nodiscard]] TradeoffPoint measure_point(Session& session, const RenderSettings& settings, const KnobValues& knobs,
                                          const TradeoffMeasurement& how, const Globals& globals,
                                          const ReferencePicture& reference, const Rect& crop);

/// `part` of a picture as a PNG in base64. `linear`: encoded to display values first.
[[nodiscard]] std::string crop_as_png(const Image<Rgb>& picture, const Rect& part, bool linear);

}  // namespace hpr
