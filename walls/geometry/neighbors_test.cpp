#include "walls/geometry/neighbors.h"

#include <gtest/gtest.h>

#include "walls/config/example_walls.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

using Found = std::array<std::optional<std::size_t>, 4>;  // left, right, up, down

TEST(AdjacentScreens, AreThoseOfAGridUpToItsEdges) {
  const Wall wall = load_wall("3x2");
  EXPECT_EQ(adjacent_screens(wall, 0), (Found{std::nullopt, 1, std::nullopt, 3}));
  EXPECT_EQ(adjacent_screens(wall, 1), (Found{0, 2, std::nullopt, 4}));
  EXPECT_EQ(adjacent_screens(wall, 5), (Found{4, std::nullopt, 2, std::nullopt}));
}

TEST(AdjacentScreens, GoOnAroundCorners) {
  const Wall cave = load_wall(test::example_wall("cave-4.toml"));
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < cave.screens.size(); ++i) {
    const Found found = adjacent_screens(cave, i);
    for (const Side side : {Side::Left, Side::Right}) {
      const auto other = found.at(static_cast<std::size_t>(side));
      if (!other) continue;
      ++pairs;
      const Side back = side == Side::Left ? Side::Right : Side::Left;
      EXPECT_EQ(adjacent_screens(cave, *other).at(static_cast<std::size_t>(back)), i) << cave.screens[i].id;
    }
  }
  EXPECT_GE(pairs, 4U);
}

TEST(AdjacentScreens, AreNotThoseOfTheOtherEyeNorFarOnes) {
  Wall wall = load_wall("2x1");
  wall.screens[0].eye = Eye::Left;
  wall.screens[1].eye = Eye::Right;
  EXPECT_EQ(adjacent_screens(wall, 0), Found{});
  wall = load_wall("2x1");
  for (glm::dvec3* const corner :
       {&wall.screens[1].lower_left, &wall.screens[1].lower_right, &wall.screens[1].upper_left}) {
    corner->x += 1.0;
  }
  EXPECT_EQ(adjacent_screens(wall, 0), Found{});
}

}  // namespace
}  // namespace hpr
