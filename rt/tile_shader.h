#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/lights/light_sampler.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/medium.h"
#include "rt/passes/pass_list.h"
#include "rt/ray_counts.h"
#include "rt/ray_settings.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

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

  /// How long the device was at the steps of the last shade(); the same steps on all ranks, whatever they lit.
  [[nodiscard]] virtual std::span<const PassTime> times() const = 0;
};

/// Lights what the device can, null: nothing, and adds the rays it traced. Returns the tiles that are left to the CPU,
/// of all samples.
[[nodiscard]] std::vector<std::size_t> shade_on_device(TileShader* device, const TilesToShade& lit, RayCounts& traced);

/// Adds the steps of the device's last shade(), of which everything took so many ms: those of threads, all together.
void add_times(const TileShader& device, double ms, int threads, std::vector<PassTime>& times);

}  // namespace hpr
