#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <thread>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/displays/display.h"
#include "walls/displays/window_plan.h"

namespace hpr {

/// A picture for pane `pane` of window `window`, turned.
struct PanePicture {
  std::size_t window = 0;
  std::size_t pane = 0;
  Image<Rgba8> image;
};

/// Windows, and the one thread that touches them. It answers the desktop while frames are made, and its OpenGL contexts
/// never meet those of the threads that render.
class WindowThread {
 public:
  /// Returns once the windows are open; without any it only looks for a desktop. Throws Error: NoDevice, and Hang when
  /// that takes longer than the limit.
  explicit WindowThread(std::vector<WindowPlan> plans, std::chrono::seconds to_open = std::chrono::seconds(60));
  /// Takes two seconds at most: a thread that does not come back from the desktop is left behind.
  ~WindowThread();
  WindowThread(const WindowThread&) = delete;
  WindowThread& operator=(const WindowThread&) = delete;

  /// Returns when all windows show them. Throws Error (NoDevice, Lost).
  void present(std::vector<PanePicture> pictures);
  [[nodiscard]] DisplayInput take_input();

 private:
  struct State;

  explicit WindowThread(std::shared_ptr<State> state);

  std::shared_ptr<State> state_;  ///< the thread holds it too, and may outlive this
  std::jthread thread_;
};

}  // namespace hpr
