#include "app/options/globals.h"

#include <fmt/format.h>

#include <algorithm>

#include "cluster/transport/communicator.h"
#include "core/error.h"
#include "core/units.h"

namespace hpr {

SceneLimits Globals::scene_limits() const {
  SceneLimits limits;
  if (!limit_mem.empty()) {
    const auto bytes = parse_bytes(limit_mem);
    if (!bytes) throw Error(ExitCode::Usage, fmt::format("--limit-mem: '{}' is no size", limit_mem), "write e.g. 4GiB");
    limits.memory_bytes = *bytes;
    limits.file_bytes = std::min(limits.file_bytes, *bytes);
  }
  if (!limit_image.empty()) {
    const auto extent = parse_extent(limit_image);
    if (!extent)
      throw Error(ExitCode::Usage, fmt::format("--limit-image: '{}' is no size", limit_image), "write e.g. 8192x8192");
    limits.image.side = std::max(extent->first, extent->second);
    limits.image.pixels = static_cast<std::uint64_t>(extent->first) * static_cast<std::uint64_t>(extent->second);
  }
  return limits;
}

ImageLimits Globals::picture_limits() const {
  return limit_image.empty() ? kPictureLimits : scene_limits().image;
}

std::chrono::nanoseconds Globals::hang_limit() const {
  if (hang_timeout.empty()) return kHangTimeout;
  const auto limit = parse_duration(hang_timeout);
  if (!limit || *limit <= std::chrono::nanoseconds::zero()) {
    throw Error(ExitCode::Usage, fmt::format("--hang-timeout: '{}' is no duration", hang_timeout), "write e.g. 30s");
  }
  return *limit;
}

}  // namespace hpr
