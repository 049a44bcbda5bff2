#include "scene/generators/shapes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/error.h"
#include "scene/generators/portable_math.h"

namespace hpr::shapes {
namespace {

using portable::cos_turns;
using portable::sin_turns;

std::uint32_t next_index(const Mesh& mesh) {
  return static_cast<std::uint32_t>(mesh.positions.size());
}

/// A mesh whose points lie on the unit sphere: the points are the normals.
Mesh sphere_mesh(const std::vector<glm::dvec3>& points, std::vector<glm::uvec3> triangles) {
  Mesh mesh;
  mesh.positions.reserve(points.size());
  for (const glm::dvec3& p : points) mesh.positions.emplace_back(p);
  mesh.normals = mesh.positions;
  mesh.triangles = std::move(triangles);
  return mesh;
}

/// Two triangles per cell of a grid of indices whose neighbours are `right` and `up`.
void add_cell(Mesh& mesh, std::uint32_t here, std::uint32_t right, std::uint32_t across, std::uint32_t up) {
  mesh.triangles.emplace_back(here, right, across);
  mesh.triangles.emplace_back(here, across, up);
}

/// Catmull-Rom through `points`, clamped at the ends (the end points count twice), at t in [0, points - 1].
glm::dvec2 spline(std::span<const glm::dvec2> points, double t) {
  const auto last = static_cast<int>(points.size()) - 1;
  const int i = std::min(static_cast<int>(t), last - 1);
  const double f = t - i;
  const auto at = [&](int k) { return points[static_cast<std::size_t>(std::clamp(k, 0, last))]; };
  const glm::dvec2 a = at(i - 1);
  const glm::dvec2 b = at(i);
  const glm::dvec2 c = at(i + 1);
  const glm::dvec2 d = at(i + 2);
  return 0.5 * (2.0 * b + f * ((c - a) + f * ((2.0 * a - 5.0 * b + 4.0 * c - d) + f * (3.0 * b - a - 3.0 * c + d))));
}

/// Triangles between points of the unit sphere.
struct Faces {
  std::vector<glm::dvec3> points;
  std::vector<glm::uvec3> triangles;
};

/// The twelve points (0, +-1, +-phi) and their cyclic shifts, of length 1: point 4 * axis + 2 * (long side < 0) +
/// (short side < 0).
std::vector<glm::dvec3> icosahedron_points(double phi) {
  std::vector<glm::dvec3> points;
  points.reserve(12);
  for (int axis = 0; axis < 3; ++axis) {
    for (int sign = 0; sign < 4; ++sign) {
      glm::dvec3 p(0.0);
      p[(axis + 1) % 3] = (sign & 1) != 0 ? -1.0 : 1.0;
      p[(axis + 2) % 3] = (sign & 2) != 0 ? -phi : phi;
      points.push_back(glm::normalize(p));
    }
  }
  return points;
}

Faces icosahedron() {
  const double phi = 0.5 * (1.0 + std::sqrt(5.0));
  std::vector<glm::dvec3> points = icosahedron_points(phi);
  // Neighbours are 2 apart before normalisation, everything else at least 3.2: three mutual neighbours are a face.
  std::vector<glm::uvec3> triangles;
  const double reach = 2.5 / std::sqrt(1.0 + phi * phi);
  const auto near = [&](std::uint32_t a, std::uint32_t b) { return glm::distance(points[a], points[b]) < reach; };
  const auto add_face = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (!near(a, b) || !near(b, c) || !near(a, c)) return;
    const bool outward = glm::dot(glm::cross(points[b] - points[a], points[c] - points[a]), points[a]) > 0.0;
    triangles.emplace_back(a, outward ? b : c, outward ? c : b);
  };
  for (std::uint32_t a = 0; a < 12; ++a) {
    for (std::uint32_t b = a + 1; b < 12; ++b) {
      for (std::uint32_t c = b + 1; c < 12; ++c) add_face(a, b, c);
    }
  }
  return {std::move(points), std::move(triangles)};
}

/// Four triangles for one, the new points on the sphere.
void subdivide(Faces& faces) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> midpoints;
  std::vector<glm::dvec3>& points = faces.points;
  const auto midpoint = [&](std::uint32_t a, std::uint32_t b) {
    const auto [entry, added] =
        midpoints.try_emplace(std::pair(std::min(a, b), std::max(a, b)), static_cast<std::uint32_t>(points.size()));
    if (added) points.push_back(glm::normalize(points[a] + points[b]));
    return entry->second;
  };
  std::vector<glm::uvec3> finer;
  finer.reserve(4 * faces.triangles.size());
  for (const glm::uvec3& t : faces.triangles) {
    const std::uint32_t ab = midpoint(t.x, t.y);
    const std::uint32_t bc = midpoint(t.y, t.z);
    const std::uint32_t ca = midpoint(t.z, t.x);
    finer.emplace_back(t.x, ab, ca);
    finer.emplace_back(ab, t.y, bc);
    finer.emplace_back(ca, bc, t.z);
    finer.emplace_back(ab, bc, ca);
  }
  faces.triangles = std::move(finer);
}

}  // namespace

