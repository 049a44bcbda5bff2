#include "walls/displays/window_thread.h"

#define GLFW_INCLUDE_NONE  // NOLINT(readability-identifier-naming): GLFW's own
#include <GL/glcorearb.h>
#include <GLFW/glfw3.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <numbers>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "walls/displays/x_server.h"

namespace hpr {
namespace {

std::string glfw_reason() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text == nullptr ? "no reason given" : text;
}

std::span<GLFWmonitor*> monitors() {
  int count = 0;
  GLFWmonitor** const all = glfwGetMonitors(&count);
  return {all, static_cast<std::size_t>(count)};
}

/// Where it is on the desktop.
Rect rect_of(GLFWmonitor* monitor) {
  const GLFWvidmode* const mode = glfwGetVideoMode(monitor);
  int x = 0;
  int y = 0;
  glfwGetMonitorPos(monitor, &x, &y);
  return mode == nullptr ? Rect{} : Rect{x, y, x + mode->width, y + mode->height};
}

GLFWmonitor* monitor_of(const WindowPlan& plan) {
  const auto all = monitors();
  if (all.empty()) throw Error(ExitCode::NoDevice, "the desktop has no monitor", "leave fullscreen out");
  if (!plan.monitor.empty()) {
    std::vector<std::string> names;
    for (GLFWmonitor* const monitor : all) {
      names.emplace_back(glfwGetMonitorName(monitor));
      if (names.back() == plan.monitor) return monitor;
    }
    throw Error(ExitCode::NoDevice, fmt::format("there is no monitor '{}'", printable(plan.monitor)),
                unknown_name_hint(plan.monitor, names));
  }
  return *std::ranges::max_element(
      all, {}, [&](GLFWmonitor* monitor) { return intersection(rect_of(monitor), plan.rect).area(); });
}

/// A window over several monitors is full screen by its place and size.
GLFWmonitor* full_screen_monitor(const WindowPlan& plan) {
  if (!plan.fullscreen) return nullptr;
  GLFWmonitor* const monitor = monitor_of(plan);
  const bool fits = intersection(rect_of(monitor), plan.rect) == plan.rect;
  return fits || !plan.monitor.empty() ? monitor : nullptr;
}

void set_hints(const WindowPlan& plan, GLFWmonitor* monitor) {
  glfwDefaultWindowHints();
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  glfwWindowHint(GLFW_DECORATED, plan.decorated ? GLFW_TRUE : GLFW_FALSE);
  glfwWindowHint(GLFW_AUTO_ICONIFY, GLFW_FALSE);  // a wall stays when another screen gets the focus
  glfwWindowHint(GLFW_DEPTH_BITS, 0);
  glfwWindowHint(GLFW_STENCIL_BITS, 0);
  const GLFWvidmode* const mode = monitor == nullptr ? nullptr : glfwGetVideoMode(monitor);
  if (mode != nullptr) glfwWindowHint(GLFW_REFRESH_RATE, mode->refreshRate);
}

/// GLFW for as long as it lives; of one thread at a time.
class Desktop {
 public:
  /// Throws Error (NoDevice) where there is none.
  Desktop();
  ~Desktop() { glfwTerminate(); }
  Desktop(const Desktop&) = delete;
  Desktop& operator=(const Desktop&) = delete;
};

/// The functions of one window's context that show pictures: its name without "gl", and its type in <GL/glcorearb.h>.
#define HPR_WINDOW_GL_FUNCTIONS(X)                       \
  X(BindFramebuffer, PFNGLBINDFRAMEBUFFERPROC)           \
  X(BindTexture, PFNGLBINDTEXTUREPROC)                   \
  X(BlitFramebuffer, PFNGLBLITFRAMEBUFFERPROC)           \
  X(Clear, PFNGLCLEARPROC)                               \
  X(ClearColor, PFNGLCLEARCOLORPROC)                     \
  X(Finish, PFNGLFINISHPROC)                             \
  X(FramebufferTexture2D, PFNGLFRAMEBUFFERTEXTURE2DPROC) \
  X(GenFramebuffers, PFNGLGENFRAMEBUFFERSPROC)           \
  X(GenTextures, PFNGLGENTEXTURESPROC)                   \
  X(GetError, PFNGLGETERRORPROC)                         \
  X(GetIntegerv, PFNGLGETINTEGERVPROC)                   \
  X(TexImage2D, PFNGLTEXIMAGE2DPROC)                     \
  X(TexSubImage2D, PFNGLTEXSUBIMAGE2DPROC)

/// A window with its context, and the pictures of its panes as textures. All calls are of one thread, the one that
/// called glfwInit.
class PaneWindow {
 public:
  /// Throws Error (NoDevice). `interval`: see glfwSwapInterval.
  PaneWindow(const WindowPlan& plan, int interval);

