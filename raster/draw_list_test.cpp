#include "raster/draw_list.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

class Random {
 public:
  double in(double from, double to) { return from + (to - from) * static_cast<double>(random_()) / 4294967296.0; }
  glm::dvec3 vector(double reach) { return {in(-reach, reach), in(-reach, reach), in(-reach, reach)}; }

 private:
  std::mt19937 random_{23};
};

View random_view(Random& random, bool orthographic) {
  View view = test::perspective_view({200, 100});
  view.eye = random.vector(2.0);
  view.axes = glm::dmat3(glm::rotate(glm::dmat4(1.0), random.in(0.0, 6.28), glm::normalize(random.vector(1.0))));
  view.left = random.in(-9.0, 8.0);
  view.right = view.left + std::exp2(random.in(-6.0, 4.0));
  view.bottom = random.in(-9.0, 8.0);
  view.top = view.bottom + std::exp2(random.in(-6.0, 4.0));
  view.near_distance = std::exp2(random.in(-12.0, 1.0));
  view.orthographic = orthographic;
  view.far_distance = view.near_distance + random.in(1.0, 20.0);
  return view;
}

TEST(Culler, NeverLosesAPointThatIsSeenInThePart) {
  Random random;
  int outside = 0;
  int inside = 0;
  int seen = 0;
  int tight = 0;
  for (int i = 0; i < 20000; ++i) {
    const View view = random_view(random, i % 5 == 0);
    const int x = static_cast<int>(random.in(0, 150));
    const int y = static_cast<int>(random.in(0, 80));
    const Rect part{x, y, x + 1 + static_cast<int>(random.in(0, 49)), y + 1 + static_cast<int>(random.in(0, 19))};
    // Half of the boxes lie where the view looks, so that all cases come up.
    const double distance = random.in(0.01, 8.0);
    const Ray ray = view_ray(view, random.in(part.x0 - 20, part.x1 + 20), random.in(part.y0 - 20, part.y1 + 20));
    const glm::dvec3 center = i % 2 == 0 ? random.vector(4.0) : ray.origin + distance * ray.direction;
    const double screen = (view.right - view.left) * (view.orthographic ? 1.0 : distance);
    const glm::dvec3 half = glm::abs(random.vector(1.0)) * screen * std::exp2(random.in(-9.0, 1.0));
    const Box box{glm::vec3(center - half), glm::vec3(center + half)};
    const glm::dmat4 matrix = clip_from_world(view, glm::dvec3(0.0));
    const Culler culler(matrix, view, part);
    const bool is_outside = culler.outside(box);
    const bool is_inside = culler.inside(box);
    const Rect pixels = is_outside ? Rect{} : culler.pixels(box);
    ASSERT_FALSE(is_outside && is_inside);
    outside += is_outside ? 1 : 0;
    inside += is_inside ? 1 : 0;
    tight += !is_outside && pixels.area() < part.area() ? 1 : 0;
    for (int sample = 0; sample < 60; ++sample) {
      glm::dvec3 at(0.0);
      for (int axis = 0; axis < 3; ++axis) {
        // Corners and edges more often than the middle.
        const double u = std::clamp(random.in(-0.3, 1.3), 0.0, 1.0);
        at[axis] = static_cast<double>(box.low[axis]) * (1.0 - u) + static_cast<double>(box.high[axis]) * u;
      }
      const glm::dvec4 clip = matrix * glm::dvec4(at, 1.0);
      const double px = (clip.x / clip.w + 1.0) * 0.5 * 200;
      const double py = (1.0 - clip.y / clip.w) * 0.5 * 100;
      const bool visible = clip.w > 0.0 && clip.z >= 0.0 && clip.z <= clip.w && px >= part.x0 && px <= part.x1 &&
                           py >= part.y0 && py <= part.y1;
      if (is_inside) {
        EXPECT_TRUE(clip.w > 0.0 && px >= part.x0 - 1 && px <= part.x1 + 1 && py >= part.y0 - 1 && py <= part.y1 + 1)
            << i;
      }
      if (!visible) continue;
      ++seen;
      ASSERT_FALSE(is_outside) << i;
      EXPECT_TRUE(px >= pixels.x0 && px <= pixels.x1 && py >= pixels.y0 && py <= pixels.y1) << i;
    }
  }
  EXPECT_GT(outside, 1500);
  EXPECT_GT(inside, 20);
  EXPECT_GT(tight, 100);
  EXPECT_GT(seen, 1000);
}

TEST(Culler, DropsNothingWhoseNearCutIsAtTheMercyOfRounding) {
  View view = test::perspective_view({100, 100}, {0.0, 0.0, 0.0});
  view.near_distance = 1e-9;
  // To the left of the view, from far behind the eye to far before it.
  const Box box{{-2000.0F, -1.0F, -1000.0F}, {-1999.0F, 1.0F, 1000.0F}};
  const Rect right_half{50, 0, 100, 100};
  const glm::dmat4 matrix = clip_from_world(view, view.eye);
  EXPECT_FALSE(Culler(matrix, view, right_half).outside(box));
  EXPECT_EQ(Culler(matrix, view, right_half).pixels(box), right_half);
  view.near_distance = 1.0;
  EXPECT_TRUE(Culler(clip_from_world(view, view.eye), view, right_half).outside(box));
}

