#include "raster/chunk_bins.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <string>

#include "raster/draw_list.h"
#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

using test::uniform;

/// Small and large meshes, near and far, many of them through the near plane or behind the eye.
Scene crowd() {
  Scene scene = test::mixed_scene();
  scene.meshes.push_back(test::waves(12));
  std::mt19937 random(5);
  for (int i = 0; i < 300; ++i) {
    const glm::dvec3 at(uniform(random, -4, 4), uniform(random, -4, 4), uniform(random, -4, 4));
    scene.instances.push_back(test::placed(2, at, uniform(random, 0, 6), std::exp2(uniform(random, -5, 1))));
  }
  finish_scene(scene);
  return scene;
}

std::vector<View> views_of(Size size) {
  View across = test::perspective_view(size, {0.0, 0.0, 0.25});  // among the meshes
  across.near_distance = 0.5;
  View jittered = test::perspective_view(size);
  jittered.left += 0.37 / size.width;
  jittered.right += 0.37 / size.width;
  View flat = test::perspective_view(size);
  flat.orthographic = true;
  flat.far_distance = 6.0;
  flat.left *= 4.0;
  flat.right *= 4.0;
  return {test::perspective_view(size), across, jittered, flat};
}

/// Areas of rectangles, one of them empty, the others all of the view.
std::vector<std::vector<Rect>> areas_of(Size size) {
  const int x = size.width / 3;
  const int y = size.height / 2;
  return {{{0, 0, x, size.height}},
          {},
          {{x, 0, 2 * x, y}, {2 * x, 0, size.width, y / 2}},
          {{2 * x, y / 2, size.width, y}, {x, y, size.width, size.height}}};
}

/// All chunks but those of which the whole view shows nothing. Culling for a part of it may keep some of these, as less
/// is known of a box that reaches behind the eye.
std::vector<ChunkRange> chunks_in_view(const Scene& scene, const Geometry& geometry, const View& view) {
  std::vector<ChunkRange> chunks;
  for (const Piece& piece : geometry.pieces) {
    const glm::dmat4 from_eye_relative = clip_from_world(view, view.eye);
    const Culler culler(*drawable_matrix(scene.instances[piece.instance], from_eye_relative, view.eye), view,
                        {0, 0, view.size().width, view.size().height});
    for (std::uint32_t i = 0; i < piece.chunks; ++i) {
      const std::uint32_t number = piece.number + i;
      if (!culler.outside(geometry.chunks[piece.first_chunk + i].box)) append_range(chunks, {number, number + 1});
    }
  }
  return chunks;
}

/// What a list draws, and where.
std::string contents(const DrawList& list) {
  std::string text = std::to_string(list.pixels.x0) + ' ' + std::to_string(list.pixels.y0) + ' ' +
                     std::to_string(list.pixels.x1) + ' ' + std::to_string(list.pixels.y1);
  for (std::size_t i = 0; i < list.commands.size(); ++i) {
    text += ';' + std::to_string(list.records[i].first_surface) + ':' + std::to_string(list.commands[i].first_index) +
            '+' + std::to_string(list.commands[i].count);
  }
  return text;
}

std::set<std::uint32_t> numbers_in(std::span<const ChunkRange> ranges) {
  std::set<std::uint32_t> numbers;
  for (const ChunkRange& range : ranges) {
    for (std::uint32_t number = range.first; number < range.last; ++number) numbers.insert(number);
  }
  return numbers;
}

TEST(ChunkBins, DrawTheListsThatAllThatIsSeenWould) {
  const Scene scene = crowd();
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  const Size size{200, 128};
  const auto areas = areas_of(size);
  std::uint64_t sent = 0;
  std::uint64_t drawn = 0;
  for (const View& view : views_of(size)) {
    const ChunkBins bins = bin_chunks(scene, geometry, geometry.numbers(), view, areas, 1);
    ASSERT_EQ(bins.areas.size(), areas.size());
    const std::vector<Piece> seen = pieces_of(geometry, chunks_in_view(scene, geometry, view));
    EXPECT_TRUE(bins.areas[1].empty());
    for (std::size_t area = 0; area < areas.size(); ++area) {
      const std::vector<Piece> pieces = pieces_of(geometry, bins.areas[area]);
      sent += chunks_in(bins.areas[area]);
      for (const Rect& part : areas[area]) {
        const DrawList whole = make_draw_list(scene, geometry, seen, view, part, Culling::Chunks, 1);
        const DrawList mine = make_draw_list(scene, geometry, pieces, view, part, Culling::Chunks, 1);
        EXPECT_EQ(contents(mine), contents(whole)) << area;
        EXPECT_EQ(mine.chunks_drawn + mine.chunks_culled, chunks_in(bins.areas[area]));
        drawn += mine.chunks_drawn;
      }
    }
  }
  EXPECT_GT(drawn, 1000U);
  EXPECT_LT(sent, 2 * drawn);
}

