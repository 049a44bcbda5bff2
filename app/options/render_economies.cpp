#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "app/options/render_options.h"
#include "app/options/words.h"
#include "core/error.h"
#include "rt/passes/half_resolution.h"

// The options that give up accuracy for time, see app/options/render_options.h.
namespace hpr {

void RenderOptions::declare_economies(CLI::App& app) {
  app.add_option(
         "--photon-radius", photon_radius,
         "metres about a point in which photons count, in a frame's first sample (default 0: from their density)")
      ->check(CLI::Range(0.0, 1e30));
  app.add_option("--resolution-scale", resolution_scale,
                 "the frame is made of so many of the pixels a side, and shown at full size by a filter")
      ->check(CLI::Range(0.1, 1.0))
      ->capture_default_str();
  app.add_option("--half-resolution", half_resolution,
                 "a list of passes whose light is worked out for one pixel in four where neighbours see the like")
      ->type_name("LIST");
}

void RenderOptions::settle_economies(FrameSettings& settings) const {
  if (!std::isfinite(photon_radius) || !std::isfinite(resolution_scale)) {
    throw Error(ExitCode::Usage, "--photon-radius and --resolution-scale take finite numbers",
                "write e.g. --resolution-scale 0.5");
  }
  if (resolution_scale != 1.0 && !settings.aovs.empty()) {
    throw Error(ExitCode::Usage, "--aov has a value for every pixel, of which --resolution-scale makes fewer",
                "draw a smaller picture with --size");
  }
  settings.rays.photon_radius = photon_radius;
  settings.resolution_scale = resolution_scale;
  if (half_resolution != "none") settings.rays.half_resolution = split_words(half_resolution);
  (void)shared_components(settings.rays);  // as for unknown passes
  if (!settings.rays.half_resolution.empty() && (reference || settings.shading == Shading::Local)) {
    throw Error(ExitCode::Usage, "--half-resolution is about passes over what is seen in the end",
                "use it without --reference and with --shading deferred");
  }
  if (denoise) settle_denoiser(settings);
}

void RenderOptions::settle_denoiser(FrameSettings& settings) const {
  if (reference || settings.shading == Shading::Local || !settings.rays.half_resolution.empty()) {
    throw Error(ExitCode::Usage, "--denoise is about the light of passes at all that is seen in the end",
                "use it without --reference and --half-resolution, and with --shading deferred");
  }
  settings.rays.denoise = true;
  if (filter.empty()) return;
  settings.rays.filter = parse_pixel_filter(filter);
  if (least_samples(settings.rays.filter) == 1) return;
  throw Error(ExitCode::Usage,
              fmt::format("--denoise looks at more places, whose weights --filter {} makes negative", filter),
              "use another filter, e.g. b-spline");
}

}  // namespace hpr
