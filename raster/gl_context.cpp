#include "raster/gl_context.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <system_error>

#include "core/error.h"
#include "core/file.h"
#include "core/log.h"
#include "core/text.h"
#include "raster/gl.h"
#include "raster/gl_backends.h"
#include "scene/view.h"

namespace hpr {
namespace {

std::string gl_string(const GlFunctions& gl, GLenum name) {
  const GLubyte* const text = gl.GetString(name);
  return text == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(text));
}

std::unique_ptr<GlContext> make_one(const std::string& backend, const GlOptions& options) {
  return backend == "egl" ? make_egl_context(options) : make_osmesa_context(options);
}

}  // namespace

GlInfo query_gl_info(const GlFunctions& gl) {
  GlInfo info;
  info.renderer = gl_string(gl, GL_RENDERER);
  info.version = gl_string(gl, GL_VERSION);
  constexpr std::array<std::string_view, 4> kSoftware{"llvmpipe", "softpipe", "swrast", "SWR"};
  info.software = std::ranges::any_of(
      kSoftware, [&](std::string_view name) { return info.renderer.find(name) != std::string::npos; });

  GLint major = 0;
  GLint minor = 0;
  gl.GetIntegerv(GL_MAJOR_VERSION, &major);
  gl.GetIntegerv(GL_MINOR_VERSION, &minor);
  if (major * 10 + minor < 45) {
    throw Error(ExitCode::NoDevice, fmt::format("{} has OpenGL {}.{}; HPR needs 4.5", info.renderer, major, minor),
                "update the graphics driver");
  }
  std::array<GLint, 2> viewport{};
  GLint texture = 0;
  gl.GetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport.data());
  gl.GetIntegerv(GL_MAX_TEXTURE_SIZE, &texture);
  const GLint largest = std::min({viewport[0], viewport[1], texture});
  if (largest < kRasterLimit) {
    throw Error(ExitCode::NoDevice,
                fmt::format("{} draws at most {} pixels a side; HPR needs {}", info.renderer, largest, kRasterLimit));
  }
  return info;
}

std::vector<std::string> all_gl_backends() {
  return {"egl", "osmesa"};
}

void check_gl_backend(const std::string& backend) {
  std::vector<std::string> choices{"auto"};
  std::ranges::copy(all_gl_backends(), std::back_inserter(choices));
  if (std::ranges::find(choices, backend) != choices.end()) return;
  throw Error(ExitCode::Usage, fmt::format("unknown backend '{}'", printable(backend)),
              unknown_name_hint(backend, choices));
}

bool has_gpu_device() {
  constexpr std::array<std::string_view, 2> kDevices{"/dev/nvidiactl", "/dev/dxg"};  // of NVIDIA, of WSL
  std::error_code error;
  if (std::ranges::any_of(kDevices, [&](std::string_view path) { return std::filesystem::exists(path, error); })) {
    return true;
  }
  return !entries_of("/dev/dri").empty();
}

void limit_software_gl(int threads) {
  if (threads <= 0) return;
  // llvmpipe reads it when its screen is made, which is with the first context. 0 is no thread beside the caller's, and
  // so none to race with when a fence ends (Mesa 22.3). What the user says counts.
  const int helpers = threads == 1 ? 0 : threads;
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no thread reads the environment yet
  setenv("LP_NUM_THREADS", std::to_string(helpers).c_str(), 0);
}

std::unique_ptr<GlContext> make_gl_context(const GlOptions& options) {
  check_gl_backend(options.backend);
  limit_software_gl(options.threads);
  if (options.backend != "auto") return make_one(options.backend, options);
  if (options.device >= 0) return make_one("egl", options);  // the only one with devices
  std::string failures;
  for (const std::string& backend : all_gl_backends()) {
    try {
      std::unique_ptr<GlContext> context = make_one(backend, options);
      if (!failures.empty()) log::warning("drawing by {} ({}), because {}", backend, context->description(), failures);
      return context;
    } catch (const Error& error) {
      if (!failures.empty()) failures += "; ";
      failures += error.what();
    }
  }
  throw Error(ExitCode::NoDevice, failures,
              "install a software renderer: apt-get install libegl1 libgl1-mesa-dri (or libosmesa6)");
}

}  // namespace hpr
