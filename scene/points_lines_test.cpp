#include "scene/points_lines.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <span>
#include <string>
#include <utility>

#include "core/error.h"
#include "scene/scene_test_tools.h"

namespace hpr {
namespace {

constexpr std::uint64_t kNoLimit = std::uint64_t{1} << 40U;
/// Corners of an octahedron of the unit sphere's area: 4 pi = 4 sqrt(3) s^2.
const double kOctahedron = std::sqrt(std::numbers::pi / std::numbers::sqrt3);
/// Corners of a square of the unit circle's circumference: 2 pi = 4 sqrt(2) s.
const double kSquare = std::numbers::pi / (2.0 * std::numbers::sqrt2);

/// An eye at (0, 0, 10) that looks along -z. A pixel is 0.01 m wide one metre before it.
std::vector<View> view_of_pixels() {
  Camera camera;
  camera.eye = {0.0, 0.0, 10.0};
  camera.lens = PerspectiveLens{.vertical_fov_radians = 2.0 * std::atan(1.0), .near_distance = 0.1};
  return {make_view(camera, {200, 200}, {})};
}

/// Pixels of 0.25 m.
std::vector<View> orthographic_view() {
  Camera camera;
  camera.lens = OrthographicLens{25.0, 25.0, 0.0, 100.0};
  return {make_view(camera, {200, 200}, {})};
}

Scene scene_of(MeshKind kind, std::vector<glm::vec3> positions, std::vector<glm::uvec3> parts) {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  mesh.kind = kind;
  mesh.positions = std::move(positions);
  mesh.triangles = std::move(parts);
  scene.instances.emplace_back();
  finish_scene(scene);
  return scene;
}
Scene points(std::vector<glm::vec3> positions) {
  std::vector<glm::uvec3> parts;
  for (std::uint32_t i = 0; i < positions.size(); ++i) parts.emplace_back(i);
  return scene_of(MeshKind::Points, std::move(positions), std::move(parts));
}
Scene line(std::vector<glm::vec3> positions) {
  std::vector<glm::uvec3> parts;
  for (std::uint32_t i = 1; i < positions.size(); ++i) parts.emplace_back(i - 1, i, i);
  return scene_of(MeshKind::Lines, std::move(positions), std::move(parts));
}

PointLineWidths metres(double width) {
  return {{width, false}, {width, false}};
}
PointLineWidths pixels(double width) {
  return {{width, true}, {width, true}};
}

/// The least and the largest distance of a mesh's vertices from a point of the world.
std::pair<double, double> distances(const Scene& scene, const Instance& instance, const glm::dvec3& from) {
  std::pair<double, double> found{1e300, 0.0};
  for (const glm::vec3& position : scene.mesh_of(instance).positions) {
    const double distance = glm::distance(world_position(instance, position), from);
    found = {std::min(found.first, distance), std::max(found.second, distance)};
  }
  return found;
}

/// Whether each edge is one of two triangles, that pass it in opposite directions.
bool is_closed(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const glm::uvec3& t : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) ++edges[{t[corner], t[(corner + 1) % 3]}];
  }
  return std::ranges::all_of(edges, [&](const auto& edge) {
    const auto back = edges.find({edge.first.second, edge.first.first});
    return edge.second == 1 && back != edges.end() && back->second == 1;
  });
}

TEST(PointsAndLines, WidthsAreReadInPixelsOrMetres) {
  EXPECT_EQ(parse_drawn_width("3"), (DrawnWidth{3.0, true}));
  EXPECT_EQ(parse_drawn_width("2.5px"), (DrawnWidth{2.5, true}));
  EXPECT_EQ(parse_drawn_width("0.01m"), (DrawnWidth{0.01, false}));
  EXPECT_EQ(parse_drawn_width("1e-3m"), (DrawnWidth{0.001, false}));
  EXPECT_EQ(parse_drawn_width("0"), (DrawnWidth{0.0, true}));
  for (const char* const text : {"", "px", "m", "-1px", "3cm", "3 px", "nan", "inf", "1001", "2e9m", "0x3", "3pxm"}) {
    EXPECT_THROW((void)parse_drawn_width(text), Error) << text;
  }
  for (const DrawnWidth width : {DrawnWidth{3.0}, DrawnWidth{0.1, false}}) {
    EXPECT_EQ(parse_drawn_width(to_text(width)), width);
  }
}

