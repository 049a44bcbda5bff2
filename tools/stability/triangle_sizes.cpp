#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "cluster/distribution/assignment.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr Size kGiantSize{256, 256};
constexpr double kNear = 1e-3;

Scene one_triangle(double reach) {
  Scene scene;
  Mesh mesh;
  mesh.positions = {glm::dvec3(-reach, -reach, -10.0), glm::dvec3(reach, -reach, -10.0), glm::dvec3(0.0, reach, -10.0)};
  mesh.triangles = {{0, 1, 2}};
  add(scene, std::move(mesh));
  finish_scene(scene);
  return scene;
}

/// The square of half side `reach` in the plane y = -1, a metre below the eye, with texture coordinates of 2 m.
Mesh ground(double reach) {
  Mesh mesh;
  for (const double z : {reach, -reach}) {
    for (const double x : {-reach, reach}) {
      mesh.positions.emplace_back(glm::dvec3(x, -1.0, z));
      mesh.uvs[0].emplace_back(glm::dvec2(0.5 * x, 0.5 * z));
    }
  }
  mesh.triangles = {{0, 1, 3}, {0, 3, 2}};
  return mesh;
}

double slope_at(int pixel) {
  return -1.0 + 2.0 * (pixel + 0.5) / kGiantSize.width;
}

StabilityFinding triangle(Drawer& drawer) {
  StabilityFinding finding = make_finding(
      "giant/triangle",
      "a triangle 10 m away with corners up to +-1e7 m, around a screen of +-10 m: error of its depth",
      8.0 * kFloatRounding, "relative; infinite where a pixel is open",
      "Corners that clipping makes take five roundings, the division three; GL clips in floats, a screen's half "
      "beside the screen, and errs by up to 16 x 2^-24 of the corners' distance.");
  finding.curve.x = "corners at +- m";
  const auto error = [&](double reach) {
    const Image<Key> keys = drawer.draw(one_triangle(reach), head_on(kGiantSize, 1.0, kNear));
    double worst = 0.0;
    for (const Key key : keys.pixels()) {
      worst = key == kNoKey ? HUGE_VAL : std::max(worst, std::abs(double{key_depth(key)} * 10.0 / kNear - 1.0));
    }
    return worst;
  };
  for (double reach = 1e2; reach < 2e9; reach *= 10.0) {
    add_point(finding, reach, error(reach), reach < 2e7);
  }
  // It depends on luck from where on: the first decade that breaks is searched.
  const auto broken =
      std::ranges::find_if(finding.curve.points, [&](const auto& at) { return at.second > finding.limit; });
  if (finding.holds() && broken != finding.curve.points.end()) {
    finding.breaks_at = breaking_point(broken->first / 10.0, broken->first, 0.1,
                                       [&](double reach) { return error(reach) <= finding.limit; });
  }
  return finding;
}

/// What an eye a metre above ground that reaches to +-`reach` sees of it, turned about the upright axis.
struct VisibleGround {
  double wrong = 0.0;                             ///< pixels wrongly open or covered
  std::vector<std::pair<double, double>> depths;  ///< distance, and the largest error of depth there
};
VisibleGround visible_ground(Drawer& drawer, double reach, double turned) {
  Scene scene;
  add(scene, ground(reach));
  finish_scene(scene);
  View view = head_on(kGiantSize, 1.0, kNear);
  view.axes = glm::dmat3(glm::rotate(glm::dmat4(1.0), turned, glm::dvec3(0.0, 1.0, 0.0)));
  const Image<Key> keys = drawer.draw(scene, view);
  VisibleGround visible;
  for (int y = kGiantSize.height; y-- > 0;) {
    const double distance = 1.0 / slope_at(y);
    const bool ground_there = distance > 0.0 && 2.0 * distance < reach;  // its edge lies nearer than the horizon
    double worst = 0.0;
    for (const Key key : keys.row(y)) {
      if (distance < 0.0 || ground_there) visible.wrong += (key != kNoKey) == ground_there ? 0.0 : 1.0;
      if (ground_there) worst = std::max(worst, std::abs(double{key_depth(key)} - kNear / distance) / kNear);
    }
    if (ground_there) visible.depths.emplace_back(distance, worst);
  }
  return visible;
}

