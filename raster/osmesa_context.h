#pragma once

#include <memory>

#include "raster/gl_context.h"

namespace hpr {

/// A context by libOSMesa, which is opened at run time: linked beside another libGL it draws nothing, silently. Throws
/// Error (NoDevice).
[[nodiscard]] std::unique_ptr<GlContext> make_osmesa_context(const GlOptions& options);

/// Releases OSMesa's context on this thread, if the library is loaded and has one. Call it only while EGL has none:
/// OSMesa takes another Mesa context for its own.
void release_osmesa();

}  // namespace hpr
