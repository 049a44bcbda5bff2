#include "walls/geometry/warping.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <functional>
#include <glm/common.hpp>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/text.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

constexpr double kParts = 65536.0;

std::uint32_t along(double position, int count) {
  const double from_center = std::clamp(position - 0.5, 0.0, static_cast<double>(count - 1));
  return static_cast<std::uint32_t>(std::llround(from_center * kParts));
}

const LevelTable& srgb_levels() {
  static const LevelTable levels([](float light) { return static_cast<double>(encode_srgb(light)); });
  return levels;
}

/// Bilinear reading of one picture.
class Reader {
 public:
  explicit Reader(const Image<Rgba8>& picture) : picture_(picture), to_level_(srgb_levels()) {}

  [[nodiscard]] Rgba8 at(const SourcePosition& position) const {
    const int x = static_cast<int>(position.x >> 16U);
    const int y = static_cast<int>(position.y >> 16U);
    const float right = static_cast<float>(position.x & 0xFFFFU) / 65536.0F;
    const float down = static_cast<float>(position.y & 0xFFFFU) / 65536.0F;
    const Rgba8 nearest = picture_.at(x, y);
    if (right == 0.0F && down == 0.0F) return nearest;
    const int beside = right > 0.0F ? x + 1 : x;
    const int below = down > 0.0F ? y + 1 : y;
    const std::array<Rgba8, 4> pixels{nearest, picture_.at(beside, y), picture_.at(x, below),
                                      picture_.at(beside, below)};
    const std::array<float, 4> weights{(1.0F - right) * (1.0F - down), right * (1.0F - down), (1.0F - right) * down,
                                       right * down};
    Rgb sum;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      sum.r += weights[i] * srgb_to_linear(pixels[i].r);
      sum.g += weights[i] * srgb_to_linear(pixels[i].g);
      sum.b += weights[i] * srgb_to_linear(pixels[i].b);
    }
    return {to_level_(sum.r), to_level_(sum.g), to_level_(sum.b), nearest.a};
  }

 private:
  const Image<Rgba8>& picture_;
  const LevelTable& to_level_;
};

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
    constexpr std::size_t kMaxBytes = 32;
    const std::size_t end = rest_.substr(0, kMaxBytes).find_first_of(" \t\r\n");
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

constexpr std::size_t kMaxVertices = std::size_t{1} << 24U;

constexpr std::string_view kCsvHint =
    "a line is x,y,u,v: a place on the screen and one of the picture, all from 0 to 1, row after row of one length";
constexpr std::string_view kObjHint = "write v x y, vt u v, and faces f v/vt v/vt v/vt; all numbers from 0 to 1";

/// What a text is, for errors.
struct Source {
  const std::string& name;
  std::string_view hint;

  [[noreturn]] void fail(int line, std::string_view what) const {
    throw Error(ExitCode::BadInput, fmt::format("{}:{}: {}", printable(name), line, what), std::string(hint));
  }
};

std::string_view trimmed(std::string_view text) {
  const auto space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && space(text.front())) text.remove_prefix(1);
  while (!text.empty() && space(text.back())) text.remove_suffix(1);
  return text;
}

/// Calls `visit` for each line that is neither empty nor a comment, with its number.
void each_line(std::string_view text, const std::function<void(std::string_view line, int number)>& visit) {
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view whole = text.substr(0, end);
    const std::string_view line = trimmed(whole.substr(0, whole.find('#')));
    if (!line.empty()) visit(line, number);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
}

std::vector<std::string_view> split(std::string_view line, std::string_view separators) {
  std::vector<std::string_view> words;
  const bool spaces = separators.find(' ') != std::string_view::npos;
  while (true) {
    const std::size_t end = line.find_first_of(separators);
    const std::string_view word = trimmed(line.substr(0, end));
    if (!spaces || !word.empty()) words.push_back(word);
    if (end == std::string_view::npos) return words;
    line.remove_prefix(end + 1);
  }
}

template <typename Number>
std::optional<Number> number_of(std::string_view word) {
  Number number{};
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
  return number;
}

/// Two numbers from 0 to 1.
glm::dvec2 position_of(std::span<const std::string_view> words, const Source& source, int line) {
  glm::dvec2 position;
  for (int i = 0; i < 2; ++i) {
    const std::string_view word = words[static_cast<std::size_t>(i)];
    const auto number = number_of<double>(word);
    if (!number) source.fail(line, fmt::format("'{}' is no number", printable(word)));
    if (!(*number >= 0.0 && *number <= 1.0)) source.fail(line, fmt::format("{} is not from 0 to 1", *number));
    position[i] = *number;
  }
  return position;
}

