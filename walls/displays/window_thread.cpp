#include "walls/displays/window_thread.h"

#include <memory>
#include <numbers>
#include <utility>

#include "core/error.h"
#include "walls/displays/window_gl.h"

namespace hpr {
namespace {

/// What the mouse does in a window: dragging turns, with shift or another button it pans, the wheel goes nearer.
class Mouse {
 public:
  Mouse(const PaneWindow& window, WindowThread& thread) : window_(window), thread_(thread) {
    GLFWwindow* const handle = window.handle();
    glfwSetWindowUserPointer(handle, this);
    glfwSetCursorPosCallback(handle, [](GLFWwindow* at, double x, double y) { of(at).move(at, x, y); });
    glfwSetScrollCallback(handle, [](GLFWwindow* at, double /*x*/, double y) { of(at).scroll(y); });
    glfwSetKeyCallback(handle, [](GLFWwindow* at, int key, int /*code*/, int action, int /*modifiers*/) {
      if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS) of(at).thread_.ask_to_stop();
    });
    glfwSetWindowCloseCallback(handle, [](GLFWwindow* at) { of(at).thread_.ask_to_stop(); });
    glfwSetWindowRefreshCallback(handle, [](GLFWwindow* at) { of(at).thread_.ask_to_redraw(); });
    glfwSetFramebufferSizeCallback(handle, [](GLFWwindow* at, int, int) { of(at).thread_.ask_to_redraw(); });
  }

 private:
  static Mouse& of(GLFWwindow* window) { return *static_cast<Mouse*>(glfwGetWindowUserPointer(window)); }

  void move(GLFWwindow* handle, double x, double y) {
    const double right = x - std::exchange(x_, x);
    const double down = y - std::exchange(y_, y);
    const auto pressed = [&](int button) { return glfwGetMouseButton(handle, button) == GLFW_PRESS; };
    const auto held = [&](int key) { return glfwGetKey(handle, key) == GLFW_PRESS; };
    const bool left = pressed(GLFW_MOUSE_BUTTON_LEFT);
    const bool other = pressed(GLFW_MOUSE_BUTTON_RIGHT) || pressed(GLFW_MOUSE_BUTTON_MIDDLE);
    if (!left && !other) return;
    const double heights = window_.plan().panes.front().wall_heights_per_pixel;
    if (other || held(GLFW_KEY_LEFT_SHIFT) || held(GLFW_KEY_RIGHT_SHIFT)) {
      thread_.add({.pan_right = right * heights, .pan_up = -down * heights});
    } else {
      thread_.add({.turn_right = std::numbers::pi * right * heights, .turn_up = -std::numbers::pi * down * heights});
    }
  }

  void scroll(double notches) {
    constexpr double kOfANotch = 0.15;
    thread_.add({.dolly = kOfANotch * notches});
  }

  const PaneWindow& window_;
  WindowThread& thread_;
  double x_ = 0.0;
  double y_ = 0.0;
};

void show(std::vector<std::unique_ptr<PaneWindow>>& windows, const std::vector<PanePicture>& pictures) {
  for (const PanePicture& picture : pictures) windows.at(picture.window)->upload(picture.pane, picture.image);
  // All are drawn before the first is swapped: what is left then takes as long for each.
  for (const auto& window : windows) window->draw();
  for (const auto& window : windows) window->swap();
}

}  // namespace

WindowThread::WindowThread(std::vector<WindowPlan> plans)
    : plans_(std::move(plans)), thread_([this](const std::stop_token& stop) { run(stop); }) {
  constexpr std::chrono::seconds kToOpen{60};
  wait_for(&WindowThread::open_, kToOpen, {ExitCode::Hang, "the desktop does not open windows"});
}

WindowThread::~WindowThread() = default;

void WindowThread::wait_for(bool WindowThread::*state, std::chrono::seconds limit, const Error& late) {
  std::unique_lock lock(mutex_);
  const bool done = changed_.wait_for(lock, limit, [&] { return this->*state || failure_ != nullptr; });
  if (failure_ != nullptr) std::rethrow_exception(failure_);
  if (!done) throw late;
}

void WindowThread::present(std::vector<PanePicture> pictures) {
  constexpr std::chrono::seconds kToShow{30};
  {
    const std::lock_guard lock(mutex_);
    pictures_ = std::move(pictures);
    presented_ = false;
  }
  glfwPostEmptyEvent();
  wait_for(&WindowThread::presented_, kToShow, {ExitCode::Lost, "the desktop shows no frames any more"});
}

DisplayInput WindowThread::take_input() {
  const std::lock_guard lock(mutex_);
  return std::exchange(input_, {});
}

void WindowThread::add(const OrbitInput& motion) {
  const std::lock_guard lock(mutex_);
  input_.orbit += motion;
}

void WindowThread::ask_to_stop() {
  const std::lock_guard lock(mutex_);
  input_.stop = true;
}

void WindowThread::ask_to_redraw() {
  const std::lock_guard lock(mutex_);
  redraw_ = true;
}

void WindowThread::run(const std::stop_token& stop) {
  try {
    serve(stop);
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
  changed_.notify_all();
}

void WindowThread::serve(const std::stop_token& stop) {
  const Desktop desktop;
  std::vector<std::unique_ptr<PaneWindow>> windows;
  std::vector<std::unique_ptr<Mouse>> mice;
  for (const WindowPlan& plan : plans_) {
    // One window waits for the monitor's next picture; were all to wait, each would cost a refresh.
    windows.push_back(std::make_unique<PaneWindow>(plan, windows.empty() ? 1 : 0));
    mice.push_back(std::make_unique<Mouse>(*windows.back(), *this));
  }
  show(windows, {});
  {
    const std::lock_guard lock(mutex_);
    open_ = true;
  }
  changed_.notify_all();

  constexpr double kLongestSleep_s = 0.1;  // the stop token wakes nobody
  while (!stop.stop_requested()) {
    glfwWaitEventsTimeout(kLongestSleep_s);
    std::vector<PanePicture> pictures;
    bool redraw = false;
    {
      const std::lock_guard lock(mutex_);
      redraw = std::exchange(redraw_, false) || !presented_;
      pictures = std::move(pictures_);
      pictures_.clear();
    }
    if (!redraw) continue;
    show(windows, pictures);
    {
      const std::lock_guard lock(mutex_);
      presented_ = pictures_.empty();
    }
    changed_.notify_all();
  }
}

}  // namespace hpr
