#include "walls/displays/window_thread.h"

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <numbers>
#include <utility>

#include "core/error.h"
#include "core/log.h"
#include "walls/displays/window_gl.h"

namespace hpr {

/// What the thread of the windows and the one that shows pictures both see.
struct WindowThread::State {
  explicit State(std::vector<WindowPlan> all) : plans(std::move(all)) {}

  void wait_for(bool State::*event, std::chrono::seconds limit, const Error& late) {
    std::unique_lock lock(mutex);
    const bool done = changed.wait_for(lock, limit, [&] { return this->*event || failure != nullptr; });
    if (failure != nullptr) std::rethrow_exception(failure);
    if (!done) throw late;
  }

  /// Whether the thread ended within the time.
  [[nodiscard]] bool ends_within(std::chrono::seconds limit) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, limit, [&] { return ended; });
  }

  void add(const OrbitInput& motion) {
    const std::lock_guard lock(mutex);
    input.orbit += motion;
  }

  void set(bool State::*event) {
    {
      const std::lock_guard lock(mutex);
      this->*event = true;
    }
    changed.notify_all();
  }

  void ask_to_stop() {
    const std::lock_guard lock(mutex);
    input.stop = true;
  }

  void run(const std::stop_token& stop);
  void serve(const std::stop_token& stop);

  const std::vector<WindowPlan> plans;
  std::mutex mutex;
  std::condition_variable changed;
  bool open = false;
  bool presented = true;
  bool redraw = false;
  bool ended = false;
  std::vector<PanePicture> pictures;  ///< not yet taken by the thread
  DisplayInput input;
  std::exception_ptr failure;  ///< why the thread ended

  class Mouse;
};

/// What the mouse does in a window: dragging turns, with shift or another button it pans, the wheel goes nearer.
class WindowThread::State::Mouse {
 public:
  Mouse(const PaneWindow& window, State& state) : window_(window), state_(state) {
    GLFWwindow* const handle = window.handle();
    glfwSetWindowUserPointer(handle, this);
    glfwSetCursorPosCallback(handle, [](GLFWwindow* at, double x, double y) { of(at).move(at, {x, y}); });
    glfwSetScrollCallback(handle, [](GLFWwindow* at, double /*x*/, double y) { of(at).scroll(y); });
    glfwSetKeyCallback(handle, [](GLFWwindow* at, int key, int /*code*/, int action, int /*modifiers*/) {
      if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS) of(at).state_.ask_to_stop();
    });
    glfwSetWindowCloseCallback(handle, [](GLFWwindow* at) { of(at).state_.ask_to_stop(); });
    glfwSetWindowRefreshCallback(handle, [](GLFWwindow* at) { of(at).state_.set(&State::redraw); });
    glfwSetFramebufferSizeCallback(handle, [](GLFWwindow* at, int, int) { of(at).state_.set(&State::redraw); });
    glfwGetCursorPos(handle, &pointer_.x, &pointer_.y);  // or the first drag would come from the window's corner
  }

 private:
  static Mouse& of(GLFWwindow* window) { return *static_cast<Mouse*>(glfwGetWindowUserPointer(window)); }

  /// Of what the wall file calls the window's pixels, which the user may have resized.
  [[nodiscard]] glm::dvec2 scale() const {
    int width = 0;
    int height = 0;
    glfwGetWindowSize(window_.handle(), &width, &height);
    const Rect& planned = window_.plan().rect;
    return {planned.width() / std::max(1.0, 1.0 * width), planned.height() / std::max(1.0, 1.0 * height)};
  }

  void move(GLFWwindow* handle, const glm::dvec2& to) {
    const glm::dvec2 by = to - std::exchange(pointer_, to);
    const auto pressed = [&](int button) { return glfwGetMouseButton(handle, button) == GLFW_PRESS; };
    const auto held = [&](int key) { return glfwGetKey(handle, key) == GLFW_PRESS; };
    const bool left = pressed(GLFW_MOUSE_BUTTON_LEFT);
    const bool other = pressed(GLFW_MOUSE_BUTTON_RIGHT) || pressed(GLFW_MOUSE_BUTTON_MIDDLE);
    pane_ = pane_at(window_.plan(), scale() * to).value_or(pane_);
    if (!left && !other) return;
    const Pane& pane = window_.plan().panes[pane_];
    const glm::dvec2 drag = pane.wall_heights_per_pixel * upright(pane, scale() * by);
    if (other || held(GLFW_KEY_LEFT_SHIFT) || held(GLFW_KEY_RIGHT_SHIFT)) {
      state_.add({.pan_right = drag.x, .pan_up = -drag.y});
    } else {
      state_.add({.turn_right = std::numbers::pi * drag.x, .turn_up = -std::numbers::pi * drag.y});
    }
  }

  void scroll(double notches) {
    constexpr double kOfANotch = 0.15;
    state_.add({.dolly = kOfANotch * notches});
  }

  const PaneWindow& window_;
  State& state_;
  glm::dvec2 pointer_{0.0};  ///< in the window
  std::size_t pane_ = 0;     ///< the one it was in last
};

