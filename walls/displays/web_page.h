#pragma once

#include <string>
#include <vector>

namespace hpr {

/// The one page of the web display.
struct WebPage {
  std::string title;
  std::string stream;                ///< path of the pictures
  double wall_heights = 1.0;         ///< how high the picture is, in heights of the wall
  std::vector<std::string> screens;  ///< ids: each has a page of its own
  std::string nonce;                 ///< of its script and style, as its Content-Security-Policy names it
};

/// HTML, complete in itself.
[[nodiscard]] std::string to_html(const WebPage& page);

}  // namespace hpr
