#include "tools/report/canvas.h"

#include <gtest/gtest.h>

#include <array>

namespace hpr {
namespace {

TEST(EscapeMarkup, LeavesNoMarkupAndNoCharacterXmlDoesNotKnow) {
  EXPECT_EQ(escape_markup("a<b>&\"c'"), "a&lt;b&gt;&amp;&quot;c&#39;");
  EXPECT_EQ(escape_markup("ä–\xF0\x9F\x98\x80\n"), "ä–\xF0\x9F\x98\x80\n");
  const std::string bad = "\xEF\xBF\xBD";
  EXPECT_EQ(escape_markup(std::string_view("\0\x1B", 2)), bad + bad);
  EXPECT_EQ(escape_markup("\x80"), bad);                                // continues nothing
  EXPECT_EQ(escape_markup("\xC3"), bad);                                // ends early
  EXPECT_EQ(escape_markup("\xC3<"), bad + "&lt;");                      // does not swallow what follows
  EXPECT_EQ(escape_markup("\xC0\xAF"), bad + bad);                      // longer than need be
  EXPECT_EQ(escape_markup("\xE0\x80\xAF"), bad + bad + bad);            // also
  EXPECT_EQ(escape_markup("\xED\xA0\x80"), bad + bad + bad);            // half a surrogate pair
  EXPECT_EQ(escape_markup("\xEF\xBF\xBF"), bad + bad + bad);            // U+FFFF
  EXPECT_EQ(escape_markup("\xF4\x90\x80\x80"), bad + bad + bad + bad);  // past the last character
}

TEST(SvgCanvas, EscapesItsTextsAndListsThePointsOfLines) {
  SvgCanvas canvas(20, 10, "a <b>", "c & d");
  canvas.polyline(std::array<Point, 2>{{{1, 2}, {3.25, 4}}}, {"#000000", 2.0, "7 3"});
  canvas.text({5, 6}, "<x>", Anchor::End, 11, true);
  const std::string svg = canvas.str();
  EXPECT_NE(svg.find("<title>a &lt;b&gt;</title>\n<desc>c &amp; d</desc>"), std::string::npos) << svg;
  EXPECT_NE(
      svg.find(
          R"(<polyline points="1.0,2.0 3.2,4.0 " fill="none" stroke="#000000" stroke-width="2" stroke-dasharray="7 3"/>)"),
      std::string::npos)
      << svg;
  EXPECT_NE(svg.find(R"(text-anchor="end" font-weight="bold">&lt;x&gt;</text>)"), std::string::npos) << svg;
}

}  // namespace
}  // namespace hpr
