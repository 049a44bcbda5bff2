#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/first_points.h"
#include "rt/outlines.h"
#include "rt/pass.h"

namespace hpr {

/// At how many places of a pixel that an outline crosses a sample looks again. All looks of a frame's samples are one
/// Sobol' sequence in the order of the samples, of which each has a net.
[[nodiscard]] std::uint32_t looks_of(std::uint32_t sample);

/// Smooths a sample's light over the pixels about each that see the like (a cross-bilateral filter: Eisemann, Durand,
/// "Flash Photography Enhancement via Intrinsic Relighting", 2004), and looks again where outlines are, lighting there
/// only what no pixel about has lit (as in Chajdas, McGuire, Luebke, "Subpixel Reconstruction Antialiasing", 2011).
/// Alike are places of one material, turned and placed alike; what one lends another is made up for how much light the
/// two scatter, so textures stay. From sample to sample fewer neighbours are alike and count less, so that the mean of
/// many samples is nearly that without. What emits light, is seen through an absorbing medium or lies behind surfaces
/// that cover in part keeps to itself. Only a frame's first kDenoisedSamples are.
///
/// Light stays in its tile, and a sample in itself: neither ranks nor threads change a bit.
class Denoiser {
 public:
  /// Whether direct light stays with its pixel, which components of the light are needed for.
  [[nodiscard]] static bool keeps_direct(const Scene& scene) { return !scene.lights.empty(); }

  /// Starts a tile of so many samples.
  void start(std::size_t samples);

  /// Takes note of points the eye sees, which are finished but not lit.
  void note(const TileWork& tile, std::span<const PathPoint> points);

  /// Once all is lit: looks again where `outlines` is 1. Puts what is to be lit in addition into `alone`.
  void look_again(TileWork& tile, const TileJob& job, std::span<const std::uint8_t> outlines,
                  std::vector<PathPoint>& alone);

  /// Once that is lit too: replaces the sample's sums.
  void resolve(TileWork& tile, const TileJob& job, std::span<const std::uint8_t> outlines);

 private:
  enum class State : std::uint8_t {
    Unlit,
    Lends,
    KeepsToItself,
    Apart,  ///< keeps its own light even on an outline: it is no finite number, or far brighter than all about
  };

  /// What tells whether two places are alike.
  struct Seen {
    glm::vec3 place{0.0F};   ///< from the eye, metres
    glm::vec3 normal{0.0F};  ///< interpolated
    glm::vec3 mapped{0.0F};  ///< the one shaded with
    glm::vec3 weight{0.0F};  ///< about the share of light that it scatters to the eye
    float width = 1.0F;      ///< how far normals may differ, in parts of what those of rough surfaces may
    std::uint32_t material = 0;
  };

  /// One more place of a pixel.
  struct Look {
    std::uint32_t pixel = 0;  ///< of the tile
    std::uint32_t number = 0;
    glm::dvec2 offset{0.0};  ///< from the pixel's centre
    double share = 0.0;      ///< of the pixel
  };

  /// Who lends to a place, and how much.
  struct Lenders {
    std::array<std::uint32_t, 9> at{};  ///< pixels of TileWork's
    std::array<glm::vec3, 9> weights{};
    std::size_t count = 0;
    float sum = 0.0F;
  };

  [[nodiscard]] static double brightest_about(const TileWork& tile, const TileJob& job, int column, int row);
  /// Finds pixels that stay apart.
  void set_apart(const TileWork& tile, const TileJob& job);
  [[nodiscard]] static Seen look_at(const SurfacePoint& surface, const glm::dvec3& eye);
  /// Of the 3 x 3 pixels about one, or about another one so many columns and rows away.
  template <typename Weigh>
  [[nodiscard]] Lenders lenders_about(const TileJob& job, std::uint32_t pixel, const glm::ivec2& shift,
                                      const Weigh& weigh) const;
  [[nodiscard]] Lenders lenders_of_look(const TileJob& job, const Look& look, const Seen& seen) const;
  [[nodiscard]] Lenders lenders_of_pixel(const TileJob& job, std::uint32_t pixel) const;
  void add_look(TileWork& tile, const TileJob& job, const Look& look, std::size_t ray, std::vector<PathPoint>& alone);
  void share(TileWork& tile, std::uint32_t pixel, std::uint32_t own, const Lenders& lenders);
  template <typename Body>
  static void each_sum(TileWork& tile, const Body& body);

  std::vector<State> states_;  ///< per pixel, sample after sample
  std::vector<Seen> seen_;     ///< likewise, of those that lend
  float narrowed_ = 1.0F;      ///< how far normals may differ in the sample at hand, in parts of the first one's
  std::uint32_t spare_ = 0;    ///< where the tile's sums have room for what is lit in addition
  /// Of the sample at hand, per pixel: radiance, then the components that are wanted.
  std::array<std::vector<glm::dvec3>, 1 + kComponents> sums_;
};

}  // namespace hpr
