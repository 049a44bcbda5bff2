#pragma once

#include <memory>

#include "raster/gl_context.h"

namespace hpr {

/// A context by EGL without surfaces (EGL_KHR_surfaceless_context, EGL_KHR_no_config_context): on the device asked for,
/// on a hardware device chosen by local rank, or on Mesa's surfaceless platform. Throws Error (NoDevice) with every
/// attempt.
[[nodiscard]] std::unique_ptr<GlContext> make_egl_context(const GlOptions& options);

/// Releases whatever context EGL holds on this thread; EGL does not notice when OSMesa takes the thread over.
void release_egl();

}  // namespace hpr
