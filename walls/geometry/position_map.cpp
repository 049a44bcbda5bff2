#include "walls/geometry/position_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

[[noreturn]] void fail(const std::string& name, std::string_view what) {
  throw Error(
      ExitCode::BadInput, fmt::format("{}: {}", printable(name), what),
      "a position map is a PFM of three channels: \"PF\", width and height, -1.0, each on a line, and 12 bytes a "
      "texel");
}

/// The words of a header, each ended by one white space.
class Header {
 public:
  explicit Header(std::string_view bytes) : rest_(bytes) {}

  /// Empty where there is none.
  std::string_view word() {
    constexpr std::size_t kLongest = 32;
    const std::size_t end = rest_.substr(0, kLongest).find_first_of(" \t\r\n");
    if (end == std::string_view::npos) return {};
    const std::string_view word = rest_.substr(0, end);
    const bool two = rest_.substr(end).starts_with("\r\n");
    rest_.remove_prefix(end + (two ? 2 : 1));
    return word;
  }

  template <typename Number>
  std::optional<Number> number() {
    const std::string_view digits = word();
    Number number{};
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (error != std::errc() || stop != digits.data() + digits.size()) return std::nullopt;
    return number;
  }

  [[nodiscard]] std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
};

constexpr std::size_t kTexelBytes = 12;

struct Layout {
  Size size;
  bool swapped = false;  ///< bytes of numbers
};

Layout read_layout(Header& header, const std::string& name) {
  const std::string_view kind = header.word();
  if (kind == "Pf") fail(name, "a PFM of one channel");
  if (kind != "PF") fail(name, "no PFM");
  const auto width = header.number<int>();
  const auto height = header.number<int>();
  const auto scale = header.number<double>();
  if (!width || !height || !scale || !std::isfinite(*scale) || *scale == 0.0) fail(name, "a header that is no PFM's");
  if (*width < 1 || *height < 1 || *width > kMaxScreenSide || *height > kMaxScreenSide) {
    fail(name, fmt::format("{} x {} texels; it may have 1 to {} a side", *width, *height, kMaxScreenSide));
  }
  return {{*width, *height}, *scale > 0.0};
}

float float_at(const char* bytes, bool swapped) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes, sizeof(word));
  return std::bit_cast<float>(swapped ? __builtin_bswap32(word) : word);
}

}  // namespace

PositionMap parse_position_map(std::span<const std::byte> bytes, const std::string& name) {
  constexpr float kFarthest = 1e6F;
  Header header({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const Layout layout = read_layout(header, name);
  const Size size = layout.size;
  const std::string_view texels = header.rest();
  if (texels.size() != size.area() * kTexelBytes) {
    fail(name, fmt::format("{} bytes after the header, and {} x {} texels take {}", texels.size(), size.width,
                           size.height, size.area() * kTexelBytes));
  }
  Image<glm::vec3> points(size);
  bool any = false;
  for (int y = 0; y < size.height; ++y) {
    const char* at = texels.data() +
                     static_cast<std::size_t>(size.height - 1 - y) * static_cast<std::size_t>(size.width) * kTexelBytes;
    for (glm::vec3& point : points.row(y)) {
      for (int i = 0; i < 3; ++i, at += sizeof(float)) point[i] = float_at(at, layout.swapped);
      if (!is_finite(point)) continue;
      const float farthest = std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)});
      if (farthest > kFarthest) {
        fail(name, fmt::format("a point at {} m; write NaN where no light falls", farthest));
      }
      any = true;
    }
  }
  if (!any) fail(name, "no texel is a point: all are NaN or infinite");
  return PositionMap(std::move(points));
}

}  // namespace hpr