  [[nodiscard]] GLFWwindow* handle() const { return window_.get(); }
  [[nodiscard]] const WindowPlan& plan() const { return plan_; }

  /// The picture of pane `pane`, turned, as large as its place.
  void upload(std::size_t pane, const Image<Rgba8>& image);
  /// What was uploaded last, in the back buffer.
  void draw();
  void swap();

 private:
  struct Destroy {
    void operator()(GLFWwindow* window) const { glfwDestroyWindow(window); }
  };
  struct Functions {
#define HPR_WINDOW_GL_MEMBER(name, type) type name = nullptr;
    HPR_WINDOW_GL_FUNCTIONS(HPR_WINDOW_GL_MEMBER)
#undef HPR_WINDOW_GL_MEMBER
  };

  void load_functions();
  void make_textures();

  WindowPlan plan_;
  std::unique_ptr<GLFWwindow, Destroy> window_;
  Functions gl_;
  std::vector<GLuint> textures_;  ///< per pane; they end with the context
  GLuint framebuffer_ = 0;
};

Desktop::Desktop() {
  end_with_x_server();
  if (glfwInit() == GLFW_TRUE) return;
  throw Error(ExitCode::NoDevice, fmt::format("there is no desktop for windows: {}", glfw_reason()),
              "start it on a desktop, or set DISPLAY to one; or use --display web");
}

PaneWindow::PaneWindow(const WindowPlan& plan, int interval) : plan_(plan) {
  GLFWmonitor* const monitor = full_screen_monitor(plan);
  set_hints(plan, monitor);
  const GLFWvidmode* const mode = monitor == nullptr ? nullptr : glfwGetVideoMode(monitor);
  const Size size = mode == nullptr ? Size{plan.rect.width(), plan.rect.height()} : Size{mode->width, mode->height};
  window_.reset(glfwCreateWindow(size.width, size.height, plan.title.c_str(), monitor, nullptr));
  if (!window_) {
    throw Error(ExitCode::NoDevice, fmt::format("cannot open the window '{}': {}", plan.title, glfw_reason()),
                "windows need OpenGL 3.3 on their desktop; --display web needs none");
  }
  if (monitor == nullptr) glfwSetWindowPos(handle(), plan.rect.x0, plan.rect.y0);
  glfwShowWindow(handle());
  glfwMakeContextCurrent(handle());
  glfwSwapInterval(interval);
  load_functions();
  make_textures();
}

void PaneWindow::load_functions() {
  const auto load = [](const char* name) {
    const GLFWglproc function = glfwGetProcAddress(name);
    if (function == nullptr) {
      throw Error(ExitCode::NoDevice, fmt::format("the desktop's OpenGL has no {}", name), "update its driver");
    }
    return function;
  };
#define HPR_WINDOW_GL_LOAD(name, type) gl_.name = reinterpret_cast<type>(load("gl" #name));
  HPR_WINDOW_GL_FUNCTIONS(HPR_WINDOW_GL_LOAD)
#undef HPR_WINDOW_GL_LOAD
}

void PaneWindow::make_textures() {
  GLint largest = 0;
  gl_.GetIntegerv(GL_MAX_TEXTURE_SIZE, &largest);
  textures_.resize(plan_.panes.size());
  gl_.GenTextures(static_cast<GLsizei>(textures_.size()), textures_.data());
  gl_.GenFramebuffers(1, &framebuffer_);
  for (std::size_t i = 0; i < textures_.size(); ++i) {
    const Rect& rect = plan_.panes[i].rect;
    if (rect.width() > largest || rect.height() > largest) {
      throw Error(
          ExitCode::NoDevice,
          fmt::format("the window '{}' shows a screen of {} x {} pixels, OpenGL's pictures have at most {} a side",
                      plan_.title, rect.width(), rect.height(), largest),
          "show less of it with --scale");
    }
    gl_.BindTexture(GL_TEXTURE_2D, textures_[i]);
    const std::vector<Rgba8> black(rect.area(), {0, 0, 0, 255});
    gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, rect.width(), rect.height(), 0, GL_RGBA, GL_UNSIGNED_BYTE, black.data());
  }
  if (gl_.GetError() != GL_NO_ERROR) {
    throw Error(ExitCode::NoDevice, fmt::format("the window '{}' has no memory for its pictures", plan_.title),
                "show less of the wall with --scale");
  }
}

