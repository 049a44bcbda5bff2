#include "scene/points_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/text.h"
#include "scene/generators/portable_math.h"
#include "scene/generators/shapes.h"

namespace hpr {
namespace {

constexpr std::size_t kLevels = 5;
constexpr std::uint64_t kMaxTriangles = std::uint64_t{1} << 24U;  ///< from here on shapes are coarser

/// Below how many pixels of width a level suffices.
constexpr std::array<double, kLevels - 1> kSpherePixels{6.0, 16.0, 48.0, 150.0};
constexpr std::array<double, 3> kTubePixels{6.0, 24.0, 100.0};

template <typename Thresholds>
std::size_t level_for(double pixels, const Thresholds& thresholds) {
  return static_cast<std::size_t>(std::ranges::upper_bound(thresholds, pixels) - thresholds.begin());
}

/// A polyhedron about a unit sphere, of the sphere's area: by Cauchy's formula it covers as much of a picture, on
/// average over all directions. Its points are the directions of its normals too.
struct SphereShape {
  std::vector<glm::dvec3> directions;
  std::vector<glm::uvec3> triangles;
  double scale = 1.0;  ///< of the points, against a sphere of radius 1
};

SphereShape shape_of(const Mesh& mesh) {
  SphereShape shape;
  for (const glm::vec3& p : mesh.positions) shape.directions.push_back(glm::normalize(glm::dvec3(p)));
  shape.triangles = mesh.triangles;
  double area = 0.0;
  for (const glm::uvec3& t : shape.triangles) {
    const glm::dvec3& a = shape.directions[t.x];
    area += 0.5 * glm::length(glm::cross(shape.directions[t.y] - a, shape.directions[t.z] - a));
  }
  shape.scale = std::sqrt(4.0 * std::numbers::pi / area);
  return shape;
}

Mesh octahedron() {
  Mesh mesh;
  mesh.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  return mesh;
}

const SphereShape& sphere_shape(std::size_t level) {
  static const std::array<SphereShape, kLevels> shapes{shape_of(octahedron()), shape_of(shapes::icosphere(0)),
                                                       shape_of(shapes::icosphere(1)), shape_of(shapes::icosphere(2)),
                                                       shape_of(shapes::icosphere(3))};
  return shapes.at(level);
}

/// A tube's cross-section: a polygon of a unit circle's circumference, and so of its mean width.
struct TubeShape {
  explicit TubeShape(std::size_t level) : sides(4U << level), cap_rings(1U << level) {
    for (std::uint32_t side = 0; side < sides; ++side) {
      const double turns = static_cast<double>(side) / sides;
      corners.emplace_back(portable::cos_turns(turns), portable::sin_turns(turns));
    }
    scale = std::numbers::pi / (sides * portable::sin_turns(0.5 / sides));
  }

  std::uint32_t sides;
  std::uint32_t cap_rings;  ///< of a hemisphere: the tube's end, and those between it and the tip
  std::vector<glm::dvec2> corners;
  double scale = 1.0;
};

const TubeShape& tube_shape(std::size_t level) {
  static const std::array<TubeShape, kTubePixels.size() + 1> shapes{TubeShape(0), TubeShape(1), TubeShape(2),
                                                                    TubeShape(3)};
  return shapes.at(std::min(level, shapes.size() - 1));
}

/// What shapes take.
struct Cost {
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;

