#include "tools/report/canvas.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace hpr {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";  // U+FFFD

/// The bytes of the character that `text` starts with; 0 when it is no character of XML.
std::size_t character_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
  const std::uint32_t first = byte(0);
  if (first < 0x80) return first >= 0x20 || first == '\t' || first == '\n' || first == '\r' ? 1 : 0;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < length) return 0;
  std::uint32_t code = first & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return 0;
    code = code << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> kMinOfLength{0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  const bool no_character = code == 0xFFFE || code == 0xFFFF || code > 0x10FFFF;
  return code < kMinOfLength.at(length) || surrogate || no_character ? 0 : length;
}

std::string_view entity(char character) {
  switch (character) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\'':
      return "&#39;";
    default:
      return {};
  }
}

std::string attributes(const Stroke& stroke) {
  std::string text = fmt::format(R"( stroke="{}" stroke-width="{:.3g}")", stroke.color, stroke.width);
  if (!stroke.dashes.empty()) text += fmt::format(R"( stroke-dasharray="{}")", stroke.dashes);
  return text;
}

/// "1.0,2.0 3.0,4.0 "
std::string coordinates(std::span<const Point> points) {
  std::string text;
  for (const Point& point : points) text += fmt::format("{:.1f},{:.1f} ", point.x, point.y);
  return text;
}

std::string_view name_of(Anchor anchor) {
  return anchor == Anchor::Start ? "start" : anchor == Anchor::Middle ? "middle" : "end";
}

}  // namespace

std::string escape_markup(std::string_view text) {
  std::string escaped;
  while (!text.empty()) {
    const std::size_t length = character_length(text);
    if (length == 0) {
      escaped += kReplacement;
    } else if (const std::string_view name = entity(text.front()); !name.empty()) {
      escaped += name;
    } else {
      escaped += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return escaped;
}

Rgba8 heat_color(double fraction) {
  constexpr std::array<std::array<double, 3>, 6> kStops{
      {{0, 0, 0}, {52, 18, 108}, {133, 26, 110}, {208, 65, 62}, {247, 148, 34}, {252, 250, 192}}};
  const double position = std::clamp(fraction, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t stop = std::min(static_cast<std::size_t>(position), kStops.size() - 2);
  const double f = position - static_cast<double>(stop);
  const auto level = [&](std::size_t channel) {
    return static_cast<std::uint8_t>(std::lround((1.0 - f) * kStops[stop][channel] + f * kStops[stop + 1][channel]));
  };
  return {level(0), level(1), level(2), 255};
}

SvgCanvas::SvgCanvas(double width, double height, std::string_view title, std::string_view description)
    : body_(fmt::format(
          R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:.0f}" height="{1:.0f}" viewBox="0 0 {0:.0f} {1:.0f}" role="img" )"
          R"(font-family="DejaVu Sans, Verdana, sans-serif" fill="#222222">)"
          "\n<title>{2}</title>\n<desc>{3}</desc>\n",
          width, height, escape_markup(title), escape_markup(description))) {
  rectangle({0, 0}, width, height, "#ffffff", {"none"});
}

void SvgCanvas::line(Point from, Point to, const Stroke& stroke) {
  body_ += fmt::format(R"(<line x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"{}/>)", from.x, from.y, to.x, to.y,
                       attributes(stroke)) +
           "\n";
}

void SvgCanvas::polyline(std::span<const Point> points, const Stroke& stroke) {
  body_ += fmt::format(R"(<polyline points="{}" fill="none"{}/>)", coordinates(points), attributes(stroke)) + "\n";
}

void SvgCanvas::polygon(std::span<const Point> points, std::string_view fill, const Stroke& stroke) {
  polygon(coordinates(points), fill, stroke);
}

void SvgCanvas::polygon(std::string_view points, std::string_view fill, const Stroke& stroke) {
  body_ += fmt::format(R"(<polygon points="{}" fill="{}"{}/>)", points, fill, attributes(stroke)) + "\n";
}

void SvgCanvas::rectangle(Point corner, double width, double height, std::string_view fill, const Stroke& stroke) {
  body_ += fmt::format(R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}"{}/>)", corner.x,
                       corner.y, width, height, fill, attributes(stroke)) +
           "\n";
}

void SvgCanvas::circle(Point center, double radius, std::string_view fill, const Stroke& stroke) {
  body_ += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="{:.1f}" fill="{}"{}/>)", center.x, center.y, radius, fill,
                       attributes(stroke)) +
           "\n";
}

void SvgCanvas::arrow(Point from, Point to, const Stroke& stroke) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const Point along{(to.x - from.x) / length, (to.y - from.y) / length};
  const double head = 5.0 + stroke.width;
  const double half = 2.0 + stroke.width * 0.6;
  const Point neck{to.x - along.x * head, to.y - along.y * head};
  line(from, neck, stroke);
  const std::string head_points =
      fmt::format("{:.1f},{:.1f} {:.1f},{:.1f} {:.1f},{:.1f}", to.x, to.y, neck.x - along.y * half,
                  neck.y + along.x * half, neck.x + along.y * half, neck.y - along.x * half);
  polygon(head_points, stroke.color, {"none"});
}

void SvgCanvas::text(Point at, std::string_view text, Anchor anchor, double size, bool bold) {
  body_ += fmt::format(R"(<text x="{:.1f}" y="{:.1f}" font-size="{:.3g}" text-anchor="{}"{}>{}</text>)", at.x, at.y,
                       size, name_of(anchor), bold ? R"( font-weight="bold")" : "", escape_markup(text)) +
           "\n";
}

void SvgCanvas::upright_text(Point at, std::string_view text, double size) {
  body_ += fmt::format(
      R"~(<text x="{0:.1f}" y="{1:.1f}" font-size="{2:.3g}" text-anchor="middle" transform="rotate(-90 {0:.1f} {1:.1f})">)~",
      at.x, at.y, size);
  body_ += escape_markup(text) + "</text>\n";
}

}  // namespace hpr