void PaneWindow::upload(std::size_t pane, const Image<Rgba8>& image) {
  HPR_CHECK(image.width() == plan_.panes[pane].rect.width() && image.height() == plan_.panes[pane].rect.height());
  glfwMakeContextCurrent(handle());
  gl_.BindTexture(GL_TEXTURE_2D, textures_[pane]);
  gl_.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, image.width(), image.height(), GL_RGBA, GL_UNSIGNED_BYTE,
                    image.pixels().data());
}

void PaneWindow::draw() {
  glfwMakeContextCurrent(handle());
  int width = 0;
  int height = 0;
  glfwGetFramebufferSize(handle(), &width, &height);
  // A window the user resized, or on a desktop that scales, shows the picture scaled.
  const double across = static_cast<double>(width) / plan_.rect.width();
  const double down = static_cast<double>(height) / plan_.rect.height();
  const auto edge = [](int at, double factor) { return static_cast<GLint>(std::lround(at * factor)); };
  gl_.BindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
  gl_.ClearColor(0.0F, 0.0F, 0.0F, 1.0F);
  gl_.Clear(GL_COLOR_BUFFER_BIT);
  gl_.BindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_);
  for (std::size_t i = 0; i < textures_.size(); ++i) {
    const Rect& rect = plan_.panes[i].rect;
    gl_.FramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, textures_[i], 0);
    // The texture's first row is the picture's upper one; GL's windows count from below.
    gl_.BlitFramebuffer(0, 0, rect.width(), rect.height(), edge(rect.x0, across), height - edge(rect.y0, down),
                        edge(rect.x1, across), height - edge(rect.y1, down), GL_COLOR_BUFFER_BIT,
                        across == 1.0 && down == 1.0 ? GL_NEAREST : GL_LINEAR);
  }
  gl_.Finish();
}

void PaneWindow::swap() {
  glfwMakeContextCurrent(handle());
  glfwSwapBuffers(handle());
}

void show(std::vector<std::unique_ptr<PaneWindow>>& windows, const std::vector<PanePicture>& pictures) {
  for (const PanePicture& picture : pictures) windows.at(picture.window)->upload(picture.pane, picture.image);
  // All are drawn before the first is swapped: what is left then takes as long for each.
  for (const auto& window : windows) window->draw();
  for (const auto& window : windows) window->swap();
}

}  // namespace

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
    glfwSetCharCallback(handle, [](GLFWwindow* at, unsigned int character) { of(at).press(character); });
    glfwSetWindowCloseCallback(handle, [](GLFWwindow* at) { of(at).state_.ask_to_stop(); });
    glfwSetWindowRefreshCallback(handle, [](GLFWwindow* at) { of(at).state_.set(&State::redraw); });
    glfwSetFramebufferSizeCallback(handle, [](GLFWwindow* at, int, int) { of(at).state_.set(&State::redraw); });
    glfwGetCursorPos(handle, &pointer_.x, &pointer_.y);  // or the first drag would come from the window's corner
  }

 private:
  static Mouse& of(GLFWwindow* window) { return *static_cast<Mouse*>(glfwGetWindowUserPointer(window)); }

  /// The scale of what the wall file calls the window's pixels, which the user may have resized.
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

  void press(unsigned int character) {
    const auto keys = character < 128 ? parse_view_key(static_cast<char>(character)) : std::nullopt;
    if (!keys) return;
    const std::lock_guard lock(state_.mutex);
    state_.input.keys += *keys;
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

  constexpr double kMaxSleep_s = 0.1;  // the stop token wakes nobody
  while (!stop.stop_requested()) {
    glfwWaitEventsTimeout(kMaxSleep_s);
    std::vector<PanePicture> arrived;
    bool draw = false;
    {
      const std::lock_guard lock(mutex);
      draw = std::exchange(redraw, false) || !presented;
      arrived = std::exchange(pictures, {});
    }
    if (!draw) continue;
    show(windows, arrived);
    {
      const std::lock_guard lock(mutex);
      presented = pictures.empty();
    }
    changed.notify_all();
  }
}

}  // namespace hpr
