#pragma once

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "core/error.h"
#include "image/color.h"
#include "image/image.h"
#include "walls/display.h"
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
  /// Returns once the windows are open. Throws Error (NoDevice, Hang).
  explicit WindowThread(std::vector<WindowPlan> plans);
  ~WindowThread();
  WindowThread(const WindowThread&) = delete;
  WindowThread& operator=(const WindowThread&) = delete;

  /// Returns when all windows show them. Throws Error (NoDevice, Lost).
  void present(std::vector<PanePicture> pictures);
  [[nodiscard]] DisplayInput take_input();

  // Of the window thread: what happened in a window.
  void add(const OrbitInput& motion);
  void ask_to_stop();
  void ask_to_redraw();

 private:
  void run(const std::stop_token& stop);
  void serve(const std::stop_token& stop);
  void wait_for(bool WindowThread::*state, std::chrono::seconds limit, const Error& late);

  std::vector<WindowPlan> plans_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
  bool presented_ = true;
  bool redraw_ = false;
  std::vector<PanePicture> pictures_;  ///< not yet taken by the thread
  DisplayInput input_;
  std::exception_ptr failure_;  ///< why the thread ended
  std::jthread thread_;         ///< last: it uses all of the above
};

}  // namespace hpr
