#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "walls/displays/display.h"

/// What of a browser's request is believed, and the page that makes such requests.
namespace hpr {

/// Where to listen.
struct WebAddress {
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;  ///< 0: any that is free
};

/// "ADDR", "ADDR:PORT", ":PORT", "[::1]:PORT"; empty: loopback, any port. Throws Error (Usage).
[[nodiscard]] WebAddress parse_web_address(const std::string& text);

/// Whether a Host header names this machine in a way no foreign site can: by number, as localhost or by its own name.
/// The port is left alone, as tunnels change it.
[[nodiscard]] bool host_is_ours(std::string_view host);
/// Whether a request from a page at `origin` is one of our own page, which came from `host`.
[[nodiscard]] bool origin_is_ours(std::string_view origin, std::string_view host);

/// The value of a cookie in a Cookie header; empty: there is none.
[[nodiscard]] std::string_view cookie_in(std::string_view header, std::string_view name);

/// {"turn": [right, up], "pan": [right, up], "dolly": d}, each as OrbitInput has it, none needed; none where it is
/// anything else, or a number is not within 100.
[[nodiscard]] std::optional<DisplayInput> parse_motion(std::string_view body);

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