std::vector<StabilityFinding> horizon(Drawer& drawer) {
  constexpr double kPromised = 1e9;
  constexpr std::array<double, 4> kTurns{0.0, 0.3, 1.1, 2.5};
  StabilityFinding rows =
      make_finding("giant/horizon",
                   "ground to +-1e9 m on all sides of an eye a metre above it, turned four ways, near plane at 1e-3 m",
                   0.0, "pixels wrongly open or covered",
                   "Ground covers all rows below the horizon that see no farther than it reaches.");
  rows.curve.x = "ground to +- m";
  StabilityFinding depths =
      make_finding("giant/ground-depth", "the same: error of depth", 52.0 * kFloatRounding,
                   "relative to the depth at the picture's lower edge",
                   "Depth is interpolated in floats between corners, where the triangle is clipped: 52 roundings.");
  depths.curve.x = "distance, m";
  const auto wrong = [&](double reach) {
    double sum = 0.0;
    for (const double turned : kTurns) sum += visible_ground(drawer, reach, turned).wrong;
    return sum;
  };
  for (double reach = 1e2; reach < 2e9; reach *= 10.0) {
    add_point(rows, reach, wrong(reach), reach < 2.0 * kPromised);
  }
  if (rows.holds()) {
    rows.breaks_at = breaking_point_if_any(kPromised, 1e30, 0.2, [&](double reach) { return wrong(reach) <= 0.0; });
  }
  for (const double turned : kTurns) {
    const VisibleGround visible = visible_ground(drawer, kPromised, turned);
    if (depths.curve.points.empty()) depths.curve.points = visible.depths;
    for (std::size_t i = 0; i < visible.depths.size(); ++i) {
      double& worst = depths.curve.points.at(i).second;
      worst = std::max(worst, visible.depths[i].second);
      depths.measured = std::max(depths.measured, worst);
    }
  }
  return {rows, depths};
}

/// The share of pixels with the wrong square of a checker of 1 m, of those a centimetre or more from any line.
double wrong_squares(const Globals& globals, double reach, std::uint64_t& not_finite) {
  Scene scene;
  Texture checker;
  Image<Rgba8> squares({2, 2});
  for (int i = 0; i < 4; ++i) squares.at(i % 2, i / 2) = i % 3 == 0 ? Rgba8{255, 255, 255, 255} : Rgba8{0, 0, 0, 255};
  checker.image = std::move(squares);
  checker.nearest = true;
  scene.textures.push_back(checker);
  Material material;
  material.unlit = true;
  material.base_color_texture.texture = 0;
  scene.materials.push_back(material);
  add(scene, ground(reach));
  finish_scene(scene);
  View view = head_on(kGiantSize, 1.0, kNear);
  view.eye = {0.137, 0.0, 0.271};
  const Picture picture = make_picture(globals, scene, view);
  not_finite += picture.counts.not_finite;
  std::size_t wrong = 0;
  std::size_t counted = 0;
  for (int y = kGiantSize.height / 2; y < kGiantSize.height; ++y) {
    for (int x = 0; x < kGiantSize.width; ++x) {
      const double distance = 1.0 / slope_at(y);
      const double east = view.eye.x + slope_at(x) * distance;
      const double north = view.eye.z - distance;
      const auto far_from_line = [](double at) { return std::abs(at - std::round(at)) > 0.01; };
      if (!far_from_line(east) || !far_from_line(north) || std::max(std::abs(east), std::abs(north)) > reach) continue;
      const bool white = std::fmod(std::abs(std::floor(east) + std::floor(north)), 2.0) == 0.0;
      wrong += (picture.radiance.at(x, y).r > 0.5F) == white ? 0U : 1U;
      ++counted;
    }
  }
  return static_cast<double>(wrong) / static_cast<double>(counted);
}

