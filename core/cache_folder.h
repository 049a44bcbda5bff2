#pragma once

#include <filesystem>

namespace hpr {

/// Where HPR keeps what it could work out again: $HPR_CACHE, else hpr/ in $XDG_CACHE_HOME or ~/.cache. Made when it is
/// not there. Throws Error (Io).
[[nodiscard]] std::filesystem::path cache_folder();

}  // namespace hpr
