#include "walls/displays/background_display.h"

#include <utility>

#include "core/error.h"
#include "core/timing.h"

namespace hpr {

void show_pictures(Display& display, std::uint64_t number, const WallPictures& pictures,
                   const std::vector<std::size_t>& screens) {
  std::vector<ScreenPicture> shown;
  shown.reserve(screens.size());
  for (const std::size_t screen : screens) shown.push_back({screen, pictures.screens[screen]});
  std::vector<MonitorPicture> monitors;
  monitors.reserve(pictures.monitors.size());
  for (std::size_t monitor = 0; monitor < pictures.monitors.size(); ++monitor)
    monitors.push_back({monitor, pictures.monitors[monitor]});
  display.show({number, shown, monitors});
}

BackgroundDisplay::~BackgroundDisplay() {
  if (shown_.valid()) shown_.wait();
}

void BackgroundDisplay::show(std::uint64_t number, std::shared_ptr<const WallPictures> pictures,
                             std::vector<std::size_t> screens) {
  HPR_CHECK(!shown_.valid());
  constexpr int kLane = 1025;  // of a trace: past all threads a rank may have
  const trace::Row row{trace::row_of_this_thread().rank, kLane};
  shown_ =
      std::async(std::launch::async, [this, number, row, pictures = std::move(pictures), screens = std::move(screens)] {
        const trace::InRow in_row(row);
        const trace::Span span("show", "frame", number);
        const Stopwatch watch;
        show_pictures(display_, number, *pictures, screens);
        return watch.ms();
      });
}

void BackgroundDisplay::wait() {
  if (shown_.valid()) shown_ms_ = shown_.get();
}

}  // namespace hpr