TEST(DrawList, NeighbouringChunksBecomeOneCommand) {
  Scene scene;
  scene.meshes = {test::waves(100)};
  scene.instances = {test::placed(0, {0.0, 0.0, 0.0}), test::placed(0, {0.0, 0.0, -1.0})};
  finish_scene(scene);
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  const View view = test::perspective_view({100, 100}, {0.0, 0.0, 8.0});
  const DrawList list = make_draw_list(scene, geometry, geometry.pieces, view, view.block, Culling::Chunks, 1);
  ASSERT_EQ(list.commands.size(), 2U);
  EXPECT_EQ(list.commands[0].count, 3U * 20000U);
  EXPECT_EQ(list.records[0].first_surface, 0U);
  EXPECT_EQ(list.records[1].first_surface, 20000U);
  EXPECT_EQ(list.triangles_drawn, 40000U);
  EXPECT_EQ(list.triangles_culled, 0U);
  EXPECT_LT(list.pixels.width(), 60);
}

TEST(DrawList, IsTheSameForAnyNumberOfThreads) {
  Scene scene;
  scene.meshes = {test::waves(20)};
  Random random;
  for (int i = 0; i < 2000; ++i)
    scene.instances.push_back(test::placed(0, random.vector(9.0), random.in(0.0, 6.0), 0.5));
  finish_scene(scene);
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  const View view = test::perspective_view({300, 200});
  const Rect part{100, 50, 180, 120};
  const DrawList one = make_draw_list(scene, geometry, geometry.pieces, view, part, Culling::Chunks, 1);
  const DrawList four = make_draw_list(scene, geometry, geometry.pieces, view, part, Culling::Chunks, 4);
  ASSERT_EQ(one.commands.size(), four.commands.size());
  EXPECT_GT(one.commands.size(), 10U);
  EXPECT_GT(one.triangles_culled, one.triangles_drawn);
  for (std::size_t i = 0; i < one.commands.size(); ++i) {
    EXPECT_EQ(one.commands[i].first_index, four.commands[i].first_index);
    EXPECT_EQ(one.commands[i].count, four.commands[i].count);
    EXPECT_EQ(one.records[i].first_surface, four.records[i].first_surface);
    if (i > 0) {
      EXPECT_GE(one.records[i].first_surface, one.records[i - 1].first_surface);
    }
  }
}

/// Surfaces, per command its triangles: [first, last) of an index buffer and the instance they belong to.
std::vector<std::array<std::uint32_t, 3>> triangles_of(const DrawList& list) {
  std::vector<std::array<std::uint32_t, 3>> all;
  for (const DrawSpan& span : list.spans) {
    for (std::size_t i = span.first; i < span.first + span.count; ++i) {
      const DrawCommand& command = list.commands[i];
      EXPECT_EQ(command.count % 3, 0U);
      for (std::uint32_t index = 0; index < command.count; index += 3) {
        all.push_back({command.first_index + index, list.records[command.base_instance].first_surface,
                       static_cast<std::uint32_t>(span.winding)});
      }
    }
  }
  return all;
}

TEST(DrawList, PartsHaveEveryTriangleOnceAndAsMany) {
  Scene scene;
  scene.meshes = {test::waves(20), test::waves(60)};
  scene.materials.resize(1);
  scene.materials[0].double_sided = false;
  scene.instances = {test::placed(0, {0.0, 0.0, 0.0}), test::placed(1, {0.0, 0.0, -1.0}),
                     test::placed(0, {0.5, 0.0, -1.0})};
  scene.instances[1].to_world[0] *= -1.0;  // drawn by the other winding
  finish_scene(scene);
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  const View view = test::perspective_view({100, 100}, {0.0, 0.0, 8.0});
  const DrawList list = make_draw_list(scene, geometry, geometry.pieces, view, view.block, Culling::Chunks, 1);
  const auto expected = triangles_of(list);
  ASSERT_EQ(expected.size(), 8800U);
  for (const std::size_t count : {0U, 1U, 2U, 3U, 7U, 16U, 8799U, 8800U, 10000U}) {
    const std::vector<DrawList> parts = split_list(list, count);
    ASSERT_EQ(parts.size(), std::clamp<std::size_t>(count, 1, 8800)) << count;
    std::vector<std::array<std::uint32_t, 3>> all;
    std::uint64_t drawn = 0;
    for (const DrawList& part : parts) {
      const auto own = triangles_of(part);
      EXPECT_GE(own.size(), 8800 / parts.size());
      EXPECT_LE(own.size(), 8800 / parts.size() + 1);
      EXPECT_EQ(part.pixels, list.pixels);
      all.insert(all.end(), own.begin(), own.end());
      drawn += part.triangles_drawn;
    }
    EXPECT_TRUE(all == expected) << count;
    EXPECT_EQ(drawn, list.triangles_drawn);
  }
  EXPECT_EQ(split_list({}, 4).size(), 1U);
}

}  // namespace

}  // namespace hpr