TEST(ChunkBins, SharesOfTheChunksAddUpToAllForAnyNumberOfThreads) {
  const Scene scene = crowd();
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  const Size size{200, 128};
  const auto areas = areas_of(size);
  const View view = test::perspective_view(size);
  const std::uint32_t count = geometry.numbers().last;
  const ChunkBins whole = bin_chunks(scene, geometry, {0, count}, view, areas, 1);
  EXPECT_TRUE(bin_chunks(scene, geometry, {0, count}, view, areas, 3).areas == whole.areas);
  EXPECT_GT(whole.chunks_culled, 0U);
  std::set<std::uint32_t> seen;
  for (const auto& ranges : whole.areas) seen.merge(numbers_in(ranges));
  EXPECT_EQ(seen.size() + whole.chunks_culled, count);
  for (const std::uint32_t step : {1U, 7U, 50U, count}) {
    std::vector<std::vector<ChunkRange>> joined(areas.size());
    for (std::uint32_t first = 0; first < count; first += step) {
      const ChunkBins bins = bin_chunks(scene, geometry, {first, std::min(count, first + step)}, view, areas, 2);
      for (std::size_t area = 0; area < areas.size(); ++area) {
        for (const ChunkRange& range : bins.areas[area]) append_range(joined[area], range);
      }
    }
    for (std::size_t area = 0; area < areas.size(); ++area) {
      for (const Rect& part : areas[area]) {
        const auto list = [&](std::span<const ChunkRange> chunks) {
          return contents(make_draw_list(scene, geometry, pieces_of(geometry, chunks), view, part, Culling::Chunks, 1));
        };
        EXPECT_EQ(list(joined[area]), list(whole.areas[area])) << area << ' ' << step;
      }
      EXPECT_LE(chunks_in(joined[area]), chunks_in(whole.areas[area]));  // cut pieces have smaller boxes
    }
  }
}

TEST(ChunkBins, AChunkStandsInTheAreasOfAPixelMoreThanItTouches) {
  // A square metre whose right edge lies on the border between two areas, but for a bit.
  Scene scene;
  Mesh mesh;
  mesh.positions = {{-0.5F, -0.5F, 0.0F}, {0.5F, -0.5F, 0.0F}, {0.5F, 0.5F, 0.0F}, {-0.5F, 0.5F, 0.0F}};
  mesh.normals.assign(4, {0.0F, 0.0F, 1.0F});
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.meshes = {mesh};
  const View view = test::perspective_view({64, 64}, {0.0, 0.0, 4.0});  // 16 pixels to the metre
  const std::vector<std::vector<Rect>> areas{{{0, 0, 40, 64}}, {{40, 0, 64, 64}}};
  for (const auto& [pixels, right] : {std::pair(-1.5, false), {-0.5, true}, {0.0, true}, {0.5, true}}) {
    scene.instances = {test::placed(0, {pixels / 16.0, 0.0, 0.0})};
    finish_scene(scene);
    const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
    const ChunkBins bins = bin_chunks(scene, geometry, geometry.numbers(), view, areas, 1);
    EXPECT_EQ(bins.areas[0], (std::vector<ChunkRange>{{0, 1}})) << pixels;
    EXPECT_EQ(!bins.areas[1].empty(), right) << pixels;
    EXPECT_EQ(bins.chunks_culled, 0U);
  }
}

TEST(ChunkBins, NothingIsBinnedOfNothing) {
  const Scene scene = test::mixed_scene();
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  const View view = test::perspective_view({64, 64});
  const ChunkBins none = bin_chunks(scene, geometry, {3, 3}, view, areas_of({64, 64}), 1);
  EXPECT_EQ(none.chunks_culled, 0U);
  for (const auto& ranges : none.areas) EXPECT_TRUE(ranges.empty());
  const ChunkBins nowhere = bin_chunks(scene, geometry, geometry.numbers(), view, {}, 1);
  EXPECT_EQ(nowhere.chunks_culled, geometry.numbers().count());
}

}  // namespace
}  // namespace hpr