/// Two screens side by side before one eye: the left one has pixels of 0.01 m one metre away, the right one of 0.04 m.
std::vector<View> unlike_views() {
  std::vector<View> views(2, view_of_pixels().front());
  views[0].right = 0.0;
  views[0].screen = {100, 200};
  views[1].left = 0.0;
  views[1].screen = {25, 50};
  return views;
}

TEST(PointsAndLines, PixelsAreThoseOfTheScreenThatShowsAPoint) {
  // Seen by the left screen, by the right one, by none (then the first one's pixels count), and from behind.
  Scene scene = points({{-3, 0, 0}, {3, 0, 0}, {0, 30, 0}, {3, 0, 20}});
  const std::vector<glm::vec3> centers = scene.meshes[0].positions;
  shape_points_and_lines(scene, pixels(3.0), unlike_views(), kNoLimit);
  const std::vector<glm::vec3>& corners = scene.meshes.at(0).positions;
  ASSERT_EQ(corners.size(), 4 * 6U);
  for (std::size_t i = 0; i < 4; ++i) {
    const double distance = glm::distance(glm::dvec3(centers[i]), glm::dvec3(0, 0, 10));
    const double pixel = (i == 1 ? 0.04 : 0.01) * distance;
    EXPECT_NEAR(glm::distance(corners[6 * i], centers[i]), kOctahedron * 1.5 * pixel, 1e-5) << i;
  }
  // Where both show a point it is drawn for the larger pixels, in whichever order they come.
  for (const bool turned : {false, true}) {
    Scene both = points({{3, 0, 0}});
    std::vector<View> views = unlike_views();
    views[0].right = 1.0;
    views[0].screen = {200, 200};
    if (turned) std::swap(views[0], views[1]);
    shape_points_and_lines(both, pixels(3.0), views, kNoLimit);
    EXPECT_NEAR(glm::distance(both.meshes.at(0).positions[0], glm::vec3(3, 0, 0)),
                kOctahedron * 1.5 * 0.04 * std::sqrt(109.0), 1e-5);
  }
  // Of two orthographic views with unlike pixels instances share no shapes.
  std::vector<View> flat(2, orthographic_view().front());
  flat[1].screen = {100, 100};
  EXPECT_TRUE(PixelFootprints(std::span(flat).first(1)).is_constant());
  EXPECT_FALSE(PixelFootprints(flat).is_constant());
}

TEST(PointsAndLines, APointIsAnOctahedronOfItsSpheresArea) {
  Scene scene = points({{1.0F, 2.0F, 3.0F}});
  scene.meshes[0].colors = {{0.1F, 0.2F, 0.3F, 1.0F}};
  scene.meshes[0].uvs[1] = {{0.5F, 0.75F}};
  shape_points_and_lines(scene, metres(0.2), view_of_pixels(), kNoLimit);
  const Mesh& mesh = scene.meshes.at(0);
  EXPECT_EQ(mesh.kind, MeshKind::Triangles);
  EXPECT_EQ(scene.triangles, 8U);
  ASSERT_EQ(mesh.positions.size(), 6U);
  const auto corner = static_cast<float>(0.1 * kOctahedron);
  EXPECT_NEAR(corner, 0.134677, 1e-6);
  EXPECT_FLOAT_EQ(mesh.positions[0].x, 1.0F + corner);
  EXPECT_FLOAT_EQ(mesh.positions[3].y, 2.0F - corner);
  EXPECT_EQ(mesh.normals[3], glm::vec3(0, -1, 0));
  EXPECT_EQ(mesh.colors, std::vector<glm::vec4>(6, {0.1F, 0.2F, 0.3F, 1.0F}));
  EXPECT_EQ(mesh.uvs[1], std::vector<glm::vec2>(6, {0.5F, 0.75F}));
  EXPECT_EQ(test::first_flaw(mesh), "");
  EXPECT_TRUE(is_closed(mesh));
  EXPECT_NEAR(scene.bounds.high.z, 3.0 + corner, 1e-6);
}

