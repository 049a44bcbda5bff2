#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/log.h"
#include "raster/gl.h"
#include "raster/gl_backends.h"

namespace hpr {
namespace {

class EglContext final : public GlContext {
 public:
  EglContext(EGLDisplay display, EGLContext context, std::string device)
      : display_(display), context_(context), device_(std::move(device)) {}
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;
  // The display is shared by all contexts of the process and has no reference count: it is never terminated.
  ~EglContext() override {
    EglContext::release();
    eglDestroyContext(display_, context_);
  }

  /// Second half of construction: needs the context current.
  void load() {
    make_current();
    gl_ = load_gl_functions([](const char* name) -> GlProc { return eglGetProcAddress(name); });
    info_ = query_gl_info(gl_);
  }

  [[nodiscard]] std::string_view name() const override { return "egl"; }
  [[nodiscard]] std::string description() const override {
    return fmt::format("{}, OpenGL {}, {}", info_.renderer, info_.version, device_);
  }
  [[nodiscard]] bool software() const override { return info_.software; }
  [[nodiscard]] const GlFunctions& gl() const override { return gl_; }

  void make_current() override {
    // OSMesa reports any Mesa context of the thread as its own, so it is asked only when EGL has none. Where EGL has
    // one it is truly current: an OSMesa context releases EGL's before it takes the thread.
    if (eglGetCurrentContext() == context_) return;
    if (eglGetCurrentContext() == EGL_NO_CONTEXT) release_osmesa();
    if (eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE) {
      throw Error(ExitCode::NoDevice,
                  fmt::format("EGL cannot make its context current (error 0x{:x}), {}", eglGetError(), device_));
    }
  }
  void release() override {
    if (eglGetCurrentContext() == context_) release_egl();
  }
  [[nodiscard]] std::unique_ptr<GlContext> share() override;