  void add(const Cost& other, std::uint64_t times = 1) {
    vertices += times * other.vertices;
    triangles += times * other.triangles;
  }
};

Cost cost_of_sphere(std::size_t level) {
  return {sphere_shape(level).directions.size(), sphere_shape(level).triangles.size()};
}
Cost cost_of_section(std::size_t level) {
  const std::uint64_t sides = tube_shape(level).sides;
  return {sides, 2 * sides};
}
Cost cost_of_cap(std::size_t level) {
  const TubeShape& tube = tube_shape(level);
  const std::uint64_t sides = tube.sides;
  return {(tube.cap_rings - 1) * sides + 1, (2 * tube.cap_rings - 1) * sides};
}

/// How offsets from a point in the world are written in the coordinates of a mesh that an instance scales.
struct Frame {
  glm::dmat3 from_world{1.0};  ///< but for a rotation or reflection; never mirrors
  glm::dmat3 to_world{1.0};    ///< its inverse
  glm::dmat3 normals{1.0};     ///< directions of normals, to be made unit length
};

glm::dmat3 rounded(const glm::dmat3& matrix) {
  return {glm::mat3(matrix)};
}

/// The largest magnitude among the elements; infinite where one is no number.
double largest_of(const glm::dmat3& matrix) {
  double largest = 0.0;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) {
      const double magnitude = std::abs(matrix[column][row]);
      largest = std::isnan(magnitude) ? std::numeric_limits<double>::infinity() : std::max(largest, magnitude);
    }
  }
  return largest;
}

bool is_usable(const glm::dmat3& matrix) {
  return largest_of(matrix) < 1e30;
}

Frame frame_of(const Instance& instance) {
  const glm::dmat3 linear(instance.to_world);
  const glm::dvec3 lengths(glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2]));
  const double longest = std::max({lengths.x, lengths.y, lengths.z});
  Frame frame;
  if (!(longest > 1e-30)) return frame;
  const double scale = longest < 1e30 ? static_cast<double>(static_cast<float>(longest)) : longest;
  const glm::dmat3 unit = linear / scale;
  const glm::dmat3 gram = glm::transpose(unit) * unit;
  double skew = 0.0;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) {
      skew = std::max(skew, std::abs(gram[column][row] - (column == row ? 1.0 : 0.0)));
    }
  }
  const double determinant = glm::determinant(unit);
  const glm::dmat3 inverse = rounded(glm::inverse(linear) * (determinant < 0.0 ? -1.0 : 1.0));
  // A flat instance has no inverse: its spheres are as flat as all else.
  if (skew < 1e-6 || std::abs(determinant) < 1e-12 || !is_usable(inverse) || !is_usable(glm::inverse(inverse))) {
    frame.from_world = glm::dmat3(1.0 / scale);
    frame.to_world = glm::dmat3(scale);
    return frame;
  }
  frame.from_world = inverse;
  frame.to_world = glm::inverse(inverse);
  frame.normals = glm::transpose(frame.to_world);
  return frame;
}

/// Shapes the points or lines of one mesh, as one instance or several of the same frame show them.
class Shaper {
 public:
  Shaper(const Mesh& mesh, const Instance& instance, const PointLineWidths& widths, const PixelFootprints& footprint)
      : mesh_(mesh),
        instance_(instance),
        frame_(frame_of(instance)),
        width_(mesh.kind == MeshKind::Points ? widths.points : widths.lines),
        footprint_(footprint) {
    // Squares of coordinates must stay finite in single precision.
    constexpr double kMaxReach = 1e17;
    max_radius_ = kMaxReach / std::max(1.0, largest_of(frame_.from_world));
    if (width_.value == 0.0) return;
    if (mesh_.kind == MeshKind::Lines) find_joints();
    count();
  }

  /// What its shapes take with no level beyond `max_level`.
  [[nodiscard]] Cost cost(std::size_t max_level) const {
    Cost sum;
    for (std::size_t level = 0; level < kLevels; ++level) {
      const std::size_t used = std::min(level, max_level);
      sum.add(cost_of_sphere(used), spheres_[level]);
      sum.add(cost_of_section(used), sections_[level]);
      sum.add({cost_of_section(used).vertices, 0}, tubes_[level]);
      sum.add(cost_of_cap(used), caps_[level]);
    }
    return sum;
  }

