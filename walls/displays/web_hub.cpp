#include "walls/displays/web_hub.h"

#include <fmt/format.h>
#include <turbojpeg.h>

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "walls/assemble.h"

namespace hpr {
namespace {

/// Browsers show no larger picture well.
constexpr int kLargestPicture = 8192;
constexpr int kQuality = 90;
constexpr double kRecent_ms = 2000.0;

std::vector<std::byte> encode_jpeg(const Image<Rgba8>& image) {
  struct End {
    void operator()(void* handle) const { tjDestroy(handle); }
  };
  const std::unique_ptr<void, End> encoder(tjInitCompress());
  std::vector<std::byte> jpeg(tjBufSize(image.width(), image.height(), TJSAMP_444));
  auto* target = reinterpret_cast<unsigned char*>(jpeg.data());
  auto size = static_cast<unsigned long>(jpeg.size());
  const auto* const pixels = reinterpret_cast<const unsigned char*>(image.pixels().data());
  if (encoder == nullptr || tjCompress2(encoder.get(), pixels, image.width(), 0, image.height(), TJPF_RGBA, &target,
                                        &size, TJSAMP_444, kQuality, TJFLAG_NOREALLOC) != 0) {
    throw Error(ExitCode::Internal, fmt::format("cannot encode a picture of {} x {} pixels as JPEG: {}", image.width(),
                                                image.height(), tjGetErrorStr2(encoder.get())));
  }
  jpeg.resize(size);
  return jpeg;
}

}  // namespace

WebHub::WebHub(const Wall& wall)
    : wall_(wall), assembled_(wall_picture(wall, kLargestPicture)), pictures_(1 + wall.screens.size()) {}

void WebHub::publish(const WallFrame& frame) {
  auto made = std::make_shared<Frame>();
  made->number = frame.number;
  made->screens.resize(wall_.screens.size());
  for (const ScreenPicture& picture : frame.screens) made->screens.at(picture.screen) = picture.image;
  const std::lock_guard lock(mutex_);
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

void WebHub::add(const OrbitInput& motion) {
  const std::lock_guard lock(mutex_);
  input_.orbit += motion;
}

std::string WebHub::status() {
  const std::lock_guard lock(mutex_);
  forget_old_times(clock_.ms());
  return fmt::format(R"({{"frame": {}, "fps": {:.2f}}})", newest_ ? newest_->number : 0,
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
  if (!frame) return nullptr;
  const std::lock_guard lock(encoder_);
  auto& last = pictures_.at(stream);
  if (!last || last->frame != frame->number) last = encode(*frame, stream);
  return last;
}

std::shared_ptr<const WebPicture> WebHub::encode(const Frame& frame, std::size_t stream) const {
  auto made = std::make_shared<WebPicture>();
  made->frame = frame.number;
  made->jpeg = encode_jpeg(stream == 0 ? draw_wall(wall_, assembled_, frame.screens) : frame.screens.at(stream - 1));
  return made;
}

}  // namespace hpr
