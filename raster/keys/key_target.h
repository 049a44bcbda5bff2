#pragma once

#include "image/image.h"
#include "raster/gl.h"

namespace hpr {

/// What GL draws keys into: 32-bit float depth and 32-bit unsigned words (the low halves of keys), both 0 where nothing
/// is drawn. Grows to what is needed and stays.
class KeyTarget {
 public:
  explicit KeyTarget(GlContext& context);

  /// Binds it with the scissor test on `part` of a view of `view` pixels, whose viewport it sets, and clears that part.
  /// The screen keeps its projection and viewport whatever is drawn of it: scissoring alone changes no pixel, shifted
  /// viewports and sub-frusta do. The framebuffer ends at the part's far corner.
  void begin(Size view, const Rect& part);

  /// Of the framebuffer, whose lower left corner is the view's.
  [[nodiscard]] GLuint depths() const { return depths_.name(); }
  [[nodiscard]] GLuint words() const { return words_.name(); }

 private:
  void grow(Size needed);

  GlContext& context_;
  Size size_;
  GlObject words_;
  GlObject depths_;
  GlObject framebuffer_;
};

}  // namespace hpr