TEST(PointsAndLines, PixelsCountWhereAPointStandsInTheView) {
  Scene scene = points({{0, 0, 0}, {0, 0, 8}, {0, 4, 7}});
  shape_points_and_lines(scene, pixels(3.0), view_of_pixels(), kNoLimit);
  const auto& positions = scene.meshes[0].positions;
  // Three pixels are 0.3 m wide at 10 m, 0.06 m at 2 m, 0.15 m at 5 m.
  EXPECT_NEAR(positions[0].x, 0.15 * kOctahedron, 1e-6);
  EXPECT_NEAR(positions[6].x, 0.03 * kOctahedron, 1e-6);
  EXPECT_NEAR(positions[12].x, 0.075 * kOctahedron, 1e-6);

  scene = points({{0, 0, 0}, {0, 0, 8}});
  shape_points_and_lines(scene, pixels(3.0), orthographic_view(), kNoLimit);
  EXPECT_NEAR(scene.meshes[0].positions[0].x, 0.375 * kOctahedron, 1e-6);
  EXPECT_NEAR(scene.meshes[0].positions[6].x, 0.375 * kOctahedron, 1e-6);

  scene = points({{0, 0, 10}});  // in the eye
  shape_points_and_lines(scene, pixels(3.0), view_of_pixels(), kNoLimit);
  EXPECT_NEAR(scene.meshes[0].positions[0].x, 0.5 * 3.0 * 0.01 * 0.1 * kOctahedron, 1e-9) << "as at the near plane";
}

TEST(PointsAndLines, LargerPointsAreFinerWithinTheTrianglesThereMayBe) {
  const std::map<double, std::uint32_t> triangles{{5.9, 8},    {6.0, 20},    {15.0, 20},    {16.0, 80}, {47.0, 80},
                                                  {48.0, 320}, {149.0, 320}, {150.0, 1280}, {0.0, 0}};
  for (const auto& [width, count] : triangles) {
    Scene scene = points({{0, 0, 0}});
    shape_points_and_lines(scene, pixels(width), orthographic_view(), kNoLimit);
    EXPECT_EQ(scene.triangles, count) << width;
    EXPECT_EQ(test::first_flaw(scene.meshes[0]), "") << width;
    EXPECT_TRUE(is_closed(scene.meshes[0])) << width;
    if (width > 0.0) {
      EXPECT_NEAR(distances(scene, scene.instances[0], {}).second / (0.125 * width), 1.0, 0.35) << width;
    }
  }
  // One point more than fit: 2^24 = 209715 * 80 + 16.
  for (const auto& [count, expected] : {std::pair{209'715U, "16777200"}, {209'716U, "4194320"}}) {
    Scene scene = points(std::vector<glm::vec3>(count, glm::vec3(0.0F)));
    try {
      shape_points_and_lines(scene, pixels(20.0), orthographic_view(), 0);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Limit);
      const std::string triangles_named = std::string(" as ") + expected + " triangles";
      EXPECT_NE(std::string(error.what()).find(triangles_named), std::string::npos) << error.what();
      EXPECT_NE(error.hint().find("--limit-mem"), std::string::npos) << error.hint();
    }
  }
}

