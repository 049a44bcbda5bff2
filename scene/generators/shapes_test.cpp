#include "scene/generators/shapes.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>

#include "scene/generators/portable_math.h"
#include "scene/scene_test_tools.h"

namespace hpr {
namespace {

/// Every directed edge of a closed, consistently wound surface meets its opposite exactly once.
bool closed(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const glm::uvec3& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  }
  for (const auto& [edge, count] : edges) {
    const auto opposite = edges.find({edge.second, edge.first});
    if (count != 1 || opposite == edges.end()) return false;
  }
  return true;
}

/// Positive when triangles wind counter-clockwise seen from outside.
double volume(const Mesh& mesh) {
  double sum = 0.0;
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t.x]);
    const glm::dvec3 b(mesh.positions[t.y]);
    const glm::dvec3 c(mesh.positions[t.z]);
    sum += glm::dot(a, glm::cross(b, c)) / 6.0;
  }
  return sum;
}

TEST(PortableMath, AgreesWithTheLibraryToTheLastBits) {
  for (int i = -4000; i <= 4000; ++i) {
    const double turns = i / 8192.0;
    EXPECT_NEAR(portable::sin_turns(turns), std::sin(2.0 * std::numbers::pi * turns), 1e-15);
    EXPECT_NEAR(portable::cos_turns(turns), std::cos(2.0 * std::numbers::pi * turns), 1e-15);
    EXPECT_NEAR(portable::exp2(turns) / std::exp2(turns), 1.0, 1e-15);
  }
  EXPECT_EQ(portable::sin_turns(0.25), 1.0);
  EXPECT_EQ(portable::cos_turns(-0.5), -1.0);
  EXPECT_EQ(portable::exp2(-3.0), 0.125);
}

TEST(Shapes, IcospheresHaveTheCountsOfTheirLevelAndAreClosed) {
  std::size_t triangles = 20;
  for (int level = 0; level <= 4; ++level, triangles *= 4) {
    const Mesh mesh = shapes::icosphere(level);
    EXPECT_EQ(mesh.triangles.size(), triangles);
    EXPECT_EQ(mesh.positions.size(), triangles / 2 + 2);
    EXPECT_TRUE(closed(mesh)) << "level " << level;
    EXPECT_EQ(test::first_flaw(mesh), "") << mesh.triangles.size() << " triangles";
  }
  EXPECT_NEAR(volume(shapes::icosphere(4)), 4.0 / 3.0 * std::numbers::pi, 0.02);
}

TEST(Shapes, CubeSpheresHaveTwelveNSquaredTrianglesAndAreClosed) {
  for (const int n : {1, 2, 3, 4, 7}) {
    const Mesh mesh = shapes::cube_sphere(n);
    const auto squares = static_cast<std::size_t>(n * n);
    EXPECT_EQ(mesh.triangles.size(), 12 * squares);
    EXPECT_EQ(mesh.positions.size(), 6 * squares + 2);
    EXPECT_TRUE(closed(mesh)) << "n " << n;
    EXPECT_EQ(test::first_flaw(mesh), "") << mesh.triangles.size() << " triangles";
    EXPECT_GT(volume(mesh), 0.0);
  }
}

TEST(Shapes, TorusKnotsAreClosedTubesOfTheVolumeTheirLengthGives) {
  const Mesh mesh = shapes::torus_knot(2, 3, 256, 32, 0.17);
  EXPECT_EQ(mesh.triangles.size(), 2U * 256U * 32U);
  EXPECT_TRUE(closed(mesh));
  EXPECT_EQ(test::first_flaw(mesh), "") << mesh.triangles.size() << " triangles";
  double length = 0.0;
  glm::dvec3 before(1.0, 0.0, 0.0);
  for (int i = 1; i <= 4096; ++i) {
    const double t = i / 4096.0;
    const double ring = 2.0 + portable::cos_turns(3 * t);
    const glm::dvec3 here =
        glm::dvec3(ring * portable::cos_turns(2 * t), portable::sin_turns(3 * t), ring * portable::sin_turns(2 * t)) /
        3.0;
    length += glm::distance(before, here);
    before = here;
  }
  // Pappus: a tube's volume is its cross-section times the length of its centre line.
  EXPECT_NEAR(volume(mesh) / (std::numbers::pi * 0.17 * 0.17 * length), 1.0, 0.02);
}