/// Twice the area of a triangle on the screen; negative when its corners go round clockwise.
double area_of(const WarpMesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  const glm::dvec2 a = mesh.vertices[triangle[0]].position;
  const glm::dvec2 b = mesh.vertices[triangle[1]].position - a;
  const glm::dvec2 c = mesh.vertices[triangle[2]].position - a;
  return b.x * c.y - b.y * c.x;
}

/// The area of the box around a triangle, as far as it lies on the screen.
double box_area_of(const WarpMesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  glm::dvec2 low(1.0);
  glm::dvec2 high(0.0);
  for (const std::uint32_t vertex : triangle) {
    low = glm::min(low, mesh.vertices[vertex].position);
    high = glm::max(high, mesh.vertices[vertex].position);
  }
  const glm::dvec2 size = glm::max(glm::min(high, glm::dvec2(1.0)) - glm::max(low, glm::dvec2(0.0)), glm::dvec2(0.0));
  return size.x * size.y;
}

constexpr double kNoArea = 1e-14;

/// `line_of`: where a triangle is in the text.
void check_mesh(const WarpMesh& mesh, const Source& source, const std::function<int(std::size_t)>& line_of) {
  // What is worth drawing covers each place once or, as boxes around triangles overlap, a few times.
  constexpr double kMaxCover = 64.0;
  double orientation = 0.0;
  double cover = 0.0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const double area = area_of(mesh, mesh.triangles[i]);
    if (std::abs(area) <= kNoArea) continue;
    if (orientation * area < 0.0) {
      const glm::dvec2 at = mesh.vertices[mesh.triangles[i][0]].position;
      source.fail(line_of(i), fmt::format("the mesh folds over at {:.4g}, {:.4g} of the screen", at.x, at.y));
    }
    orientation = area;
    cover += box_area_of(mesh, mesh.triangles[i]);
    if (cover > kMaxCover) source.fail(line_of(i), "the triangles cover the screen many times over");
  }
  if (orientation == 0.0) source.fail(1, "the mesh covers nothing of the screen");
}

/// Takes a grid in row by row.
class CsvReader {
 public:
  explicit CsvReader(const std::string& name) : source_{name, kCsvHint} {}

  void add(std::string_view line, int number) {
    const bool names = first_ && std::isalpha(static_cast<unsigned char>(line.front())) != 0;
    first_ = false;
    if (names) return;
    const std::vector<std::string_view> words = split(line, ",;");
    if (words.size() != 4) source_.fail(number, fmt::format("{} values where four are wanted", words.size()));
    if (lines_.size() == kMaxVertices) source_.fail(number, fmt::format("more than {} vertices", kMaxVertices));
    const WarpMesh::Vertex vertex{position_of(std::span(words).first(2), source_, number),
                                  position_of(std::span(words).subspan(2), source_, number)};
    count(!lines_.empty() && vertex.position.x <= mesh_.vertices.back().position.x, number);
    mesh_.vertices.push_back(vertex);
    lines_.push_back(number);
  }

  WarpMesh take() {
    const int last = lines_.empty() ? 1 : lines_.back();
    if (columns_ < 2) source_.fail(last, "no grid of at least two rows of two vertices");
    if (in_row_ != columns_) source_.fail(last, fmt::format("the last row has {} vertices of {}", in_row_, columns_));
    for (std::size_t corner = 0; corner + columns_ < mesh_.vertices.size(); ++corner) {
      if (corner % columns_ == columns_ - 1) continue;
      const auto a = static_cast<std::uint32_t>(corner);
      const auto below = static_cast<std::uint32_t>(corner + columns_);
      mesh_.triangles.push_back({a, a + 1, below});
      mesh_.triangles.push_back({a + 1, below + 1, below});
    }
    check_mesh(mesh_, source_, [&](std::size_t i) { return lines_[mesh_.triangles[i][0]]; });
    return std::move(mesh_);
  }

 private:
  void count(bool new_row, int number) {
    if (new_row && columns_ == 0) columns_ = in_row_;
    const bool wrong = new_row ? in_row_ != columns_ : columns_ > 0 && in_row_ == columns_;
    if (wrong) {
      source_.fail(number, fmt::format("a row of {} vertices after rows of {}; x rises along a row",
                                       new_row ? in_row_ : in_row_ + 1, columns_));
    }
    in_row_ = new_row ? 1 : in_row_ + 1;
  }