 private:
  EGLDisplay display_;
  EGLContext context_;
  std::string device_;
  GlFunctions gl_;
  GlInfo info_;
};

/// EGL_NO_CONTEXT where there is none. `shared`: whose buffers it has too.
EGLContext create_context(EGLDisplay display, EGLContext shared) {
  constexpr std::array<EGLint, 7> kAttributes{
      EGL_CONTEXT_MAJOR_VERSION,           4,       EGL_CONTEXT_MINOR_VERSION, 5, EGL_CONTEXT_OPENGL_PROFILE_MASK,
      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
  return eglCreateContext(display, EGL_NO_CONFIG_KHR, shared, kAttributes.data());
}

std::unique_ptr<GlContext> EglContext::share() {
  auto* const context = create_context(display_, context_);
  if (context == EGL_NO_CONTEXT) return nullptr;
  auto made = std::make_unique<EglContext>(display_, context, device_);
  made->gl_ = gl_;  // functions of one vendor serve all its contexts
  made->info_ = info_;
  return made;
}

/// The words of a space-separated list of extensions.
bool has_extension(const char* extensions, std::string_view wanted) {
  if (extensions == nullptr) return false;
  std::string_view rest(extensions);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, end) == wanted) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

struct EglDevice {
  EGLDeviceEXT handle = EGL_NO_DEVICE_EXT;
  int index = 0;
  bool software = false;
};

std::vector<EglDevice> list_devices(const char* client_extensions) {
  if (!has_extension(client_extensions, "EGL_EXT_device_enumeration") &&
      !has_extension(client_extensions, "EGL_EXT_device_base")) {
    return {};
  }
  const auto query_devices = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  const auto query_string =
      reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  std::array<EGLDeviceEXT, 64> handles{};
  EGLint count = 0;
  if (query_devices == nullptr ||
      query_devices(static_cast<EGLint>(handles.size()), handles.data(), &count) != EGL_TRUE)
    return {};
  std::vector<EglDevice> devices;
  for (int i = 0; i < count; ++i) {
    auto* const handle = handles.at(static_cast<std::size_t>(i));
    const char* const extensions = query_string == nullptr ? nullptr : query_string(handle, EGL_EXTENSIONS);
    devices.push_back({handle, i, has_extension(extensions, "EGL_MESA_device_software")});
  }
  return devices;
}

/// One way to a display; tried in order.
struct Attempt {
  std::string what;
  EGLenum platform = 0;
  void* native = nullptr;
};

std::vector<Attempt> plan_attempts(const GlOptions& options, const char* client_extensions) {
  const std::vector<EglDevice> devices = list_devices(client_extensions);
  const bool by_device = has_extension(client_extensions, "EGL_EXT_platform_device");
  const auto on_device = [](const EglDevice& device) {
    return Attempt{fmt::format("EGL device {}{}", device.index, device.software ? " (software)" : ""),
                   EGL_PLATFORM_DEVICE_EXT, device.handle};
  };
  if (options.device >= 0) {
    if (!by_device || options.device >= static_cast<int>(devices.size())) {
      throw Error(ExitCode::NoDevice, fmt::format("there is no EGL device {}", options.device),
                  fmt::format("EGL lists {} devices, counted from 0", by_device ? devices.size() : 0));
    }
    return {on_device(devices[static_cast<std::size_t>(options.device)])};
  }

  std::vector<Attempt> attempts;
  std::vector<EglDevice> hardware;
  std::ranges::copy_if(devices, std::back_inserter(hardware), [](const EglDevice& d) { return !d.software; });
  if (by_device) {
    // Ranks of one host start at different devices; each still falls back to the others.
    for (std::size_t i = 0; i < hardware.size(); ++i) {
      attempts.push_back(on_device(hardware[(static_cast<std::size_t>(options.local_rank) + i) % hardware.size()]));
    }
  }
  if (has_extension(client_extensions, "EGL_MESA_platform_surfaceless")) {
    attempts.push_back({"EGL surfaceless", EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY});
  }
  for (const EglDevice& device : devices) {
    if (by_device && device.software) attempts.push_back(on_device(device));
  }
  return attempts;
}

/// Creates the context of one attempt, or throws Error (NoDevice) saying what failed.
std::unique_ptr<GlContext> try_attempt(const Attempt& attempt) {
  const auto fail = [&](std::string_view step) {
    return Error(ExitCode::NoDevice, fmt::format("{}: {} (error 0x{:x})", attempt.what, step, eglGetError()));
  };
  const auto get_display =
      reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  auto* const display = get_display(attempt.platform, attempt.native, nullptr);
  if (display == EGL_NO_DISPLAY) throw fail("no display");
  if (eglInitialize(display, nullptr, nullptr) != EGL_TRUE) throw fail("the display does not start");
  const char* const extensions = eglQueryString(display, EGL_EXTENSIONS);
  if (!has_extension(extensions, "EGL_KHR_surfaceless_context")) throw fail("no contexts without a surface");
  if (!has_extension(extensions, "EGL_KHR_no_config_context") &&
      !has_extension(extensions, "EGL_MESA_configless_context")) {
    throw fail("no contexts without a config");
  }
  if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) throw fail("no desktop OpenGL");
  auto* const context = create_context(display, EGL_NO_CONTEXT);
  if (context == EGL_NO_CONTEXT) throw fail("no OpenGL 4.5 core context");
  auto made = std::make_unique<EglContext>(display, context, attempt.what);
  made->load();
  return made;
}

}  // namespace

std::unique_ptr<GlContext> make_egl_context(const GlOptions& options) {
  const char* const client_extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (!has_extension(client_extensions, "EGL_EXT_platform_base")) {
    throw Error(ExitCode::NoDevice, "EGL has no platform without windows", "install libegl-mesa0, or a vendor's EGL");
  }
  std::string failures;
  for (const Attempt& attempt : plan_attempts(options, client_extensions)) {
    try {
      std::unique_ptr<GlContext> context = try_attempt(attempt);
      if (!failures.empty()) log::info("drawing on {}, because {}", attempt.what, failures);
      return context;
    } catch (const Error& error) {
      if (!failures.empty()) failures += "; ";
      failures += error.what();
    }
  }
  throw Error(ExitCode::NoDevice, failures.empty() ? "EGL offers neither devices nor a surfaceless platform" : failures,
              "install libegl-mesa0 and libgl1-mesa-dri, or try --backend osmesa");
}

void release_egl() {
  if (eglGetCurrentContext() == EGL_NO_CONTEXT) return;
  eglMakeCurrent(eglGetCurrentDisplay(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

}  // namespace hpr