void add_quad(Mesh& mesh, const std::array<glm::dvec3, 4>& corners, const glm::dvec2& repeat) {
  constexpr std::array<glm::dvec2, 4> kUv{{{0.0, 1.0}, {1.0, 1.0}, {1.0, 0.0}, {0.0, 0.0}}};
  const glm::dvec3 normal = glm::normalize(glm::cross(corners[2] - corners[0], corners[3] - corners[1]));
  const std::uint32_t first = next_index(mesh);
  for (std::size_t i = 0; i < 4; ++i) {
    mesh.positions.emplace_back(corners[i]);
    mesh.normals.emplace_back(normal);
    mesh.uvs[0].emplace_back(kUv[i] * repeat);
  }
  add_cell(mesh, first, first + 1, first + 2, first + 3);
}

void add_box(Mesh& mesh, const glm::dvec3& low, const glm::dvec3& high) {
  const auto corner = [&](int x, int y, int z) {
    return glm::dvec3(x != 0 ? high.x : low.x, y != 0 ? high.y : low.y, z != 0 ? high.z : low.z);
  };
  add_quad(mesh, {corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1)});
  add_quad(mesh, {corner(1, 0, 0), corner(0, 0, 0), corner(0, 1, 0), corner(1, 1, 0)});
  add_quad(mesh, {corner(1, 0, 1), corner(1, 0, 0), corner(1, 1, 0), corner(1, 1, 1)});
  add_quad(mesh, {corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1), corner(0, 1, 0)});
  add_quad(mesh, {corner(0, 1, 1), corner(1, 1, 1), corner(1, 1, 0), corner(0, 1, 0)});
  add_quad(mesh, {corner(0, 0, 0), corner(1, 0, 0), corner(1, 0, 1), corner(0, 0, 1)});
}

Mesh icosphere(int level) {
  HPR_CHECK(level >= 0 && level <= 10);
  Faces faces = icosahedron();
  for (int step = 0; step < level; ++step) subdivide(faces);
  return sphere_mesh(faces.points, std::move(faces.triangles));
}

Mesh cube_sphere(int n) {
  HPR_CHECK(n >= 1 && n <= 512);
  std::vector<glm::dvec3> points;
  std::map<std::tuple<int, int, int>, std::uint32_t> known;  // by lattice point, so that faces share their edges
  const auto point = [&](const std::array<int, 3>& p) {
    const auto [entry, added] =
        known.try_emplace(std::make_tuple(p[0], p[1], p[2]), static_cast<std::uint32_t>(points.size()));
    if (added) points.push_back(glm::normalize(glm::dvec3(p[0], p[1], p[2])));
    return entry->second;
  };
  std::vector<glm::uvec3> triangles;
  for (std::size_t face = 0; face < 6; ++face) {
    const std::size_t axis = face / 2;
    const int side = face % 2 == 0 ? -1 : 1;
    // On the lower face of an axis the other two change places, so that both faces wind outwards.
    const std::size_t u = side > 0 ? (axis + 1) % 3 : (axis + 2) % 3;
    const std::size_t v = side > 0 ? (axis + 2) % 3 : (axis + 1) % 3;
    const auto at = [&](int i, int j) {
      std::array<int, 3> p{};
      p[axis] = side * n;
      p[u] = 2 * i - n;
      p[v] = 2 * j - n;
      return point(p);
    };
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        triangles.emplace_back(at(i, j), at(i + 1, j), at(i + 1, j + 1));
        triangles.emplace_back(at(i, j), at(i + 1, j + 1), at(i, j + 1));
      }
    }
  }
  return sphere_mesh(points, std::move(triangles));
}