  Source source_;
  WarpMesh mesh_;
  std::vector<int> lines_;   ///< per vertex
  std::size_t columns_ = 0;  ///< of the first row, once it has ended
  std::size_t in_row_ = 0;
  bool first_ = true;
};

/// An OBJ as it stands: its places and sources have indices of their own.
class ObjReader {
 public:
  explicit ObjReader(const std::string& name) : source_{name, kObjHint} {}

  void add(std::string_view line, int number) {
    const std::vector<std::string_view> words = split(line, " \t");
    if (words.front() == "f") return add_face(words, number);
    const bool position = words.front() == "v";
    if (!position && words.front() != "vt") return;
    std::vector<glm::dvec2>& list = position ? positions_ : sources_;
    if (words.size() < 3) source_.fail(number, "two numbers are wanted");
    if (list.size() == kMaxVertices) source_.fail(number, fmt::format("more than {} vertices", kMaxVertices));
    list.push_back(position_of(std::span(words).subspan(1, 2), source_, number));
  }

  WarpMesh take() {
    if (mesh_.triangles.empty()) source_.fail(1, "there are no faces");
    check_mesh(mesh_, source_, [&](std::size_t i) { return lines_[i]; });
    return std::move(mesh_);
  }

 private:
  /// Counted from 1, or backwards from the latest by negative numbers.
  [[nodiscard]] std::size_t index(std::string_view word, std::size_t count, int number) const {
    const auto index = number_of<long long>(word);
    if (!index) source_.fail(number, fmt::format("'{}' is no index", printable(word)));
    const auto size = static_cast<long long>(count);
    const long long from_first = *index < 0 ? size + *index : *index - 1;
    if (from_first < 0 || from_first >= size) {
      source_.fail(number, fmt::format("index {} of the {} there are so far", *index, size));
    }
    return static_cast<std::size_t>(from_first);
  }

  void add_face(const std::vector<std::string_view>& words, int number) {
    if (words.size() < 4) source_.fail(number, "a face has three corners or more");
    const auto first = static_cast<std::uint32_t>(mesh_.vertices.size());
    if (first + words.size() > kMaxVertices) source_.fail(number, fmt::format("more than {} corners", kMaxVertices));
    for (std::size_t i = 1; i < words.size(); ++i) {
      const std::vector<std::string_view> parts = split(words[i], "/");
      if (parts.size() < 2 || parts[1].empty()) source_.fail(number, "a corner of a face has no vt");
      mesh_.vertices.push_back(
          {positions_[index(parts[0], positions_.size(), number)], sources_[index(parts[1], sources_.size(), number)]});
    }
    for (std::uint32_t i = 2; i + 1 < words.size(); ++i) {
      mesh_.triangles.push_back({first, first + i - 1, first + i});
      lines_.push_back(number);
    }
  }

  Source source_;
  std::vector<glm::dvec2> positions_;
  std::vector<glm::dvec2> sources_;
  WarpMesh mesh_;
  std::vector<int> lines_;  ///< per triangle
};

}  // namespace

LevelTable::LevelTable(const std::function<double(float light)>& level) {
  const auto rounded = [&](float light) { return std::lround(255.0 * std::clamp(level(light), 0.0, 1.0)); };
  // Floats from 0 to 1 rise as their bits do.
  constexpr auto kOne = std::bit_cast<std::uint32_t>(1.0F);
  std::uint32_t from = 0;
  for (std::size_t k = 0; k < 256; ++k) {
    std::uint32_t to = kOne + 1;
    while (from < to) {
      const std::uint32_t midpoint = from + (to - from) / 2;
      if (rounded(std::bit_cast<float>(midpoint)) >= static_cast<long>(k)) {
        to = midpoint;
      } else {
        from = midpoint + 1;
      }
    }
    least_.at(k) = from > kOne ? std::numeric_limits<float>::infinity() : std::bit_cast<float>(from);
  }
  least_[0] = -std::numeric_limits<float>::infinity();
  least_[256] = std::numeric_limits<float>::infinity();
  for (std::size_t step = 0; step < start_.size(); ++step) {
    const float light = static_cast<float>(step) / kSteps;
    const auto past = std::ranges::upper_bound(least_, light);
    start_.at(step) = static_cast<std::uint8_t>(past - least_.begin() - 1);
  }
}

