#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/options/accuracy_options.h"
#include "app/options/globals.h"
#include "engine/frame.h"
#include "engine/quality.h"
#include "engine/samples.h"
#include "scene/view.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

/// The flags of `render` that every command that draws a scene has.
struct RenderOptions {
  std::string camera;
  std::vector<double> eye;
  std::vector<double> at;
  std::vector<double> up{0.0, 1.0, 0.0};
  double fov_degrees = 0.0;
  std::string primary = "raster";
  std::string passes = "auto";
  std::string quality = "good";
  std::optional<std::string> spp;  ///< these take the quality's value where they are not given
  std::optional<int> max_depth;
  std::optional<int> light_samples;
  std::optional<double> glossy_cutoff;
  std::optional<std::uint32_t> photons;
  std::optional<bool> indirect;
  double photon_radius = 0.0;     ///< metres
  double resolution_scale = 1.0;  ///< of the pixels a side
  std::string half_resolution;    ///< passes
  std::string filter;
  bool adaptive = false;
  bool denoise = false;
  std::string aov;
  std::string environment;
  bool reference = false;
  bool no_terminator_fix = false;
  std::string distribute = "auto";
  int groups = 0;
  std::string strategy = "auto";
  std::string data = "replicated";
  std::string shading = "deferred";
  RayBuildOptions ray_build;
  WireOptions wire;
  bool explain = false;
  std::string stats;
  bool strict = false;    ///< values that are no finite numbers are errors
  double exposure = 0.0;  ///< stops, of display colours only

  void declare(CLI::App& app);
  /// All but what a command that draws many frames says in its own way: --reference, --aov, --explain and --stats.
  void declare_frame(CLI::App& app);

  /// The scene with the light these options give it.
  [[nodiscard]] Scene load(const std::string& source, const Globals& globals) const;

  /// The camera the user means: by --eye and --at, by name or index, else the scene's first, else one that frames it.
  [[nodiscard]] Camera choose_camera(const Scene& scene) const;

  /// Throws Error (Usage) for unknown names, before any scene is loaded. `seed`: of everything random.
  [[nodiscard]] FrameSettings settings(std::uint64_t seed) const;
  /// The same.
  [[nodiscard]] Sampling sampling() const;

  /// Options that were given beside --reference and change nothing with it.
  [[nodiscard]] std::vector<std::string> without_use() const;

 private:
  void declare_light(CLI::App& app);
  void declare_economies(CLI::App& app);
  void check_numbers() const;
  void check_combination(const FrameSettings& settings) const;
  void settle_photons(const Quality& defaults, RaySettings& rays) const;
  void settle_economies(FrameSettings& settings) const;
  void settle_denoiser(FrameSettings& settings) const;
};

/// Throws Error (Usage) where `options` leave no surface for every pixel of a file of keys.
void check_raw(const RenderOptions& options);

/// Of those RenderOptions declares, without their dashes.
[[nodiscard]] std::vector<std::string> option_names();

/// Sets one option, named without its dashes, as the command line would. Throws CLI::ParseError when there is none of
/// this name or it does not take the value.
void set_option(RenderOptions& options, const std::string& name, const std::string& value);

}  // namespace hpr