namespace {

void show(std::vector<std::unique_ptr<PaneWindow>>& windows, const std::vector<PanePicture>& pictures) {
  for (const PanePicture& picture : pictures) windows.at(picture.window)->upload(picture.pane, picture.image);
  // All are drawn before the first is swapped: what is left then takes as long for each.
  for (const auto& window : windows) window->draw();
  for (const auto& window : windows) window->swap();
}

}  // namespace

// Once the private constructor is through, the destructor ends the thread, also when the wait throws.
WindowThread::WindowThread(std::vector<WindowPlan> plans, std::chrono::seconds to_open)
    : WindowThread(std::make_shared<State>(std::move(plans))) {
  state_->wait_for(&State::open, to_open,
                   {ExitCode::Hang, "the desktop does not open windows",
                    "see whether the X server of DISPLAY answers; or use --display web"});
}

WindowThread::WindowThread(std::shared_ptr<State> state)
    : state_(std::move(state)), thread_([shared = state_](const std::stop_token& stop) { shared->run(stop); }) {}

WindowThread::~WindowThread() {
  constexpr std::chrono::seconds kToEnd{2};
  thread_.request_stop();
  if (state_->ends_within(kToEnd)) return;
  log::debug("the desktop does not answer: its thread is left behind");
  thread_.detach();
}

void WindowThread::present(std::vector<PanePicture> pictures) {
  constexpr std::chrono::seconds kToShow{30};
  {
    const std::lock_guard lock(state_->mutex);
    state_->pictures = std::move(pictures);
    state_->presented = false;
  }
  glfwPostEmptyEvent();
  state_->wait_for(&State::presented, kToShow, {ExitCode::Lost, "the desktop shows no frames any more"});
}

DisplayInput WindowThread::take_input() {
  const std::lock_guard lock(state_->mutex);
  return std::exchange(state_->input, {});
}

void WindowThread::State::run(const std::stop_token& stop) {
  try {
    serve(stop);
  } catch (...) {
    const std::lock_guard lock(mutex);
    failure = std::current_exception();
  }
  set(&State::ended);
}

void WindowThread::State::serve(const std::stop_token& stop) {
  const Desktop desktop;
  std::vector<std::unique_ptr<PaneWindow>> windows;
  std::vector<std::unique_ptr<Mouse>> mice;
  for (const WindowPlan& plan : plans) {
    // One window waits for the monitor's next picture; were all to wait, each would cost a refresh.
    windows.push_back(std::make_unique<PaneWindow>(plan, windows.empty() ? 1 : 0));
    mice.push_back(std::make_unique<Mouse>(*windows.back(), *this));
  }
  show(windows, {});
  set(&State::open);

  constexpr double kLongestSleep_s = 0.1;  // the stop token wakes nobody
  while (!stop.stop_requested()) {
    glfwWaitEventsTimeout(kLongestSleep_s);
    std::vector<PanePicture> taken;
    bool draw = false;
    {
      const std::lock_guard lock(mutex);
      draw = std::exchange(redraw, false) || !presented;
      taken = std::exchange(pictures, {});
    }
    if (!draw) continue;
    show(windows, taken);
    {
      const std::lock_guard lock(mutex);
      presented = pictures.empty();
    }
    changed.notify_all();
  }
}

}  // namespace hpr
