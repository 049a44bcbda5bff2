#pragma once

#include <string>
#include <string_view>

namespace hpr {

/// A report as one HTML document, well-formed XML too, in the style all reports share; no script, no other file, no
/// network. `title` is plain text, `body` markup.
[[nodiscard]] std::string html_page(std::string_view title, std::string_view body);

/// A line of the list of facts (dl) a report begins with: `name` is markup, `value` plain text.
[[nodiscard]] std::string html_entry(std::string_view name, std::string_view value);

}  // namespace hpr
