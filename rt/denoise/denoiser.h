#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "rt/denoise/coverage_fragments.h"
#include "rt/denoise/joint_bilateral_filter.h"
#include "rt/passes/pass.h"
#include "rt/passes/path_vertex.h"

namespace hpr {

/// Filters a sample's light by a joint bilateral filter (joint_bilateral_filter.h), and samples pixels that silhouette
/// edges cross at more places, shading there only what no pixel about has shaded (as in Chajdas, McGuire, Luebke,
/// "Subpixel Reconstruction Antialiasing", 2011). From sample to sample fewer neighbors are accepted and weigh less, so
/// that the mean of many samples is nearly the unfiltered one. Of light that few samples find, and one pixel alone,
/// what would show is left out (docs/decisions/0028-rare-light-in-first-pictures.md). Surfaces that emit, that are seen
/// through an absorbing medium or that lie behind surfaces of partial coverage are left as they are. Only a frame's
/// first kDenoisedSamples are filtered.
///
/// Light comes from the tile and from what its margin sees (see TileMargin), and a sample stays in itself: neither
/// ranks nor threads change a bit.
class Denoiser {
 public:
  /// Whether direct light stays with its pixel, which components of the light are needed for.
  [[nodiscard]] static bool keeps_direct(const Scene& scene) { return !scene.lights.empty(); }

  /// How wide the margin has to be in a sample: what the filter reads, and what decides whether that is a tap.
  [[nodiscard]] static int reach(std::uint32_t sample);

  /// Starts a tile of so many samples, whose components are filtered too where they are summed, with so many strips of
  /// margins in all.
  void start(std::size_t samples, std::size_t margins, bool with_components);

  /// Reads the features of primary vertices, which are finished but not shaded.
  void add_vertices(const LightContext& context, std::span<const PathVertex> points);

  /// Once all is shaded: samples the fragments of pixels that edges cross. `margin`: the strips of the sample. Appends
  /// the vertices that no tap can stand in for to `unfiltered`: they are to be shaded.
  void resample_edges(const LightContext& context, const TileJob& job, std::span<const TileJob> margin,
                      const TileFragments& fragments, RayBuffers& buffers, PixelSums& sums,
                      std::vector<PathVertex>& unfiltered);

  /// Once those are shaded too: replaces the sample's sums.
  void resolve(const LightContext& context, const TileJob& job, const TileFragments& fragments, PixelSums& sums);

 private:
  enum class State : std::uint8_t {
    Unlit,
    Tap,
    Alone,
    Apart,  ///< keeps its own light even where an edge crosses it
  };

  /// The light that is filtered: planes of NeighborFeatures::scattering.
  enum class FilterLobe : std::uint8_t {
    All,
    Specular,  ///< all that is not diffuse
    Diffuse,
  };

  /// What the filter compares.
  struct PixelFeature {
    SurfaceFeature feature;
    glm::vec3 shading_normal{0.0F};  ///< the normal shaded with
    glm::vec3 specular{0.0F};  ///< about the fraction of light reflected or transmitted by specular lobes to the eye
    glm::vec3 diffuse{0.0F};   ///< about the fraction of light scattered by the diffuse lobe
    float width = 1.0F;        ///< how far normals may differ, relative to those of rough surfaces
    bool separate_diffuse = false;  ///< `width` holds for specular light only, and diffuse light is known
    float alpha = 1.0F;             ///< of the smoothest lobe; 0: a mirror
    /// 1: this lobe blurs what it shows over the pixels about; less: over so much of one. 0 where the surface turns.
    float blur = 0.0F;
  };

  /// The light of the 8 pixels about one, by its brightest channel.
  struct Surroundings {
    double brightest = 0.0;
    double irradiance = 0.0;  ///< the brightest of those that show the like, over the fraction they scatter; 0: none
    bool is_known = true;     ///< whether all in the tile are lit
  };

  /// Rare light that few samples have found yet: beyond what the pixels about have.
  struct Excess {
    std::uint32_t pixel = 0;  ///< as states_
    std::size_t at = 0;       ///< an index of planes
    double fraction = 0.0;    ///< of the pixel's light that is filtered
    double shared = 0.0;      ///< the part of that light which the pixels about take
  };

  /// One more place of a pixel.
  struct SubpixelSample {
    std::uint32_t pixel = 0;   ///< of the tile
    std::uint32_t number = 0;  ///< of the pixel's samples
    glm::vec2 position{0.0F};  ///< from the pixel's centre
    double fraction = 0.0;     ///< of the pixel
  };