StabilityFinding checker(const Globals& globals, std::uint64_t& not_finite) {
  StabilityFinding finding =
      make_finding("giant/checker", "a checker of 1 m on ground up to +-1e4 m, of pixels 1 cm or more from its lines",
                   0.0, "share of pixels with the wrong square",
                   "Texture coordinates round to 2^-24 of the largest: 16 roundings of 1e4 m are 1 cm.");
  finding.curve.x = "ground to +- m";
  for (double reach = 1e2; reach < 2e9; reach *= 10.0) {
    const double wrong = wrong_squares(globals, reach, not_finite);
    add_point(finding, reach, wrong, reach <= 1e4);
  }
  if (finding.holds()) {
    finding.breaks_at = breaking_point_if_any(
        1e4, 1e9, 0.2, [&](double reach) { return wrong_squares(globals, reach, not_finite) <= 0.0; });
  }
  return finding;
}

/// Pixels that do not show a wall's own light, the eye so close before it.
std::size_t wrong_close_pixels(const Globals& globals, double distance, std::uint64_t& not_finite) {
  Scene scene;
  Material material;
  material.unlit = true;
  material.base_color = {0.25F, 0.5F, 0.75F, 1.0F};
  scene.materials.push_back(material);
  add(scene, rectangle({-10.0F, -10.0F}, {10.0F, 10.0F}), glm::translate(glm::dmat4(1.0), {0.3, 0.2, -5.0}));
  finish_scene(scene);
  View view = head_on({64, 64}, 1.0, 0.5 * distance);
  view.eye = {0.0, 0.0, -5.0 + distance};
  const Picture picture = make_picture(globals, scene, view);
  not_finite += picture.counts.not_finite;
  std::size_t wrong = 0;
  for (const Rgb& color : picture.radiance.pixels()) wrong += color == Rgb{0.25F, 0.5F, 0.75F} ? 0U : 1U;
  return wrong;
}

StabilityFinding close_wall(const Globals& globals, std::uint64_t& not_finite) {
  StabilityFinding finding =
      make_finding("giant/close-wall", "the eye 1e-1 .. 1e-4 m before a wall of 20 m that lies 5 m from the origin",
                   0.0, "pixels that do not show it",
                   "Clipping errs by up to 16 x 2^-24 of the wall's 10 m, which must be less than the distance.");
  finding.curve.x = "distance, m";
  const auto wrong = [&](double distance) {
    return static_cast<double>(wrong_close_pixels(globals, distance, not_finite));
  };
  for (int power = -9; power <= -1; ++power) {
    const double distance = std::pow(10.0, power);
    add_point(finding, distance, wrong(distance), power >= -4);
  }
  if (finding.holds()) {
    finding.breaks_at = breaking_point_if_any(1e-4, 1e-12, 0.1, [&](double d) { return wrong(d) <= 0.0; });
  }
  return finding;
}

std::vector<StabilityFinding> measure_giant(const Globals& globals) {
  Drawer drawer(globals);
  std::vector<StabilityFinding> findings{triangle(drawer)};
  for (StabilityFinding& finding : horizon(drawer)) findings.push_back(std::move(finding));
  std::uint64_t not_finite = 0;
  findings.push_back(checker(globals, not_finite));
  findings.push_back(close_wall(globals, not_finite));
  StabilityFinding finite = make_finding("giant/not-finite", "all pictures of this case", 0.0,
                                         "pixels whose light was no finite number", "None of them has a reason to be.");
  finite.measured = static_cast<double>(not_finite);
  findings.push_back(finite);
  return findings;
}

constexpr std::uint32_t kCells = 707;  // a side: 999 698 triangles
constexpr Size kTinySize{256, 256};
constexpr int kFirst = 65;  // pixels [65, 127) of each side, inside one tile
constexpr int kPixels = 62;

