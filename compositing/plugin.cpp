#include "compositing/plugin.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include "core/error.h"
#include "core/text.h"

namespace hpr {

void load_compositor_plugin(const std::filesystem::path& path) {
  const std::string name = printable(path.string());
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) {
    throw Error(ExitCode::Io, fmt::format("--plugin: {} is no file", name), "name the .so that was built");
  }
  // A path without a slash would be looked for where libraries are.
  void* const object = ::dlopen(std::filesystem::absolute(path).c_str(), RTLD_NOW | RTLD_LOCAL);
  if (object == nullptr) {
    throw Error(ExitCode::BadInput, fmt::format("--plugin: cannot open {}: {}", name, printable(::dlerror(), 400)),
                "name a shared object that was built against this installation");
  }
  void* const symbol = ::dlsym(object, "hpr_compositor_plugin");
  if (symbol == nullptr) {
    throw Error(ExitCode::BadInput, fmt::format("--plugin: {} brings no strategy", name),
                "its source must hold HPR_COMPOSITOR_PLUGIN(Strategy)");
  }
  const CompositorPlugin* const plugin = reinterpret_cast<decltype(&hpr_compositor_plugin)>(symbol)();
  if (std::string_view(plugin->built_for) != kBuild) {
    throw Error(
        ExitCode::BadInput,
        fmt::format("--plugin: {} was built for HPR {}, this is {}", name, printable(plugin->built_for), kBuild),
        "build it again, against this installation");
  }
  try {
    register_compositor(plugin->make);
  } catch (const Error& error) {
    throw Error(error.code(), fmt::format("--plugin: {}: {}", name, error.what()), error.hint());
  }
}

}  // namespace hpr
