#include "gpu/gpu_keys.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "gpu/bvh.h"
#include "gpu/device/test_gpu.h"
#include "rt/test_scene.h"
#include "rt/trace/primary_rays.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;
using test::sphere;

Image<Key> keys_by_embree(const Scene& scene, const View& view) {
  const std::vector<SurfaceRange> objects = covering_surfaces(scene, false);
  const RayScene rays(scene, RaySpace(scene), 2, objects);
  TileLayer<Key> layer{FrameLayout({view.size()})};
  PrimaryRays(scene, rays, 2).draw(view, 0, std::array{Rect{0, 0, view.size().width, view.size().height}}, layer);
  Image<Key> image(view.size());
  for (int y = 0; y < view.size().height; ++y) {
    for (int x = 0; x < view.size().width; ++x) image.at(x, y) = layer.at(0, x, y);
  }
  return image;
}

struct Differences {
  std::size_t seen = 0;
  std::size_t surfaces = 0;  ///< pixels that show another one, or one where there is none
  std::size_t depths = 0;    ///< of the same surface
};

Differences between(const Image<Key>& a, const Image<Key>& b) {
  Differences found;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    const Key mine = a.pixels()[i];
    const Key other = b.pixels()[i];
    found.seen += mine != kNoKey ? 1U : 0U;
    if (key_surface(mine) != key_surface(other)) {
      ++found.surfaces;
    } else {
      found.depths += mine != other ? 1U : 0U;
    }
  }
  return found;
}

/// A view of parallel rays, so many metres high from its middle, from half a metre before it up to `far`.
View orthographic(View view, double half_height, double far) {
  view.orthographic = true;
  view.near_distance = 0.5;
  view.far_distance = far;
  view.top = half_height;
  view.bottom = -half_height;
  view.right = half_height * view.screen.width / view.screen.height;
  view.left = -view.right;
  return view;
}

class GpuKeysTest : public test::OnGpu {
 protected:
  void expect_as_embree(const Scene& scene, const View& view, const std::string& what, double others = 5e-4) {
    SCOPED_TRACE(what);
    const GpuScene placed(device(), scene, covering_surfaces(scene, false), 2);
    const Image<Key> found = GpuKeys(device()).draw(placed, view);
    const Differences off = between(found, keys_by_embree(scene, view));
    const auto pixels = static_cast<double>(found.pixels().size());
    EXPECT_GT(static_cast<double>(off.seen), 0.01 * pixels);
    EXPECT_LE(static_cast<double>(off.surfaces), others * pixels);
    EXPECT_EQ(off.depths, 0U);
  }
};

TEST_F(GpuKeysTest, AreThoseOfEmbree) {
  for (const char* const name :
       {"gen:cornell", "gen:gallery", "gen:asteroids", "gen:tetra?s=5", "gen:sphereflake?s=2"}) {
    const Scene scene = load_scene(name);
    View view =
        make_view(scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front(), {192, 144}, scene.bounds);
    view.jitter = {0.21, -0.37};
    expect_as_embree(scene, view, name);
  }
}