/// `kCells` x `kCells` squares of two triangles, of side 1 / kCells.
Mesh fine_grid() {
  Mesh mesh;
  for (std::uint32_t row = 0; row <= kCells; ++row) {
    for (std::uint32_t column = 0; column <= kCells; ++column) {
      mesh.positions.emplace_back(glm::dvec3(column, row, 0.0) / static_cast<double>(kCells));
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  }
  for (std::uint32_t row = 0; row < kCells; ++row) {
    for (std::uint32_t column = 0; column < kCells; ++column) {
      const std::uint32_t a = row * (kCells + 1) + column;
      const std::uint32_t b = a + kCells + 1;
      mesh.triangles.emplace_back(a, a + 1, b + 1);
      mesh.triangles.emplace_back(a, b + 1, b);
    }
  }
  return mesh;
}

/// Over a square of `pixels` from pixel (first, first) of a view of slope 1, counted from below, a metre away.
glm::dmat4 over_pixels(int first, int pixels) {
  const double side = 2.0 / kTinySize.width;
  const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {-1.0 + first * side, -1.0 + first * side, -1.0});
  return glm::scale(moved, glm::dvec3(pixels * side, pixels * side, 1.0));
}

/// Pixels that are open though inside, covered though outside, or show a cell that does not hold their centre.
std::size_t wrong_pixels(const Image<Key>& keys) {
  std::size_t wrong = 0;
  constexpr double kCellsPerPixel = static_cast<double>(kCells) / kPixels;
  constexpr double kSnap = kCellsPerPixel / 256.0;
  for (int y = 0; y < kTinySize.height; ++y) {
    for (int x = 0; x < kTinySize.width; ++x) {
      const Key key = keys.at(x, kTinySize.height - 1 - y);
      const bool inside = x >= kFirst && x < kFirst + kPixels && y >= kFirst && y < kFirst + kPixels;
      if ((key != kNoKey) != inside) {
        ++wrong;
      } else if (inside) {
        const std::uint32_t cell = key_surface(key) / 2;
        const auto off = [&](int pixel, std::uint32_t at) {
          const double center = (pixel - kFirst + 0.5) * kCellsPerPixel;
          return center < at - kSnap || center > at + 1.0 + kSnap;
        };
        wrong += off(x, cell % kCells) || off(y, cell / kCells) ? 1U : 0U;
      }
    }
  }
  return wrong;
}

/// The largest share of `parts` over the mean, in chunks of neighbouring triangles.
double max_over_mean(const Scene& scene, int parts, std::uint32_t chunk) {
  std::uint32_t max_count = 0;
  for (const auto& ranges : partition_objects(scene, parts, chunk)) {
    std::uint32_t count = 0;
    for (const SurfaceRange& range : ranges) count += range.count();
    max_count = std::max(max_count, count);
  }
  return (max_count - static_cast<double>(scene.triangles) / parts) / chunk;
}

std::vector<StabilityFinding> measure_tiny(const Globals& globals) {
  Drawer drawer(globals);
  Scene scene;
  add(scene, fine_grid(), over_pixels(kFirst, kPixels));
  finish_scene(scene);
  StabilityFinding pixels = make_finding(
      "tiny/pixels", fmt::format("{} triangles, each 1/130 of a pixel, in one tile", scene.triangles), 0.0,
      "pixels open, covered or shown wrongly", "Every centre lies in a cell but for 1/256 pixel of snapping.");
  pixels.measured = static_cast<double>(wrong_pixels(drawer.draw(scene, head_on(kTinySize, 1.0, 0.01))));

  StabilityFinding balance = make_finding(
      "tiny/balance", "the same, and the same over all the screen, shared out to 2 .. 512 ranks", 1.5,
      "chunks of 512 triangles above the mean, largest share",
      "Halving whole chunks is off by half a chunk a level, halved by each level below: 1 chunk, and the last.");
  balance.curve.x = "ranks";
  Scene spread = scene;
  spread.instances[0].to_world = over_pixels(0, kTinySize.width);
  finish_scene(spread);
  for (int ranks = 2; ranks <= 512; ranks = ranks * 3 / 2 + 1) {
    const double worst = std::max(max_over_mean(scene, ranks, 512), max_over_mean(spread, ranks, 512));
    add_point(balance, ranks, worst);
  }
  return {pixels, balance};
}

}  // namespace

StabilityCase giant_case() {
  return {"giant", "triangles of 1e9 m, ground to the horizon, an eye almost on a wall", measure_giant};
}

StabilityCase tiny_case() {
  return {"tiny", "a million triangles in one tile: what is seen, and how they are shared out", measure_tiny};
}

}  // namespace hpr::stability
