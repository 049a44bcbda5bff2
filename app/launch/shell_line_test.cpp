#include "app/launch/shell_line.h"

#include <gtest/gtest.h>

#include <array>

namespace hpr {
namespace {

TEST(ShellLine, QuotesWhatAShellWouldTakeApart) {
  const std::array<std::string, 6> words{"hpr", "render", "my scene.glb", "--environment=1,1,1", "gen:rods?n=3", ""};
  EXPECT_EQ(shell_line(words), "hpr render 'my scene.glb' --environment=1,1,1 'gen:rods?n=3' ''");
  EXPECT_EQ(shell_quote("it's"), R"('it'\''s')");
}

}  // namespace
}  // namespace hpr
