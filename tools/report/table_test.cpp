#include "tools/report/table.h"

#include <gtest/gtest.h>

#include <cmath>

namespace hpr {
namespace {

struct Row {
  std::string name;
  double ms = 0.0;
  std::uint64_t bytes = 0;
  std::optional<double> predicted;
  std::string note;
};

const std::vector<Column<Row>>& columns() {
  static const std::vector<Column<Row>> all{
      field<Row>("name", &Row::name, {.title = "name", .align = Align::Left, .width = 6}),
      field<Row>("ms.median", &Row::ms, {.title = "ms", .format = "{:.1f}", .csv_format = "{:.3f}"}),
      field<Row>("bytes", &Row::bytes,
                 {.title = "MB",
                  .html_title = "MB <sent>",
                  .format = "{:.2f}",
                  .scale = 1e-6,
                  .width = 5,
                  .wrong = [](const Json& value) { return value.get<std::uint64_t>() > 1'000'000; }}),
      field<Row>("ms.predicted", &Row::predicted, {.title = "predicted", .format = "{:.1f}"}),
      {"note",
       [](const Row& row) { return row.note.empty() ? Json() : Json(row.note); },
       {.title = "", .align = Align::Left, .gap = 2, .sparse = true, .code = true},
       [](Row& row, const Json& value) { row.note = value.string(); }}};
  return all;
}

const std::vector<Row> kRows{{"a", 1.25, 500'000, 2.0, ""},
                             {"a longer <name>", 10.5, 1'500'000, std::nullopt, "x,\"y\""}};

Table table() {
  return {columns(), std::span<const Row>(kRows)};
}

TEST(Table, TextIsAlignedAndHasNoSpacesAtTheEndOfLines) {
  EXPECT_EQ(table().text({"name", "ms.median", "bytes", "ms.predicted"}),
            "name              ms    MB predicted\n"
            "a                1.2  0.50       2.0\n"
            "a longer <name> 10.5  1.50         -\n");
  EXPECT_EQ(table().text({"bytes", "name"}), "   MB name\n 0.50 a\n 1.50 a longer <name>\n");
  EXPECT_EQ(table().text({"note"}), "-\nx,\"y\"\n") << "titles that are all empty make no line";
}

TEST(Table, CsvQuotesTextsAndLeavesOutWhatIsNoNumber) {
  std::vector<Row> rows = kRows;
  rows[0].ms = NAN;
  EXPECT_EQ(Table(columns(), std::span<const Row>(rows)).csv(),
            "name,ms_median,bytes,ms_predicted,note\n"
            "a,,500000,2,\n"
            "a longer <name>,10.500,1500000,,\"x,\"\"y\"\"\"\n");
}

TEST(Table, JsonNestsKeysWithDotsAndRowsComeBackFromIt) {
  const Json json = table().json();
  EXPECT_EQ(json.dump(),
            R"([{"name":"a","ms":{"median":1.25,"predicted":2.0},"bytes":500000},)"
            R"({"name":"a longer <name>","ms":{"median":10.5,"predicted":null},"bytes":1500000,"note":"x,\"y\""}])");
  const std::vector<Row> back = rows_from_json(columns(), json);
  EXPECT_EQ(Table(columns(), std::span<const Row>(back)).json(), json);
  EXPECT_THROW((void)rows_from_json(columns(), Json::parse(R"([{"name": "a"}])")), JsonError);
  EXPECT_THROW((void)rows_from_json(columns(), Json::parse(R"({"name": "a"})")), JsonError);
}

TEST(Table, HtmlHasNoMarkupOfItsValuesAndMarksRowsAndCells) {
  EXPECT_EQ(
      table().html({"name", "bytes", "ms.predicted", "note"},
                   {.caption = "All.",
                    .highlighted = [](std::size_t row) { return row == 0; },
                    .starts_group = [](std::size_t row) { return row == 1; }}),
      "<div class=\"wide\"><table>\n<caption>All.</caption>\n<thead><tr><th scope=\"col\">name</th>"
      "<th scope=\"col\">MB &lt;sent&gt;</th><th scope=\"col\">predicted</th><th scope=\"col\"></th></tr></thead>\n"
      "<tbody>\n<tr class=\"fastest\"><th scope=\"row\">a</th><td>0.50</td><td>2.0</td><td><code>–</code></td></tr>\n"
      "</tbody>\n<tbody>\n<tr><th scope=\"row\">a longer &lt;name&gt;</th><td class=\"wrong\">1.50</td><td>–</td>"
      "<td><code>x,&quot;y&quot;</code></td></tr>\n</tbody></table></div>\n");
}

}  // namespace
}  // namespace hpr