  [[nodiscard]] static bool knows_diffuse(const LightContext& context);
  /// Calls `body` with each pixel of the tile and then of its margin: its index into PixelSums, and that of its planes.
  template <typename Body>
  static void each_pixel(const TileJob& job, std::span<const TileJob> margin, const Body& body);
  [[nodiscard]] Surroundings surroundings_of(const TileJob& job, std::size_t at) const;
  /// Finds pixels that stay apart, and excess.
  void set_apart(const LightContext& context, const PixelSums& sums, const TileJob& job,
                 std::span<const TileJob> margin);
  [[nodiscard]] static double sky_light(const LightContext& context, const PixelFeature& seen);
  /// Whether there is light in a sum that stays with its pixel.
  [[nodiscard]] static bool keeps(const LightContext& context, std::size_t sum);
  /// That light.
  [[nodiscard]] static glm::dvec3 kept_light(const PixelSums& sums, std::size_t sum, std::uint32_t pixel);
  /// Sets the features of the taps, then their light.
  void set_taps(const TileJob& job, std::span<const TileJob> margin);
  void set_light(const LightContext& context, const TileJob& job, std::span<const TileJob> margin,
                 const PixelSums& sums);
  /// Finds where narrow lobes blur what they show.
  void set_blur(const LightContext& context, const TileJob& job, std::span<const TileJob> margin,
                const PixelSums& sums);
  /// Takes excess from the light of the taps; later shares it out among the pixels about.
  void take_excess(const LightContext& context);
  /// The sum of the weights of a window whose pixels are all alike, but those that the tile does not know.
  [[nodiscard]] double window_sum(const TileJob& job, std::size_t at, int radius) const;
  [[nodiscard]] glm::dvec3 scattering_ratio(std::size_t tap, const ScatteringTerm<float>& term) const;
  void add_share(const LightContext& context, const TileJob& job, const PixelSums& sums, const Excess& excess,
                 const glm::ivec2& to, const glm::dvec3& fraction);
  void share_excess(const LightContext& context, const TileJob& job, const PixelSums& sums);
  /// What the centers of pixels and of subpixel samples have in common.
  [[nodiscard]] static FilterCenter<float> center_of(const View& view, const SurfaceFeature& feature,
                                                     std::uint32_t pixel);
  /// The fraction of light that is scattered to the eye.
  [[nodiscard]] static glm::vec3 scattering_of(const PixelFeature& seen, FilterLobe lobe);
  [[nodiscard]] FilterCenter<float> center_at(const TileJob& job, std::uint32_t pixel, FilterLobe lobe) const;
  void add_background(const LightContext& context, const SubpixelSample& sample, const glm::dvec3& direction);
  /// False where no tap has a weight.
  [[nodiscard]] bool add_filtered(const LightContext& context, const TileJob& job, const SubpixelSample& sample,
                                  const SurfaceFeature& seen);
  /// Pixels whose sample sees what none of their parts is stay apart: so what was missed keeps its light.
  void set_unexpected_apart(const TileJob& job, std::span<const CoverageFragment> fragments);
  void sample_fragment(const LightContext& context, const TileJob& job, RayBuffers& buffers, PixelSums& sums,
                       View& view, const CoverageFragment& fragment, const SubpixelOffsets& positions);
  void add_sample(const LightContext& context, const TileJob& job, RayBuffers& buffers, const SubpixelSample& sample,
                  std::size_t ray, std::vector<PathVertex>& unfiltered);
  void filter(const LightContext& context, const TileJob& job, std::uint32_t pixel);
  /// Calls `body` with the number of each sum that is wanted: 0 for the radiance, 1 + i for component i.
  template <typename Body>
  void each_sum(const Body& body) const;

  std::vector<State> states_;                      ///< per pixel, sample after sample
  std::vector<PixelFeature> pixel_features_;       ///< per pixel, sample after sample; of taps
  std::unique_ptr<NeighborFeatures<float>> taps_;  ///< of the current sample
  /// Light of the taps by pixel, 0 where there is none: radiance, then the components that are wanted.
  std::vector<TapVectors<double>> light_;
  std::vector<TapVectors<double>>
      diffuse_light_;  ///< the diffuse part of light_; when some pixel of the tile separates it
  std::vector<TapVectors<double>> kept_light_;         ///< the part of light_ that stays with its pixel: direct light
  std::array<double, TapPlanes::kSize> brightness_{};  ///< of the current sample's pixels; below 0: unknown
  std::array<float, TapPlanes::kSize> distance_{};     ///< of the current sample's taps, see PixelSums
  std::vector<Excess> excess_;                         ///< of the current sample
  bool some_separate_ = false;
  TapWeights<float> weights_;
  TapWeights<float> diffuse_weights_;
  float narrowed_ = 1.0F;  ///< how far normals may differ in the sample at hand, relative to the first one
  std::vector<SubpixelSample> samples_;  ///< that rays were sent for
  std::uint32_t spare_ = 0;              ///< where the tile's sums have room for what is lit in addition
  /// The filtered sums of the current sample, per pixel: radiance, then the components that are wanted.
  std::array<std::vector<glm::dvec3>, 1 + kComponents> filtered_;
  std::size_t sums_ = 1;  ///< how many of filtered_ are wanted
  std::vector<double>
      uncovered_;  ///< of the current sample, per pixel, where coverage is wanted: its samples of the background
};

}  // namespace hpr
