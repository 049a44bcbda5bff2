#include "raster/gl_functions.h"

#include <fmt/format.h>

#include <string_view>

#include "core/error.h"

namespace hpr {
namespace {

std::string_view error_name(GLenum error) {
  switch (error) {
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
      return "GL_OUT_OF_MEMORY";
    case GL_CONTEXT_LOST:
      return "GL_CONTEXT_LOST";
    default:
      return "an unknown error";
  }
}

}  // namespace

GlFunctions load_gl_functions(const std::function<GlProc(const char*)>& get) {
  GlFunctions gl;
  const auto load = [&]<typename Function>(Function& function, const char* name) {
    function = reinterpret_cast<Function>(get(name));
    if (function != nullptr) return;
    throw Error(ExitCode::NoDevice, fmt::format("OpenGL lacks the function {}", name),
                "HPR needs OpenGL 4.5: update the graphics driver");
  };
#define HPR_GL_LOAD(name, type) load(gl.name, "gl" #name);
  HPR_GL_FUNCTIONS(HPR_GL_LOAD)
#undef HPR_GL_LOAD
  return gl;
}

void check_gl(const GlFunctions& gl, const std::string& where) {
  const GLenum first = gl.GetError();
  if (first == GL_NO_ERROR) return;
  bool memory = first == GL_OUT_OF_MEMORY;
  // Each distributed part of GL may hold one flag. A lost context reports forever, so the drain has an end.
  for (int i = 0; i < 16; ++i) {
    const GLenum error = gl.GetError();
    if (error == GL_NO_ERROR) break;
    memory = memory || error == GL_OUT_OF_MEMORY;
  }
  if (memory) {
    throw Error(ExitCode::Limit, fmt::format("OpenGL ran out of memory while {}", where),
                "use more ranks (each holds a smaller share), a coarser scene or smaller screens");
  }
  throw Error(ExitCode::NoDevice, fmt::format("OpenGL reports {} while {}", error_name(first), where),
              "try another driver with --backend egl or --backend osmesa");
}

}  // namespace hpr