  [[nodiscard]] std::uint64_t bytes(const Cost& cost) const {
    std::uint64_t vertex = 2 * sizeof(glm::vec3) + (mesh_.colors.empty() ? 0 : sizeof(glm::vec4));
    for (const auto& uvs : mesh_.uvs) vertex += uvs.empty() ? 0 : sizeof(glm::vec2);
    return cost.vertices * vertex + cost.triangles * sizeof(glm::uvec3);
  }

  [[nodiscard]] Mesh shape(std::size_t max_level) {
    const Cost size = cost(max_level);
    Mesh shaped;
    shaped.name = mesh_.name;
    shaped.material = mesh_.material;
    shaped.positions.reserve(size.vertices);
    shaped.normals.reserve(size.vertices);
    if (!mesh_.colors.empty()) shaped.colors.reserve(size.vertices);
    for (std::size_t set = 0; set < mesh_.uvs.size(); ++set) {
      if (!mesh_.uvs[set].empty()) shaped.uvs[set].reserve(size.vertices);
    }
    shaped.triangles.reserve(size.triangles);
    if (width_.value == 0.0) return shaped;
    for (const glm::uvec3& part : mesh_.triangles) {
      if (mesh_.kind == MeshKind::Points) {
        add_sphere(shaped, part.x, max_level);
      } else {
        add_tube(shaped, part, max_level);
      }
    }
    HPR_CHECK(shaped.positions.size() == size.vertices && shaped.triangles.size() == size.triangles);
    return shaped;
  }

 private:
  /// Where on a segment its tube has a ring: what of its second end's place, and the radius there.
  struct Ring {
    double at = 0.0;
    double radius = 0.0;
  };

  [[nodiscard]] double radius_at(const glm::dvec3& point) const {
    const double radius = 0.5 * width_.value * (width_.in_pixels ? footprint_.at(point) : 1.0);
    return radius < max_radius_ ? radius : max_radius_;  // of views without a size too
  }
  [[nodiscard]] double pixels_at(const glm::dvec3& point) const {
    return width_.in_pixels ? width_.value : width_.value / footprint_.at(point);
  }
  [[nodiscard]] glm::dvec3 world(std::uint32_t vertex) const {
    return world_position(instance_, mesh_.positions[vertex]);
  }

  void find_joints() {
    is_end_.assign(mesh_.positions.size(), false);
    for (const glm::uvec3& part : mesh_.triangles) {
      if (has_length(part)) is_end_[part.y] = true;
    }
  }

  /// From a segment's first end to its second, as its frame sees it.
  [[nodiscard]] glm::dvec3 span_of(const glm::uvec3& part) const {
    return frame_.to_world * (glm::dvec3(mesh_.positions[part.y]) - glm::dvec3(mesh_.positions[part.x]));
  }
  [[nodiscard]] bool has_length(const glm::uvec3& part) const {
    const double length = glm::length(span_of(part));
    return length > 1e-30 && std::isfinite(length);
  }

  [[nodiscard]] std::size_t sphere_level(std::uint32_t vertex) const {
    return level_for(pixels_at(world(vertex)), kSpherePixels);
  }
  [[nodiscard]] std::size_t tube_level(const glm::uvec3& part) const {
    return level_for(std::max(pixels_at(world(part.x)), pixels_at(world(part.y))), kTubePixels);
  }

  void count() {
    for (const glm::uvec3& part : mesh_.triangles) {
      if (mesh_.kind == MeshKind::Points) {
        ++spheres_[sphere_level(part.x)];
      } else if (has_length(part)) {
        const std::size_t level = tube_level(part);
        find_rings(part);
        sections_[level] += rings_.size() - 1;
        ++tubes_[level];
        caps_[level] += is_end_[part.x] ? 1U : 2U;
      }
    }
  }

