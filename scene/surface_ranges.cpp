#include "scene/surface_ranges.h"

#include <algorithm>

namespace hpr {

std::vector<SurfaceRange> merged_ranges(std::vector<SurfaceRange> ranges, std::uint32_t end) {
  for (SurfaceRange& range : ranges) range.last = std::min(range.last, end);
  std::erase_if(ranges, [](const SurfaceRange& range) { return range.first >= range.last; });
  std::ranges::sort(ranges, {}, &SurfaceRange::first);
  std::vector<SurfaceRange> result;
  for (const SurfaceRange& range : ranges) {
    if (!result.empty() && range.first <= result.back().last) {
      result.back().last = std::max(result.back().last, range.last);
    } else {
      result.push_back(range);
    }
  }
  return result;
}

std::vector<InstanceRange> split_by_instance(const Scene& scene, const std::vector<SurfaceRange>& ranges) {
  std::vector<InstanceRange> parts;
  for (const SurfaceRange& range : ranges) {
    for (std::uint32_t instance = locate_surface(scene, range.first).instance; instance < scene.instances.size();
         ++instance) {
      const std::uint32_t base = scene.instances[instance].first_surface;
      if (base >= range.last) break;
      const auto count = static_cast<std::uint32_t>(scene.mesh_of(scene.instances[instance]).triangles.size());
      const std::uint32_t first = std::max(range.first, base) - base;
      const std::uint32_t last = std::min(range.last - base, count);
      if (first < last) parts.push_back({instance, {first, last}});
    }
  }
  return parts;
}

std::vector<SurfaceRange> common_ranges(const std::vector<SurfaceRange>& a, const std::vector<SurfaceRange>& b) {
  std::vector<SurfaceRange> common;
  for (std::size_t i = 0, k = 0; i < a.size() && k < b.size();) {
    const SurfaceRange both{std::max(a[i].first, b[k].first), std::min(a[i].last, b[k].last)};
    if (both.first < both.last) common.push_back(both);
    a[i].last < b[k].last ? ++i : ++k;
  }
  return common;
}

std::vector<SurfaceRange> covering_surfaces(const Scene& scene, bool alpha_tested) {
  std::vector<SurfaceRange> ranges;
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    const bool is_alpha_tested = scene.materials[mesh.material].alpha_mode != AlphaMode::Opaque;
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    if (is_alpha_tested != alpha_tested || count == 0) continue;
    if (!ranges.empty() && ranges.back().last == instance.first_surface) {
      ranges.back().last += count;
    } else {
      ranges.push_back({instance.first_surface, instance.first_surface + count});
    }
  }
  return ranges;
}

}  // namespace hpr
