#pragma once

#include <span>
#include <string>
#include <string_view>

#include "image/color.h"

/// What reports draw with: markup that is HTML and XML at once, SVG shapes, and the colors of pixel maps.
namespace hpr {

/// `text` as content or as an attribute's value: nothing in it is markup, and bytes that are no UTF-8, or no character
/// of XML, become U+FFFD.
[[nodiscard]] std::string escape_markup(std::string_view text);

/// The color of a heat map for a fraction from 0 to 1: from black to pale yellow in equal steps of lightness.
[[nodiscard]] Rgba8 heat_color(double fraction);

/// A position on a canvas, in pixels; y grows downwards.
struct Point {
  double x = 0.0;
  double y = 0.0;
};

/// How a line or an outline is drawn.
struct Stroke {
  std::string_view color = "#222222";
  double width = 1.0;
  std::string_view dashes = {};  ///< as in stroke-dasharray; empty: none
};

enum class Anchor { Start, Middle, End };

/// Collects shapes into an SVG document that can stand inline in a page or, since it names its namespace and uses no
/// style sheet, in a file of its own.
class SvgCanvas {
 public:
  /// A white canvas of `width` x `height`; `title` is the text alternative's first line, `description` the rest.
  SvgCanvas(double width, double height, std::string_view title, std::string_view description);

  void line(Point from, Point to, const Stroke& stroke);
  void polyline(std::span<const Point> points, const Stroke& stroke);
  /// A closed shape; `fill` may be "none".
  void polygon(std::span<const Point> points, std::string_view fill, const Stroke& stroke);
  void rectangle(Point corner, double width, double height, std::string_view fill, const Stroke& stroke);
  void circle(Point center, double radius, std::string_view fill, const Stroke& stroke);
  /// A line that ends in a head.
  void arrow(Point from, Point to, const Stroke& stroke);
  void text(Point at, std::string_view text, Anchor anchor = Anchor::Start, double size = 12.0, bool bold = false);
  /// Text that reads upwards.
  void upright_text(Point at, std::string_view text, double size = 12.0);

  [[nodiscard]] std::string str() const { return body_ + "</svg>\n"; }

 private:
  void polygon(std::string_view points, std::string_view fill, const Stroke& stroke);

  std::string body_;
};

}  // namespace hpr
