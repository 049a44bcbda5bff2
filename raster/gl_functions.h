#pragma once

#include <GL/glcorearb.h>

#include <functional>
#include <string>

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

}  // namespace hpr