TEST(PointsAndLines, TheLimitCountsWhatTheyNeed) {
  // Six vertices of 24 bytes and eight triangles of 12, with what is there: 24 bytes and an instance.
  const std::uint64_t bytes = 6 * 24 + 8 * 12 + 24 + sizeof(Instance);
  Scene scene = points({{0, 0, 0}});
  EXPECT_THROW(shape_points_and_lines(scene, metres(0.1), view_of_pixels(), bytes - 1), Error);
  EXPECT_NO_THROW(shape_points_and_lines(scene, metres(0.1), view_of_pixels(), bytes));
  EXPECT_EQ(memory_of(scene), bytes - 24);
}

TEST(PointsAndLines, TellWhatTheyWereMadeInto) {
  Scene scene = points({{0, 0, 0}, {0, 0, 8}});
  shape_points_and_lines(scene, metres(0.1), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.shapes_note, "2 points of 0.1m, as 16 triangles");
  scene = line({{0, 0, 0}, {0, 0, -2}});
  shape_points_and_lines(scene, pixels(3.0), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.shapes_note,
            "1 line segments of 3px, as 16 triangles (pixels of the first frame: what comes nearer grows)");
}

TEST(PointsAndLines, ASegmentIsATubeWithTips) {
  Scene scene = line({{0, 0, 0}, {0, 0, -2}});
  scene.meshes[0].colors = {{1, 0, 0, 1}, {0, 1, 0, 1}};
  shape_points_and_lines(scene, metres(0.02), view_of_pixels(), kNoLimit);
  const Mesh& mesh = scene.meshes[0];
  ASSERT_EQ(mesh.positions.size(), 10U) << "two squares and two tips";
  EXPECT_EQ(scene.triangles, 16U);
  EXPECT_EQ(test::first_flaw(mesh), "");
  EXPECT_TRUE(is_closed(mesh));
  EXPECT_NEAR(mesh.positions[0].z, 0.01 * kSquare, 1e-7);
  EXPECT_EQ(mesh.normals[0], glm::vec3(0, 0, 1));
  EXPECT_NEAR(mesh.positions[9].z, -2.0 - 0.01 * kSquare, 1e-6);
  for (std::size_t i = 1; i < 9; ++i) {
    EXPECT_EQ(mesh.positions[i].z, i < 5 ? 0.0F : -2.0F);
    EXPECT_NEAR(glm::length(glm::dvec2(mesh.positions[i])), 0.01 * kSquare, 1e-7);
  }
  for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(mesh.colors[i].r, i < 5 ? 1.0F : 0.0F);

  for (const auto& [width, sides] : {std::pair{5.0, 4U}, {6.0, 8U}, {24.0, 16U}, {100.0, 32U}}) {
    scene = line({{0, 0, 0}, {90, 0, 0}});
    shape_points_and_lines(scene, pixels(width), orthographic_view(), kNoLimit);
    EXPECT_EQ(scene.triangles, 2 * sides + 2 * (2 * sides / 4 - 1) * sides) << width;
    EXPECT_EQ(test::first_flaw(scene.meshes[0]), "") << width;
    EXPECT_TRUE(is_closed(scene.meshes[0])) << width;
  }
}

TEST(PointsAndLines, SegmentsThatFollowOneAnotherShareTheirEnds) {
  Scene scene = line({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}});
  shape_points_and_lines(scene, metres(0.02), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.triangles, 16U + 12U);
  EXPECT_EQ(scene.meshes[0].positions.size(), 10U + 9U);
  EXPECT_EQ(test::first_flaw(scene.meshes[0]), "");

  scene = scene_of(MeshKind::Lines, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, {{0, 1, 1}, {1, 2, 2}, {2, 0, 0}});
  shape_points_and_lines(scene, metres(0.02), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.triangles, 3 * 12U) << "a loop has no ends";

  scene = line({{0, 0, 0}, {0, 0, 0}, {1, 0, 0}, {1, 0, 0}});
  shape_points_and_lines(scene, metres(0.02), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.triangles, 16U) << "segments without length are nothing";
}

