#pragma once

#include <memory>
#include <string>

#include "raster/gl_context.h"

/// What gl_context.cpp and the files of the two backends share; others make contexts by make_gl_context.
namespace hpr {

/// What a context says of itself.
struct GlInfo {
  std::string renderer;
  std::string version;
  bool software = false;
};

/// Asks the current context. Throws Error (NoDevice) when it is older than OpenGL 4.5, or cannot hold the screens a
/// view may have (kRasterLimit pixels a side).
[[nodiscard]] GlInfo query_gl_info(const GlFunctions& gl);

/// A context by EGL without surfaces (EGL_KHR_surfaceless_context, EGL_KHR_no_config_context): on the device asked for,
/// on a hardware device chosen by local rank, or on Mesa's surfaceless platform. Throws Error (NoDevice) with every
/// attempt.
[[nodiscard]] std::unique_ptr<GlContext> make_egl_context(const GlOptions& options);

/// Releases whatever context EGL holds on this thread; EGL does not notice when OSMesa takes the thread over.
void release_egl();

/// A context by libOSMesa, which is opened at run time: linked beside another libGL it draws nothing, silently. Throws
/// Error (NoDevice).
[[nodiscard]] std::unique_ptr<GlContext> make_osmesa_context(const GlOptions& options);

/// Releases OSMesa's context on this thread, if the library is loaded and has one. Call it only while EGL has none:
/// OSMesa takes another Mesa context for its own.
void release_osmesa();

}  // namespace hpr
