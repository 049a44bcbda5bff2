#include "walls/config/wall_template.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/error.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

Wall sound(const WallTemplate& wall) {
  const std::string text = write_wall_template(wall);
  WallReading reading = parse_wall(text, "template");
  for (const WallFinding& finding : reading.findings) ADD_FAILURE() << finding.what << "\n" << text;
  return std::move(reading.wall);
}

std::vector<std::string> hosts(int count) {
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) names.push_back("wall" + std::to_string(i));
  return names;
}

TEST(WallTemplate, EveryWallItWritesIsReadWithoutAFinding) {
  for (const auto& [columns, rows] : {std::pair(1, 1), std::pair(6, 3), std::pair(12, 11), std::pair(32, 32)}) {
    for (const int count : {0, 1, columns * rows}) {
      for (const Size pixels : {Size{1920, 1080}, Size{1080, 1920}, Size{3840, 2160}, Size{64, 48}}) {
        const Wall wall =
            sound({.columns = columns, .rows = rows, .hosts = hosts(count), .tile_pixels = pixels, .command = "hpr\n"});
        ASSERT_EQ(wall.screens.size(), static_cast<std::size_t>(columns * rows));
        EXPECT_EQ(wall.nodes.size(), static_cast<std::size_t>(count));
        EXPECT_EQ(wall.screens.front().pixels, pixels);
      }
    }
  }
}

TEST(WallTemplate, SixByThreeOnNineHostsDrivesTwoNeighboursEach) {
  const Wall wall = sound({.columns = 6,
                           .rows = 3,
                           .hosts = hosts(9),
                           .tiles_per_host = 2,
                           .ranks_per_host = 3,
                           .tile_pixels = Size{1920, 1080},
                           .tile_size_m = glm::dvec2(1.0, 0.5625),
                           .gap_m = glm::dvec2(0.01, -0.02)});
  ASSERT_EQ(wall.screens.size(), 18U);
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    EXPECT_EQ(wall.screens[i].node, "wall" + std::to_string(i / 2)) << i;
    EXPECT_EQ(wall.windows[i].rect.x0, i % 2 == 0 ? 0 : 1920) << i;
    EXPECT_EQ(wall.screens[i].window, wall.windows[i].id) << i;
    EXPECT_TRUE(wall.windows[i].fullscreen);
  }
  EXPECT_EQ(wall.nodes.front().ranks, 3);
  EXPECT_NEAR(wall.screens[1].lower_left.x - wall.screens[0].lower_right.x, 0.01, 1e-12);
  EXPECT_NEAR(wall.screens[0].lower_left.y - wall.screens[6].upper_left.y, -0.02, 1e-12);
}

TEST(WallTemplate, SharesOutEvenlyUnlessTold) {
  const Wall wall = sound({.columns = 5, .rows = 2, .hosts = hosts(4)});
  std::map<std::string, int> counts;
  for (const WallScreen& screen : wall.screens) ++counts[screen.node];
  EXPECT_EQ(counts, (std::map<std::string, int>{{"wall0", 3}, {"wall1", 2}, {"wall2", 3}, {"wall3", 2}}));
  // The last host may have fewer.
  EXPECT_EQ(sound({.columns = 7, .rows = 1, .hosts = hosts(4), .tiles_per_host = 2}).screens.back().node, "wall3");
}

TEST(WallTemplate, RefusesWhatDoesNotFit) {
  const auto refuses = [](const WallTemplate& wall, const std::string& words) {
    try {
      (void)write_wall_template(wall);
      ADD_FAILURE() << "no error of " << words;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Usage);
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
      EXPECT_FALSE(error.hint().empty());
    }
  };
  refuses({.columns = 6, .rows = 3, .hosts = hosts(8), .tiles_per_host = 2}, "take 9 hosts, but 8 are named");
  refuses({.columns = 6, .rows = 3, .hosts = hosts(10), .tiles_per_host = 2}, "take 9 hosts, but 10 are named");
  refuses({.columns = 2, .rows = 1, .hosts = hosts(3)}, "3 hosts for 2 screens");
  refuses({.columns = 0, .rows = 1}, "0 x 1 screens");
  refuses({.columns = 65, .rows = 64}, "65 x 64 screens");
  refuses({.columns = 1'000'000, .rows = 1'000'000}, "screens");
  refuses({.tile_pixels = Size{0, 5}}, "0 x 5 pixels");
  refuses({.tile_size_m = glm::dvec2(0.0, 1.0)}, "apart");
  refuses({.tile_size_m = glm::dvec2(1.0, std::nan(""))}, "apart");
  refuses({.gap_m = glm::dvec2(-5.0, 0.0)}, "apart");
}

}  // namespace
}  // namespace hpr