  /// The rings of a segment's tube, from end to end: at the ends, and where pixels are much smaller than between their
  /// neighbors, as where a line passes close to the eye.
  void find_rings(const glm::uvec3& part) {
    constexpr int kMaxHalvings = 10;
    const glm::dvec3 a = world(part.x);
    const glm::dvec3 b = world(part.y);
    rings_.clear();
    rings_.push_back({0.0, radius_at(a)});
    add_rings(a, b, {1.0, radius_at(b)}, width_.in_pixels && !footprint_.is_constant() ? kMaxHalvings : 0);
  }

  /// Those after the last one up to `last`.
  void add_rings(const glm::dvec3& a, const glm::dvec3& b, const Ring& last, int halvings) {
    const Ring first = rings_.back();
    const double halfway = 0.5 * (first.at + last.at);
    const double radius = radius_at(a + halfway * (b - a));
    if (halvings > 0 && radius < 0.4 * (first.radius + last.radius)) {
      add_rings(a, b, {halfway, radius}, halvings - 1);
      add_rings(a, b, last, halvings - 1);
    } else {
      rings_.push_back(last);
    }
  }

  /// Adds the vertex at `offset` from `center`, whose normal points to `direction`, with the attributes of the place
  /// `at` between two vertices.
  void add_vertex(Mesh& to, const glm::dvec3& center, const glm::dvec3& offset, const glm::dvec3& direction,
                  const glm::uvec3& part, double at) const {
    to.positions.emplace_back(center + frame_.from_world * offset);
    to.normals.emplace_back(glm::normalize(frame_.normals * direction));
    const auto between = [&](const auto& values) {
      using Value = typename std::remove_cvref_t<decltype(values)>::value_type;
      if (at == 0.0) return values[part.x];
      if (at == 1.0) return values[part.y];
      const auto f = static_cast<float>(at);
      return Value((1.0F - f) * values[part.x] + f * values[part.y]);
    };
    if (!mesh_.colors.empty()) to.colors.push_back(between(mesh_.colors));
    for (std::size_t set = 0; set < mesh_.uvs.size(); ++set) {
      if (!mesh_.uvs[set].empty()) to.uvs[set].push_back(between(mesh_.uvs[set]));
    }
  }

  static std::uint32_t next_index(const Mesh& mesh) { return static_cast<std::uint32_t>(mesh.positions.size()); }

  void add_sphere(Mesh& to, std::uint32_t vertex, std::size_t max_level) const {
    const SphereShape& shape = sphere_shape(std::min(sphere_level(vertex), max_level));
    const glm::dvec3 center(mesh_.positions[vertex]);
    const double radius = shape.scale * radius_at(world(vertex));
    const std::uint32_t first = next_index(to);
    for (const glm::dvec3& direction : shape.directions) {
      add_vertex(to, center, radius * direction, direction, glm::uvec3(vertex), 0.0);
    }
    for (const glm::uvec3& t : shape.triangles) to.triangles.push_back(t + first);
  }

