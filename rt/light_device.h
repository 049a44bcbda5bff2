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
#include "rt/ray_settings.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

struct PhotonMaps;

/// What light is computed from, on whatever device: a scene, its tables, and what is to be done. As long as the shader
/// that has it lives, it stays as it is.
struct LightSources {
  const Scene& scene;
  const Surfaces& surfaces;
  const LightSampler& lights;
  const RaySettings& settings;
  std::span<const PassPlan> plan;
  std::array<bool, kLobes.size()> followed_lobes;
};

/// Tiles of some samples that a device is to light.
struct DeviceTiles {
  std::span<const ShadedSample> samples;
  std::span<const std::size_t> tiles;
  std::span<const Media> eyes;                ///< what the eye of each view is in
  const PhotonMaps* photons = nullptr;        ///< null: none were traced
  const std::function<bool()>& is_overtaken;  ///< asked now and then: the rest means nothing then; may be empty
};

/// Lights tiles in the CPU's stead.
class LightDevice {
 public:
  LightDevice() = default;
  virtual ~LightDevice() = default;
  LightDevice(const LightDevice&) = delete;
  LightDevice& operator=(const LightDevice&) = delete;

  /// Called with each tile of a sample: kTilePixels of radiance with the share that surfaces cover; none where the
  /// device could not finish it.
  using Store = std::function<void(const ShadedSample& sample, std::size_t tile, std::span<const glm::vec4> pixels)>;
  virtual void shade(const DeviceTiles& lit, RayCounts& counts, const Store& store) = 0;
};

/// Lights what the device can, null: nothing, and adds the rays it traced. Returns the tiles that are left to the CPU,
/// of all samples.
[[nodiscard]] std::vector<std::size_t> light_on_device(LightDevice* device, const DeviceTiles& lit, RayCounts& traced);

}  // namespace hpr
