#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "walls/displays/display.h"
#include "walls/displays/web_hub.h"
#include "walls/displays/web_request.h"
#include "walls/displays/web_server.h"
#include "walls/drawing/assemble.h"

namespace hpr {
namespace {

constexpr int kQuality = 90;
constexpr double kRecent_ms = 2000.0;

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

WebHub::WebHub(const Wall& wall)
    : wall_(wall), assembled_(wall_picture(wall, kMaxPictureSide)), pictures_(1 + wall.screens.size()) {
  auto nothing = std::make_shared<Frame>();
  nothing->screens.resize(wall.screens.size());
  newest_ = std::move(nothing);
}

void WebHub::publish(const WallFrame& frame) {
  std::vector<std::shared_ptr<const Image<Rgba8>>> images;
  for (const ScreenPicture& picture : frame.screens) {
    images.push_back(std::make_shared<const Image<Rgba8>>(picture.image));
  }
  const std::lock_guard lock(mutex_);
  auto made = std::make_shared<Frame>(*newest_);
  made->number = frame.number;
  ++made->serial;
  for (std::size_t i = 0; i < images.size(); ++i) made->screens.at(frame.screens[i].screen) = std::move(images[i]);
  newest_ = std::move(made);
  times_ms_.push_back(clock_.ms());
  forget_old_times(times_ms_.back());
}

void WebHub::forget_old_times(double now_ms) {
  while (!times_ms_.empty() && times_ms_.front() < now_ms - kRecent_ms) times_ms_.pop_front();
}

DisplayInput WebHub::take_input() {
  const std::lock_guard lock(mutex_);
  return std::exchange(input_, {});
}

void WebHub::add(const DisplayInput& input) {
  const std::lock_guard lock(mutex_);
  input_ += input;
}

std::string WebHub::status() {
  const std::lock_guard lock(mutex_);
  forget_old_times(clock_.ms());
  return fmt::format(R"({{"frame": {}, "fps": {:.2f}}})", newest_->number,
                     static_cast<double>(times_ms_.size()) * 1e3 / kRecent_ms);
}

std::optional<std::size_t> WebHub::stream_of(std::string_view screen) const {
  const auto found = std::ranges::find(wall_.screens, screen, &WallScreen::id);
  if (found == wall_.screens.end()) return std::nullopt;
  return 1 + static_cast<std::size_t>(found - wall_.screens.begin());
}

std::shared_ptr<const WebPicture> WebHub::picture(std::size_t stream) {
  std::shared_ptr<const Frame> frame;
  {
    const std::lock_guard lock(mutex_);
    frame = newest_;
  }
  if (frame->serial == 0 || (stream > 0 && !frame->screens.at(stream - 1))) return nullptr;
  const std::lock_guard lock(encoding_);
  auto& last = pictures_.at(stream);
  if (!last || last->serial != frame->serial) last = encode(*frame, stream);
  return last;
}

std::shared_ptr<const WebPicture> WebHub::encode(const Frame& frame, std::size_t stream) {
  auto made = std::make_shared<WebPicture>();
  made->frame = frame.number;
  made->serial = frame.serial;
  if (stream > 0) {
    encoder_.append(*frame.screens.at(stream - 1), kQuality, made->jpeg);
    return made;
  }
  std::vector<const Image<Rgba8>*> screens;
  for (const auto& screen : frame.screens) screens.push_back(screen.get());
  encoder_.append(draw_wall(wall_, assembled_, screens), kQuality, made->jpeg);
  return made;
}

DisplayKind web_display() {
  return {.name = "web", .whole_wall = true, .interactive = true, .make = make_web_display, .check = check_web_display};
}

}  // namespace hpr
