#include "walls/displays/window_gl.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include "core/error.h"
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

}  // namespace

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
    const Rect& place = plan_.panes[i].place;
    if (place.width() > largest || place.height() > largest) {
      throw Error(
          ExitCode::NoDevice,
          fmt::format("the window '{}' shows a screen of {} x {} pixels, OpenGL's pictures have at most {} a side",
                      plan_.title, place.width(), place.height(), largest),
          "show less of it with --scale");
    }
    gl_.BindTexture(GL_TEXTURE_2D, textures_[i]);
    const std::vector<Rgba8> black(place.area(), {0, 0, 0, 255});
    gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, place.width(), place.height(), 0, GL_RGBA, GL_UNSIGNED_BYTE,
                   black.data());
  }
  if (gl_.GetError() != GL_NO_ERROR) {
    throw Error(ExitCode::NoDevice, fmt::format("the window '{}' has no memory for its pictures", plan_.title),
                "show less of the wall with --scale");
  }
}

void PaneWindow::upload(std::size_t pane, const Image<Rgba8>& image) {
  HPR_CHECK(image.width() == plan_.panes[pane].place.width() && image.height() == plan_.panes[pane].place.height());
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
    const Rect& place = plan_.panes[i].place;
    gl_.FramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, textures_[i], 0);
    // The texture's first row is the picture's upper one; GL's windows count from below.
    gl_.BlitFramebuffer(0, 0, place.width(), place.height(), edge(place.x0, across), height - edge(place.y0, down),
                        edge(place.x1, across), height - edge(place.y1, down), GL_COLOR_BUFFER_BIT,
                        across == 1.0 && down == 1.0 ? GL_NEAREST : GL_LINEAR);
  }
  gl_.Finish();
}

void PaneWindow::swap() {
  glfwMakeContextCurrent(handle());
  glfwSwapBuffers(handle());
}

}  // namespace hpr
