#include "scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <span>
#include <vector>

#include "core/error.h"

namespace hpr {
namespace {

/// Between the corners of a box, along its longest side.
double extent_of(const Bounds& box) {
  const glm::dvec3 size = 0.5 * box.high - 0.5 * box.low;
  return 2.0 * std::max({size.x, size.y, size.z});
}

glm::dvec3 center_of(const Bounds& box) {
  return 0.5 * box.high + 0.5 * box.low;
}

/// The upper median of some values.
double median_of(std::vector<double>& values) {
  const auto median = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, median);
  return *median;
}

/// The center of most of the small things in a scene, axis by axis, if they stand closely together: half of them within
/// a thousandth of the scene. Else, and where that is about the scene's center, this.
glm::dvec3 detail_center_of(const Bounds& bounds, std::span<const Bounds> boxes) {
  constexpr double kSmall = 1e-3;
  const glm::dvec3 center = center_of(bounds);
  const double small = kSmall * extent_of(bounds);
  std::array<std::vector<double>, 3> centers;
  for (const Bounds& box : boxes) {
    if (!(extent_of(box) <= small)) continue;
    for (int axis = 0; axis < 3; ++axis) centers.at(static_cast<std::size_t>(axis)).push_back(center_of(box)[axis]);
  }
  if (centers[0].empty()) return center;
  glm::dvec3 detail(0.0);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double>& values = centers.at(static_cast<std::size_t>(axis));
    detail[axis] = median_of(values);
    for (double& value : values) value = std::abs(value - detail[axis]);
    if (!(median_of(values) <= small)) return center;
  }
  return glm::distance(detail, center) > small ? detail : center;
}

}  // namespace

void finish_scene(Scene& scene) {
  if (scene.materials.empty()) scene.materials.emplace_back();
  constexpr std::uint64_t kMaxTriangles = std::numeric_limits<std::uint32_t>::max() - std::uint64_t{1};

  std::vector<Bounds> boxes;
  boxes.reserve(scene.meshes.size());
  for (const Mesh& mesh : scene.meshes) boxes.push_back(mesh_bounds(mesh));

  std::uint64_t triangles = 0;
  Bounds bounds = empty_bounds();
  std::vector<Bounds> placed;
  for (Instance& instance : scene.instances) {
    HPR_CHECK(instance.mesh < scene.meshes.size());
    instance.first_surface = static_cast<std::uint32_t>(triangles);
    triangles += scene.mesh_of(instance).triangle_count();
    if (triangles > kMaxTriangles) {
      throw Error(ExitCode::Limit, fmt::format("the scene has more than {} triangles after instancing", kMaxTriangles),
                  "surface ids have 32 bits; draw fewer instances or a coarser level of detail");
    }
    if (scene.mesh_of(instance).triangle_count() == 0) continue;
    const Bounds box = transformed(instance.to_world, boxes[instance.mesh]);
    bounds = united(bounds, box);
    placed.push_back(box);
  }
  scene.triangles = static_cast<std::uint32_t>(triangles);
  scene.bounds = triangles > 0 ? bounds : Bounds{};
  scene.detail_center = detail_center_of(scene.bounds, placed);
}

std::uint64_t mesh_triangles(const Scene& scene) {
  std::uint64_t triangles = 0;
  for (const Mesh& mesh : scene.meshes) triangles += mesh.triangle_count();
  return triangles;
}

std::uint64_t memory_of(const Mesh& mesh) {
  return (mesh.positions.size() + mesh.normals.size()) * sizeof(glm::vec3) +
         (mesh.colors.size() + mesh.tangents.size()) * sizeof(glm::vec4) +
         (mesh.uvs[0].size() + mesh.uvs[1].size()) * sizeof(glm::vec2) + mesh.triangles.size() * sizeof(glm::uvec3);
}

