#include "scene/gltf/context.h"

#include <fmt/format.h>

#include <utility>

#include "core/text.h"

namespace hpr {

GltfContext::GltfContext(std::string_view name, const SceneLimits& limits)
    : name_(printable(name, 300)), limits_(limits) {}

void GltfContext::fail(std::string_view where, std::string_view what, std::string_view hint, ExitCode code) const {
  const std::string message =
      where.empty() ? fmt::format("{}: {}", name_, what) : fmt::format("{}: {}: {}", name_, where, what);
  throw Error(code, message, std::string(hint));
}

void GltfContext::warn(std::string_view where, std::string_view what) {
  constexpr std::size_t kMaxWarnings = 100;
  std::string message = where.empty() ? std::string(what) : fmt::format("{}: {}", where, what);
  if (warnings_.size() >= kMaxWarnings) {
    ++dropped_;
    return;
  }
  if (seen_.insert(message).second) warnings_.push_back(std::move(message));
}

void GltfContext::warn_not_finite(std::string_view where, std::uint64_t count, std::size_t first_vertex) {
  if (count == 0) return;
  not_finite_ += count;
  warn(where, fmt::format("{} values are no finite numbers, the first at vertex {}; replaced", count, first_vertex));
}

void GltfContext::check_room(std::uint64_t bytes, std::string_view what) const {
  if (bytes > memory_left()) {
    fail("", fmt::format("{} would take the scene past the memory limit of {} bytes", what, limits_.memory_bytes),
         "draw less, or raise --limit-mem", ExitCode::Limit);
  }
}

void GltfContext::charge(std::uint64_t bytes, std::string_view what) {
  check_room(bytes, what);
  charged_ += bytes;
}

std::vector<std::string> GltfContext::take_warnings() {
  if (dropped_ > 0) warnings_.push_back(fmt::format("{} further warnings", std::exchange(dropped_, 0)));
  seen_.clear();
  return std::exchange(warnings_, {});
}

}  // namespace hpr
