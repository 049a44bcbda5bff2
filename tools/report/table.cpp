#include "tools/report/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#include "core/error.h"
#include "tools/report/canvas.h"

namespace hpr {
namespace {

constexpr std::string_view kStyle = R"css(
:root { color-scheme: light; }
body { font: 15px/1.5 "DejaVu Sans", Verdana, sans-serif; color: #1a1a1a; background: #ffffff; margin: 2rem auto; max-width: 1240px; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0.3rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 0.4rem; border-bottom: 1px solid #999999; }
h3 { font-size: 1rem; margin: 1.4rem 0 0.2rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.1rem 1rem; margin: 0.6rem 0; }
dt { font-weight: bold; } dd { margin: 0; overflow-wrap: anywhere; }
code { font-family: "DejaVu Sans Mono", monospace; font-size: 0.9em; }
.warning { border-left: 4px solid #8a3c00; background: #fdf3e6; padding: 0.4rem 0.8rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.8rem; white-space: nowrap; }
caption, thead th { white-space: normal; }
caption { text-align: left; padding-bottom: 0.4rem; }
th, td { padding: 0.15rem 0.5rem; text-align: right; border-bottom: 1px solid #dddddd; font-variant-numeric: tabular-nums; }
th:first-child, td:last-child, th:last-child { text-align: left; }
thead th { border-bottom: 2px solid #444444; vertical-align: bottom; }
tbody + tbody { border-top: 2px solid #999999; }
tr.fastest td, tr.fastest th { background: #e8f1f8; font-weight: bold; }
td.wrong { background: #f8dcd6; font-weight: bold; }
figure { margin: 0.4rem 0 1.2rem; } figcaption { max-width: 70rem; }
.schedules { display: flex; flex-wrap: wrap; gap: 0 2.5rem; align-items: flex-start; } .schedules section { max-width: 100%; break-inside: avoid; }
svg { max-width: 100%; height: auto; }
@media print { body { margin: 0; max-width: none; font-size: 11px; } table { font-size: 8px; } figure, table, h3 { break-inside: avoid; } h2, h3 { break-after: avoid; } }
@page { size: A4 landscape; margin: 12mm; }
)css";

std::string number_text(const Json& value, const std::string& format, double scale) {
  if (!value.is_integer() || scale != 1.0) {
    const double scaled = scale == 1.0 ? value.get<double>() : value.get<double>() * scale;
    return fmt::vformat(format, fmt::make_format_args(scaled));
  }
  if (value.is_unsigned()) {
    const auto whole = value.get<std::uint64_t>();
    return fmt::vformat(format, fmt::make_format_args(whole));
  }
  const auto negative = value.get<std::int64_t>();
  return fmt::vformat(format, fmt::make_format_args(negative));
}

/// A field as RFC 4180 has it: in quotes where it holds what separates fields.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

bool is_missing(const Json& value) {
  return value.is_null() || (value.is_number() && std::isnan(value.get<double>()));
}

std::string text_cell(const Json& value, const ColumnStyle& style) {
  if (is_missing(value)) return "-";
  return value.is_string() ? value.string() : number_text(value, style.format, style.scale);
}

std::string csv_cell(const Json& value, const ColumnStyle& style) {
  if (value.is_string()) return csv_field(value.string());
  if (value.is_boolean()) return value.get<bool>() ? "1" : "0";
  if (value.is_null() || !std::isfinite(value.get<double>())) return "";
  return number_text(value, style.csv_format, 1.0);
}

std::string html_cell(const Json& value, const ColumnStyle& style) {
  if (is_missing(value)) return "–";
  if (value.is_string()) return escape_markup(value.string());
  if (std::isinf(value.get<double>())) return value.get<double>() > 0.0 ? "∞" : "-∞";
  return escape_markup(number_text(value, style.html_format.empty() ? style.format : style.html_format, style.scale));
}

/// Sets the value at a path of keys, making the objects on it.
void set_at(Json& object, std::string_view path, const Json& value) {
  const std::size_t dot = path.find('.');
  if (dot == std::string_view::npos) {
    object[path] = value;
  } else {
    set_at(object[path.substr(0, dot)], path.substr(dot + 1), value);
  }
}

/// A cell of a row: a heading where it is the row's first.
std::string table_cell(const Json& value, const ColumnStyle& of, bool is_heading) {
  std::string cell = html_cell(value, of);
  if (of.code) cell = fmt::format("<code>{}</code>", cell);
  if (is_heading) return fmt::format("<th scope=\"row\">{}</th>", cell);
  const bool is_wrong = of.wrong != nullptr && of.wrong(value);
  return fmt::format("<td{}>{}</td>", is_wrong ? " class=\"wrong\"" : "", cell);
}

}  // namespace

std::vector<std::size_t> Table::indices_of(const std::vector<std::string>& keys) const {
  std::vector<std::size_t> indices;
  for (const std::string& key : keys) {
    const auto found = std::ranges::find(columns_, key, &Shown::key);
    HPR_CHECK(found != columns_.end());
    indices.push_back(static_cast<std::size_t>(found - columns_.begin()));
  }
  return indices;
}

std::vector<std::size_t> Table::json_columns() const {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (columns_[i].style.in_json) indices.push_back(i);
  }
  return indices;
}

std::string Table::text(const std::vector<std::string>& keys) const {
  const std::vector<std::size_t> shown = indices_of(keys);
  std::vector<std::vector<std::string>> lines(rows_.size() + 1);
  std::vector<std::size_t> widths;
  for (const std::size_t column : shown) {
    const ColumnStyle& style = columns_[column].style;
    lines.front().push_back(style.title);
    for (std::size_t row = 0; row < rows_.size(); ++row) {
      lines[row + 1].push_back(text_cell(rows_[row][column], style));
    }
    widths.push_back(style.width);
    for (const auto& line : lines) widths.back() = std::max(widths.back(), line.back().size());
  }
  const auto untitled = [](const std::string& title) { return title.empty(); };
  if (std::ranges::all_of(lines.front(), untitled)) lines.erase(lines.begin());
  std::string text;
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const ColumnStyle& style = columns_[shown[i]].style;
      if (i > 0) text.append(style.gap, ' ');
      text += style.align == Align::Left ? fmt::format("{:<{}}", line[i], widths[i])
                                         : fmt::format("{:>{}}", line[i], widths[i]);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text;
}

std::string Table::csv(const std::vector<std::string>& keys) const {
  return csv_of(indices_of(keys));
}

std::string Table::csv() const {
  return csv_of(json_columns());
}

std::string Table::csv_of(const std::vector<std::size_t>& columns) const {
  std::string text;
  const auto end_of = [&](std::size_t i) { return i + 1 == columns.size() ? "\n" : ","; };
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const Shown& column = columns_[columns[i]];
    std::string name = column.style.csv_name.empty() ? column.key : column.style.csv_name;
    std::ranges::replace(name, '.', '_');
    text += name + end_of(i);
  }
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      text += csv_cell(row[columns[i]], columns_[columns[i]].style) + end_of(i);
    }
  }
  return text;
}

Json Table::json() const {
  Json array = Json::array();
  for (const auto& row : rows_) {
    Json object = Json::object();
    for (const std::size_t column : json_columns()) {
      const Shown& shown = columns_[column];
      if (!shown.style.sparse || !row[column].is_null()) set_at(object, shown.key, row[column]);
    }
    array.push_back(std::move(object));
  }
  return array;
}

std::string Table::html(const std::vector<std::string>& keys, const HtmlTableStyle& style) const {
  const std::vector<std::size_t> shown = indices_of(keys);
  std::string text = "<div class=\"wide\"><table>";
  if (!style.caption.empty()) text += fmt::format("\n<caption>{}</caption>\n", style.caption);
  text += "<thead><tr>";
  for (const std::size_t column : shown) {
    const ColumnStyle& of = columns_[column].style;
    text += fmt::format("<th scope=\"col\">{}</th>", escape_markup(of.html_title.empty() ? of.title : of.html_title));
  }
  text += "</tr></thead>\n<tbody>\n";
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    if (style.starts_group && style.starts_group(row)) text += "</tbody>\n<tbody>\n";
    text += style.highlighted && style.highlighted(row) ? "<tr class=\"fastest\">" : "<tr>";
    for (const std::size_t column : shown) {
      text += table_cell(rows_[row][column], columns_[column].style, column == shown.front());
    }
    text += "</tr>\n";
  }
  return text + "</tbody></table></div>\n";
}

const Json& value_at(const Json& object, std::string_view path) {
  const std::size_t dot = path.find('.');
  return dot == std::string_view::npos ? object.at(path)
                                       : value_at(object.at(path.substr(0, dot)), path.substr(dot + 1));
}

std::string html_heading(std::string_view title, std::span<const Fact> facts) {
  std::string text = fmt::format("<h1>{}</h1>\n<dl>\n", title);
  for (const Fact& fact : facts) {
    const std::string value = escape_markup(fact.value);
    text += fmt::format("<dt>{}</dt><dd>{}</dd>\n", fact.name, fact.code ? "<code>" + value + "</code>" : value);
  }
  return text + "</dl>\n";
}

std::string html_figure(std::string_view svg, std::string_view caption) {
  const std::string below = caption.empty() ? "" : fmt::format("<figcaption>{}</figcaption>\n", caption);
  return fmt::format("<figure>\n{}{}</figure>\n", svg, below);
}

std::string html_page(std::string_view title, std::string_view body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n{}</main>\n</body>\n</html>\n",
      escape_markup(title), kStyle, body);
}

}  // namespace hpr