TEST(PointsAndLines, ALineThatPassesCloseToTheEyeIsThinThere) {
  Scene scene = line({{-50.0F, 0.0F, 9.0F}, {50.0F, 0.0F, 9.0F}});
  shape_points_and_lines(scene, pixels(2.0), view_of_pixels(), kNoLimit);
  EXPECT_EQ(test::first_flaw(scene.meshes[0]), "");
  EXPECT_TRUE(is_closed(scene.meshes[0]));
  double at_middle = 0.0;
  for (const glm::vec3& p : scene.meshes[0].positions) {
    const double distance = std::hypot(p.x, 1.0);
    const double radius = std::hypot(p.y, p.z - 9.0);
    if (p.x == 0.0F) at_middle = radius;
    if (std::abs(p.x) < 50.0F) {
      EXPECT_NEAR(radius, 0.01 * distance * kSquare, 1e-6) << p.x;
    }
  }
  EXPECT_NEAR(at_middle, 0.01 * kSquare, 1e-6);
  const std::uint32_t in_pixels = scene.triangles;
  scene = line({{-50.0F, 0.0F, 9.0F}, {50.0F, 0.0F, 9.0F}});
  shape_points_and_lines(scene, metres(0.02), view_of_pixels(), kNoLimit);
  EXPECT_LT(scene.triangles, in_pixels);
}

TEST(PointsAndLines, AreAsWideHoweverTheirInstanceScales) {
  glm::dmat4 turned(0.0);  // a quarter turn about z, enlarged fourfold
  turned[0][1] = 4.0;
  turned[1][0] = -4.0;
  turned[2][2] = 4.0;
  turned[3] = {5, 0, 0, 1};
  glm::dmat4 stretched(1.0);
  stretched[0] = {3.0, 0.5, 0.0, 0.0};
  stretched[3] = {0, 5, 0, 1};
  glm::dmat4 reflected = stretched;
  reflected[0] = -reflected[0];
  glm::dmat4 moved = turned;
  moved[3] = {0, 0, -30, 1};
  for (const bool is_line : {false, true}) {
    Scene scene = is_line ? line({{1, 2, 3}, {1, 2, 3.001F}}) : points({{1, 2, 3}});
    for (const glm::dmat4& matrix : {turned, stretched, reflected, moved}) scene.instances.push_back({0, matrix, 0});
    shape_points_and_lines(scene, metres(0.2), view_of_pixels(), kNoLimit);
    ASSERT_EQ(scene.instances.size(), 5U);
    const double expected = 0.1 * (is_line ? kSquare : kOctahedron);
    for (const Instance& instance : scene.instances) {
      const auto [low, high] = distances(scene, instance, world_position(instance, {1.0F, 2.0F, 3.0F}));
      EXPECT_NEAR(low, expected, 0.005);
      EXPECT_NEAR(high, expected, 0.005);
      EXPECT_EQ(test::first_flaw(scene.mesh_of(instance)), "");
      const glm::dmat3 normals_to_world = glm::transpose(glm::inverse(glm::dmat3(instance.to_world)));
      for (std::size_t i = 0; !is_line && i < scene.mesh_of(instance).positions.size(); ++i) {
        const glm::dvec3 out = world_position(instance, scene.mesh_of(instance).positions[i]) -
                               world_position(instance, {1.0F, 2.0F, 3.0F});
        const glm::dvec3 normal = normals_to_world * glm::dvec3(scene.mesh_of(instance).normals[i]);
        EXPECT_NEAR(glm::dot(glm::normalize(normal), glm::normalize(out)), 1.0, 1e-6) << "a sphere's normals";
      }
      // In the world, fronts face away from the center.
      const Mesh& mesh = scene.mesh_of(instance);
      const glm::uvec3& t = mesh.triangles[0];
      const glm::dvec3 a = world_position(instance, mesh.positions[t.x]);
      const glm::dvec3 across = glm::cross(world_position(instance, mesh.positions[t.y]) - a,
                                           world_position(instance, mesh.positions[t.z]) - a);
      const double outward = glm::dot(across, a - world_position(instance, {1.0F, 2.0F, 3.0F}));
      EXPECT_GT(is_mirrored(instance) ? -outward : outward, 0.0);
    }
    EXPECT_EQ(scene.instances[1].mesh, scene.instances[4].mesh) << "moved only";
    EXPECT_NE(scene.instances[0].mesh, scene.instances[1].mesh);
    EXPECT_NE(scene.instances[2].mesh, scene.instances[3].mesh);
  }
}

