#pragma once

#include <GL/glcorearb.h>

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "raster/gl_context.h"

/// OpenGL as HPR calls it: the table of functions of a context, its errors, and objects that delete themselves.
namespace hpr {

/// Every OpenGL 4.5 core function HPR calls: its name without "gl", and its type in <GL/glcorearb.h>.
#define HPR_GL_FUNCTIONS(X)                                              \
  X(AttachShader, PFNGLATTACHSHADERPROC)                                 \
  X(BindBuffer, PFNGLBINDBUFFERPROC)                                     \
  X(BindFramebuffer, PFNGLBINDFRAMEBUFFERPROC)                           \
  X(BindVertexArray, PFNGLBINDVERTEXARRAYPROC)                           \
  X(CheckNamedFramebufferStatus, PFNGLCHECKNAMEDFRAMEBUFFERSTATUSPROC)   \
  X(ClearBufferfv, PFNGLCLEARBUFFERFVPROC)                               \
  X(ClearBufferuiv, PFNGLCLEARBUFFERUIVPROC)                             \
  X(ClipControl, PFNGLCLIPCONTROLPROC)                                   \
  X(ColorMask, PFNGLCOLORMASKPROC)                                       \
  X(CompileShader, PFNGLCOMPILESHADERPROC)                               \
  X(CreateBuffers, PFNGLCREATEBUFFERSPROC)                               \
  X(CreateFramebuffers, PFNGLCREATEFRAMEBUFFERSPROC)                     \
  X(CreateProgram, PFNGLCREATEPROGRAMPROC)                               \
  X(CreateRenderbuffers, PFNGLCREATERENDERBUFFERSPROC)                   \
  X(CreateShader, PFNGLCREATESHADERPROC)                                 \
  X(CreateVertexArrays, PFNGLCREATEVERTEXARRAYSPROC)                     \
  X(CullFace, PFNGLCULLFACEPROC)                                         \
  X(DeleteBuffers, PFNGLDELETEBUFFERSPROC)                               \
  X(DeleteFramebuffers, PFNGLDELETEFRAMEBUFFERSPROC)                     \
  X(DeleteProgram, PFNGLDELETEPROGRAMPROC)                               \
  X(DeleteRenderbuffers, PFNGLDELETERENDERBUFFERSPROC)                   \
  X(DeleteShader, PFNGLDELETESHADERPROC)                                 \
  X(DeleteVertexArrays, PFNGLDELETEVERTEXARRAYSPROC)                     \
  X(DepthFunc, PFNGLDEPTHFUNCPROC)                                       \
  X(DepthMask, PFNGLDEPTHMASKPROC)                                       \
  X(DepthRangef, PFNGLDEPTHRANGEFPROC)                                   \
  X(Disable, PFNGLDISABLEPROC)                                           \
  X(DrawElements, PFNGLDRAWELEMENTSPROC)                                 \
  X(Enable, PFNGLENABLEPROC)                                             \
  X(EnableVertexArrayAttrib, PFNGLENABLEVERTEXARRAYATTRIBPROC)           \
  X(Finish, PFNGLFINISHPROC)                                             \
  X(FrontFace, PFNGLFRONTFACEPROC)                                       \
  X(GetError, PFNGLGETERRORPROC)                                         \
  X(GetIntegerv, PFNGLGETINTEGERVPROC)                                   \
  X(GetProgramInfoLog, PFNGLGETPROGRAMINFOLOGPROC)                       \
  X(GetProgramiv, PFNGLGETPROGRAMIVPROC)                                 \
  X(GetShaderInfoLog, PFNGLGETSHADERINFOLOGPROC)                         \
  X(GetShaderiv, PFNGLGETSHADERIVPROC)                                   \
  X(GetString, PFNGLGETSTRINGPROC)                                       \
  X(LinkProgram, PFNGLLINKPROGRAMPROC)                                   \
  X(MultiDrawElementsIndirect, PFNGLMULTIDRAWELEMENTSINDIRECTPROC)       \
  X(NamedBufferData, PFNGLNAMEDBUFFERDATAPROC)                           \
  X(NamedBufferStorage, PFNGLNAMEDBUFFERSTORAGEPROC)                     \
  X(NamedFramebufferRenderbuffer, PFNGLNAMEDFRAMEBUFFERRENDERBUFFERPROC) \
  X(NamedRenderbufferStorage, PFNGLNAMEDRENDERBUFFERSTORAGEPROC)         \
  X(PixelStorei, PFNGLPIXELSTOREIPROC)                                   \
  X(PolygonMode, PFNGLPOLYGONMODEPROC)                                   \
  X(ReadPixels, PFNGLREADPIXELSPROC)                                     \
  X(Scissor, PFNGLSCISSORPROC)                                           \
  X(ShaderSource, PFNGLSHADERSOURCEPROC)                                 \
  X(UniformMatrix4fv, PFNGLUNIFORMMATRIX4FVPROC)                         \
  X(UseProgram, PFNGLUSEPROGRAMPROC)                                     \
  X(VertexArrayAttribBinding, PFNGLVERTEXARRAYATTRIBBINDINGPROC)         \
  X(VertexArrayAttribFormat, PFNGLVERTEXARRAYATTRIBFORMATPROC)           \
  X(VertexArrayAttribIFormat, PFNGLVERTEXARRAYATTRIBIFORMATPROC)         \
  X(VertexArrayBindingDivisor, PFNGLVERTEXARRAYBINDINGDIVISORPROC)       \
  X(VertexArrayElementBuffer, PFNGLVERTEXARRAYELEMENTBUFFERPROC)         \
  X(VertexArrayVertexBuffer, PFNGLVERTEXARRAYVERTEXBUFFERPROC)           \
  X(Viewport, PFNGLVIEWPORTPROC)

/// The functions of one context. Two contexts of one process may come from different libraries (EGL's vendor, OSMesa),
/// so each has its own table and nothing links against a libGL.
struct GlFunctions {
#define HPR_GL_MEMBER(name, type) type name = nullptr;
  HPR_GL_FUNCTIONS(HPR_GL_MEMBER)
#undef HPR_GL_MEMBER
};

using GlProc = void (*)();

/// Asks `get` for every function, under its full name. Throws Error (NoDevice) naming the first that is missing. EGL's
/// lookup returns a stub for any name, so a full table proves nothing: check the version as well.
[[nodiscard]] GlFunctions load_gl_functions(const std::function<GlProc(const char*)>& get);

/// Throws Error when GL reports one since it was last asked: Limit for GL_OUT_OF_MEMORY, else NoDevice. `where` ends
/// "... while", as in "uploading the scene".
void check_gl(const GlFunctions& gl, const std::string& where);

/// One GL name, deleted in the context it came from.
class GlObject {
 public:
  using Delete = void (*)(const GlFunctions& gl, GLuint name);

