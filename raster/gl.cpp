#include "raster/gl.h"

#include <fmt/format.h>

#include <chrono>
#include <exception>
#include <initializer_list>
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

GlObject link(GlContext& context, std::initializer_list<GLuint> shaders) {
  const GlFunctions& gl = context.gl();
  GlObject program(context, gl.CreateProgram(), [](const GlFunctions& f, GLuint name) { f.DeleteProgram(name); });
  for (const GLuint shader : shaders) gl.AttachShader(program.name(), shader);
  gl.LinkProgram(program.name());
  GLint linked = GL_FALSE;
  gl.GetProgramiv(program.name(), GL_LINK_STATUS, &linked);
  if (linked != GL_TRUE) {
    throw Error(ExitCode::NoDevice, fmt::format("the graphics driver cannot link a program: {}",
                                                read_log(program.name(), gl.GetProgramiv, gl.GetProgramInfoLog)));
  }
  return program;
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

GlObject make_texture(GlContext& context) {
  GLuint name = 0;
  context.gl().CreateTextures(GL_TEXTURE_2D, 1, &name);
  context.gl().TextureParameteri(name, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  context.gl().TextureParameteri(name, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  return {context, name, [](const GlFunctions& gl, GLuint n) { gl.DeleteTextures(1, &n); }};
}

GlObject make_framebuffer(GlContext& context) {
  GLuint name = 0;
  context.gl().CreateFramebuffers(1, &name);
  return {context, name, [](const GlFunctions& gl, GLuint n) { gl.DeleteFramebuffers(1, &n); }};
}

GlObject make_program(GlContext& context, std::string_view vertex_source, std::string_view fragment_source) {
  const GlObject vertex = compile(context, GL_VERTEX_SHADER, vertex_source);
  const GlObject fragment = compile(context, GL_FRAGMENT_SHADER, fragment_source);
  return link(context, {vertex.name(), fragment.name()});
}

GlObject make_compute_program(GlContext& context, std::string_view source) {
  const GlObject shader = compile(context, GL_COMPUTE_SHADER, source);
  return link(context, {shader.name()});
}

GlFence::GlFence(GlContext& context)
    : context_(context), sync_(context.gl().FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)) {}

GlFence::~GlFence() {
  try {
    context_.make_current();
    context_.gl().DeleteSync(sync_);
  } catch (const std::exception& error) {
    log::warning("a GL fence is left behind: {}", error.what());
  }
}

void GlFence::wait(std::string_view doing, std::chrono::nanoseconds limit) const {
  const auto limit_ns = static_cast<GLuint64>(limit.count());
  switch (context_.gl().ClientWaitSync(sync_, GL_SYNC_FLUSH_COMMANDS_BIT, limit_ns)) {
    case GL_ALREADY_SIGNALED:
    case GL_CONDITION_SATISFIED:
      return;
    case GL_TIMEOUT_EXPIRED:
      throw Error(ExitCode::Hang,
                  fmt::format("OpenGL has not answered for {} s while {}",
                              std::chrono::duration_cast<std::chrono::seconds>(limit).count(), doing),
                  "see what the system's log says of it (dmesg)");
    default:
      throw Error(ExitCode::NoDevice, fmt::format("OpenGL cannot wait while {}", doing),
                  "try another driver with --backend egl or --backend osmesa");
  }
}

}  // namespace hpr