  void add_tube(Mesh& to, const glm::uvec3& part, std::size_t max_level) {
    if (!has_length(part)) return;
    const TubeShape& shape = tube_shape(std::min(tube_level(part), max_level));
    find_rings(part);
    const glm::dvec3 along = glm::normalize(span_of(part));
    const glm::dvec3 helper = std::abs(along.y) < 0.9 ? glm::dvec3(0.0, 1.0, 0.0) : glm::dvec3(1.0, 0.0, 0.0);
    const glm::dvec3 u = glm::normalize(glm::cross(helper, along));
    const glm::dvec3 v = glm::cross(along, u);
    const glm::dvec3 a(mesh_.positions[part.x]);
    const glm::dvec3 b(mesh_.positions[part.y]);
    // A ring of the sphere of `ring`'s radius about its place, `turns` of a full turn towards `along`.
    const auto add_ring = [&](const Ring& ring, double turns) {
      const glm::dvec3 center = a + ring.at * (b - a);
      const double across = portable::cos_turns(turns);
      const double ahead = portable::sin_turns(turns);
      for (const glm::dvec2& corner : shape.corners) {
        const glm::dvec3 direction = across * (corner.x * u + corner.y * v) + ahead * along;
        add_vertex(to, center, shape.scale * ring.radius * direction, direction, part, ring.at);
      }
    };
    const auto add_tip = [&](const Ring& ring, const glm::dvec3& direction) {
      add_vertex(to, a + ring.at * (b - a), shape.scale * ring.radius * direction, direction, part, ring.at);
      return next_index(to) - 1;
    };
    // Between two rings; the second one is further along.
    const auto join = [&](std::uint32_t before, std::uint32_t after) {
      for (std::uint32_t side = 0; side < shape.sides; ++side) {
        const std::uint32_t next = (side + 1) % shape.sides;
        to.triangles.emplace_back(before + side, before + next, after + next);
        to.triangles.emplace_back(before + side, after + next, after + side);
      }
    };
    const double step = 0.25 / shape.cap_rings;
    std::uint32_t last = next_index(to);
    if (!is_end_[part.x]) {
      const std::uint32_t tip = add_tip(rings_.front(), -along);
      last = next_index(to);
      for (std::uint32_t ring = shape.cap_rings - 1; ring > 0; --ring) add_ring(rings_.front(), -step * ring);
      add_ring(rings_.front(), 0.0);
      for (std::uint32_t side = 0; side < shape.sides; ++side) {
        to.triangles.emplace_back(tip, last + (side + 1) % shape.sides, last + side);
      }
      for (std::uint32_t ring = 1; ring < shape.cap_rings; ++ring, last += shape.sides) join(last, last + shape.sides);
    } else {
      add_ring(rings_.front(), 0.0);
    }
    for (std::size_t ring = 1; ring < rings_.size(); ++ring, last += shape.sides) {
      add_ring(rings_[ring], 0.0);
      join(last, last + shape.sides);
    }
    for (std::uint32_t ring = 1; ring < shape.cap_rings; ++ring, last += shape.sides) {
      add_ring(rings_.back(), step * ring);
      join(last, last + shape.sides);
    }
    const std::uint32_t tip = add_tip(rings_.back(), along);
    for (std::uint32_t side = 0; side < shape.sides; ++side) {
      to.triangles.emplace_back(last + side, last + (side + 1) % shape.sides, tip);
    }
  }

  const Mesh& mesh_;
  const Instance& instance_;
  Frame frame_;
  DrawnWidth width_;
  const PixelFootprints& footprint_;
  double max_radius_ = 0.0;
  std::vector<bool> is_end_;  ///< of each vertex: whether a segment ends there
  std::vector<Ring> rings_;   ///< of the segment at hand
  // How many there are, by level.
  std::array<std::uint64_t, kLevels> spheres_{};
  std::array<std::uint64_t, kLevels> tubes_{};
  std::array<std::uint64_t, kLevels> sections_{};
  std::array<std::uint64_t, kLevels> caps_{};
};

/// Which instances may share a shaped mesh: the mesh it comes of and what its shapes depend on.
using ShapeKey = std::pair<std::uint32_t, std::array<double, 9>>;

ShapeKey key_of(const Scene& scene, std::size_t instance, const PointLineWidths& widths, bool constant_pixels) {
  const Instance& placed = scene.instances[instance];
  ShapeKey key{placed.mesh, {}};
  const DrawnWidth& width = scene.mesh_of(placed).kind == MeshKind::Points ? widths.points : widths.lines;
  if (width.in_pixels && !constant_pixels) {
    key.second[0] = static_cast<double>(instance);
    return key;
  }
  const glm::dmat3 from_world = frame_of(placed).from_world;
  for (int i = 0; i < 9; ++i) key.second[static_cast<std::size_t>(i)] = from_world[i / 3][i % 3];
  return key;
}

}  // namespace

