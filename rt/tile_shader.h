#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <span>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/lights/light_sampler.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/medium.h"
#include "rt/passes/pass_list.h"
#include "rt/ray_counts.h"
#include "rt/ray_settings.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

class PhotonDevice;
struct PhotonMaps;

/// What light is computed from, on whatever device: a scene, its tables, and what is to be done. As long as the shader
/// that has it lives, it stays as it is.
struct ShadingInputs {
  const Scene& scene;
  const Surfaces& surfaces;
  const LightSampler& lights;
  const RaySettings& settings;
  std::span<const PassPlan> plan;
  std::array<bool, kLobes.size()> followed_lobes;
};

/// Tiles of some samples that a device is to light.
struct TilesToShade {
  std::span<const ShadedSample> samples;
  std::span<const std::size_t> tiles;
  std::span<const Media> eyes;                ///< what the eye of each view is in
  const PhotonMaps* photons = nullptr;        ///< null: none were traced
  const std::function<bool()>& is_overtaken;  ///< asked now and then: the rest means nothing then; may be empty
};

/// A surface that a pixel shows, from which a device is to follow light.
struct EyePoint {
  glm::dvec3 origin{0.0};  ///< of the ray that meets it, world
  glm::dvec3 direction{0.0};
  double coverage = 1.0;  ///< of the pixel
  Sampler sampler;        ///< before the first draw
  std::uint32_t surface = kNoSurface;
  std::uint32_t pixel = 0;  ///< index into PixelSums
};

/// What reaches the pixel from there, as PixelSums has it.
struct PointLight {
  glm::dvec3 radiance{0.0};
  glm::dvec3 diffuse{0.0};                                  ///< PixelSums::diffuse
  glm::dvec3 direct{0.0};                                   ///< Component::Direct and Component::Shadow together
  float distance = std::numeric_limits<float>::infinity();  ///< PixelSums::distance
  std::uint32_t is_unfinished = 0;                          ///< the device could not: the rest means nothing
};

/// Points that one view shows.
struct PointsOfView {
  const View* view = nullptr;
  Media eye_media;
  std::span<const EyePoint> points;
  std::span<PointLight> light;  ///< set, one for each point
};

/// Points of one sample, or of some that have no photons.
struct PointsToShade {
  std::span<const PointsOfView> groups;
  SampleNumber number;
  const PhotonMaps* photons = nullptr;
  const std::function<bool()>& is_overtaken;
};

/// Lights tiles in the CPU's stead.
class TileShader {
 public:
  TileShader() = default;
  virtual ~TileShader() = default;
  TileShader(const TileShader&) = delete;
  TileShader& operator=(const TileShader&) = delete;

  /// Called with each tile of a sample: kTilePixels of radiance with the share that surfaces cover; none where the
  /// device could not finish it.
  using Store = std::function<void(const ShadedSample& sample, std::size_t tile, std::span<const glm::vec4> pixels)>;
  virtual void shade(const TilesToShade& lit, RayCounts& counts, const Store& store) = 0;
  /// Lights points, for who filters the light.
  virtual void shade_points(const PointsToShade& lit, RayCounts& counts) = 0;

  /// What traces photons in the CPU's stead; null where that is to be the CPU.
  [[nodiscard]] virtual PhotonDevice* photon_device() = 0;

  /// How long the device was at its steps since clear_times(); the same steps on all ranks, whatever they lit.
  [[nodiscard]] virtual std::span<const PassTime> times() const = 0;
  virtual void clear_times() = 0;
};

/// Whether only light is stored, and no layer of what it is made of.
[[nodiscard]] bool wants_light_alone(const LightOutput& output);

/// Lights what the device can and adds the rays it traced. Returns the tiles that are left to the CPU, of all samples.
[[nodiscard]] std::vector<std::size_t> shade_on_device(TileShader& device, const TilesToShade& lit, RayCounts& traced);

/// Splits the last of `times`, which took in the tracing of photons, into the device's steps of that and the rest.
void add_photon_times(TileShader& device, int threads, std::vector<PassTime>& times);

/// Adds the steps of the device, of which everything took so many ms: those of threads, all together.
void add_times(const TileShader& device, double ms, int threads, std::vector<PassTime>& times);

}  // namespace hpr
