#pragma once

#include <GL/glcorearb.h>

#include <chrono>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "raster/gl_context.h"

/// OpenGL as HPR calls it: the table of functions of a context, its errors, and objects that delete themselves.
namespace hpr {

/// Every OpenGL 4.5 core function HPR calls: its name without "gl", and its type in <GL/glcorearb.h>.
#define HPR_GL_FUNCTIONS(X)                                            \
  X(AttachShader, PFNGLATTACHSHADERPROC)                               \
  X(BindBuffer, PFNGLBINDBUFFERPROC)                                   \
  X(BindBufferRange, PFNGLBINDBUFFERRANGEPROC)                         \
  X(BindFramebuffer, PFNGLBINDFRAMEBUFFERPROC)                         \
  X(BindTextureUnit, PFNGLBINDTEXTUREUNITPROC)                         \
  X(BindVertexArray, PFNGLBINDVERTEXARRAYPROC)                         \
  X(CheckNamedFramebufferStatus, PFNGLCHECKNAMEDFRAMEBUFFERSTATUSPROC) \
  X(ClearBufferfv, PFNGLCLEARBUFFERFVPROC)                             \
  X(ClearBufferuiv, PFNGLCLEARBUFFERUIVPROC)                           \
  X(ClientWaitSync, PFNGLCLIENTWAITSYNCPROC)                           \
  X(ClipControl, PFNGLCLIPCONTROLPROC)                                 \
  X(ColorMask, PFNGLCOLORMASKPROC)                                     \
  X(CompileShader, PFNGLCOMPILESHADERPROC)                             \
  X(CopyNamedBufferSubData, PFNGLCOPYNAMEDBUFFERSUBDATAPROC)           \
  X(CreateBuffers, PFNGLCREATEBUFFERSPROC)                             \
  X(CreateFramebuffers, PFNGLCREATEFRAMEBUFFERSPROC)                   \
  X(CreateProgram, PFNGLCREATEPROGRAMPROC)                             \
  X(CreateShader, PFNGLCREATESHADERPROC)                               \
  X(CreateTextures, PFNGLCREATETEXTURESPROC)                           \
  X(CreateVertexArrays, PFNGLCREATEVERTEXARRAYSPROC)                   \
  X(CullFace, PFNGLCULLFACEPROC)                                       \
  X(DeleteBuffers, PFNGLDELETEBUFFERSPROC)                             \
  X(DeleteFramebuffers, PFNGLDELETEFRAMEBUFFERSPROC)                   \
  X(DeleteProgram, PFNGLDELETEPROGRAMPROC)                             \
  X(DeleteShader, PFNGLDELETESHADERPROC)                               \
  X(DeleteSync, PFNGLDELETESYNCPROC)                                   \
  X(DeleteTextures, PFNGLDELETETEXTURESPROC)                           \
  X(DeleteVertexArrays, PFNGLDELETEVERTEXARRAYSPROC)                   \
  X(DepthFunc, PFNGLDEPTHFUNCPROC)                                     \
  X(DepthMask, PFNGLDEPTHMASKPROC)                                     \
  X(DepthRangef, PFNGLDEPTHRANGEFPROC)                                 \
  X(Disable, PFNGLDISABLEPROC)                                         \
  X(DispatchCompute, PFNGLDISPATCHCOMPUTEPROC)                         \
  X(DrawElements, PFNGLDRAWELEMENTSPROC)                               \
  X(Enable, PFNGLENABLEPROC)                                           \
  X(EnableVertexArrayAttrib, PFNGLENABLEVERTEXARRAYATTRIBPROC)         \
  X(FenceSync, PFNGLFENCESYNCPROC)                                     \
  X(Finish, PFNGLFINISHPROC)                                           \
  X(FrontFace, PFNGLFRONTFACEPROC)                                     \
  X(GetError, PFNGLGETERRORPROC)                                       \
  X(GetIntegerv, PFNGLGETINTEGERVPROC)                                 \
  X(GetProgramInfoLog, PFNGLGETPROGRAMINFOLOGPROC)                     \
  X(GetProgramiv, PFNGLGETPROGRAMIVPROC)                               \
  X(GetShaderInfoLog, PFNGLGETSHADERINFOLOGPROC)                       \
  X(GetShaderiv, PFNGLGETSHADERIVPROC)                                 \
  X(GetString, PFNGLGETSTRINGPROC)                                     \
  X(LinkProgram, PFNGLLINKPROGRAMPROC)                                 \
  X(MapNamedBufferRange, PFNGLMAPNAMEDBUFFERRANGEPROC)                 \
  X(MemoryBarrier, PFNGLMEMORYBARRIERPROC)                             \
  X(MultiDrawElementsIndirect, PFNGLMULTIDRAWELEMENTSINDIRECTPROC)     \
  X(NamedBufferData, PFNGLNAMEDBUFFERDATAPROC)                         \
  X(NamedBufferStorage, PFNGLNAMEDBUFFERSTORAGEPROC)                   \
  X(NamedFramebufferTexture, PFNGLNAMEDFRAMEBUFFERTEXTUREPROC)         \
  X(PixelStorei, PFNGLPIXELSTOREIPROC)                                 \
  X(PolygonMode, PFNGLPOLYGONMODEPROC)                                 \
  X(ReadPixels, PFNGLREADPIXELSPROC)                                   \
  X(Scissor, PFNGLSCISSORPROC)                                         \
  X(ShaderSource, PFNGLSHADERSOURCEPROC)                               \
  X(TextureParameteri, PFNGLTEXTUREPARAMETERIPROC)                     \
  X(TextureStorage2D, PFNGLTEXTURESTORAGE2DPROC)                       \
  X(Uniform1i, PFNGLUNIFORM1IPROC)                                     \
  X(Uniform4i, PFNGLUNIFORM4IPROC)                                     \
  X(UniformMatrix4fv, PFNGLUNIFORMMATRIX4FVPROC)                       \
  X(UseProgram, PFNGLUSEPROGRAMPROC)                                   \
  X(VertexArrayAttribBinding, PFNGLVERTEXARRAYATTRIBBINDINGPROC)       \
  X(VertexArrayAttribFormat, PFNGLVERTEXARRAYATTRIBFORMATPROC)         \
  X(VertexArrayAttribIFormat, PFNGLVERTEXARRAYATTRIBIFORMATPROC)       \
  X(VertexArrayBindingDivisor, PFNGLVERTEXARRAYBINDINGDIVISORPROC)     \
  X(VertexArrayElementBuffer, PFNGLVERTEXARRAYELEMENTBUFFERPROC)       \
  X(VertexArrayVertexBuffer, PFNGLVERTEXARRAYVERTEXBUFFERPROC)         \
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
/// Two-dimensional, for single texels: neither filtered nor mipmapped.
[[nodiscard]] GlObject make_texture(GlContext& context);
[[nodiscard]] GlObject make_framebuffer(GlContext& context);
/// Throws Error (NoDevice) with the driver's log when a shader is refused.
[[nodiscard]] GlObject make_program(GlContext& context, std::string_view vertex_source,
                                    std::string_view fragment_source);
[[nodiscard]] GlObject make_compute_program(GlContext& context, std::string_view source);

/// How long GL may take for what was asked of it.
inline constexpr std::chrono::seconds kGlWaitLimit{30};

/// A point after all commands that its context was sent before it was made.
class GlFence {
 public:
  /// Expects the context to be current.
  explicit GlFence(GlContext& context);
  ~GlFence();
  GlFence(const GlFence&) = delete;
  GlFence& operator=(const GlFence&) = delete;

  /// Returns once those commands are done. Throws Error: Hang where they are not within `limit`, NoDevice where GL
  /// cannot wait. `doing`: as in "drawing".
  void wait(std::string_view doing, std::chrono::nanoseconds limit = kGlWaitLimit) const;

 private:
  GlContext& context_;
  GLsync sync_;
};

}  // namespace hpr
