#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

struct GlFunctions;

/// An OpenGL 4.5 core context without a window, bound to the thread that uses it. Several, of different backends, may
/// live in one process and be used in turn: call make_current() before every block of GL calls.
class GlContext {
 public:
  GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;
  virtual ~GlContext() = default;

  /// The backend as on the command line: "egl" or "osmesa".
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// Renderer, version and device, for people.
  [[nodiscard]] virtual std::string description() const = 0;
  /// Whether the CPU draws.
  [[nodiscard]] virtual bool software() const = 0;
  /// Makes this the calling thread's context and releases another backend's; cheap when it already is.
  virtual void make_current() = 0;
  /// Releases it where it is the calling thread's, so that another thread may make it current.
  virtual void release() = 0;
  /// Another context that has this one's buffers and programs too, for use by another thread; current on none. Null
  /// where the backend has none. Neither needs the other to outlive it.
  [[nodiscard]] virtual std::unique_ptr<GlContext> share() { return nullptr; }
  /// The functions of this context; call them only while it is current.
  [[nodiscard]] virtual const GlFunctions& gl() const = 0;
};

struct GlOptions {
  std::string backend = "auto";  ///< "auto" or one of all_gl_backends()
  int device = -1;               ///< EGL device by index; -1: hardware devices are dealt out by local rank
  int local_rank = 0;            ///< of this process on its host
  int threads = 0;               ///< see limit_software_gl()
};

/// The names of all backends, in the order in which "auto" tries them.
[[nodiscard]] std::vector<std::string> all_gl_backends();

/// Throws Error (Usage), with the choices, unless `backend` is "auto" or one of all_gl_backends().
void check_gl_backend(const std::string& backend);

/// Whether this machine has the device of a GPU. Without one every context is a software renderer's.
[[nodiscard]] bool has_gpu_device();

/// Bounds the threads of software renderers, unless the environment already does; 0: they decide. For a process's first
/// context, and before the process starts threads that read the environment.
void limit_software_gl(int threads);

/// A context, current on this thread. "auto" takes the first backend that works and logs what it passed over; with a
/// device, EGL. Throws Error: NoDevice, with every attempt and its reason; Usage for an unknown backend.
[[nodiscard]] std::unique_ptr<GlContext> make_gl_context(const GlOptions& options);

}  // namespace hpr
