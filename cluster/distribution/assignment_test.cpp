#include "cluster/distribution/assignment.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "core/error.h"

namespace hpr {
namespace {

const std::vector<std::vector<Size>> kLayouts{{{1, 1}},
                                              {{64, 64}},
                                              {{333, 217}},
                                              {{1280, 1024}},
                                              {{1920, 1080}},
                                              {{3000, 65}},
                                              {{63, 2000}},
                                              {{640, 360}, {640, 360}, {640, 360}, {640, 360}, {640, 360}, {640, 360}},
                                              {{100, 50}, {1000, 900}, {1, 1}, {129, 65}}};

/// How many tiles each area holds; fails when a tile is in none or in two, or a rectangle cuts a tile.
std::vector<int> tiles_of_areas(const FrameLayout& layout, const std::vector<std::vector<ScreenRect>>& areas) {
  std::vector<int> owners(layout.tiles(), 0);
  std::vector<int> counts;
  for (const auto& area : areas) {
    int count = 0;
    for (const ScreenRect& rect : area) {
      EXPECT_FALSE(rect.pixels.empty());
      for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
        const TilePlace position = layout.place(tile);
        if (position.screen != rect.screen) continue;
        const Rect shared = intersection(position.pixels, rect.pixels);
        if (shared.empty()) continue;
        EXPECT_EQ(shared, position.pixels) << "a tile is cut";
        ++owners[tile];
        ++count;
      }
    }
    counts.push_back(count);
  }
  EXPECT_EQ(std::ranges::count(owners, 1), static_cast<std::ptrdiff_t>(layout.tiles()));
  return counts;
}

TEST(AssignTiles, EveryTileLiesInExactlyOneAreaAndAreasAreBalanced) {
  for (const auto& screens : kLayouts) {
    const FrameLayout layout(screens);
    for (int ranks = 1; ranks <= 17; ++ranks) {
      const auto counts =
          tiles_of_areas(layout, assign_tiles(layout, std::vector<int>(static_cast<std::size_t>(ranks), 1)));
      const double ideal = static_cast<double>(layout.tiles()) / ranks;
      EXPECT_LE(*std::ranges::max_element(counts), 1.15 * ideal + 1.0)
          << ranks << " ranks, " << layout.tiles() << " tiles";
      EXPECT_GE(*std::ranges::min_element(counts), 0.85 * ideal - 1.0)
          << ranks << " ranks, " << layout.tiles() << " tiles";
    }
  }
}

TEST(AssignTiles, AreasFollowTheirWeights) {
  const FrameLayout layout({{1920, 1080}});
  const auto counts = tiles_of_areas(layout, assign_tiles(layout, {1, 2, 5, 2}));
  const std::vector<double> ideal{51, 102, 255, 102};
  for (std::size_t i = 0; i < counts.size(); ++i) EXPECT_NEAR(counts[i], ideal[i], 0.1 * ideal[i]) << i;
}

TEST(AssignTiles, AWholeScreenPerRankIsNotCut) {
  const FrameLayout layout(std::vector<Size>(6, {640, 360}));
  for (const auto& area : assign_tiles(layout, std::vector<int>(6, 1))) {
    ASSERT_EQ(area.size(), 1U);
    EXPECT_EQ(area[0].pixels, (Rect{0, 0, 640, 360}));
  }
}

TEST(AssignTilesDeathTest, WeightsArePositive) {
  EXPECT_DEATH((void)assign_tiles(FrameLayout({{64, 64}}), {}), "broken contract");
  EXPECT_DEATH((void)assign_tiles(FrameLayout({{64, 64}}), {1, 0}), "broken contract");
}

/// Small triangles strewn over a cube by a fixed seed, in meshes of the given sizes, each placed twice.
Scene strewn(const std::vector<std::uint32_t>& sizes) {
  std::mt19937 random(7);
  const auto coordinate = [&] { return static_cast<float>(random() % 10000) / 10000.0F; };
  Scene scene;
  for (const std::uint32_t size : sizes) {
    Mesh mesh;
    for (std::uint32_t t = 0; t < size; ++t) {
      const glm::vec3 corner(coordinate(), coordinate(), coordinate());
      for (const glm::vec3& side : {glm::vec3(0), glm::vec3(0.01F, 0, 0), glm::vec3(0, 0.01F, 0)}) {
        mesh.positions.push_back(corner + side);
      }
      mesh.triangles.emplace_back(3 * t, 3 * t + 1, 3 * t + 2);
    }
    mesh.normals.assign(mesh.positions.size(), {0, 0, 1});
    const auto index = static_cast<std::uint32_t>(scene.meshes.size());
    scene.meshes.push_back(mesh);
    for (int copy = 0; copy < 2; ++copy) {
      Instance instance{.mesh = index};
      instance.to_world[3] = {copy * 2.0, index * 0.5, 0.0, 1.0};
      scene.instances.push_back(instance);
    }
  }
  finish_scene(scene);
  return scene;
}

void expect_partition(const std::vector<std::vector<SurfaceRange>>& partition, std::uint32_t triangles) {
  std::vector<int> owners(triangles, 0);
  for (const auto& part : partition) {
    std::uint32_t after = 0;
    for (const SurfaceRange& range : part) {
      ASSERT_LT(range.first, range.last);
      ASSERT_LE(range.last, triangles);
      EXPECT_GE(range.first, after) << "ranges ascend";
      EXPECT_TRUE(&range == part.data() || range.first != after) << "neighbours are merged";
      after = range.last;
      for (std::uint32_t surface = range.first; surface < range.last; ++surface) ++owners[surface];
    }
  }
  EXPECT_EQ(std::ranges::count(owners, 1), static_cast<std::ptrdiff_t>(triangles));
}

std::uint32_t triangles_in(const std::vector<SurfaceRange>& part) {
  return std::accumulate(part.begin(), part.end(), 0U,
                         [](std::uint32_t sum, const SurfaceRange& range) { return sum + range.count(); });
}

TEST(PartitionObjects, EverySurfaceLiesInExactlyOnePartAndPartsAreBalancedToAChunk) {
  for (const auto& sizes :
       std::vector<std::vector<std::uint32_t>>{{}, {0}, {1}, {3, 0, 1}, {1000, 1, 40}, {5, 5, 700, 3000}}) {
    const Scene scene = strewn(sizes);
    for (const std::uint32_t chunk : {1U, 7U, 512U}) {
      for (int parts = 1; parts <= 17; ++parts) {
        const auto partition = partition_objects(scene, parts, chunk);
        ASSERT_EQ(partition.size(), static_cast<std::size_t>(parts));
        expect_partition(partition, scene.triangles);
        const double ideal = static_cast<double>(scene.triangles) / parts;
        for (const auto& part : partition) {
          EXPECT_NEAR(triangles_in(part), ideal, chunk + 1.0) << parts << " parts, chunks of " << chunk;
        }
      }
    }
  }
}

TEST(PartitionObjects, PartsAreSpatiallyCoherent) {
  Scene scene = strewn({400});
  scene.instances[1].to_world[3] = {1000, 0, 0, 1};
  finish_scene(scene);
  const auto partition = partition_objects(scene, 2, 16);
  EXPECT_EQ(partition[0], (std::vector<SurfaceRange>{{0, 400}}));
  EXPECT_EQ(partition[1], (std::vector<SurfaceRange>{{400, 800}}));
}

TEST(PartitionObjects, TrianglesOfOnePositionAreStillDistributed) {
  Scene scene;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}};
  mesh.normals = {{0, 0, 1}};
  mesh.triangles.assign(100, {0, 0, 0});
  scene.meshes = {mesh};
  scene.instances = {Instance{}};
  finish_scene(scene);
  for (const auto& part : partition_objects(scene, 4, 1)) EXPECT_EQ(triangles_in(part), 25U);
}

