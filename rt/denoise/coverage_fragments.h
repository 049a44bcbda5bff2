#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/denoise/silhouette_edges.h"

namespace hpr {

/// Offsets from a pixel's centre, in pixels: a net of Sobol's sequence, distributed as the pixel filter demands.
using SubpixelOffsets = std::array<glm::vec2, 32>;

/// How what a surface shows changes over a pixel: places about evenly, and so the part of normals across the view,
/// which on a sphere changes evenly up to the silhouette, where the normals themselves turn ever faster.
class Patch {
 public:
  Patch() = default;
  /// Fits some features of one surface, at least one, by least squares. `to_eye`: unit length.
  Patch(std::span<const KnownFeature> known, std::span<const SurfaceFeature> features, const glm::vec3& to_eye);

  /// At a place of the pixel, from its centre.
  [[nodiscard]] SurfaceFeature at(const glm::vec2& position) const;

 private:
  /// In the pixel's centre, and by how much it changes with x and with y.
  using Plane = std::array<glm::vec3, 3>;

  std::uint32_t material_ = 0;
  glm::vec3 to_eye_{0.0F};
  Plane position_{};
  Plane across_{};
};

/// What a surface, or the background, shows of a pixel that edges cross: a fragment of an A-buffer (Carpenter,
/// "The A-buffer, an Antialiased Hidden Surface Method", 1984).
struct CoverageFragment {
  enum class Shows : std::uint8_t {
    Background,
    Surface,
    Many,  ///< surfaces and background that are not distinguished
  };
  std::uint32_t pixel = 0;    ///< of the tile
  std::uint32_t samples = 0;  ///< a bit for each offset that shows it
  float fraction = 0.0F;      ///< of the pixel
  glm::vec2 centroid{0.0F};   ///< where it is sampled when no offset meets it
  Shows shows = Shows::Background;
  Patch patch{};  ///< of a surface

  /// The number of offsets that show it.
  [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(std::popcount(samples)); }
  /// Where it is seen, from the pixel's centre: a place for each number, all in turn.
  [[nodiscard]] glm::vec2 position_at(const SubpixelOffsets& positions, std::uint32_t number) const;
  /// Whether that may be what is seen of it at a place.
  [[nodiscard]] bool matches(const View& view, const SurfaceFeature& feature, const glm::vec2& position) const;
};

struct TileFragments {
  std::vector<std::uint8_t> crossed;        ///< 1 for each pixel that an edge crosses; empty: not yet known
  std::vector<CoverageFragment> fragments;  ///< of the crossed pixels, pixel after pixel
  const SubpixelOffsets* positions = nullptr;
};

/// Finds the parts of pixels of one tile after the other. Keeps its memory.
class FragmentFinder {
 public:
  /// Sets the fragments and returns which pixels edges cross. `job`: any sample of the tile.
  [[nodiscard]] std::vector<std::uint8_t> find(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                               TileFragments& found);

 private:
  /// Offsets that show one surface.
  struct Kind {
    std::uint32_t first = 0;
    std::uint32_t samples = 0;
  };

  [[nodiscard]] Patch patch_of(const TileJob& job, std::uint32_t pixel, std::span<const KnownFeature> known,
                               std::span<const SurfaceFeature> features);
  void add_sides(const TileJob& job, const SilhouetteEdges::Pixel& pixel, TileFragments& found);
  /// Traces a ray through every offset of the pending pixels.
  void trace_pending(const LightContext& context, RayBuffers& buffers, const TileJob& job, TileFragments& found);
  void group(const TileJob& job, std::uint32_t pixel, std::span<const SurfaceFeature> seen, TileFragments& found);

  View view_;
  SilhouetteEdges silhouettes_;
  std::vector<std::uint32_t> pending_;  ///< pixels
  std::vector<SurfaceFeature> traced_features_;
  std::vector<Kind> kinds_;
  std::vector<KnownFeature> known_;
};

/// The fragments of the edge pixels of all tiles. Found by rays that belong to no sample: else a thin thing would be
/// sampled more closely only when a sample happens to meet it, and lose light. Kept while the views stay the same.
class CoverageFragments {
 public:
  /// Before a frame is lit, by one thread. `views[i]` is screen i of the layout.
  void prepare(const FrameLayout& layout, std::span<const View> views, const RaySettings& settings);

  /// `job`: any sample of the frame. One thread at a time calls it for a tile.
  [[nodiscard]] const TileFragments& of_tile(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                             std::size_t tile, FragmentFinder& finder);

 private:
  FrameLayout layout_;
  std::vector<View> views_;
  SubpixelOffsets positions_{};
  std::vector<TileFragments> tiles_;
};

}  // namespace hpr