Mesh torus_knot(int p, int q, int along, int around, double tube) {
  HPR_CHECK(along >= 3 && around >= 3 && tube > 0.0);
  Mesh mesh;
  const auto center = [&](double t) {
    const double ring = 2.0 + cos_turns(q * t);
    return glm::dvec3(ring * cos_turns(p * t), sin_turns(q * t), ring * sin_turns(p * t)) / 3.0;
  };
  for (int i = 0; i < along; ++i) {
    const double t = static_cast<double>(i) / along;
    constexpr double kStep = 1e-4;
    // The frame leans on the direction away from the axis of the torus's tube, which no torus knot runs along: it
    // closes after one turn, unlike a frame carried along.
    const glm::dvec3 tangent = glm::normalize(center(t + kStep) - center(t - kStep));
    const glm::dvec3 ring(2.0 / 3.0 * cos_turns(p * t), 0.0, 2.0 / 3.0 * sin_turns(p * t));
    const glm::dvec3 side = glm::normalize(glm::cross(tangent, center(t) - ring));
    const glm::dvec3 out = glm::cross(side, tangent);
    for (int j = 0; j < around; ++j) {
      const double angle = static_cast<double>(j) / around;
      const glm::dvec3 normal = cos_turns(angle) * out + sin_turns(angle) * side;
      mesh.positions.emplace_back(center(t) + tube * normal);
      mesh.normals.emplace_back(glm::normalize(normal));
    }
  }
  const auto index = [&](int i, int j) { return static_cast<std::uint32_t>((i % along) * around + j % around); };
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      add_cell(mesh, index(i, j), index(i, j + 1), index(i + 1, j + 1), index(i + 1, j));
    }
  }
  return mesh;
}

Mesh vase(int n) {
  HPR_CHECK(n >= 2 && n % 2 == 0 && n <= 1024);  // other rows miss points of the profile
  // Radius and height, from the bottom's centre up the outside, over the lip and down the inside.
  constexpr std::array<glm::dvec2, 17> kProfile{{{0.0, 0.0},
                                                 {0.16, 0.0},
                                                 {0.21, 0.02},
                                                 {0.20, 0.07},
                                                 {0.30, 0.22},
                                                 {0.37, 0.42},
                                                 {0.30, 0.62},
                                                 {0.16, 0.78},
                                                 {0.16, 0.90},
                                                 {0.25, 0.99},
                                                 {0.24, 1.0},
                                                 {0.14, 0.90},
                                                 {0.14, 0.78},
                                                 {0.28, 0.61},
                                                 {0.345, 0.42},
                                                 {0.24, 0.18},
                                                 {0.0, 0.10}}};
  const int around = 4 * n;
  const int rows = 8 * n;
  const auto profile = [&](double row) { return spline(kProfile, row * (kProfile.size() - 1) / rows); };
  Mesh mesh;
  mesh.positions.emplace_back(0.0F, kProfile.front().y, 0.0F);
  for (int row = 1; row < rows; ++row) {
    for (int j = 0; j < around; ++j) {
      const double angle = static_cast<double>(j) / around;
      const glm::dvec2 p = profile(row);
      mesh.positions.emplace_back(p.x * cos_turns(angle), p.y, p.x * sin_turns(angle));
    }
  }
  const std::uint32_t top = next_index(mesh);
  mesh.positions.emplace_back(0.0F, kProfile.back().y, 0.0F);

  const auto index = [&](int row, int j) { return static_cast<std::uint32_t>(1 + (row - 1) * around + j % around); };
  for (int j = 0; j < around; ++j) mesh.triangles.emplace_back(0, index(1, j), index(1, j + 1));
  for (int row = 1; row < rows - 1; ++row) {
    for (int j = 0; j < around; ++j) {
      add_cell(mesh, index(row, j), index(row + 1, j), index(row + 1, j + 1), index(row, j + 1));
    }
  }
  for (int j = 0; j < around; ++j) mesh.triangles.emplace_back(index(rows - 1, j), top, index(rows - 1, j + 1));
  mesh.normals = smooth_normals(mesh.positions, mesh.triangles);
  return mesh;
}

