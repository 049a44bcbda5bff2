#include "scene/partial_mesh.h"

#include <algorithm>
#include <glm/common.hpp>
#include <limits>
#include <memory>
#include <utility>

#include "core/error.h"
#include "scene/requirements.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// The run that holds triangle `t`, or else the one after it.
const PartialMesh::Run* find_run(const PartialMesh& partial, std::uint32_t t) {
  const auto run = std::ranges::upper_bound(partial.runs, t, {}, &PartialMesh::Run::last);
  return run == partial.runs.end() ? nullptr : &*run;
}

/// What all vertices' arrays have of some vertices.
template <typename Value>
std::vector<Value> picked(const std::vector<Value>& values, std::span<const std::uint32_t> vertices) {
  std::vector<Value> picked;
  if (values.empty()) return picked;
  picked.reserve(vertices.size());
  for (const std::uint32_t vertex : vertices) picked.push_back(values[vertex]);
  return picked;
}

/// Some of a mesh's vertices, in the order they have there.
struct ChosenVertices {
  std::vector<std::uint32_t> vertices;  ///< of the mesh
  std::vector<std::uint32_t> numbers;   ///< by the mesh's vertex, of those that are chosen
};

/// The vertices that some triangles use, and with triangle 0 those that none does.
ChosenVertices vertices_of(const Mesh& mesh, std::span<const SurfaceRange> ranges) {
  ChosenVertices chosen;
  chosen.numbers.assign(mesh.positions.size(), 0);
  if (!ranges.empty() && ranges.front().first == 0) {
    std::ranges::fill(chosen.numbers, 1U);
    for (const glm::uvec3& triangle : mesh.triangles) {
      for (int corner = 0; corner < 3; ++corner) chosen.numbers[triangle[corner]] = 0;
    }
  }
  for (const SurfaceRange& range : ranges) {
    for (std::uint32_t t = range.first; t < range.last; ++t) {
      for (int corner = 0; corner < 3; ++corner) chosen.numbers[mesh.triangles[t][corner]] = 1;
    }
  }
  for (std::uint32_t vertex = 0; vertex < chosen.numbers.size(); ++vertex) {
    if (chosen.numbers[vertex] == 0) continue;
    chosen.numbers[vertex] = static_cast<std::uint32_t>(chosen.vertices.size());
    chosen.vertices.push_back(vertex);
  }
  return chosen;
}

}  // namespace

bool PartialMesh::holds(std::uint32_t t) const {
  const Run* const run = find_run(*this, t);
  return run != nullptr && run->first <= t;
}

std::uint32_t PartialMesh::index_of(std::uint32_t t) const {
  const Run* const run = find_run(*this, t);
  HPR_CHECK(run != nullptr && run->first <= t);
  return run->at + (t - run->first);
}

Mesh without_triangles(const Mesh& whole) {
  HPR_CHECK(!whole.partial);
  PartialMesh partial;
  partial.triangles = whole.triangle_count();
  partial.bounds = mesh_bounds(whole);
  for (const glm::vec3& p : whole.positions) partial.reach = glm::max(partial.reach, glm::abs(glm::dvec3(p)));
  partial.longest_edge = longest_edge(whole);
  partial.bytes = memory_of(whole);
  partial.content = content_hash(whole);
  const std::span<const glm::uvec3> triangles = whole.triangles;
  for (std::uint32_t first = 0; first < partial.triangles; first += kPartChunk) {
    partial.chunks.push_back(
        bounds_of(whole, triangles.subspan(first, std::min(kPartChunk, partial.triangles - first))));
  }
  Mesh mesh;
  mesh.name = whole.name;
  mesh.kind = whole.kind;
  mesh.material = whole.material;
  mesh.partial = std::make_shared<const PartialMesh>(std::move(partial));
  return mesh;
}

Mesh part_of_mesh(const Mesh& whole, std::span<const SurfaceRange> ranges, const PartialMesh& partial) {
  HPR_CHECK(!whole.partial && whole.triangle_count() == partial.triangles);
  const auto [vertices, numbers] = vertices_of(whole, ranges);
  Mesh part;
  part.name = whole.name;
  part.kind = whole.kind;
  part.material = whole.material;
  part.positions = picked(whole.positions, vertices);
  part.normals = picked(whole.normals, vertices);
  for (std::size_t set = 0; set < part.uvs.size(); ++set) part.uvs[set] = picked(whole.uvs[set], vertices);
  part.colors = picked(whole.colors, vertices);
  part.tangents = picked(whole.tangents, vertices);
  PartialMesh own = partial;
  own.runs.clear();
  std::size_t count = 0;
  for (const SurfaceRange& range : ranges) count += range.count();
  part.triangles.reserve(count);
  for (const SurfaceRange& range : ranges) {
    own.runs.push_back({range.first, range.last, static_cast<std::uint32_t>(part.triangles.size())});
    for (std::uint32_t t = range.first; t < range.last; ++t) {
      const glm::uvec3& corners = whole.triangles[t];
      part.triangles.emplace_back(numbers[corners.x], numbers[corners.y], numbers[corners.z]);
    }
  }
  part.partial = std::make_shared<const PartialMesh>(std::move(own));
  return part;
}

bool is_held_by_all(const Scene& scene, const Mesh& mesh) {
  if (mesh.kind != MeshKind::Triangles) return true;
  if (mesh.material >= scene.materials.size()) return false;  // the default, which comes last
  const Material& material = scene.materials[mesh.material];
  return material.alpha_mode == AlphaMode::Blend || material.thickness > 0.0F || emits(scene, material);
}

bool is_shared_out(const Scene& scene) {
  return std::ranges::any_of(scene.meshes, [](const Mesh& mesh) { return mesh.partial != nullptr; });
}

std::uint64_t whole_memory_of(const Scene& scene) {
  std::uint64_t bytes = memory_of(scene);
  for (const Mesh& mesh : scene.meshes) {
    if (mesh.partial) bytes += mesh.partial->bytes - memory_of(mesh);
  }
  return bytes;
}

}  // namespace hpr
