#include "raster/gl_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "core/error.h"
#include "raster/gl_functions.h"
#include "scene/view.h"

namespace hpr {
namespace {

std::string gl_string(const GlFunctions& gl, GLenum name) {
  const GLubyte* const text = gl.GetString(name);
  return text == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(text));
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
  GLint renderbuffer = 0;
  gl.GetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport.data());
  gl.GetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &renderbuffer);
  const GLint largest = std::min({viewport[0], viewport[1], renderbuffer});
  if (largest < kRasterLimit) {
    throw Error(ExitCode::NoDevice,
                fmt::format("{} draws at most {} pixels a side; HPR needs {}", info.renderer, largest, kRasterLimit));
  }
  return info;
}

}  // namespace hpr