/// A wall of one side, a ball, and both mirrored, flattened and far from round; some hide others.
Scene placed_in_many_ways() {
  Scene scene;
  Material one_sided = test::diffuse();
  one_sided.double_sided = false;
  const std::uint32_t single = add_material(scene, one_sided);
  const std::uint32_t both = add_material(scene, test::diffuse());
  Material veil = test::diffuse();
  veil.alpha_mode = AlphaMode::Blend;
  const std::uint32_t wall = add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, single));
  const std::uint32_t ball = add_mesh(scene, sphere(0.7, 12, single));
  const std::uint32_t floor = add_mesh(scene, quad({-9, -2, 9}, {18, 0, 0}, {0, 0, -18}, both));
  const std::uint32_t glass = add_mesh(scene, quad({-9, -9, 3}, {18, 0, 0}, {0, 18, 0}, add_material(scene, veil)));
  const auto moved = [](double x, double y, const glm::dvec3& scale, double turned = 0.0) {
    const glm::dmat4 there = glm::translate(glm::dmat4(1.0), glm::dvec3(x, y, 0.0));
    return glm::scale(glm::rotate(there, turned, glm::dvec3(0.3, 1.0, 0.1)), scale);
  };
  place_mesh(scene, floor);
  place_mesh(scene, glass);  // covers in part: has no keys
  place_mesh(scene, wall, moved(-3, 1, {1, 1, 1}));
  place_mesh(scene, wall, moved(-1, 1, {-1, 1, 1}));       // mirrored
  place_mesh(scene, wall, moved(1, 1, {1, 1, 1}, 3.0));    // seen from behind
  place_mesh(scene, wall, moved(3, 1, {-1, 1, 1}, 3.0));   // that, mirrored
  place_mesh(scene, ball, moved(-3, -1, {1, 1, 0}, 0.4));  // flat
  place_mesh(scene, ball, moved(-1, -1, {1, 1, 1e-8}, 0.4));
  place_mesh(scene, ball, moved(1, -1, {1e-3, 1, 1}, 0.4));
  place_mesh(scene, ball, moved(3, -1, {1, -1, 1}));
  place_mesh(scene, ball, moved(0, 0, {0.5, 0.5, 0.5}));
  finish_scene(scene);
  return scene;
}

TEST_F(GpuKeysTest, SidesAndShapesOfInstancesAreThoseOfEmbree) {
  const Scene scene = placed_in_many_ways();
  expect_as_embree(scene, test::view_from({0, 0.2, 8}, {0, 0, 0}, {160, 120}, scene), "before");
  expect_as_embree(scene, test::view_from({0.5, 0.3, -8}, {0, 0, 0}, {160, 120}, scene), "behind");
  expect_as_embree(scene, test::view_from({700, 900, 8000}, {0, 0, 0}, {160, 120}, scene, 0.001), "far");
  expect_as_embree(scene, test::view_from({0, 0.2, 0.3}, {0, 0, -1}, {160, 120}, scene, 2.0), "within");
  const View from_above = orthographic(test::view_from({1, 6, 2}, {0, 0, 0}, {160, 120}, scene), 3.0, 40.0);
  expect_as_embree(scene, from_above, "orthographic");
}

/// From afar single precision rounds places by more than a pixel.
TEST_F(GpuKeysTest, EyesFarAwayMissNothingAtTheEdgesOfBoxes) {
  Scene scene;
  const std::uint32_t grey = add_material(scene, test::diffuse());
  const std::uint32_t wall = add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, grey));
  for (int i = 0; i < 9; ++i) {
    place_mesh(scene, wall, glm::translate(glm::dmat4(1.0), glm::dvec3(2.5 * (i % 3), 2.5 * (i / 3), 0.1 * i)));
  }
  finish_scene(scene);
  expect_as_embree(scene, test::view_from({3e6, 2e6, 9e6}, {2.5, 2.5, 0}, {160, 120}, scene, 1e-6), "far");
}

/// An orthographic view whose planes lie far apart has few depths: of what has one of them the lowest id stays, also
/// where that lies behind.
TEST_F(GpuKeysTest, SurfacesOfOneDepthAreThoseOfEmbree) {
  Scene scene;
  const std::uint32_t grey = add_material(scene, test::diffuse());
  const std::uint32_t wall = add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, grey));
  for (int i = 0; i < 12; ++i) {
    place_mesh(scene, wall, glm::translate(glm::dmat4(1.0), glm::dvec3(0.1 * i, 0.0, 0.02 * i)));
  }
  finish_scene(scene);
  const View view = orthographic(test::view_from({0, 0, 3}, {0, 0, 0}, {160, 120}, scene), 1.5, 4e6);
  expect_as_embree(scene, view, "orthographic");
}

