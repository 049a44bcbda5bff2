#include "app/doctor/graphics_checks.h"

#include <fmt/format.h>

#include "core/error.h"
#include "raster/gl_context.h"

namespace hpr {
namespace {

Finding try_backend(const std::string& backend) {
  try {
    const auto context = make_gl_context({.backend = backend, .device = -1, .local_rank = 0, .threads = 1});
    if (context->software()) {
      return {backend, FindingStatus::Ok, context->description() + " (software: pictures are right, frames are slow)",
              ""};
    }
    return {backend, FindingStatus::Ok, context->description(), ""};
  } catch (const Error& error) {
    return {backend, FindingStatus::Warn, error.what(), error.hint()};
  }
}

/// One backend is enough; without any nothing can be drawn.
Finding any_backend() {
  const auto context = make_gl_context({.backend = "auto", .device = -1, .local_rank = 0, .threads = 1});
  return {"OpenGL", FindingStatus::Ok, fmt::format("--backend auto takes {}", context->name()), ""};
}

}  // namespace

std::vector<Check> graphics_checks() {
  std::vector<Check> checks;
  for (const std::string& backend : all_gl_backends()) {
    checks.push_back({fmt::format("OpenGL by {}", backend), [backend] { return try_backend(backend); }});
  }
  checks.push_back({"OpenGL", any_backend});
  return checks;
}

}  // namespace hpr
