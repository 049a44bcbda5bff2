#include "walls/displays/web_request.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace hpr {
namespace {

TEST(WebRequest, AddressesAreLoopbackAndAnyPortUnlessTheySayMore) {
  EXPECT_EQ(parse_web_address("").host, "127.0.0.1");
  EXPECT_EQ(parse_web_address("").port, 0);
  EXPECT_EQ(parse_web_address(":8080").host, "127.0.0.1");
  EXPECT_EQ(parse_web_address(":8080").port, 8080);
  EXPECT_EQ(parse_web_address("localhost:80").host, "127.0.0.1");
  EXPECT_EQ(parse_web_address("0.0.0.0:80").host, "0.0.0.0");
  EXPECT_EQ(parse_web_address("[::1]:81").host, "::1");
  EXPECT_EQ(parse_web_address("[::1]:81").port, 81);
  for (const std::string bad : {"example.org:80", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:70000", "::1", "[", "[::1"}) {
    EXPECT_THROW(static_cast<void>(parse_web_address(bad)), Error) << bad;
  }
}

TEST(WebRequest, ASiteThatPointsItsNameHereIsNotBelieved) {
  for (const std::string_view ours : {"127.0.0.1:8080", "localhost:9000", "[::1]:80", "192.168.1.5"}) {
    EXPECT_TRUE(host_is_ours(ours)) << ours;
  }
  for (const std::string_view other : {"evil.example:8080", "", "127.0.0.1.evil.example", "localhost.evil.example"}) {
    EXPECT_FALSE(host_is_ours(other)) << other;
  }
  EXPECT_TRUE(origin_is_ours("http://localhost:1", "localhost:1"));
  EXPECT_FALSE(origin_is_ours("http://localhost:2", "localhost:1"));
  EXPECT_FALSE(origin_is_ours("https://evil.example", "localhost:1"));
  EXPECT_FALSE(origin_is_ours("null", "localhost:1"));
}

TEST(WebRequest, CookiesAreFoundByTheirWholeName) {
  EXPECT_EQ(cookie_in("a=1; hpr-80=xyz; b=2", "hpr-80"), "xyz");
  EXPECT_EQ(cookie_in("hpr-80=xyz", "hpr-80"), "xyz");
  EXPECT_EQ(cookie_in("xhpr-80=xyz", "hpr-80"), "");
  EXPECT_EQ(cookie_in("hpr-8=xyz", "hpr-80"), "");
  EXPECT_EQ(cookie_in("", "hpr-80"), "");
  EXPECT_EQ(cookie_in(";;; =", "hpr-80"), "");
}

TEST(WebRequest, AMotionIsReadAndAnythingElseIsNone) {
  const auto motion = parse_motion(R"({"turn": [0.5, -1], "pan": [2, 3], "dolly": -0.25})");
  ASSERT_TRUE(motion.has_value());
  EXPECT_EQ(motion->orbit, (OrbitInput{0.5, -1.0, 2.0, 3.0, -0.25}));
  EXPECT_EQ(motion->keys, ViewKeys{});
  EXPECT_EQ(parse_motion(R"({"keys": "++=-wtt"})")->keys, (ViewKeys{.half_stops = 2, .tones = 2, .wireframes = 1}));
  EXPECT_EQ(parse_motion("{}"), DisplayInput{});
  for (const std::string_view bad :
       {"", "1", "[]", "{", R"({"turn": 1})", R"({"turn": [1]})", R"({"turn": ["a", 1]})", R"({"dolly": "x"})",
        R"({"dolly": 1e300})", R"({"pan": [1e999, 0]})", R"({"turn": [null, 0]})"}) {
    EXPECT_EQ(parse_motion(bad), std::nullopt) << bad;
  }
  EXPECT_EQ(parse_motion(std::string(4096, '[')), std::nullopt);
}

TEST(WebPage, NamesAreEscapedAndNothingIsLeftToFillIn) {
  const std::string html =
      to_html({.title = "<b>\"&", .stream = "/stream/a", .wall_heights = 0.25, .screens = {"a", "b"}, .nonce = "abc"});
  EXPECT_NE(html.find("<title>&lt;b&gt;&quot;&amp;</title>"), std::string::npos);
  EXPECT_NE(html.find(R"(<a href="/screen/b">b</a>)"), std::string::npos);
  EXPECT_NE(html.find(R"(src="/stream/a")"), std::string::npos);
  EXPECT_NE(html.find(R"(data-heights="0.25")"), std::string::npos);
  EXPECT_NE(html.find(R"(<script nonce="abc">)"), std::string::npos);
  for (const char* const word : {"{title}", "{nonce}", "{links}", "{stream}", "{heights}"}) {
    EXPECT_EQ(html.find(word), std::string::npos) << word;
  }
}

}  // namespace
}  // namespace hpr