TEST_F(GpuKeysTest, ClosedSurfacesHaveNoHolesFromAfar) {
  Scene scene;
  const std::uint32_t grey = add_material(scene, test::diffuse());
  place_mesh(scene, add_mesh(scene, sphere(1.0, 160, grey)),
             glm::rotate(glm::dmat4(1.0), 0.3, glm::dvec3(0.3, 1.0, 0.1)));
  finish_scene(scene);
  for (const double distance : {5.0, 1e4, 1e6}) {
    expect_as_embree(scene,
                     test::view_from({0, 0.6 * distance, 0.8 * distance}, {0, 0, 0}, {96, 72}, scene, 2.0 / distance),
                     std::to_string(distance), 0.0);
  }
}

/// More pixels than are drawn at once.
TEST_F(GpuKeysTest, LargeScreensAreDrawnInPieces) {
  const Scene scene = load_scene("gen:cornell");
  expect_as_embree(scene, make_view(scene.cameras.front(), {500, 301}, scene.bounds), "cornell");
}

/// A software device ends a thread's loops in silence.
TEST_F(GpuKeysTest, ARayThatMeetsTooMuchIsAnErrorAndNotAHole) {
  Scene scene;
  const std::uint32_t wall =
      add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, add_material(scene, test::diffuse())));
  for (int i = 0; i < 40'000; ++i) place_mesh(scene, wall);
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {8, 8}, scene, 0.3);
  try {
    const Image<Key> keys = GpuKeys(device()).draw(GpuScene(device(), scene, covering_surfaces(scene, false), 2), view);
    for (const Key key : keys.pixels()) ASSERT_LT(key_surface(key), 2U);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit) << error.what();
    EXPECT_TRUE(device().info().software);
  }
}

TEST(GpuScene, WhatFlattensHasNoInverse) {
  glm::dmat3 matrix(1.0);
  EXPECT_TRUE(usable_inverse(matrix));
  matrix[2][2] = 1e-3;
  ASSERT_TRUE(usable_inverse(matrix));
  EXPECT_DOUBLE_EQ((*usable_inverse(matrix))[2][2], 1e3);
  matrix[2][2] = 1e-8;
  EXPECT_FALSE(usable_inverse(matrix));
  matrix[2][2] = 0.0;
  EXPECT_FALSE(usable_inverse(matrix));
  EXPECT_FALSE(usable_inverse(glm::dmat3(0.0)));
  matrix[2] = matrix[1];
  EXPECT_FALSE(usable_inverse(matrix));
}

TEST_F(GpuKeysTest, ABlockOfAScreenHasTheKeysOfTheWhole) {
  const Scene scene = placed_in_many_ways();
  const GpuScene placed(device(), scene, covering_surfaces(scene, false), 2);
  View view = test::view_from({0, 0.2, 8}, {0, 0, 0}, {100, 80}, scene);
  GpuKeys drawer(device());
  const Image<Key> whole = drawer.draw(placed, view);
  view.block = {30, 20, 77, 61};
  const Image<Key> block = drawer.draw(placed, view);
  for (int y = 0; y < 41; ++y) {
    for (int x = 0; x < 47; ++x) ASSERT_EQ(block.at(x, y), whole.at(x + 30, y + 20)) << x << ' ' << y;
  }
}

