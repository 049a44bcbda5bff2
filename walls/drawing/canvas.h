#pragma once

#include <glm/vec2.hpp>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// A sheet to draw on: units are pixels, (0, 0) is the upper left corner, y points down; pixel (x, y) covers
/// [x, x + 1] x [y, y + 1]. What reaches past the sheet is cut.
class Canvas {
 public:
  virtual ~Canvas() = default;

  virtual void fill(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color) = 0;
  virtual void polyline(std::span<const glm::dvec2> points, Rgba8 color, double width) = 0;
  virtual void disc(const glm::dvec2& center, double radius, Rgba8 color) = 0;
  /// One line, centred on `center` in both directions; `height` is that of the font.
  virtual void text(const glm::dvec2& center, std::string_view line, double height, Rgba8 color) = 0;

  void line(const glm::dvec2& from, const glm::dvec2& to, Rgba8 color, double width);
  /// The outline of a rectangle, inside it.
  void frame(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color, double width);
  /// Diagonal lines `spacing` apart inside a rectangle; they run on between rectangles of one sheet.
  void hatch(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color, double spacing, double width);
};

/// Draws into an SVG document.
class SvgCanvas final : public Canvas {
 public:
  explicit SvgCanvas(Size size, std::string_view title);
  void fill(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color) override;
  void polyline(std::span<const glm::dvec2> points, Rgba8 color, double width) override;
  void disc(const glm::dvec2& center, double radius, Rgba8 color) override;
  void text(const glm::dvec2& center, std::string_view line, double height, Rgba8 color) override;
  /// The whole document; UTF-8.
  [[nodiscard]] std::string document() const { return text_ + "</svg>\n"; }

 private:
  std::string text_;
};

/// Draws into pixels, with cairo. Sides up to 32767 (Error: Limit).
class PixelCanvas final : public Canvas {
 public:
  explicit PixelCanvas(Size size);
  ~PixelCanvas() override;
  PixelCanvas(const PixelCanvas&) = delete;
  PixelCanvas& operator=(const PixelCanvas&) = delete;
  void fill(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color) override;
  void polyline(std::span<const glm::dvec2> points, Rgba8 color, double width) override;
  void disc(const glm::dvec2& center, double radius, Rgba8 color) override;
  void text(const glm::dvec2& center, std::string_view line, double height, Rgba8 color) override;
  [[nodiscard]] Image<Rgba8> image() const;

 private:
  struct Surface;
  std::unique_ptr<Surface> surface_;
};

}  // namespace hpr