DrawnWidth parse_drawn_width(const std::string& text) {
  DrawnWidth width;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, width.value);
  const std::string_view unit(stop, static_cast<std::size_t>(end - stop));
  width.in_pixels = unit != "m";
  const double largest = width.in_pixels ? 1000.0 : 1e9;
  const bool is_known = unit.empty() || unit == "px" || unit == "m";
  if (error == std::errc() && is_known && width.value >= 0.0 && width.value <= largest) return width;
  throw Error(ExitCode::Usage, fmt::format("'{}' is no width of 0 to 1000 pixels or 0 to 1e9 metres", printable(text)),
              "write e.g. 3px, 0.01m, or 3, which are pixels");
}

std::string to_text(const DrawnWidth& width) {
  return fmt::format("{}{}", width.value, width.in_pixels ? "px" : "m");
}

double PixelFootprint::at(const glm::dvec3& point) const {
  return orthographic ? metres : metres * std::max(glm::length(point - eye), min_distance);
}

PixelFootprint footprint_of(const View& view) {
  const double area = (view.right - view.left) / view.screen.width * ((view.top - view.bottom) / view.screen.height);
  return {view.eye, std::sqrt(area), view.near_distance, view.orthographic};
}

namespace {

/// Whether a point lies where the view's screen shows it, or before the near plane on the way there.
bool shows(const View& view, const glm::dvec3& point) {
  const glm::dvec3 offset = (point - view.eye) * view.axes;
  const double distance = view.orthographic ? 1.0 : -offset.z;
  return distance > 0.0 && offset.x >= view.left * distance && offset.x <= view.right * distance &&
         offset.y >= view.bottom * distance && offset.y <= view.top * distance;
}

}  // namespace

PixelFootprints::PixelFootprints(std::span<const View> views) : first_(footprint_of(views.front())) {
  const auto is_first = [&](const View& view) { return footprint_of(view) == first_; };
  if (std::ranges::all_of(views, is_first)) return;
  for (const View& view : views) each_.emplace_back(footprint_of(view), view);
}

double PixelFootprints::at(const glm::dvec3& point) const {
  double largest = 0.0;
  for (const auto& [footprint, view] : each_) {
    if (shows(view, point)) largest = std::max(largest, footprint.at(point));
  }
  return largest > 0.0 ? largest : first_.at(point);
}

bool PixelFootprints::is_constant() const {
  return each_.empty() && first_.orthographic;
}

bool has_points_or_lines(const Scene& scene) {
  return std::ranges::any_of(scene.meshes, [](const Mesh& mesh) { return mesh.kind != MeshKind::Triangles; });
}

namespace {

/// The shapes of all points and lines of a scene, before it has them.
struct Shapes {
  std::vector<Shaper> shapers;
  std::vector<std::optional<std::size_t>> of_instance;  ///< per instance: the index of its shaper
  std::uint64_t parts = 0;                              ///< points and segments
};

Shapes find_shapes(const Scene& scene, const PointLineWidths& widths, const PixelFootprints& footprint) {
  Shapes shapes;
  shapes.of_instance.resize(scene.instances.size());
  std::map<ShapeKey, std::size_t> known;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Mesh& mesh = scene.mesh_of(scene.instances[i]);
    if (mesh.kind == MeshKind::Triangles) continue;
    const ShapeKey key = key_of(scene, i, widths, footprint.is_constant());
    const auto [entry, added] = known.try_emplace(key, shapes.shapers.size());
    shapes.of_instance[i] = entry->second;
    if (!added) continue;
    shapes.shapers.emplace_back(mesh, scene.instances[i], widths, footprint);
    shapes.parts += mesh.triangles.size();
  }
  return shapes;
}

Cost cost_of(const Shapes& shapes, std::size_t max_level) {
  Cost total;
  for (const Shaper& shaper : shapes.shapers) total.add(shaper.cost(max_level));
  return total;
}