glm::dmat4 placed(const glm::dvec3& center, double scale) {
  glm::dmat4 matrix(scale);
  matrix[3] = glm::dvec4(center, 1.0);
  return matrix;
}

}  // namespace hpr::shapes

namespace hpr::patterns {
namespace {

constexpr Rgba8 kBlack{0, 0, 0, 255};
constexpr Rgba8 kWhite{255, 255, 255, 255};

template <typename Texel>
Image<Rgba8> painted(Size size, Texel texel) {
  HPR_CHECK(size.width > 0 && size.height > 0);
  Image<Rgba8> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) image.at(x, y) = texel(x, y);
  }
  return image;
}

std::uint8_t level(int part, int whole) {
  return static_cast<std::uint8_t>(255 * part / std::max(whole, 1));
}

}  // namespace

Image<Rgba8> zone_plate(Size size) {
  return painted(size, [&](int x, int y) {
    // Four times the squared radius, an integer: whole turns can be taken off exactly.
    const std::int64_t u = 2 * x + 1 - size.width;
    const std::int64_t v = 2 * y + 1 - size.height;
    const std::int64_t period = std::int64_t{8} * size.width;
    const double turns = static_cast<double>((u * u + v * v) % period) / static_cast<double>(period);
    const auto intensity = static_cast<float>(0.5 + 0.5 * portable::cos_turns(turns));
    return to_srgb({intensity, intensity, intensity});
  });
}

Image<Rgba8> texel_grid(Size size, int step) {
  HPR_CHECK(step > 0);
  return painted(size, [&](int x, int y) { return x % step == 0 || y % step == 0 ? kBlack : kWhite; });
}

Image<Rgba8> siemens_star(Size size, int lines) {
  HPR_CHECK(lines > 0 && lines % 2 == 0);
  std::vector<std::pair<double, double>> directions;
  for (int i = 0; i < lines; ++i) {
    const double turns = (i + 0.25) / (2.0 * lines);  // a little turned: no line through texel centres
    directions.emplace_back(portable::cos_turns(turns), portable::sin_turns(turns));
  }
  return painted(size, [&](int x, int y) {
    const double u = x + 0.5 - 0.5 * size.width;
    const double v = y + 0.5 - 0.5 * size.height;
    // Crossing a line changes the side of just this one, so the parity alternates from sector to sector.
    const auto left_of = std::ranges::count_if(directions, [&](auto d) { return d.first * v - d.second * u > 0.0; });
    return left_of % 2 == 0 ? kWhite : kBlack;
  });
}

Image<Rgba8> grey_wedge(Size size, int steps) {
  return painted(size, [&](int x, int) {
    const std::uint8_t grey = level(x * steps / size.width, steps - 1);
    return Rgba8{grey, grey, grey, 255};
  });
}

Image<Rgba8> tile_ruler(Size size) {
  constexpr int kCell = 32;
  constexpr int kDigit = 6;  // texels from digit to digit, four of them lit
  return painted(size, [&](int x, int y) {
    const int column = x % kCell;
    const int line = y % kCell;
    if (column == 0 || line == 0) return kBlack;
    const int digit = (column - 1) / kDigit;
    const bool upper = line >= 8 && line < 12;
    const bool lower = line >= 20 && line < 24;
    if ((upper || lower) && digit < 5 && (column - 1) % kDigit < 4) {
      const int number = upper ? x / kCell : y / kCell;
      return ((number >> (4 - digit)) & 1) != 0 ? kWhite : kBlack;
    }
    return Rgba8{level(x, size.width - 1), level(y, size.height - 1), 160, 255};
  });
}

Image<Rgba8> checker(Rgb odd, Rgb even) {
  return painted({2, 2}, [&](int x, int y) { return x == y ? to_srgb(odd) : to_srgb(even); });
}

}  // namespace hpr::patterns
