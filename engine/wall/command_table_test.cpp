#include "engine/wall/command_table.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace hpr {
namespace {

TEST(CommandTable, SplitsWordsAndKeepsQuotedOnesWhole) {
  CommandTable table;
  std::vector<std::string> received;
  table.add({"say", "WORDS", "", [&](Arguments arguments) {
               received.assign(arguments.begin(), arguments.end());
               return std::string("said");
             }});
  EXPECT_EQ(table.run("  say one \"two three\" # four"), "said");
  EXPECT_EQ(received, (std::vector<std::string>{"one", "two three"}));
  EXPECT_EQ(table.run(""), "");
  EXPECT_EQ(table.run("# a remark"), "");
}

TEST(CommandTable, UnknownCommandsNameTheNearest) {
  CommandTable table;
  table.add({"render", "", "", [](Arguments) { return std::string(); }});
  try {
    (void)table.run("rendr");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("did you mean 'render'?"), std::string::npos) << error.hint();
  }
}

TEST(CommandTable, HelpListsEveryCommandOrOne) {
  CommandTable table;
  table.add({"render", "", "draw", [](Arguments) { return std::string(); }});
  EXPECT_NE(table.run("help").find("help [COMMAND]"), std::string::npos);
  EXPECT_NE(table.run("help").find("render"), std::string::npos);
  EXPECT_EQ(table.run("help render").find("help"), std::string::npos);
  EXPECT_THROW((void)table.run("help nothing"), Error);
}

TEST(PointOf, TakesThreeFiniteNumbers) {
  EXPECT_EQ(point_of("1,-2.5,3e2"), glm::dvec3(1, -2.5, 300));
  for (const char* wrong : {"", "1", "1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,2,inf", "1,2,3,", "1,,3"}) {
    EXPECT_THROW((void)point_of(wrong), Error) << wrong;
  }
}

TEST(CommandTable, KnowsWhichLinesChangeNothing) {
  CommandTable table;
  table.add({"look", "", "around", [](Arguments) { return std::string(); }, true});
  table.add({"move", "", "somewhere", [](Arguments) { return std::string(); }});
  for (const char* const line : {"look", "help move", "", "# move", "nonsense", "an \"open quote"}) {
    EXPECT_TRUE(table.only_tells(line)) << line;
  }
  EXPECT_FALSE(table.only_tells("move"));
  EXPECT_FALSE(table.only_tells("  move by 1 # now"));
}

}  // namespace
}  // namespace hpr
