#include "walls/config/key_table.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

enum class Shade { None, Paper, Glass };

struct Bulb {
  int watts = 40;

  bool operator==(const Bulb&) const = default;
};

struct Lamp {
  std::string id;
  Bulb bulb = {};
  Shade shade = Shade::None;
  double height_m = 0.0;
  bool is_on = false;
};

const KeyTable<Lamp>& lamp_keys() {
  static const std::vector<std::string> shades{"none", "paper", "glass"};
  static const KeyTable<Bulb> bulb_keys{"bulb",
                                        {{"watts", keys::always(keys::whole(&Bulb::watts, 1, 1000)), "of power"}}};
  static const KeyTable<Lamp> table{
      "lamp",
      {{"id", keys::always(keys::id(&Lamp::id)), "unique", "\"desk\""},
       {"bulb", keys::table(&Lamp::bulb, bulb_keys), "what shines"},
       {"shade", keys::choice(&Lamp::shade, shades), "around it"},
       {"height_m", keys::positive(&Lamp::height_m, 10.0), "above the floor", "", "on the table"},
       {"on", keys::boolean(&Lamp::is_on), "shines"},
       {"price", keys::ignored<Lamp>(), ""}}};
  return table;
}

struct Reading {
  Lamp lamp;
  std::string findings;
};

Reading read(const std::string& text) {
  const auto document = parse_toml(text);
  Reading reading;
  Findings findings("lamp.toml", text);
  TableReader reader(std::get<TomlValue>(document), "lamp", findings);
  read_keys(lamp_keys(), reader, ".", reading.lamp);
  for (const WallFinding& finding : findings.take()) reading.findings += finding.what + " (" + finding.hint + ")\n";
  return reading;
}

TEST(KeyTable, FillsMembersAndLeavesThoseOfAbsentKeys) {
  const Reading reading = read("id = \"a\"\nshade = \"glass\"\nheight_m = 1.5\nbulb = { watts = 60 }\n");
  EXPECT_EQ(reading.findings, "");
  EXPECT_EQ(reading.lamp.id, "a");
  EXPECT_EQ(reading.lamp.shade, Shade::Glass);
  EXPECT_EQ(reading.lamp.height_m, 1.5);
  EXPECT_EQ(reading.lamp.bulb.watts, 60);
  EXPECT_FALSE(reading.lamp.is_on);
}

TEST(KeyTable, FindsMissingWrongUnknownAndIgnoredKeys) {
  EXPECT_EQ(
      read("bulb = { watts = 0 }\nwats = 3\nprice = 5\nx_mine = 1\n").findings,
      "lamp.toml:1:1: lamp has no 'id' (add id = \"desk\")\n"
      "lamp.toml:1:18: 'watts' of bulb is 0 (it must be from 1 to 1000)\n"
      "lamp.toml:2:1: lamp has no key 'wats' (choices: id, bulb, shade, height_m, on, price (x_... is free for your "
      "own data))\n"
      "lamp.toml:3:9: not acted on by this version: price (the wall is used without them)\n");
}

TEST(KeyTable, WritesWhatDiffersAndWhatIsAlwaysWritten) {
  Lamp lamp{.id = "a"};
  EXPECT_EQ(write_inline(lamp_keys(), lamp), "{ id = \"a\" }");
  lamp.bulb.watts = 60;
  lamp.shade = Shade::Paper;
  lamp.is_on = true;
  EXPECT_EQ(write_keys(lamp_keys(), lamp, "", "\n"),
            "id = \"a\"\nbulb = { watts = 60 }\nshade = \"paper\"\non = true\n");
}

TEST(KeyTable, DescribesItselfAsSchemaAndForDocs) {
  const Json schema = schema_of(lamp_keys());
  EXPECT_EQ(schema["required"], Json(std::vector<std::string>{"id"}));
  EXPECT_EQ(schema["properties"]["bulb"]["properties"]["watts"],
            (Json{{"type", "integer"}, {"minimum", 1}, {"maximum", 1000}}));
  EXPECT_EQ(schema["properties"]["price"], Json(true));
  EXPECT_EQ(schema["additionalProperties"], Json(false));

  const std::vector<KeyDescription> rows = describe(lamp_keys(), "");
  ASSERT_EQ(rows.size(), 7U);
  EXPECT_EQ(rows[0].initial, "required");
  EXPECT_EQ(rows[2].table, ".bulb");
  EXPECT_EQ(rows[2].initial, "40");
  EXPECT_EQ(rows[2].takes, "1 to 1000");
  EXPECT_EQ(rows[3].initial, "\"none\"");
  EXPECT_EQ(rows[4].initial, "on the table");
}

}  // namespace
}  // namespace hpr
