#include "walls/displays/display.h"
#include "walls/displays/web_hub.h"
#include "walls/displays/web_request.h"
#include "walls/displays/web_server.h"

namespace hpr {
namespace {

/// A page for browsers with the assembled wall, or one screen; the mouse moves the camera (WebServer).
class WebDisplay final : public Display {
 public:
  WebDisplay(const Wall& wall, const WebAddress& address) : hub_(wall), server_(hub_, address) {}

  [[nodiscard]] std::string_view name() const override { return "web"; }
  [[nodiscard]] std::string url() const { return server_.url(); }

  void show(const WallFrame& frame) override {
    hub_.publish(frame);
    server_.notify();
  }

  [[nodiscard]] DisplayInput take_input() override { return hub_.take_input(); }

 private:
  WebHub hub_;
  WebServer server_;
};

std::unique_ptr<Display> make_web_display(const Wall& wall, const DisplayOptions& options) {
  auto display = std::make_unique<WebDisplay>(wall, parse_web_address(options.web_address));
  if (options.announce) options.announce(display->url());
  return display;
}

void check_web_display(const Wall& /*wall*/, const DisplayOptions& options) {
  const WebAddress address = parse_web_address(options.web_address);
  if (address.port != 0) check_listening(address);
}

}  // namespace

DisplayKind web_display() {
  return {.name = "web", .whole_wall = true, .interactive = true, .make = make_web_display, .check = check_web_display};
}

}  // namespace hpr