std::string describe_shapes(const Scene& scene, const PointLineWidths& widths, std::uint64_t triangles) {
  std::vector<std::string> kinds;
  bool in_pixels = false;
  const auto describe = [&](MeshKind kind, const char* name, const DrawnWidth& width) {
    std::uint64_t count = 0;
    for (const Instance& instance : scene.instances) {
      if (scene.mesh_of(instance).kind == kind) count += scene.mesh_of(instance).triangles.size();
    }
    if (count == 0) return;
    kinds.push_back(fmt::format("{} {} of {}", count, name, to_text(width)));
    in_pixels |= width.in_pixels;
  };
  describe(MeshKind::Points, "points", widths.points);
  describe(MeshKind::Lines, "line segments", widths.lines);
  return fmt::format("{}, as {} triangles{}", fmt::join(kinds, " and "), triangles,
                     in_pixels ? " (pixels of the first frame: what comes nearer grows)" : "");
}

/// Gives instances their meshes: the first shape of a mesh stands in its place, others come last.
void place_shapes(Scene& scene, const Shapes& shapes, std::vector<Mesh> shaped) {
  std::vector<std::optional<std::uint32_t>> mesh_of(shaped.size());
  std::vector<bool> is_replaced(scene.meshes.size(), false);
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (!shapes.of_instance[i]) continue;
    const std::size_t shape = *shapes.of_instance[i];
    std::uint32_t& mesh = scene.instances[i].mesh;
    if (!mesh_of[shape]) {
      const bool is_first = !is_replaced[mesh];
      if (is_first) {
        is_replaced[mesh] = true;
        mesh_of[shape] = mesh;
        scene.meshes[mesh] = std::move(shaped[shape]);
      } else {
        mesh_of[shape] = static_cast<std::uint32_t>(scene.meshes.size());
        scene.meshes.push_back(std::move(shaped[shape]));
      }
    }
    mesh = *mesh_of[shape];
  }
  for (Mesh& mesh : scene.meshes) {  // what no instance shows
    if (mesh.kind == MeshKind::Triangles) continue;
    mesh.kind = MeshKind::Triangles;
    mesh.triangles.clear();
    mesh.normals.assign(mesh.positions.size(), glm::vec3(0.0F, 0.0F, 1.0F));
  }
}

}  // namespace

void shape_points_and_lines(Scene& scene, const PointLineWidths& widths, std::span<const View> views,
                            std::uint64_t memory_bytes) {
  const PixelFootprints footprint(views);
  Shapes shapes = find_shapes(scene, widths, footprint);
  std::size_t level = kLevels - 1;
  while (level > 0 && cost_of(shapes, level).triangles > kMaxTriangles) --level;
  std::uint64_t bytes = memory_of(scene);
  for (const Shaper& shaper : shapes.shapers) bytes += shaper.bytes(shaper.cost(level));
  if (bytes > memory_bytes) {
    throw Error(ExitCode::Limit,
                fmt::format("{}: {} points and lines need {} bytes as {} triangles, more than the limit of {}",
                            printable(scene.name), shapes.parts, bytes, cost_of(shapes, level).triangles, memory_bytes),
                "draw fewer of them, let instances share meshes by widths in metres (--point-size 0.01m), or raise "
                "--limit-mem");
  }
  if (cost_of(shapes, level).triangles > std::numeric_limits<std::uint32_t>::max()) {  // meshes count in 32 bits
    throw Error(ExitCode::Limit,
                fmt::format("{}: {} points and lines are {} triangles, more than 32 bits count", printable(scene.name),
                            shapes.parts, cost_of(shapes, level).triangles),
                "draw fewer of them");
  }
  scene.shapes_note = describe_shapes(scene, widths, cost_of(shapes, level).triangles);
  std::vector<Mesh> shaped;
  shaped.reserve(shapes.shapers.size());
  for (Shaper& shaper : shapes.shapers) shaped.push_back(shaper.shape(level));
  place_shapes(scene, shapes, std::move(shaped));
  finish_scene(scene);
}

}  // namespace hpr
