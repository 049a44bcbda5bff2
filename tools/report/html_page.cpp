#include "tools/report/html_page.h"

#include <fmt/format.h>

#include "tools/report/markup.h"

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

}  // namespace

std::string html_entry(std::string_view name, std::string_view value) {
  return fmt::format("<dt>{}</dt><dd>{}</dd>\n", name, escape_markup(value));
}

std::string html_page(std::string_view title, std::string_view body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n{}</main>\n</body>\n</html>\n",
      escape_markup(title), kStyle, body);
}

}  // namespace hpr
