#include <fmt/format.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <random>

#include "scene/generators/shapes.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

/// Where a square of half side 1 fills a screen of slope 0.6, turned or not: a metre away.
glm::dmat4 before_the_eye(double turned) {
  return glm::rotate(glm::translate(glm::dmat4(1.0), {0.0, 0.0, -1.0}), turned, glm::dvec3(0.0, 0.0, 1.0));
}

/// `count` triangles round one vertex, to a circle of radius 2.
Mesh fan(std::uint32_t count) {
  Mesh mesh;
  mesh.positions.emplace_back(0.0F);
  for (std::uint32_t i = 0; i < count; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / count;
    mesh.positions.emplace_back(glm::dvec3(2.0 * std::cos(angle), 2.0 * std::sin(angle), 0.0));
    mesh.triangles.emplace_back(0, 1 + i, 1 + (i + 1) % count);
  }
  return mesh;
}

/// The square [-1, 1]^2 with a band of `count` strips across its middle, each 2 wide and 2 `aspect` high.
Mesh strips(std::uint32_t count, double aspect) {
  Mesh mesh;
  const auto add_row = [&](double y) {
    for (const float x : {-1.0F, 1.0F}) mesh.positions.emplace_back(x, static_cast<float>(y), 0.0F);
  };
  add_row(-1.0);
  for (std::uint32_t i = 0; i <= count; ++i) add_row(2.0 * aspect * i);
  add_row(1.0);
  for (std::uint32_t row = 0; row <= count + 1; ++row) {
    const std::uint32_t a = 2 * row;
    mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, a + 3}, {a, a + 3, a + 2}});
  }
  return mesh;
}

/// The square [-1, 1]^2 in eight columns of squares, every second one's half as high: along the seven lines between
/// them, corners lie in the middle of edges.
Mesh t_junctions() {
  constexpr std::uint32_t kColumns = 8;
  Mesh mesh;
  for (std::uint32_t column = 0; column < kColumns; ++column) {
    const std::uint32_t rows = column % 2 == 0 ? 13 : 26;
    const auto at = [](std::uint32_t i, std::uint32_t n) {
      return -1.0F + 2.0F * static_cast<float>(i) / static_cast<float>(n);
    };
    for (std::uint32_t row = 0; row < rows; ++row) {
      const Mesh cell = rectangle({at(column, kColumns), at(row, rows)}, {at(column + 1, kColumns), at(row + 1, rows)});
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      mesh.positions.insert(mesh.positions.end(), cell.positions.begin(), cell.positions.end());
      for (const glm::uvec3& triangle : cell.triangles) mesh.triangles.push_back(triangle + first);
    }
  }
  return mesh;
}

StabilityFinding finding_of(const char* name, std::string parameter, const Coverage& found) {
  StabilityFinding finding =
      make_finding(fmt::format("slivers/{}", name),
                   fmt::format("{}: {} pixels missed, {} covered twice", parameter, found.missed, found.twice), 0.0,
                   "pixels not covered exactly once",
                   "Shared corners snap to one place, and an edge gives each pixel centre to one side only.");
  finding.measured = static_cast<double>(found.missed + found.twice);
  return finding;
}

StabilityFinding fans(Drawer& drawer) {
  constexpr std::uint32_t kTriangles = 100'000;
  Coverage found;
  // With an odd number of pixels the hub lies on a pixel's centre.
  for (const int side : {512, 511}) {
    found += coverage(drawer, fan(kTriangles), before_the_eye(0.0), head_on({side, side}, 0.6, 0.01));
  }
  return finding_of("fan", fmt::format("{} triangles round one vertex, between pixels and on a centre", kTriangles),
                    found);
}

StabilityFinding strip_bands(Drawer& drawer) {
  Coverage all;
  StabilityCurve curve{"height to width of a strip", {}, {}};
  for (int power = -12; power <= -6; ++power) {
    Coverage found;
    for (const double turned : {0.0, 0.3}) {
      found +=
          coverage(drawer, strips(64, std::pow(10.0, power)), before_the_eye(turned), head_on({512, 511}, 0.6, 0.01));
    }
    all += found;
    curve.points.emplace_back(std::pow(10.0, power), static_cast<double>(found.missed + found.twice));
  }
  StabilityFinding finding =
      finding_of("strips", "64 strips of aspect 1e-6 .. 1e-12 across pixel centres, level and turned", all);
  finding.curve = std::move(curve);
  return finding;
}

StabilityFinding closed_sphere(Drawer& drawer) {
  const Mesh sphere = shapes::icosphere(6);
  Coverage found;
  for (int side = 0; side < 6; ++side) {
    View view = head_on({256, 256}, 1.0, 1e-3);
    view.eye = {0.3, 0.2, -0.1};
    const glm::dvec3 back((side % 3 == 0) ? 1.0 : 0.0, (side % 3 == 1) ? 1.0 : 0.0, (side % 3 == 2) ? 1.0 : 0.0);
    const glm::dvec3 up(back.z, back.x, back.y);
    view.axes[2] = side < 3 ? back : -back;
    view.axes[1] = up;
    view.axes[0] = glm::cross(up, view.axes[2]);
    found += coverage(drawer, sphere, glm::rotate(glm::dmat4(1.0), 0.4, glm::dvec3(0.6, 0.8, 0.0)), view);
  }
  return finding_of("closed-sphere",
                    fmt::format("an icosphere of {} triangles from inside, six views", sphere.triangles.size()), found);
}

