#include "core/json.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <type_traits>

namespace hpr {
namespace {

/// Whether a list may be written without Json::array.
template <typename T>
concept BracesMakeAnArray = requires(T a) {
  Json{a, a};
}
|| requires(T a) {
  Json{{{"key", a}}, {{"key", a}}};
};

TEST(Json, BracesMakeObjectsInTheirOrderAndArrayMakesArrays) {
  const Json json{{"z", 1}, {"a", {{"one", "pair"}}}, {"list", Json::array({"x", nullptr, true, Json::array()})}};
  EXPECT_EQ(json.dump(), R"({"z":1,"a":{"one":"pair"},"list":["x",null,true,[]]})");
  EXPECT_EQ(Json::object().dump(), "{}");
  EXPECT_EQ(Json().dump(), "null");
  static_assert(!BracesMakeAnArray<int> && !BracesMakeAnArray<const char*> && !BracesMakeAnArray<Json>);
  static_assert(!std::is_constructible_v<Json, const void*>, "a pointer is no truth value");
}

TEST(Json, GrowsByKeyAndAtItsEnd) {
  Json json;
  json["runs"].push_back({{"ms", 1.5}});
  json["runs"].push_back(2);
  json["a"]["b"]["c"] = "deep";
  json["runs"][1] = -3;
  EXPECT_EQ(json.dump(), R"({"runs":[{"ms":1.5},-3],"a":{"b":{"c":"deep"}}})");
  json["a"] = nullptr;
  json.erase("runs");
  json.erase("never there");
  EXPECT_EQ(json.dump(), R"({"a":null})");
  json["text"] = "x";
  EXPECT_THROW(json["text"].push_back(1), JsonError);
  EXPECT_THROW((void)json["text"]["key"], JsonError);
}

TEST(Json, ADumpIsIndentedAsReportsAre) {
  const Json json{{"a", Json::array({1, Json::array(), Json::object()})}, {"b", {{"c", false}}}};
  EXPECT_EQ(json.dump(2), "{\n  \"a\": [\n    1,\n    [],\n    {}\n  ],\n  \"b\": {\n    \"c\": false\n  }\n}");
}

TEST(Json, IntegersAreExactAndRealsKeepTheirPoint) {
  constexpr auto kLow = std::numeric_limits<std::int64_t>::min();
  constexpr auto kHigh = std::numeric_limits<std::uint64_t>::max();
  const Json json = Json::array({kLow, kHigh, 0, -0.0, 3.0, 0.1, 0.1F, 1e300, 5e-324});
  constexpr const char* kText =
      "[-9223372036854775808,18446744073709551615,0,-0.0,3.0,0.1,0.10000000149011612,1e+300,5e-324]";
  EXPECT_EQ(json.dump(), kText);
  const Json read = Json::parse(kText);
  EXPECT_EQ(read.dump(), kText);
  EXPECT_EQ(read[0].get<std::int64_t>(), kLow);
  EXPECT_EQ(read[1].get<std::uint64_t>(), kHigh);
  EXPECT_TRUE(read[0].is_integer() && !read[0].is_unsigned() && read[0].is_number());
  EXPECT_TRUE(read[1].is_integer() && read[1].is_unsigned());
  EXPECT_TRUE(read[4].is_number() && !read[4].is_integer());
  EXPECT_TRUE(Json(7).is_unsigned()) << "what is not negative is unsigned, whatever type it came from";
}

TEST(Json, NumbersThatAreNotFiniteAreNull) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(Json::array({std::nan(""), kInfinite, -kInfinite}).dump(), "[null,null,null]");
}

TEST(Json, StandardTypesConvert) {
  EXPECT_EQ(Json(std::vector<double>{1, 2.5}).dump(), "[1.0,2.5]");
  EXPECT_EQ(Json(std::array<int, 2>{1, 2}).dump(), "[1,2]");
  EXPECT_EQ(Json(std::set<std::string>{"b", "a"}).dump(), R"(["a","b"])");
  EXPECT_EQ(Json(std::map<std::string, int>{{"b", 1}, {"a", 2}}).dump(), R"({"a":2,"b":1})");
  EXPECT_EQ(Json(std::vector<std::vector<int>>{{}, {1}}).dump(), "[[],[1]]");
  EXPECT_EQ(Json(std::optional<int>()).dump(), "null");
  EXPECT_EQ(Json(std::optional<std::string>("x")).dump(), "\"x\"");
  EXPECT_EQ(Json(std::string_view("abc").substr(1)).dump(), "\"bc\"");
}

TEST(Json, ReadingIsChecked) {
  const Json json = Json::parse(R"({"s": "x", "i": 300, "n": -1, "r": 3.0, "b": true, "l": [1, 2], "m": [1, "x"]})");
  EXPECT_EQ(json.at("s").get<std::string>(), "x");
  EXPECT_EQ(json.at("i").get<int>(), 300);
  EXPECT_EQ(json.at("i").get<double>(), 300.0);
  EXPECT_EQ(json.at("n").get<float>(), -1.0F);
  EXPECT_EQ(json.at("b").get<bool>(), true);
  EXPECT_EQ(json.at("l").get<std::vector<int>>(), (std::vector<int>{1, 2}));
  EXPECT_THROW((void)json.at("i").get<std::uint8_t>(), JsonError);
  EXPECT_THROW((void)json.at("i").get<std::int8_t>(), JsonError);
  EXPECT_THROW((void)Json(std::uint64_t{1} << 63U).get<std::int64_t>(), JsonError);
  EXPECT_THROW((void)json.at("n").get<std::uint64_t>(), JsonError);
  EXPECT_THROW((void)Json(-129).get<std::int8_t>(), JsonError);
  EXPECT_THROW((void)json.at("r").get<int>(), JsonError) << "reals are no integers";
  EXPECT_THROW((void)json.at("s").get<double>(), JsonError);
  EXPECT_THROW((void)json.at("i").get<bool>(), JsonError);
  EXPECT_THROW((void)json.at("i").string(), JsonError);
  EXPECT_THROW((void)json.at("m").get<std::vector<int>>(), JsonError);
  EXPECT_THROW((void)json.at("s").elements(), JsonError);
  EXPECT_THROW((void)json.at("l").members(), JsonError);
  EXPECT_THROW((void)json.at("l")[2], JsonError);
  EXPECT_THROW((void)json.at("none"), JsonError);
  EXPECT_THROW((void)json.at("l").at("none"), JsonError);
}

TEST(Json, WhatIsAbsentReadsAsNull) {
  const Json json{{"a", 1}};
  EXPECT_TRUE(json["b"].is_null());
  EXPECT_TRUE(json["a"]["b"]["c"].is_null()) << "in what is no object as well";
  EXPECT_EQ(json.find("b"), nullptr);
  EXPECT_TRUE(json.contains("a"));
  EXPECT_EQ(json.value("a", 7), 1);
  EXPECT_EQ(json.value("b", 7), 7);
  EXPECT_THROW((void)json.value("a", std::string()), JsonError) << "there, and no string";
  EXPECT_EQ(json.size(), 1U);
  EXPECT_TRUE(json["a"].empty());
}

/// The offset of the error of a text that is no JSON.
std::optional<std::size_t> error_offset(std::string_view text) {
  EXPECT_FALSE(Json::try_parse(text)) << text;
  try {
    (void)Json::parse(text);
  } catch (const JsonError& error) {
    return error.offset();
  }
  return std::nullopt;
}

TEST(Json, SyntaxErrorsSayWhereTheyAre) {
  const std::pair<const char*, std::size_t> cases[] = {
      {"", 0}, {"{\"a\": 1,}", 8}, {"[1, 2", 5}, {"[1]\n]", 4}, {"[\"a\nb\"]", 3}, {"\"\xff\"", 1}, {"nul", 3}};
  for (const auto& [text, offset] : cases) EXPECT_EQ(error_offset(text), offset) << text;
}

TEST(Json, NumbersBeyondDoubleAreAnErrorWithoutAPosition) {
  EXPECT_EQ(error_offset("[1e999]"), std::nullopt);
  EXPECT_EQ(Json::parse("18446744073709551616").get<double>(), 0x1p64) << "integers beyond 64 bits are reals";
}

TEST(Json, NestingIsLimited) {
  const auto nests = [](std::size_t depth, int max_depth) {
    return Json::try_parse(std::string(depth, '[') + std::string(depth, ']'), max_depth).has_value();
  };
  EXPECT_TRUE(nests(3, 3));
  EXPECT_FALSE(nests(4, 3));
  EXPECT_TRUE(nests(Json::kMaxDepth, Json::kMaxDepth));
  EXPECT_FALSE(nests(1'000'000, Json::kMaxDepth)) << "and the stack does not overflow";
  EXPECT_TRUE(Json::try_parse(R"([[], [], {"a": []}, {"b": {}}])", 3)) << "neighbours do not add up";
}

TEST(Json, OfEqualKeysTheLastCountsAtTheFirstsPosition) {
  EXPECT_EQ(Json::parse(R"({"a": 1, "b": 2, "a": {"c": 3, "c": 4}, "b": 5})").dump(), R"({"a":{"c":4},"b":5})");
}

/// Comparing all pairs of keys would take minutes.
TEST(Json, ObjectsOfVeryManyMembersFindThem) {
  constexpr int kKeys = 300'000;
  std::string text = "{";
  for (int i = 0; i < kKeys; ++i) text += fmt::format(R"("{}": 1, )", i);
  const Json json = Json::parse(text + R"("7": 2, "299999": 3})");
  EXPECT_EQ(json.members()[7].value, 2);
  EXPECT_EQ(json["299999"], 3);
  Json copy = json;
  copy.erase("8");
  EXPECT_EQ(copy.find("9"), &copy.members()[8].value);
  const auto in_copy = [&](const Json::Member& member) { return copy.contains(member.key); };
  EXPECT_EQ(std::ranges::count_if(json.members(), in_copy), kKeys - 1);
}

TEST(Json, TextIsKeptAndWhatIsNoUtf8Replaced) {
  const Json json = Json::parse(R"(["\u00e9\ud83d\ude00\u0000\n\"\\/", "é"])");
  EXPECT_EQ(json[0].string(), std::string("é😀\0\n\"\\/", 11));
  EXPECT_EQ(json.dump(), "[\"é😀\\u0000\\n\\\"\\\\/\",\"é\"]");
  EXPECT_EQ(json.dump_ascii(), R"(["\u00e9\ud83d\ude00\u0000\n\"\\/","\u00e9"])");
  EXPECT_EQ(Json("caf\xe9!").dump(), "\"caf\xEF\xBF\xBD!\"");
  EXPECT_EQ(Json("caf\xe9!").dump_ascii(), R"("caf\ufffd!")");
  EXPECT_EQ(Json::parse("\xEF\xBB\xBF[1]").dump(), "[1]") << "a byte order mark is skipped";
}

