#include "core/cache_folder.h"

#include <fmt/format.h>

#include <cstdlib>
#include <string>
#include <system_error>

#include "core/error.h"

namespace hpr {
namespace {

std::string variable(const char* name) {
  const char* const value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): nothing sets variables
  return value == nullptr ? std::string() : std::string(value);
}

std::filesystem::path chosen_folder() {
  if (const std::string own = variable("HPR_CACHE"); !own.empty()) return own;
  if (const std::string shared = variable("XDG_CACHE_HOME"); !shared.empty()) {
    return std::filesystem::path(shared) / "hpr";
  }
  if (const std::string home = variable("HOME"); !home.empty()) return std::filesystem::path(home) / ".cache" / "hpr";
  throw Error(ExitCode::Io, "there is no folder to keep things in: neither HPR_CACHE nor HOME is set",
              "set HPR_CACHE to a folder");
}

}  // namespace

std::filesystem::path cache_folder() {
  std::filesystem::path folder = chosen_folder();
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) {
    throw Error(ExitCode::Io, fmt::format("cannot make '{}': {}", folder.string(), failed.message()),
                "set HPR_CACHE to a folder that can be written to");
  }
  return folder;
}

}  // namespace hpr
