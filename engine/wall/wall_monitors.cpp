#include "engine/wall/wall_monitors.h"

#include "walls/drawing/assemble.h"

namespace hpr {

WallMonitors::WallMonitors(const Wall& wall) : wall_(wall) {
  for (const WallMonitor& monitor : wall.monitors) layouts_.push_back(monitor_layout(wall, monitor));
}

std::vector<Image<Rgba8>> WallMonitors::draw(Communicator& comm, std::span<const Image<Rgba8>> pictures,
                                             std::span<const int> shown_by) const {
  std::vector<Image<Rgba8>> monitors;
  for (std::size_t m = 0; m < layouts_.size(); ++m) {
    const MonitorLayout& layout = layouts_[m];
    std::vector<Image<Rgba8>> parts(layout.screens.size());
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Size size{layout.rects[i].width(), layout.rects[i].height()};
      const int from = shown_by[layout.screens[i]];
      if (comm.rank() == from) parts[i] = resample(pictures[layout.screens[i]], size);
      if (from == 0) continue;
      if (comm.rank() == from) comm.send(std::as_bytes(parts[i].pixels()), 0);
      if (comm.rank() == 0) {
        parts[i] = Image<Rgba8>(size);
        comm.receive(std::as_writable_bytes(parts[i].pixels()), from);
      }
    }
    if (comm.rank() == 0) monitors.push_back(draw_monitor(wall_, wall_.monitors[m], layout, parts));
  }
  return monitors;
}

}  // namespace hpr
