#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "rt/denoise/joint_bilateral_filter.h"
#include "rt/denoise/pixel_parts.h"
#include "rt/passes/pass.h"
#include "rt/passes/path_vertex.h"

namespace hpr {

/// Smooths a sample's light over the pixels about each that see the like (a cross-bilateral filter: Eisemann, Durand,
/// "Flash Photography Enhancement via Intrinsic Relighting", 2004), and looks again where outlines are, lighting there
/// only what no pixel about has lit (as in Chajdas, McGuire, Luebke, "Subpixel Reconstruction Antialiasing", 2011).
/// Alike are places of one material, turned and placed alike; what one pixel lends another is made up for how much
/// light the two scatter, so textures stay. From sample to sample fewer neighbours are alike and count less, so that
/// the mean of many samples is nearly that without. What emits light, is seen through an absorbing medium or lies
/// behind surfaces that cover in part keeps to itself. Only a frame's first kDenoisedSamples are.
///
/// Light stays in its tile, and a sample in itself: neither ranks nor threads change a bit.
class Denoiser {
 public:
  /// Whether direct light stays with its pixel, which components of the light are needed for.
  [[nodiscard]] static bool keeps_direct(const Scene& scene) { return !scene.lights.empty(); }

  /// Starts a tile of so many samples, whose components are filtered too where they are summed.
  void start(std::size_t samples, bool with_components);

  /// Takes note of points the eye sees, which are finished but not lit.
  void note(const LightContext& context, std::span<const PathPoint> points);

  /// Once all is lit: looks again at pixels that outlines cross. Puts what is to be lit in addition into `alone`.
  void look_again(const LightContext& context, const TileJob& job, const TileParts& again, RayBuffers& buffers,
                  PixelSums& sums, std::vector<PathPoint>& alone);

  /// Once that is lit too: replaces the sample's sums.
  void resolve(const LightContext& context, const TileJob& job, const TileParts& again, PixelSums& sums);

 private:
  enum class State : std::uint8_t {
    Unlit,
    Lends,
    KeepsToItself,
    Apart,  ///< keeps its own light even on an outline
  };

  /// The light that is filtered: planes of NeighborFeatures::scattering.
  enum class FilterLobe : std::uint8_t {
    All,
    Specular,  ///< all that is not diffuse
    Diffuse,
  };

  /// What tells whether two places are alike.
  struct Seen {
    Sight sight;
    glm::vec3 mapped{0.0F};    ///< the normal shaded with
    glm::vec3 mirrored{0.0F};  ///< about the share of light that it mirrors and lets through to the eye
    glm::vec3 matte{0.0F};     ///< and that it scatters otherwise
    float width = 1.0F;        ///< how far normals may differ, in parts of what those of rough surfaces may
    bool is_split = false;     ///< that holds for what it mirrors alone, and matte light is known
  };

  /// One more place of a pixel.
  struct Look {
    std::uint32_t pixel = 0;   ///< of the tile
    std::uint32_t number = 0;  ///< of the pixel's looks
    glm::vec2 place{0.0F};     ///< from the pixel's centre
    double share = 0.0;        ///< of the pixel
  };

  [[nodiscard]] static bool tells_matte(const LightContext& context);
  [[nodiscard]] static double brightest_about(const PixelSums& sums, const TileJob& job, int column, int row);
  /// Finds pixels that stay apart.
  void set_apart(const PixelSums& sums, const TileJob& job);
  /// Whether there is light in a sum that stays with its pixel.
  [[nodiscard]] static bool keeps(const LightContext& context, std::size_t sum);
  /// Sets what the pixels that lend see and lend.
  void set_sights(const TileJob& job);
  void set_lent(const LightContext& context, const TileJob& job, const PixelSums& sums);
  /// What the centers of pixels and of subpixel samples have in common.
  [[nodiscard]] static FilterCenter<float> center_of(const View& view, const Sight& sight, std::uint32_t pixel);
  /// The fraction of light that is scattered to the eye.
  [[nodiscard]] static glm::vec3 scattering_of(const Seen& seen, FilterLobe lobe);
  [[nodiscard]] FilterCenter<float> center_at(const TileJob& job, std::uint32_t pixel, FilterLobe lobe) const;
  void add_background(const LightContext& context, const Look& look, const glm::dvec3& direction);
  /// False where nobody lends.
  [[nodiscard]] bool add_lent(const LightContext& context, const TileJob& job, const Look& look, const Sight& seen);
  /// Pixels whose sample sees what none of their parts is stay apart: so what was missed keeps its light.
  void set_unexpected_apart(const TileJob& job, std::span<const PixelPart> parts);
  void look_at_part(const LightContext& context, const TileJob& job, RayBuffers& buffers, PixelSums& sums, View& view,
                    const PixelPart& part, const Looks& places);
  void add_look(const LightContext& context, const TileJob& job, RayBuffers& buffers, const Look& look, std::size_t ray,
                std::vector<PathPoint>& alone);
  void share(const LightContext& context, const TileJob& job, std::uint32_t pixel);
  /// Calls `body` with the number of each sum that is wanted: 0 for the radiance, 1 + i for component i.
  template <typename Body>
  void each_sum(const Body& body) const;

  std::vector<State> states_;                      ///< per pixel, sample after sample
  std::vector<Seen> seen_;                         ///< likewise, of those that lend
  std::unique_ptr<NeighborFeatures<float>> taps_;  ///< of the sample at hand
  /// Likewise light, 0 where nothing is lent: radiance, then the components that are wanted.
  std::vector<TapVectors<double>> lent_;
  std::vector<TapVectors<double>> matte_;  ///< of that; when some pixel of the tile is_split
  std::vector<TapVectors<double>> kept_;   ///< of that: light of small lights, which stays with its pixel
  bool some_split_ = false;
  TapWeights<float> weights_;
  TapWeights<float> matte_weights_;
  float narrowed_ = 1.0F;    ///< how far normals may differ in the sample at hand, in parts of the first one's
  std::vector<Look> looks_;  ///< that rays were sent for
  std::uint32_t spare_ = 0;  ///< where the tile's sums have room for what is lit in addition
  /// Of the sample at hand, per pixel: radiance, then the components that are wanted.
  std::array<std::vector<glm::dvec3>, 1 + kComponents> filtered_;
  std::size_t sums_ = 1;  ///< how many of those are wanted
};

}  // namespace hpr