TEST(Json, EqualityIsByValue) {
  EXPECT_EQ(Json(3), 3.0);
  EXPECT_EQ(Json(3U), 3);
  EXPECT_NE(Json(-1), std::numeric_limits<std::uint64_t>::max());
  EXPECT_NE(Json(1), true);
  EXPECT_NE(Json(), false);
  EXPECT_EQ(Json("a"), "a");
  EXPECT_EQ(Json::parse(R"({"a": 1, "b": [2]})"), (Json{{"b", Json::array({2})}, {"a", 1}}));
  EXPECT_NE(Json::parse(R"({"a": 1})"), Json::parse(R"({"a": 1, "b": null})"));
  EXPECT_NE(Json::parse("[1, 2]"), Json::parse("[2, 1]"));
  EXPECT_NE(Json(std::nan("")), std::nan(""));
}

TEST(Json, CopiesAreDeepAndMovedFromValuesAreNull) {
  Json json{{"a", Json::array({"text"})}};
  const Json copy = json;
  json["a"].push_back(1);
  EXPECT_EQ(copy.dump(), R"({"a":["text"]})");
  const Json moved = std::move(json);
  EXPECT_TRUE(json.is_null());  // NOLINT(bugprone-use-after-move): that is what is promised
  EXPECT_EQ(moved["a"].size(), 2U);
  json = moved["a"];
  EXPECT_EQ(json.dump(), R"(["text",1])");
  std::ostringstream out;
  out << json;
  EXPECT_EQ(out.str(), json.dump());
}

}  // namespace
}  // namespace hpr
