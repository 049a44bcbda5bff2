#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "image/color.h"
#include "image/filter.h"
#include "rt/passes/pass_id.h"
#include "rt/show/show.h"
#include "rt/trace/ray_build.h"
#include "scene/scene.h"

namespace hpr {

/// What the eye sees past all surfaces, also through the holes of those that cover in part. Mirrors, glass and light
/// meet the scene's environment whatever it is.
struct Background {
  enum class Kind : std::uint8_t {
    Environment,  ///< the scene's; its own background where it has none
    Color,
    Transparent,  ///< nothing: the picture's alpha says what surfaces cover
  };
  Kind kind = Kind::Environment;
  Rgb color;  ///< of Color: radiance

  bool operator==(const Background&) const = default;
};

/// How light is computed. Equal settings give equal pictures on any number of ranks and threads.
struct RaySettings {
  Show show = Show::Shaded;         ///< past Shaded there is neither reference nor denoiser, nor half resolution
  std::vector<PassId> passes = {};  ///< those that are named; empty: as `auto_passes` says
  bool auto_passes = true;          ///< where none is named: what the scene requires; false: none
  bool all_passes = false;          ///< all that run by default, also where the scene does not require them
  int max_depth = 8;                ///< reflections and refractions in a row
  int light_samples = 1;            ///< rays per point and sample towards emitting surfaces and the environment
  double glossy_cutoff = 0.3;       ///< specular lobes of at least this roughness are not followed by rays
  std::uint32_t photons = 0;        ///< sent per sample; 0: kPhotons, and only where the pass is named
  bool global_photons = false;      ///< also those that were scattered by rough surfaces only: all indirect light
  bool gather = false;              ///< under a constant environment rays bring all indirect light, in place of photons
  /// Elsewhere rays look for the indirect light of what the eye sees, and photons tell that of the surfaces they reach
  /// (final gathering, Jensen 1996).
  bool final_gather = false;
  double photon_radius = 0.0;  ///< metres; 0: chosen from the photons' density and the footprint
  /// Metres that a pixel covers of what is seen: photons are gathered from about so far. 0: as their density has it.
  double photon_footprint = 0.0;
  bool fits_photons = false;    ///< no more of `photons` are sent than fill the footprint
  double photons_gathered = 4;  ///< that a first radius takes in, at least: few are enough where samples are many
  int occlusion_rays = 4;       ///< of the ambient-occlusion pass, per point and sample
  double ambient = 0.2;         ///< radiance that pass lets in where nothing is near
  bool terminator_fix = true;   ///< lifts the origins of shadow rays onto the smooth surface that the normals describe
  RayBuild build = {};          ///< of Embree's scenes
  /// Passes whose light of the first surface is computed for one pixel in four and upsampled to its neighbors
  /// (HalfResShading); PassId::Shadow stands for direct light.
  std::vector<PassId> half_resolution = {};
  /// Surfaces that this rank's ray scenes hold, where rays are forwarded between ranks; none: all of them.
  std::optional<std::vector<SurfaceRange>> part = {};
  std::vector<int> holders = {};  ///< the ranks whose parts are all of the scene, this one among them; empty: all ranks
  Background background = {};
  bool denoise = false;  ///< see Denoiser
  /// Filters of a tile (Denoiser, HalfResShading) read its neighbors' pixels too, not only those of other blocks:
  /// its edges show no seams, and a seventh of the pixels is shaded twice.
  bool filter_across_tiles = false;
  PixelFilter filter =
      PixelFilter::Box;    ///< of the pixels, which denoising samples at more places; none of its weights < 0
  bool on_device = false;  ///< a device lights in the CPU's stead, see TileShader
  bool reference = false;  ///< path tracing in place of all passes, paths of max_depth segments
  std::uint64_t seed = 1;  ///< of all randomness
  int threads = 1;
  int host_ranks = 1;  ///< ranks of this host: they share its memory

  bool operator==(const RaySettings&) const = default;
};

/// So many first samples of a frame are denoised: with more of them, further plain ones are the better use of time.
inline constexpr std::uint32_t kDenoisedSamples = 16;

/// Photons sent per sample where the pass is named and nothing says how many.
inline constexpr std::uint32_t kPhotons = 200'000;

}  // namespace hpr
