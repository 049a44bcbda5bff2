#include "raster/gl.h"

#include <fmt/format.h>

#include <exception>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/log.h"

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

using GetParameter = void (*)(GLuint, GLenum, GLint*);
using GetLog = void (*)(GLuint, GLsizei, GLsizei*, GLchar*);

std::string read_log(GLuint name, GetParameter parameter, GetLog log) {
  GLint length = 0;
  parameter(name, GL_INFO_LOG_LENGTH, &length);
  std::string text(static_cast<std::size_t>(length > 0 ? length : 0), '\0');
  GLsizei written = 0;
  if (!text.empty()) log(name, length, &written, text.data());
  text.resize(static_cast<std::size_t>(written));
  return text;
}

GlObject compile(GlContext& context, GLenum kind, std::string_view source) {
  const GlFunctions& gl = context.gl();
  GlObject shader(context, gl.CreateShader(kind), [](const GlFunctions& f, GLuint name) { f.DeleteShader(name); });
  const GLchar* const text = source.data();
  const auto length = static_cast<GLint>(source.size());
  gl.ShaderSource(shader.name(), 1, &text, &length);
  gl.CompileShader(shader.name());
  GLint compiled = GL_FALSE;
  gl.GetShaderiv(shader.name(), GL_COMPILE_STATUS, &compiled);
  if (compiled != GL_TRUE) {
    throw Error(ExitCode::NoDevice, fmt::format("the graphics driver refuses a shader: {}",
                                                read_log(shader.name(), gl.GetShaderiv, gl.GetShaderInfoLog)));
  }
  return shader;
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

GlObject::~GlObject() {
  if (context_ == nullptr || name_ == 0) return;
  try {
    context_->make_current();
    free_(context_->gl(), name_);
  } catch (const std::exception& error) {
    log::warning("a GL object is left behind: {}", error.what());
  }
}

GlObject make_buffer(GlContext& context) {
  GLuint name = 0;
  context.gl().CreateBuffers(1, &name);
  return {context, name, [](const GlFunctions& gl, GLuint n) { gl.DeleteBuffers(1, &n); }};
}

GlObject make_vertex_array(GlContext& context) {
  GLuint name = 0;
  context.gl().CreateVertexArrays(1, &name);
  return {context, name, [](const GlFunctions& gl, GLuint n) { gl.DeleteVertexArrays(1, &n); }};
}

GlObject make_renderbuffer(GlContext& context) {
  GLuint name = 0;
  context.gl().CreateRenderbuffers(1, &name);
  return {context, name, [](const GlFunctions& gl, GLuint n) { gl.DeleteRenderbuffers(1, &n); }};
}

GlObject make_framebuffer(GlContext& context) {
  GLuint name = 0;
  context.gl().CreateFramebuffers(1, &name);
  return {context, name, [](const GlFunctions& gl, GLuint n) { gl.DeleteFramebuffers(1, &n); }};
}

GlObject make_program(GlContext& context, std::string_view vertex_source, std::string_view fragment_source) {
  const GlFunctions& gl = context.gl();
  const GlObject vertex = compile(context, GL_VERTEX_SHADER, vertex_source);
  const GlObject fragment = compile(context, GL_FRAGMENT_SHADER, fragment_source);
  GlObject program(context, gl.CreateProgram(), [](const GlFunctions& f, GLuint name) { f.DeleteProgram(name); });
  gl.AttachShader(program.name(), vertex.name());
  gl.AttachShader(program.name(), fragment.name());
  gl.LinkProgram(program.name());
  GLint linked = GL_FALSE;
  gl.GetProgramiv(program.name(), GL_LINK_STATUS, &linked);
  if (linked != GL_TRUE) {
    throw Error(ExitCode::NoDevice, fmt::format("the graphics driver cannot link a program: {}",
                                                read_log(program.name(), gl.GetProgramiv, gl.GetProgramInfoLog)));
  }
  return program;
}

}  // namespace hpr