TEST(PointsAndLines, EachInstanceHasItsOwnPixels) {
  Scene scene = points({{0, 0, 0}});
  glm::dmat4 nearer(1.0);
  nearer[3].z = 8.0;
  scene.instances.push_back({0, nearer, 0});
  shape_points_and_lines(scene, pixels(2.0), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.meshes.size(), 2U);
  EXPECT_NEAR(distances(scene, scene.instances[0], {0, 0, 0}).second, 0.1 * kOctahedron, 1e-6);
  EXPECT_NEAR(distances(scene, scene.instances[1], {0, 0, 8}).second, 0.02 * kOctahedron, 1e-6);
}

TEST(PointsAndLines, FlatInstancesAndMeshesThatNobodySeesDoNoHarm) {
  Scene scene = points({{0, 0, 0}});
  scene.instances[0].to_world[2] = glm::dvec4(0.0);
  Mesh unseen = scene.meshes[0];
  scene.meshes.push_back(unseen);
  shape_points_and_lines(scene, metres(0.2), view_of_pixels(), kNoLimit);
  EXPECT_EQ(scene.triangles, 8U);
  EXPECT_FALSE(has_points_or_lines(scene));
  EXPECT_EQ(test::first_flaw(scene.meshes[1]), "");
  scene.instances[0].to_world = glm::dmat4(0.0);
  scene.instances[0].to_world[3].w = 1.0;
  scene.meshes[0] = unseen;
  shape_points_and_lines(scene, pixels(2.0), view_of_pixels(), kNoLimit);
  EXPECT_EQ(test::first_flaw(scene.meshes[0]), "");
}

TEST(PointsAndLines, NoScaleOrViewMakesThemInfinite) {
  View nowhere = view_of_pixels().front();
  nowhere.right = std::numeric_limits<double>::quiet_NaN();
  View huge = orthographic_view().front();
  huge.right = 3e38;
  huge.top = 3e38;
  for (const double scale : {1e-300, 1e-31, 1e-20, 1e20, 1e31, 1e200}) {
    for (const double stretch : {1.0, 3.0}) {
      for (const View& view : {view_of_pixels().front(), nowhere, huge}) {
        for (const PointLineWidths& widths : {pixels(1000.0), metres(1e9), metres(0.01)}) {
          for (const bool is_line : {false, true}) {
            Scene scene = is_line ? line({{0, 0, 0}, {1e-3F, 0, 0}}) : points({{0, 0, 0}});
            scene.instances[0].to_world = glm::dmat4(glm::dmat3(scale));
            scene.instances[0].to_world[1][1] *= stretch;
            shape_points_and_lines(scene, widths, std::span(&view, 1), kNoLimit);
            for (const Mesh& mesh : scene.meshes) {
              for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
                EXPECT_LT(glm::length(glm::dvec3(mesh.positions[i])), 1e18) << scale;
                EXPECT_NEAR(glm::length(glm::dvec3(mesh.normals[i])), 1.0, 1e-6) << scale;
              }
            }
            EXPECT_LT(glm::length(scene.bounds.high), is_line && scale > 1e20 ? 1e300 : 1e18) << scale;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace hpr