std::uint8_t LevelTable::operator()(float light) const {
  if (!(light > 0.0F)) return start_.front();
  std::size_t level = start_[static_cast<std::size_t>(std::min(light, 1.0F) * kSteps)];
  while (std::min(light, 1.0F) >= least_[level + 1]) ++level;
  return static_cast<std::uint8_t>(level);
}

SourcePosition source_position(double x, double y, Size size) {
  return {along(x, size.width), along(y, size.height)};
}

Image<Rgba8> warped(const Image<Rgba8>& picture, const Image<SourcePosition>& sources, int threads) {
  HPR_CHECK(picture.size().area() > 0);
  const Reader reader(picture);
  Image<Rgba8> result(sources.size(), {0, 0, 0, 255});
  parallel_for(threads, static_cast<std::size_t>(sources.height()), [&](std::size_t y) {
    const auto from = sources.row(static_cast<int>(y));
    const auto to = result.row(static_cast<int>(y));
    for (std::size_t x = 0; x < from.size(); ++x) {
      if (from[x] != kNoSource) to[x] = reader.at(from[x]);
    }
  });
  return result;
}

PositionMap parse_position_map(std::span<const std::byte> bytes, const std::string& name) {
  constexpr float kMaxCoordinate = 1e6F;
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
      if (farthest > kMaxCoordinate) {
        fail(name, fmt::format("a point at {} m; write NaN where no light falls", farthest));
      }
      any = true;
    }
  }
  if (!any) fail(name, "no texel is a point: all are NaN or infinite");
  return PositionMap(std::move(points));
}

WarpMesh parse_warp_csv(std::string_view text, const std::string& name) {
  CsvReader reader(name);
  each_line(without_mark(text), [&](std::string_view line, int number) { reader.add(line, number); });
  return reader.take();
}

WarpMesh parse_warp_obj(std::string_view text, const std::string& name) {
  ObjReader reader(name);
  each_line(without_mark(text), [&](std::string_view line, int number) { reader.add(line, number); });
  return reader.take();
}

Image<SourcePosition> mesh_sources(const WarpMesh& mesh, Size size) {
  // Centres on an edge belong to both sides, and on the screen's own edge to the mesh, whatever rounding says.
  constexpr double kOnEdge = -1e-9;
  Image<SourcePosition> sources(size, kNoSource);
  const glm::dvec2 scale(size.width, size.height);
  const auto in_pixels = [&](const glm::dvec2& position) { return glm::dvec2(position.x, 1.0 - position.y) * scale; };
  for (const auto& triangle : mesh.triangles) {
    const auto& [v0, v1, v2] =
        std::tie(mesh.vertices[triangle[0]], mesh.vertices[triangle[1]], mesh.vertices[triangle[2]]);
    if (std::abs(area_of(mesh, triangle)) <= kNoArea) continue;
    const glm::dvec2 a = in_pixels(v0.position);
    const glm::dvec2 b = in_pixels(v1.position) - a;
    const glm::dvec2 c = in_pixels(v2.position) - a;
    const double area = b.x * c.y - b.y * c.x;
    const auto [left, right] = std::minmax({a.x, a.x + b.x, a.x + c.x});
    const auto [top, bottom] = std::minmax({a.y, a.y + b.y, a.y + c.y});
    const int x1 = std::min(static_cast<int>(right) + 1, size.width);
    const int y1 = std::min(static_cast<int>(bottom) + 1, size.height);
    for (int y = std::max(static_cast<int>(top) - 1, 0); y < y1; ++y) {
      for (int x = std::max(static_cast<int>(left) - 1, 0); x < x1; ++x) {
        if (sources.at(x, y) != kNoSource) continue;
        const glm::dvec2 p = glm::dvec2(x + 0.5, y + 0.5) - a;
        const double towards_b = (p.x * c.y - p.y * c.x) / area;
        const double towards_c = (b.x * p.y - b.y * p.x) / area;
        if (towards_b < kOnEdge || towards_c < kOnEdge || 1.0 - towards_b - towards_c < kOnEdge) continue;
        const glm::dvec2 source = v0.source + towards_b * (v1.source - v0.source) + towards_c * (v2.source - v0.source);
        const glm::dvec2 at = in_pixels(source);
        sources.at(x, y) = source_position(at.x, at.y, size);
      }
    }
  }
  return sources;
}

}  // namespace hpr
