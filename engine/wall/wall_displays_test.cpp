#include "engine/wall/wall_displays.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "walls/config/wall_file.h"
#include "walls/config/wall_template.h"

namespace hpr {
namespace {

using Owners = std::vector<int>;

Wall wall_of(const std::vector<std::string>& hosts) {
  return parse_wall(write_wall_template({.columns = 4, .rows = 1, .hosts = hosts}), "wall").wall;
}

std::string warnings_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote, Owners& owners) {
  testing::internal::CaptureStderr();
  owners = owners_of(wall, hosts, remote);
  return testing::internal::GetCapturedStderr();
}

TEST(ScreenOwners, ScreensAreShownByRanksOfTheirHosts) {
  Owners owners;
  EXPECT_EQ(warnings_of(wall_of({"a", "b"}), {"b", "a", "a"}, false, owners), "");
  EXPECT_EQ(owners, (Owners{1, 2, 0, 0}));
  EXPECT_EQ(warnings_of(wall_of({"a", "b"}), {"a.lab.org", "b"}, false, owners), "");
  EXPECT_EQ(owners, (Owners{0, 0, 1, 1}));
  EXPECT_EQ(warnings_of(wall_of({"a.lab.org", "b"}), {"a", "b"}, false, owners), "");
  EXPECT_EQ(owners, (Owners{0, 0, 1, 1}));
  EXPECT_NE(warnings_of(wall_of({"a.one", "b"}), {"a.two", "b"}, false, owners), "");
}

TEST(ScreenOwners, OneWarningNamesAllHostsWithoutARank) {
  Owners owners;
  const Wall wall = wall_of({"a", "b", "c"});
  const std::string warnings = warnings_of(wall, {"b"}, false, owners);
  EXPECT_EQ(owners, (Owners{0, 0, 0, 0}));
  EXPECT_EQ(std::ranges::count(warnings, '\n'), 1) << warnings;
  EXPECT_NE(warnings.find("no rank runs on a, c: others show 3 screens"), std::string::npos) << warnings;
  EXPECT_EQ(warnings_of(wall, {"b"}, true, owners), "");
}

TEST(ScreenOwners, OneWarningNamesAllRanksThatAreMissing) {
  Wall wall = wall_of({});
  for (std::size_t i = 0; i < wall.screens.size(); ++i) wall.screens[i].rank = static_cast<int>(i);
  Owners owners;
  const std::string warnings = warnings_of(wall, {"x", "y"}, false, owners);
  EXPECT_EQ((Owners{owners[0], owners[1]}), (Owners{0, 1}));
  EXPECT_NE(warnings.find("2 screens are of ranks 2 to 3, but there are only 2: others show them"), std::string::npos)
      << warnings;
}

}  // namespace
}  // namespace hpr
