#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/json.h"

/// Reports written from one list of columns: aligned text, CSV, JSON and HTML.
namespace hpr {

enum class Align { Left, Right };

/// How a column is shown. Formats are those of fmt for one number.
struct ColumnStyle {
  std::string title = {};                      ///< above the column in text
  std::string html_title = {};                 ///< above the column in HTML; empty: `title`
  std::string format = "{}";                   ///< of numbers in text
  std::string html_format = {};                ///< of numbers in HTML; empty: `format`
  std::string csv_format = "{}";               ///< of numbers in CSV
  std::string csv_name = {};                   ///< empty: the key, with "_" for each "."
  double scale = 1.0;                          ///< multiplies the numbers of text and HTML: 1e-6 shows bytes as MB
  Align align = Align::Right;                  ///< in text
  std::size_t width = 0;                       ///< in text: the column has as many characters at least
  std::size_t gap = 1;                         ///< in text: spaces before the column
  bool in_json = true;                         ///< false: the column is for people alone
  bool sparse = false;                         ///< JSON leaves it out of rows where it is null
  bool code = false;                           ///< HTML shows it as code
  bool (*wrong)(const Json& value) = nullptr;  ///< HTML marks values for which it returns true
};

/// One column of a table of rows of type Row.
template <typename Row>
struct Column {
  std::string key;  ///< in JSON; "ms.median" stands in an object of its own: {"ms": {"median": ..}}
  std::function<Json(const Row& row)> value;
  ColumnStyle style = {};
  std::function<void(Row& row, const Json& value)> read = nullptr;  ///< null: rows_from_json leaves it
};

/// Sets a member to a JSON value: null is no value of an optional, and NaN. Throws JsonError.
template <typename Member>
void read_member(Member& member, const Json& value) {
  if constexpr (requires {
                  typename Member::value_type;
                  member.has_value();
                }) {
    if (value.is_null()) {
      member.reset();
    } else {
      member = value.get<typename Member::value_type>();
    }
  } else if constexpr (std::is_floating_point_v<Member>) {
    member = value.is_null() ? std::numeric_limits<Member>::quiet_NaN() : value.get<Member>();
  } else {
    member = value.get<Member>();
  }
}

/// A column that shows a member and can be read back. `get`: a pointer to the member, or a generic function that
/// returns a reference to it.
template <typename Row, typename Get>
[[nodiscard]] Column<Row> field(std::string key, Get get, ColumnStyle style = {}) {
  return {std::move(key), [get](const Row& row) { return Json(std::invoke(get, row)); }, std::move(style),
          [get](Row& row, const Json& value) { read_member(std::invoke(get, row), value); }};
}

/// What HTML adds to the cells of a table. Null functions: no row.
struct HtmlTableStyle {
  std::string_view caption = {};
  std::function<bool(std::size_t row)> highlighted = nullptr;
  std::function<bool(std::size_t row)> starts_group = nullptr;  ///< a line separates it from the row before
};

/// The cells of a report.
class Table {
 public:
  template <typename Row>
  Table(const std::vector<Column<Row>>& columns, std::span<const Row> rows) {
    for (const Column<Row>& column : columns) columns_.push_back({column.key, column.style});
    for (const Row& row : rows) {
      auto& cells = rows_.emplace_back();
      for (const Column<Row>& column : columns) cells.push_back(column.value(row));
    }
  }

  /// A line of titles, unless none has one, and a line per row, columns aligned; null and NaN are "-".
  [[nodiscard]] std::string text(const std::vector<std::string>& keys) const;
  /// Lines of names and rows (RFC 4180, but for its line ends); null and what is not finite is empty.
  [[nodiscard]] std::string csv(const std::vector<std::string>& keys) const;
  /// CSV of all columns that JSON has.
  [[nodiscard]] std::string csv() const;
  /// An array of objects.
  [[nodiscard]] Json json() const;
  /// A table element in a box that scrolls; null and NaN are "–", infinity is "∞".
  [[nodiscard]] std::string html(const std::vector<std::string>& keys, const HtmlTableStyle& style = {}) const;

 private:
  struct Shown {
    std::string key;
    ColumnStyle style;
  };

  [[nodiscard]] std::vector<std::size_t> indices_of(const std::vector<std::string>& keys) const;
  [[nodiscard]] std::vector<std::size_t> json_columns() const;
  [[nodiscard]] std::string csv_of(const std::vector<std::size_t>& columns) const;

  std::vector<Shown> columns_;
  std::vector<std::vector<Json>> rows_;
};

/// The value at a path of keys, "ms.median". Throws JsonError where there is none.
[[nodiscard]] const Json& value_at(const Json& object, std::string_view path);

/// Rows from the array of objects that Table::json made of them. Columns without a `read`, and sparse ones that a row
/// lacks, keep their defaults. Throws JsonError.
template <typename Row>
[[nodiscard]] std::vector<Row> rows_from_json(const std::vector<Column<Row>>& columns, const Json& array) {
  std::vector<Row> rows;
  for (const Json& object : array.elements()) {
    Row& row = rows.emplace_back();
    for (const Column<Row>& column : columns) {
      if (!column.read || (column.style.sparse && !object.contains(column.key))) continue;
      column.read(row, value_at(object, column.key));
    }
  }
  return rows;
}

/// A line of the list of facts that a report begins with.
struct Fact {
  std::string_view name;
  std::string value;
  bool code = false;
};

/// A page's heading and facts, as HTML.
[[nodiscard]] std::string html_heading(std::string_view title, std::span<const Fact> facts);
/// A drawing with a caption, which is markup; empty: none.
[[nodiscard]] std::string html_figure(std::string_view svg, std::string_view caption);
/// A report as one HTML document, well-formed XML too, in the style all reports share; no script, no other file, no
/// network. `title` is plain text, `body` markup.
[[nodiscard]] std::string html_page(std::string_view title, std::string_view body);

}  // namespace hpr
