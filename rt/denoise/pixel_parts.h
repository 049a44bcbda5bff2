#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/denoise/outlines.h"

namespace hpr {

/// Places of a pixel, from its centre: a net of Sobol's sequence, as the filter asks.
using Looks = std::array<glm::vec2, 32>;

/// How what a surface shows changes over a pixel: places about evenly, and so the part of normals across the view,
/// which on a sphere changes evenly up to the outline, where the normals themselves turn ever faster.
class Patch {
 public:
  Patch() = default;
  /// Fits some sights of one surface, at least one, by least squares. `to_eye`: unit length.
  Patch(std::span<const Known> known, std::span<const Sight> sights, const glm::vec3& to_eye);

  /// At a place of the pixel, from its centre.
  [[nodiscard]] Sight at(const glm::vec2& place) const;

 private:
  /// In the pixel's centre, and by how much it changes with x and with y.
  using Plane = std::array<glm::vec3, 3>;

  std::uint32_t material_ = 0;
  glm::vec3 to_eye_{0.0F};
  Plane place_{};
  Plane across_{};
};

/// What a surface, or the background, shows of a pixel that outlines cross: what an A-buffer holds of it (Carpenter,
/// "The A-buffer, an Antialiased Hidden Surface Method", 1984).
struct PixelPart {
  enum class Shows : std::uint8_t {
    Background,
    Surface,
    Many,  ///< surfaces and background that are not told apart
  };
  std::uint32_t pixel = 0;  ///< of the tile
  std::uint32_t looks = 0;  ///< a bit for each that sees it
  float share = 0.0F;       ///< of the pixel
  glm::vec2 middle{0.0F};   ///< the place to look at where no look sees it
  Shows shows = Shows::Background;
  Patch patch{};  ///< of a surface

  /// Of the looks that see it.
  [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(std::popcount(looks)); }
  /// Where it is seen, from the pixel's centre: a place for each number, all in turn.
  [[nodiscard]] glm::vec2 place(const Looks& places, std::uint32_t number) const;
  /// Whether that may be what is seen of it at a place.
  [[nodiscard]] bool is_like(const View& view, const Sight& sight, const glm::vec2& place) const;
};

struct TileParts {
  std::vector<std::uint8_t> crossed;  ///< 1 for each pixel that an outline crosses; empty: not yet known
  std::vector<PixelPart> parts;       ///< of those, pixel after pixel
  const Looks* places = nullptr;
};

/// Finds the parts of pixels of one tile after the other. Keeps its memory.
class PartFinder {
 public:
  /// Sets the parts and returns which pixels outlines cross. `job`: any sample of the tile.
  [[nodiscard]] std::vector<std::uint8_t> find(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                               TileParts& found);

 private:
  /// Looks that see the like.
  struct Kind {
    std::uint32_t first = 0;
    std::uint32_t looks = 0;
  };

  [[nodiscard]] Patch patch_of(const TileJob& job, std::uint32_t pixel, std::span<const Known> known,
                               std::span<const Sight> sights);
  void add_sides(const TileJob& job, const TileOutlines::Pixel& pixel, TileParts& found);
  /// Asks rays for all looks at the pixels that are left over.
  void ask(const LightContext& context, RayBuffers& buffers, const TileJob& job, TileParts& found);
  void group(const TileJob& job, std::uint32_t pixel, std::span<const Sight> seen, TileParts& found);

  View view_;
  TileOutlines outlines_;
  std::vector<std::uint32_t> asked_;  ///< pixels
  std::vector<Sight> seen_;
  std::vector<Kind> kinds_;
  std::vector<Known> known_;
};

/// Parts of the pixels of all tiles. Found by rays that no sample has a part in: else a thin thing would be looked at
/// more closely only when a sample happens to meet it, and lose light. Kept while the views stay the same.
class PixelParts {
 public:
  /// Before a frame is lit, by one thread. `views[i]` is screen i of the layout.
  void prepare(const FrameLayout& layout, std::span<const View> views, const RaySettings& settings);

  /// `job`: any sample of the frame. One thread at a time asks for a tile.
  [[nodiscard]] const TileParts& of_tile(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                         std::size_t tile, PartFinder& finder);

 private:
  FrameLayout layout_;
  std::vector<View> views_;
  Looks places_{};
  std::vector<TileParts> tiles_;
};

}  // namespace hpr