std::uint64_t memory_of(const Scene& scene) {
  std::uint64_t bytes = scene.instances.size() * sizeof(Instance);
  for (const Mesh& mesh : scene.meshes) bytes += memory_of(mesh);
  for (const Texture& texture : scene.textures) bytes += texture.image.is_reachable() ? texture.image.size_bytes() : 0;
  return bytes;
}

SurfaceLocation locate_surface(const Scene& scene, std::uint32_t surface) {
  HPR_CHECK(surface < scene.triangles);
  // The last instance that starts at or before the id; empty instances before it start there too and are skipped.
  const auto after = std::ranges::upper_bound(scene.instances, surface, {}, &Instance::first_surface);
  const auto index = static_cast<std::uint32_t>(after - scene.instances.begin()) - 1;
  return {index, surface - scene.instances[index].first_surface};
}

bool is_mirrored(const Instance& instance) {
  const glm::dmat3 linear(instance.to_world);
  double largest = 1e-300;  // scaled by it, tiny and huge matrices keep the sign of their determinant
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) largest = std::max(largest, std::abs(linear[column][row]));
  }
  return glm::determinant(linear / largest) < 0.0;
}

glm::dvec3 world_position(const Instance& instance, const glm::vec3& position) {
  return {instance.to_world * glm::dvec4(position, 1.0)};
}

std::vector<glm::vec3> smooth_normals(const std::vector<glm::vec3>& positions,
                                      const std::vector<glm::uvec3>& triangles) {
  std::vector<glm::dvec3> sums(positions.size(), glm::dvec3(0.0));
  for (const glm::uvec3& t : triangles) {
    const glm::dvec3 v0(positions[t.x]);
    const glm::dvec3 normal = glm::cross(glm::dvec3(positions[t.y]) - v0, glm::dvec3(positions[t.z]) - v0);
    for (int corner = 0; corner < 3; ++corner) sums[t[corner]] += normal;
  }
  std::vector<glm::vec3> normals(positions.size());
  std::ranges::transform(sums, normals.begin(), [](const glm::dvec3& sum) {
    const double length = glm::length(sum);
    return length > 0.0 && std::isfinite(length) ? glm::vec3(sum / length) : glm::vec3(0.0F, 0.0F, 1.0F);
  });
  return normals;
}

Bounds empty_bounds() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {glm::dvec3(kInfinity), glm::dvec3(-kInfinity)};
}

Bounds united(const Bounds& a, const Bounds& b) {
  return {glm::min(a.low, b.low), glm::max(a.high, b.high)};
}

double longest_edge(const Mesh& mesh) {
  if (mesh.partial) return mesh.partial->longest_edge;
  double longest = 0.0;
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t.x]);
    const glm::dvec3 b(mesh.positions[t.y]);
    const glm::dvec3 c(mesh.positions[t.z]);
    longest = std::max({longest, glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)});
  }
  return longest;
}

Bounds mesh_bounds(const Mesh& mesh) {
  if (mesh.partial) return mesh.partial->bounds;
  return bounds_of(mesh, mesh.triangles);
}

Bounds bounds_of(const Mesh& mesh, std::span<const glm::uvec3> triangles) {
  Bounds bounds = empty_bounds();
  for (const glm::uvec3& triangle : triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      const glm::dvec3 p(mesh.positions[triangle[corner]]);
      bounds.low = glm::min(bounds.low, p);
      bounds.high = glm::max(bounds.high, p);
    }
  }
  return bounds;
}

Bounds transformed(const glm::dmat4& matrix, const Bounds& box) {
  const glm::dvec3 half = 0.5 * (box.high - box.low);
  const glm::dvec3 center = glm::dvec3(matrix * glm::dvec4(0.5 * (box.low + box.high), 1.0));
  glm::dvec3 reach(0.0);
  for (int axis = 0; axis < 3; ++axis) reach += glm::abs(glm::dvec3(matrix[axis])) * half[axis];
  return {center - reach, center + reach};
}

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
      const std::uint32_t count = scene.mesh_of(scene.instances[instance]).triangle_count();
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
    const std::uint32_t count = mesh.triangle_count();
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