  GlObject() = default;
  GlObject(GlContext& context, GLuint name, Delete free) : context_(&context), name_(name), free_(free) {}
  GlObject(GlObject&& other) noexcept
      : context_(std::exchange(other.context_, nullptr)), name_(std::exchange(other.name_, 0)), free_(other.free_) {}
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(context_, other.context_);
    std::swap(name_, other.name_);
    std::swap(free_, other.free_);
    return *this;
  }
  GlObject(const GlObject&) = delete;
  GlObject& operator=(const GlObject&) = delete;
  ~GlObject();

  [[nodiscard]] GLuint name() const { return name_; }

 private:
  GlContext* context_ = nullptr;
  GLuint name_ = 0;
  Delete free_ = nullptr;
};

/// All of them expect the context to be current.
[[nodiscard]] GlObject make_buffer(GlContext& context);
[[nodiscard]] GlObject make_vertex_array(GlContext& context);
[[nodiscard]] GlObject make_renderbuffer(GlContext& context);
[[nodiscard]] GlObject make_framebuffer(GlContext& context);
/// Throws Error (NoDevice) with the driver's log when a shader is refused.
[[nodiscard]] GlObject make_program(GlContext& context, std::string_view vertex_source,
                                    std::string_view fragment_source);

}  // namespace hpr
