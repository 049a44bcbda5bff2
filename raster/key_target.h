#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"
#include "raster/gl.h"

namespace hpr {

/// The halves of a rectangle's keys: [height][width], the last row first, as GL reads them; 0 in both where nothing was
/// drawn.
struct KeyHalves {
  std::span<const float> depths;
  std::span<const std::uint32_t> words;
};

/// What GL draws keys into: 32-bit float depth and 32-bit unsigned words (the low halves of keys), both 0 where nothing
/// is drawn. Grows to what is needed and stays.
class KeyTarget {
 public:
  explicit KeyTarget(GlContext& context);

  /// Binds it with the scissor test on `part` of a view of `view` pixels, whose viewport it sets, and clears that part.
  /// The screen keeps its projection and viewport whatever is drawn of it: scissoring alone changes no pixel, shifted
  /// viewports and sub-frusta do. The framebuffer ends at the part's far corner.
  void begin(Size view, const Rect& part);

  /// Reads `pixels` of the view into halves(); rows from the bottom up, as GL has them.
  void read(Size view, const Rect& pixels);
  [[nodiscard]] KeyHalves halves() const { return {depths_, words_}; }

 private:
  void grow(Size needed);

  GlContext& context_;
  Size size_;
  GlObject words_buffer_;
  GlObject depth_buffer_;
  GlObject framebuffer_;
  std::vector<float> depths_;
  std::vector<std::uint32_t> words_;
};

/// Merges (maximum) the keys of the rectangle `pixels`, once or several times drawn, into the tiles of `screen`, and
/// marks those tiles active where anything was drawn.
void pack_keys(std::span<const KeyHalves> drawn, const Rect& pixels, std::size_t screen, TileLayer<Key>& layer,
               int threads);

}  // namespace hpr
