#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "rt/denoise/joint_bilateral_filter.h"
#include "rt/passes/pass.h"
#include "rt/passes/path_vertex.h"

namespace hpr {

/// Light of the first surface that is computed for one pixel of each 2 x 2 block of a tile, the tap, and upsampled by a
/// joint bilateral filter to those pixels of its block that show a similar surface (Kopf, Cohen, Lischinski,
/// Uyttendaele, "Joint Bilateral Upsampling", 2007). All others compute their own. Blocks begin at even pixels of the
/// screen, also where a tile begins between. No light comes from other tiles, but from what a margin sees: so nothing
/// depends on how tiles are distributed. From sample to sample another pixel of the block is the tap.
class HalfResShading {
 public:
  /// How wide the tile's margin has to be.
  static constexpr int kReach = 1;

  /// Starts a tile. `shared`: see shared_components.
  void start(ComponentSet shared, const LightContext& context, const TileJob& job);

  /// Takes the taps among the first generation of points of a strip of the tile's margin, whose light is computed, and
  /// removes the other points. Before choose().
  void add_margin(const TileJob& strip, std::vector<PathVertex>& points);

  /// Decides which pixels are upsampled among the first generation of points of some rows, whole blocks of them: those
  /// have PathVertex::upsampled set and follow no ray of a shared pass.
  void choose(std::vector<PathVertex>& points, int first_row);

  /// Once all light of the tile is computed: adds to each upsampled pixel the mean of the taps about it.
  void upsample(PixelSums& sums);

 private:
  /// What a pixel shows.
  struct Feature {
    glm::dvec3 position{0.0};
    glm::dvec3 normal{0.0};  ///< the one shaded with
    std::uint32_t material = 0;
    std::uint32_t pixel = 0;                      ///< index into PixelSums
    std::array<glm::vec3, kPasses> scattering{};  ///< of the shared passes: about the fraction that reaches the eye
  };

  [[nodiscard]] Feature feature_of(const PathVertex& point) const;
  void set_tap(const glm::ivec2& block, const Feature& feature);
  /// The center of a pixel; its window is to be set.
  [[nodiscard]] FilterCenter<double> center_of(const Feature& feature) const;
  /// From the upper left corner of the first block, which may begin before the tile.
  [[nodiscard]] glm::ivec2 position_of(std::uint32_t pixel) const;
  [[nodiscard]] bool is_tap(const glm::ivec2& position) const;
  [[nodiscard]] FilterWindow taps_about(std::uint32_t pixel) const;

  ComponentSet shared_ = 0;
  std::vector<const PassInfo*> passes_;  ///< those that share components: the terms of the filter
  double glossy_cutoff_ = 0.0;
  Rect rect_;             ///< the tile
  glm::ivec2 before_{0};  ///< pixels of the first block before the tile
  glm::ivec2 tap_{0};     ///< in its block
  glm::dvec3 eye_{0.0};
  std::unique_ptr<NeighborFeatures<double>> taps_;            ///< one for each block, by block
  std::array<std::uint32_t, TapPlanes::kSize> tap_pixels_{};  ///< of each tap, index into PixelSums
  std::vector<Feature> upsampled_;
  TapWeights<double> weights_;
};

}  // namespace hpr