std::vector<StabilityFinding> t_junction_grids(Drawer& drawer) {
  constexpr double kSlope = 0.6;
  constexpr int kSide = 512;
  StabilityFinding level =
      finding_of("t-junctions", "seven upright lines of corners on edges",
                 coverage(drawer, t_junctions(), before_the_eye(0.0), head_on({kSide, kSide}, kSlope, 0.01)));
  level.why = "Corners on an upright edge snap to its column of 1/256 pixel.";
  StabilityFinding turned =
      finding_of("t-junctions-turned", "the same, turned by 0.3 rad",
                 coverage(drawer, t_junctions(), before_the_eye(0.3), head_on({kSide, kSide}, kSlope, 0.01)));
  // Seven lines across the screen, triangles of half an edge's length by what snapping moves a corner off the edge.
  const double pixels_of_lines = 7.0 * kSide / std::cos(0.3);
  turned.limit = 0.5 * pixels_of_lines * std::numbers::sqrt2 / 256.0;
  turned.why =
      "A corner snaps off the edge it lies on by up to sqrt(2)/256 pixel: the cracks' area is what may be missed.";
  return {level, turned};
}

std::vector<StabilityFinding> measure_slivers(const Globals& globals) {
  Drawer drawer(globals);
  std::vector<StabilityFinding> findings{fans(drawer), strip_bands(drawer), closed_sphere(drawer)};
  for (StabilityFinding& finding : t_junction_grids(drawer)) findings.push_back(std::move(finding));
  return findings;
}

/// What is mixed into a mesh, one for every ten of its triangles.
enum class Extra {
  Points,    ///< corners twice or thrice
  Doubles,   ///< triangles that are there already
  Segments,  ///< three corners in a line, the third in the middle of an edge
  Needles,   ///< along an edge, a millionth of the triangle high
};

struct Mixed {
  Mesh mesh;
  std::vector<std::uint32_t> source;  ///< per triangle the one of the clean mesh it stands for
};

Mixed mixed(const Mesh& clean, Extra extra) {
  Mixed result{clean, {}};
  result.mesh.triangles.clear();
  result.mesh.normals.clear();
  std::mt19937 random(7);
  const auto add_triangle = [&](const glm::uvec3& triangle, std::uint32_t source) {
    result.mesh.triangles.push_back(triangle);
    result.source.push_back(source);
  };
  for (std::uint32_t i = 0; i < clean.triangles.size(); ++i) {
    const glm::uvec3 t = clean.triangles[i];
    if (random() % 10 == 0) {
      const glm::vec3 a = clean.positions[t.x];
      const glm::vec3 b = clean.positions[t.y];
      const glm::vec3 c = clean.positions[t.z];
      const auto third = static_cast<std::uint32_t>(result.mesh.positions.size());
      if (extra == Extra::Points) {
        add_triangle({t.x, t.y, t.y}, i);
        add_triangle({t.z, t.z, t.z}, i);
      } else if (extra == Extra::Doubles) {
        add_triangle(t, i);
      } else if (extra == Extra::Segments) {
        result.mesh.positions.push_back(0.5F * a + 0.5F * b);
        add_triangle({t.x, t.y, third}, i);
      } else {
        result.mesh.positions.push_back(0.5F * a + 0.5F * b + 1e-6F * (c - a));
        add_triangle({t.x, t.y, third}, i);
      }
    }
    add_triangle(t, i);
  }
  return result;
}

Scene scene_of(Mesh mesh) {
  Scene scene;
  add(scene, std::move(mesh),
      glm::rotate(glm::translate(glm::dmat4(1.0), {0.0, 0.0, -3.0}), 0.7, glm::dvec3(0.48, 0.6, 0.64)));
  finish_scene(scene);
  return scene;
}

std::vector<StabilityFinding> measure_degenerate(const Globals& globals) {
  Drawer drawer(globals);
  const Mesh clean = shapes::icosphere(5);
  const View view = head_on({512, 512}, 0.4, 0.01);
  const Image<Key> expected = drawer.draw(scene_of(clean), view);
  const auto measure = [&](Extra extra, const char* name, const char* what) {
    const Mixed other = mixed(clean, extra);
    const Image<Key> keys = drawer.draw(scene_of(other.mesh), view);
    StabilityFinding finding =
        make_finding(fmt::format("degenerate/{}", name),
                     fmt::format("a sphere of {} triangles and {} that are {}", clean.triangles.size(),
                                 other.mesh.triangles.size() - clean.triangles.size(), what),
                     0.0, "share of pixels that show another triangle than without",
                     "They cover no pixel's centre, or cover it at the very depth of the triangle they stand for.");
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < keys.pixels().size(); ++i) {
      const Key a = keys.pixels()[i];
      const Key b = expected.pixels()[i];
      const bool same = a == kNoKey ? b == kNoKey : b != kNoKey && other.source[key_surface(a)] == key_surface(b);
      wrong += same ? 0U : 1U;
    }
    finding.measured = static_cast<double>(wrong) / static_cast<double>(keys.pixels().size());
    return finding;
  };
  std::vector<StabilityFinding> findings{
      measure(Extra::Points, "points", "points"), measure(Extra::Doubles, "doubles", "there already"),
      measure(Extra::Segments, "segments", "segments"), measure(Extra::Needles, "needles", "needles along edges")};
  for (std::size_t i = 2; i < findings.size(); ++i) {
    // They lie along one edge of ten triangles of three, and reach past it by what their third corner snaps.
    findings[i].limit = edges(expected) / 30.0 * 2.0 * std::numbers::sqrt2 / 256.0;
    findings[i].why = "Their third corner snaps up to sqrt(2)/256 pixel past the edge, which few centres lie on.";
  }
  return findings;
}

}  // namespace

StabilityCase slivers_case() {
  return {"slivers", "fans, strips and T-junctions: every pixel is covered exactly once", measure_slivers};
}

StabilityCase degenerate_case() {
  return {"degenerate", "points, doubles, segments and needles in a mesh: it looks as without", measure_degenerate};
}

}  // namespace hpr::stability
