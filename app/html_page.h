#pragma once

#include <string>
#include <string_view>

namespace hpr {

/// A report as one HTML document, well-formed XML too, in the style all reports share; no script, no other file, no
/// network. `title` is plain text, `body` markup.
[[nodiscard]] std::string html_page(std::string_view title, std::string_view body);

}  // namespace hpr
