#pragma once

#include <string>
#include <string_view>

/// Pieces of HTML and SVG, written so that they are XML too.
namespace hpr {

/// `text` as content or as an attribute's value: nothing in it is markup, and what is no UTF-8, or no character XML
/// knows, becomes U+FFFD.
[[nodiscard]] std::string escape_markup(std::string_view text);

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

/// A drawing in the making: inline in a page or, since it names its namespace and uses no style sheet, a file of its
/// own.
class SvgDrawing {
 public:
  /// Shapes stand in a box of `width` x `height`; `title` is the text alternative's first line, `description` the rest.
  SvgDrawing(double width, double height, std::string_view title, std::string_view description);

  void line(Point from, Point to, const Stroke& stroke);
  void polyline(std::string_view points, const Stroke& stroke);
  /// A closed shape; `fill` may be "none".
  void polygon(std::string_view points, std::string_view fill, const Stroke& stroke);
  void rectangle(Point corner, double width, double height, std::string_view fill, const Stroke& stroke);
  void circle(Point center, double radius, std::string_view fill, const Stroke& stroke);
  /// A line that ends in a head.
  void arrow(Point from, Point to, const Stroke& stroke);
  void text(Point at, std::string_view text, Anchor anchor = Anchor::Start, double size = 12.0, bool bold = false);
  /// Reads upwards.
  void upright_text(Point at, std::string_view text, double size = 12.0);

  [[nodiscard]] std::string str() const { return body_ + "</svg>\n"; }

 private:
  std::string body_;
};

}  // namespace hpr