TEST(Groups, AreContiguousAndEvenlySized) {
  for (int ranks = 1; ranks <= 17; ++ranks) {
    EXPECT_GE(default_groups(ranks), 1);
    EXPECT_LE(default_groups(ranks), ranks);
    for (int groups = 1; groups <= ranks; ++groups) {
      int next = 0;
      std::size_t smallest = 99;
      std::size_t largest = 0;
      for (const auto& group : make_groups(ranks, groups)) {
        for (const int rank : group) EXPECT_EQ(rank, next++);
        smallest = std::min(smallest, group.size());
        largest = std::max(largest, group.size());
      }
      EXPECT_EQ(next, ranks);
      EXPECT_LE(largest - smallest, 1U);
      EXPECT_GE(smallest, 1U);
    }
  }
  EXPECT_EQ(default_groups(16), 4);
}

TEST(Assign, EverySurfaceIsDrawnExactlyOnceForEveryTile) {
  const Scene scene = strewn({40, 1, 0, 30});
  const FrameLayout layout({{333, 217}, {65, 64}});
  for (const Distribution distribution : kDistributions) {
    for (int ranks = 1; ranks <= 17; ++ranks) {
      const int groups = default_groups(ranks);
      const auto assignments = assign(distribution, scene, layout, ranks, groups);
      ASSERT_EQ(assignments.size(), static_cast<std::size_t>(ranks));
      std::vector<std::vector<ScreenRect>> areas;
      for (int rank = 0; rank < ranks; ++rank) {
        const Assignment& mine = assignments[static_cast<std::size_t>(rank)];
        EXPECT_TRUE(std::ranges::is_sorted(mine.group));
        EXPECT_EQ(std::ranges::count(mine.group, rank), 1);
        if (mine.group.front() != rank) continue;
        areas.push_back(mine.area);
        std::vector<std::vector<SurfaceRange>> partition;
        for (const int member : mine.group) {
          const Assignment& theirs = assignments[static_cast<std::size_t>(member)];
          EXPECT_EQ(theirs.group, mine.group);
          EXPECT_EQ(theirs.area, mine.area);
          partition.push_back(theirs.objects);
        }
        expect_partition(partition, scene.triangles);
      }
      EXPECT_EQ(static_cast<int>(areas.size()), draws_alone(distribution)                ? ranks
                                                : distribution == Distribution::SortLast ? 1
                                                                                         : groups);
      (void)tiles_of_areas(layout, areas);
    }
  }
}

TEST(Distributions, HaveNamesThatParseBack) {
  for (const Distribution distribution : kDistributions) {
    EXPECT_EQ(parse_distribution(name_of(distribution)), distribution);
  }
  try {
    (void)parse_distribution("sort-fist");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("'sort-first'"), std::string::npos);
  }
}

}  // namespace
}  // namespace hpr
