#pragma once

#define GLFW_INCLUDE_NONE  // NOLINT(readability-identifier-naming): GLFW's own
#include <GL/glcorearb.h>
#include <GLFW/glfw3.h>

#include <chrono>
#include <memory>
#include <stop_token>
#include <thread>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/displays/display.h"
#include "walls/displays/window_plan.h"

namespace hpr {

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
