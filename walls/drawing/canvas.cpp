#include "walls/drawing/canvas.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

std::string svg_color(Rgba8 color) {
  return fmt::format("#{:02x}{:02x}{:02x}", color.r, color.g, color.b);
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : printable(text, 200)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

}  // namespace

void Canvas::line(const glm::dvec2& from, const glm::dvec2& to, Rgba8 color, double width) {
  polyline(std::array{from, to}, color, width);
}

void Canvas::frame(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color, double width) {
  fill(corner, {size.x, width}, color);
  fill({corner.x, corner.y + size.y - width}, {size.x, width}, color);
  fill(corner, {width, size.y}, color);
  fill({corner.x + size.x - width, corner.y}, {width, size.y}, color);
}

void Canvas::hatch(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color, double spacing, double width) {
  const glm::dvec2 end = corner + size;
  // Lines x + y = sum.
  for (double sum = std::ceil((corner.x + corner.y) / spacing) * spacing; sum < end.x + end.y; sum += spacing) {
    const double x0 = std::max(corner.x, sum - end.y);
    const double x1 = std::min(end.x, sum - corner.y);
    if (x1 > x0) line({x0, sum - x0}, {x1, sum - x1}, color, width);
  }
}

SvgCanvas::SvgCanvas(Size size, std::string_view title)
    : text_(
          fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
                      "font-family=\"DejaVu Sans, sans-serif\" text-anchor=\"middle\">\n<title>{2}</title>\n",
                      size.width, size.height, escaped(title))) {}

void SvgCanvas::fill(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color) {
  text_ += fmt::format("<rect x=\"{:g}\" y=\"{:g}\" width=\"{:g}\" height=\"{:g}\" fill=\"{}\"/>\n", corner.x, corner.y,
                       size.x, size.y, svg_color(color));
}

void SvgCanvas::polyline(std::span<const glm::dvec2> points, Rgba8 color, double width) {
  std::string list;
  for (const glm::dvec2& p : points) list += fmt::format("{}{:g},{:g}", list.empty() ? "" : " ", p.x, p.y);
  text_ += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{:g}\"/>\n", list,
                       svg_color(color), width);
}

void SvgCanvas::disc(const glm::dvec2& center, double radius, Rgba8 color) {
  text_ += fmt::format("<circle cx=\"{:g}\" cy=\"{:g}\" r=\"{:g}\" fill=\"{}\"/>\n", center.x, center.y, radius,
                       svg_color(color));
}

void SvgCanvas::text(const glm::dvec2& center, std::string_view line, double height, Rgba8 color) {
  // Half of what lies between a capital's top and the line it stands on.
  constexpr double kHalfCapital = 0.36;
  text_ += fmt::format("<text x=\"{:g}\" y=\"{:g}\" font-size=\"{:g}\" fill=\"{}\">{}</text>\n", center.x,
                       center.y + kHalfCapital * height, height, svg_color(color), escaped(line));
}

struct PixelCanvas::Surface {
  explicit Surface(Size size)
      : surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, size.width, size.height)),
        context(cairo_create(surface)) {}
  ~Surface() {
    cairo_destroy(context);
    cairo_surface_destroy(surface);
  }
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;

  void use(Rgba8 color) const { cairo_set_source_rgb(context, color.r / 255.0, color.g / 255.0, color.b / 255.0); }

  cairo_surface_t* surface;
  cairo_t* context;
};

PixelCanvas::PixelCanvas(Size size) {
  constexpr int kMaxSide = 32767;
  HPR_CHECK(size.width > 0 && size.height > 0);
  if (size.width > kMaxSide || size.height > kMaxSide) {
    throw Error(ExitCode::Limit, fmt::format("cannot draw a picture of {} x {} pixels", size.width, size.height),
                fmt::format("pictures may have {} pixels a side", kMaxSide));
  }
  surface_ = std::make_unique<Surface>(size);
  if (cairo_surface_status(surface_->surface) != CAIRO_STATUS_SUCCESS) {
    throw Error(ExitCode::Limit, fmt::format("no memory for a picture of {} x {} pixels", size.width, size.height),
                "draw a smaller one");
  }
}

PixelCanvas::~PixelCanvas() = default;

void PixelCanvas::fill(const glm::dvec2& corner, const glm::dvec2& size, Rgba8 color) {
  surface_->use(color);
  cairo_rectangle(surface_->context, corner.x, corner.y, size.x, size.y);
  cairo_fill(surface_->context);
}

void PixelCanvas::polyline(std::span<const glm::dvec2> points, Rgba8 color, double width) {
  if (points.empty()) return;
  surface_->use(color);
  cairo_set_line_width(surface_->context, width);
  cairo_new_path(surface_->context);
  for (const glm::dvec2& p : points) cairo_line_to(surface_->context, p.x, p.y);
  cairo_stroke(surface_->context);
}

void PixelCanvas::disc(const glm::dvec2& center, double radius, Rgba8 color) {
  surface_->use(color);
  cairo_new_path(surface_->context);
  cairo_arc(surface_->context, center.x, center.y, radius, 0.0, 2.0 * std::numbers::pi);
  cairo_fill(surface_->context);
}

void PixelCanvas::text(const glm::dvec2& center, std::string_view line, double height, Rgba8 color) {
  const std::string shown = printable(line, 200);
  cairo_t* const context = surface_->context;
  surface_->use(color);
  cairo_select_font_face(context, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context, height);
  cairo_text_extents_t extents;
  cairo_text_extents(context, shown.c_str(), &extents);
  constexpr double kHalfCapital = 0.36;
  cairo_move_to(context, center.x - extents.x_bearing - 0.5 * extents.width, center.y + kHalfCapital * height);
  cairo_show_text(context, shown.c_str());
}

Image<Rgba8> PixelCanvas::image() const {
  cairo_surface_flush(surface_->surface);
  const Size size{cairo_image_surface_get_width(surface_->surface), cairo_image_surface_get_height(surface_->surface)};
  const unsigned char* const data = cairo_image_surface_get_data(surface_->surface);
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(surface_->surface));
  Image<Rgba8> image(size);
  for (int y = 0; y < size.height; ++y) {
    const unsigned char* pixel = data + static_cast<std::size_t>(y) * stride;
    for (Rgba8& target : image.row(y)) {
      // RGB24 is a native word 0x00RRGGBB: bytes b, g, r on the little-endian machines this runs on.
      target = {pixel[2], pixel[1], pixel[0], 255};
      pixel += 4;
    }
  }
  return image;
}

}  // namespace hpr