TEST_F(GpuKeysTest, HoweverSurfacesAreDealtOutTheLargestKeysAreThoseOfAll) {
  const Scene scene = load_scene("gen:gallery");
  const View view =
      make_view(scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front(), {96, 72}, scene.bounds);
  GpuKeys drawer(device());
  const std::vector<SurfaceRange> all = covering_surfaces(scene, false);
  const Image<Key> expected = drawer.draw(GpuScene(device(), scene, all, 2), view);
  Image<Key> largest(view.size());
  constexpr std::uint32_t kParts = 3;
  for (std::uint32_t part = 0; part < kParts; ++part) {
    const SurfaceRange of{scene.triangles / kParts * part,
                          part + 1 == kParts ? scene.triangles : scene.triangles / kParts * (part + 1)};
    const Image<Key> keys = drawer.draw(GpuScene(device(), scene, common_ranges(all, {of}), 2), view);
    for (std::size_t i = 0; i < keys.pixels().size(); ++i)
      largest.pixels()[i] = std::max(largest.pixels()[i], keys.pixels()[i]);
  }
  EXPECT_EQ(largest.pixels().size(), expected.pixels().size());
  EXPECT_TRUE(std::ranges::equal(largest.pixels(), expected.pixels()));
}

TEST_F(GpuKeysTest, OfSurfacesAtOnePlaceTheLowestIdStays) {
  Scene scene;
  const std::uint32_t wall =
      add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, add_material(scene, test::diffuse())));
  for (int i = 0; i < 40; ++i) place_mesh(scene, wall);
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {64, 64}, scene, 0.3);
  const Image<Key> keys = GpuKeys(device()).draw(GpuScene(device(), scene, covering_surfaces(scene, false), 2), view);
  for (const Key key : keys.pixels()) ASSERT_LT(key_surface(key), 2U);
}

TEST_F(GpuKeysTest, NothingIsSeenOfNothing) {
  Scene scene;
  place_mesh(scene, add_mesh(scene, quad({0, 0, 0}, {0, 0, 0}, {0, 0, 0}, add_material(scene, test::diffuse()))));
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {20, 10}, scene);
  for (const std::vector<SurfaceRange>& objects : {std::vector<SurfaceRange>{}, covering_surfaces(scene, false)}) {
    const Image<Key> keys = GpuKeys(device()).draw(GpuScene(device(), scene, objects, 2), view);
    for (const Key key : keys.pixels()) ASSERT_EQ(key, kNoKey);
  }
}

TEST(Bvh, HoldsEveryBoxOnceInBoxesThatHoldIt) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> anywhere(-5.0F, 5.0F);
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{5}, std::size_t{3000}}) {
    std::vector<FloatBox> boxes(count);
    for (FloatBox& box : boxes) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.low.at(axis) = anywhere(random);
        box.high.at(axis) = box.low.at(axis) + 0.01F * std::abs(anywhere(random));
      }
    }
    boxes.push_back({{1, 1, 1}, {0, 2, 2}});  // empty
    boxes.push_back({{0, 0, 0}, {std::numeric_limits<float>::infinity(), 1, 1}});
    const Bvh bvh = BvhBuilder(2).build(boxes);
    std::vector<int> found(boxes.size());
    const auto check = [&](const auto& self, std::uint32_t at, std::uint32_t depth) -> void {
      const BvhNode& node = bvh.nodes.at(at);
      ASSERT_LT(depth, kMaxBvhDepth);
      const auto expect_inside = [&](const auto& low, const auto& high) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          EXPECT_GE(low.at(axis), node.low.at(axis));
          EXPECT_LE(high.at(axis), node.high.at(axis));
        }
      };
      for (std::uint32_t i = 0; i < node.items; ++i) {
        const std::uint32_t item = bvh.items.at(node.first + i);
        ++found.at(item);
        expect_inside(boxes[item].low, boxes[item].high);
      }
      if (node.items > 0) return;
      for (const std::uint32_t child : {node.first, node.first + 1}) {
        expect_inside(bvh.nodes.at(child).low, bvh.nodes.at(child).high);
        self(self, child, depth + 1);
      }
    };
    ASSERT_EQ(bvh.nodes.empty(), count == 0);
    if (count > 0) check(check, 0, 0);
    for (std::size_t i = 0; i < boxes.size(); ++i) EXPECT_EQ(found[i], i < count ? 1 : 0) << i;
  }
}

}  // namespace
}  // namespace hpr