TEST(Shapes, VasesHaveTheTrianglesOfATeapotAndAreClosed) {
  for (const int n : {2, 4, 8, 12}) {
    const Mesh mesh = shapes::vase(n);
    EXPECT_EQ(mesh.triangles.size(), static_cast<std::size_t>(64 * n * n - 8 * n));
    EXPECT_TRUE(closed(mesh)) << "n " << n;
    EXPECT_EQ(test::first_flaw(mesh), "") << mesh.triangles.size() << " triangles";
  }
  const Mesh mesh = shapes::vase(12);
  EXPECT_GT(volume(mesh), 0.0);
  for (const glm::vec3& p : mesh.positions) {
    EXPECT_GT(p.y, -0.01F);
    EXPECT_LT(p.y, 1.01F);
  }
}

TEST(Shapes, BoxFacesLookOutwards) {
  Mesh mesh;
  shapes::add_box(mesh, {-1, 0, 2}, {1, 3, 6});
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_EQ(test::first_flaw(mesh), "") << mesh.triangles.size() << " triangles";
  EXPECT_DOUBLE_EQ(volume(mesh), 24.0);
}

TEST(Shapes, AQuadShowsItsPictureUpright) {
  Mesh mesh;
  shapes::add_quad(mesh, {{{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}}});
  EXPECT_EQ(mesh.normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(mesh.uvs[0][0], glm::vec2(0, 1)) << "the lower left corner shows the picture's last row";
  EXPECT_EQ(mesh.uvs[0][2], glm::vec2(1, 0));
}

TEST(Patterns, TheTileRulerNamesEveryCell) {
  const Image<Rgba8> ruler = patterns::tile_ruler({512, 320});
  for (int cell_y = 0; cell_y < 10; ++cell_y) {
    for (int cell_x = 0; cell_x < 16; ++cell_x) {
      int column = 0;
      int line = 0;
      for (int digit = 0; digit < 5; ++digit) {
        const int x = 32 * cell_x + 2 + 6 * digit;
        column = 2 * column + (ruler.at(x, 32 * cell_y + 9).r == 255 ? 1 : 0);
        line = 2 * line + (ruler.at(x, 32 * cell_y + 21).r == 255 ? 1 : 0);
      }
      EXPECT_EQ(column, cell_x);
      EXPECT_EQ(line, cell_y);
    }
  }
}

TEST(Patterns, TheSiemensStarIsHalfWhiteAndPointSymmetric) {
  const Image<Rgba8> star = patterns::siemens_star({256, 256}, 18);
  int white = 0;
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) {
      white += star.at(x, y).r == 255 ? 1 : 0;
      EXPECT_EQ(star.at(x, y), star.at(255 - x, 255 - y));
    }
  }
  EXPECT_NEAR(white, 32768, 700);
  int changes = 0;
  for (int i = 0; i < 7200; ++i) {
    const auto at = [&](int k) {
      return star.at(static_cast<int>(128.0 + 110.0 * portable::cos_turns(k / 7200.0)),
                     static_cast<int>(128.0 + 110.0 * portable::sin_turns(k / 7200.0)));
    };
    changes += at(i) == at(i + 1) ? 0 : 1;
  }
  EXPECT_GE(changes, 36);
}

TEST(Patterns, TheZonePlateIsBrightestInItsCentreAndTheWedgeHasItsSteps) {
  const Image<Rgba8> plate = patterns::zone_plate({512, 320});
  EXPECT_EQ(plate.at(256, 160).r, 255);
  const Image<Rgba8> wedge = patterns::grey_wedge({512, 320}, 64);
  EXPECT_EQ(wedge.at(0, 0).r, 0);
  EXPECT_EQ(wedge.at(511, 319).r, 255);
  int steps = 1;
  for (int x = 1; x < 512; ++x) steps += wedge.at(x, 5) == wedge.at(x - 1, 5) ? 0 : 1;
  EXPECT_EQ(steps, 64);
}

}  // namespace
}  // namespace hpr
