#include "raster/gl_context.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>

#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "raster/egl_context.h"
#include "raster/osmesa_context.h"

namespace hpr {
namespace {

std::unique_ptr<GlContext> make_one(const std::string& backend, const GlOptions& options) {
  return backend == "egl" ? make_egl_context(options) : make_osmesa_context(options);
}

}  // namespace

std::vector<std::string> all_gl_backends() {
  return {"egl", "osmesa"};
}

void check_gl_backend(const std::string& backend) {
  std::vector<std::string> choices{"auto"};
  std::ranges::copy(all_gl_backends(), std::back_inserter(choices));
  if (std::ranges::find(choices, backend) != choices.end()) return;
  throw Error(ExitCode::Usage, fmt::format("unknown backend '{}'", printable(backend)),
              unknown_name_hint(backend, choices));
}

std::unique_ptr<GlContext> make_gl_context(const GlOptions& options) {
  check_gl_backend(options.backend);
  // llvmpipe reads it when its screen is made, which is with the first context.
  // NOLINTNEXTLINE(concurrency-mt-unsafe): contexts are made before a process starts threads that read the environment
  if (options.threads > 0) setenv("LP_NUM_THREADS", std::to_string(options.threads).c_str(), 1);

  if (options.backend != "auto") return make_one(options.backend, options);
  if (options.device >= 0) return make_one("egl", options);  // the only one with devices
  std::string failures;
  for (const std::string& backend : all_gl_backends()) {
    try {
      std::unique_ptr<GlContext> context = make_one(backend, options);
      if (!failures.empty()) log::warning("drawing by {} ({}), because {}", backend, context->description(), failures);
      return context;
    } catch (const Error& error) {
      if (!failures.empty()) failures += "; ";
      failures += error.what();
    }
  }
  throw Error(ExitCode::NoDevice, failures,
              "install a software renderer: apt-get install libegl1 libgl1-mesa-dri (or libosmesa6)");
}

}  // namespace hpr
