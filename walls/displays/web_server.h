#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <utility>  // boost/asio/awaitable.hpp 1.74 needs it and does not include it

#include "walls/displays/web_hub.h"
#include "walls/displays/web_request.h"

namespace hpr {

/// Listens there for a moment. Throws Error (Io).
void check_listening(const WebAddress& address);

/// Shows a hub's frames to browsers, from a thread of its own. HTTP/1.1, GET and one POST, to whoever has the key: it
/// stands in the address that is announced to the user, and becomes a cookie. Eight connections; each request is read
/// within a time limit and up to 4 KiB of body; a viewer that reads slowly misses frames, one that takes no 64 KiB
/// within `to_write` is let go.
class WebServer {
 public:
  /// Listens before it returns. `hub` must outlive it. Throws Error (Io).
  WebServer(WebHub& hub, const WebAddress& address, std::chrono::milliseconds to_write = std::chrono::seconds(10));
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// What opens in a browser, key included.
  [[nodiscard]] std::string url() const;
  /// There is a new frame. Any thread may call it.
  void notify();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace hpr
