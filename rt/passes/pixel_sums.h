#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/passes/pass_list.h"

namespace hpr {

struct TileJob;

/// What is summed beside what the samples want.
struct WantedSums {
  bool all_components = false;  ///< those that no sample wants too
  /// What a denoiser needs: the diffuse part of each, distances, and room for one more sample behind those given.
  bool diffuse = false;
  bool cost = false;        ///< the rays of each pixel
  std::size_t margins = 0;  ///< strips, which have the sums of a tile each, behind all others
};

/// Light summed per pixel of one tile, sample after sample, in an order that no thread changes: what passes add to.
class PixelSums {
 public:
  /// Sets all sums of tile `tile` to 0 where `job` wants them, and what the samples store directly of its rows (normal,
  /// albedo). The samples' jobs are alike.
  void clear(const TileJob& job, std::size_t tile, std::span<const ShadedSample> samples, const WantedSums& wants);

  /// Adds light that reaches a pixel.
  void add(std::uint32_t pixel, Component component, const glm::dvec3& light) {
    add(pixel, component, light, contains(kDiffuseComponents, component));
  }
  void add(std::uint32_t pixel, Component component, const glm::dvec3& light, bool is_diffuse) {
    radiance[pixel] += light;
    if (is_diffuse && wants_diffuse) diffuse[pixel] += light;
    if (wants_components) add_to_component(pixel, component, light, is_diffuse);
  }
  /// Adds what the eye sees of the background in a fraction of the pixel.
  void add_background(std::uint32_t pixel, double fraction, const glm::dvec3& light) {
    add(pixel, Component::Direct, fraction * light);
    if (wants_coverage) uncovered[pixel] += fraction;
  }
  /// Adds diffuse light that something hides, to components that are wanted: as direct light and its shadow.
  void add_shadowed(std::uint32_t pixel, const glm::dvec3& light) {
    add_to_component(pixel, Component::Direct, light, true);
    add_to_component(pixel, Component::Shadow, -light, true);
  }
  /// Notes how many metres from the pixel's first surface a lobe that is followed for itself found something.
  void note_distance(std::uint32_t pixel, double metres) {
    if (wants_diffuse) distance[pixel] = std::min(distance[pixel], static_cast<float>(metres));
  }
  /// Counts a ray that was traced for a pixel.
  void count_ray(std::uint32_t pixel) {
    if (wants_cost) cost[pixel] += 1.0F;
  }

  /// Stores the sums of a sample as pixels of the job's rows of tile `tile`. Light that is no finite number is black,
  /// in all layers, and counted in `counts`.
  void store(const TileJob& job, std::size_t tile, const LightOutput& output, RayCounts& counts) const;

  bool wants_components = false;
  bool wants_diffuse = false;
  bool wants_cost = false;
  bool wants_coverage = false;

  // Per pixel of the tile, sample after sample; all but the radiance only when wanted.
  std::vector<glm::dvec3> radiance;
  std::array<std::vector<glm::dvec3>, kComponents> components;
  /// The diffuse part of the radiance: what the first surface scatters by lobes that no pass follows for itself,
  /// without the light of sampled lights; then the diffuse part of each component.
  std::vector<glm::dvec3> diffuse;
  std::array<std::vector<glm::dvec3>, kComponents> diffuse_components;
  std::vector<float> cost;        ///< rays traced
  std::vector<float> distance;    ///< the least that was noted; infinite: none
  std::vector<double> uncovered;  ///< fraction of the pixel that shows the background

 private:
  void add_to_component(std::uint32_t pixel, Component component, const glm::dvec3& light, bool is_diffuse) {
    components[static_cast<std::size_t>(component)][pixel] += light;
    if (is_diffuse && wants_diffuse) diffuse_components[static_cast<std::size_t>(component)][pixel] += light;
  }
};

/// Stores a sample's pixels that a device has lit (TileShader), as PixelSums does: of the job's rows of tile `tile`.
void store_shaded(const TileJob& job, std::size_t tile, std::span<const glm::vec4> pixels, const LightOutput& output,
                  RayCounts& counts);

/// Whether a pixel of floats can hold the light; what does not fit is stored as black.
[[nodiscard]] bool fits_floats(const glm::dvec3& light);

/// Adds normal and base color of what each pixel sees to tile `tile`, of several surfaces each by its share.
void add_first_surfaces(const std::vector<PathVertex>& points, std::size_t tile, const LightOutput& output);

/// Makes the tile active in all layers there are.
void set_active(const LightOutput& output, std::size_t tile);

}  // namespace hpr
