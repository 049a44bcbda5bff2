#include "rt/trace/remote_triangles.h"

#include <algorithm>
#include <utility>

#include "core/error.h"

namespace hpr {
namespace {

/// A bit of TriangleRecord::arrays.
enum Array : std::uint32_t { Uv0 = 1, Uv1 = 2, Colors = 4, Tangents = 8 };

template <typename Value>
void read_corners(const std::vector<Value>& values, const glm::uvec3& corners, std::array<Value, 3>& to) {
  for (std::size_t i = 0; i < 3; ++i) to[i] = values[corners[static_cast<int>(i)]];
}

template <typename Value>
std::uint32_t read_if_any(const std::vector<Value>& values, const glm::uvec3& corners, Array bit,
                          std::array<Value, 3>& to) {
  if (values.empty()) return 0;
  read_corners(values, corners, to);
  return bit;
}

template <typename Value>
std::vector<Value> listed(const std::array<Value, 3>& values) {
  return {values.begin(), values.end()};
}

}  // namespace

TriangleRecord record_of(const Scene& scene, std::uint32_t surface) {
  const SurfaceLocation location = locate_surface(scene, surface);
  const Mesh& mesh = scene.mesh_of(scene.instances[location.instance]);
  const glm::uvec3& corners = mesh.triangle(location.triangle);
  TriangleRecord record;
  read_corners(mesh.positions, corners, record.positions);
  read_corners(mesh.normals, corners, record.normals);
  record.arrays = read_if_any(mesh.uvs[0], corners, Uv0, record.uvs[0]) |
                  read_if_any(mesh.uvs[1], corners, Uv1, record.uvs[1]) |
                  read_if_any(mesh.colors, corners, Colors, record.colors) |
                  read_if_any(mesh.tangents, corners, Tangents, record.tangents);
  return record;
}

std::shared_ptr<const Mesh> mesh_of(const TriangleRecord& record, std::uint32_t material) {
  auto mesh = std::make_shared<Mesh>();
  mesh->positions = listed(record.positions);
  mesh->normals = listed(record.normals);
  if ((record.arrays & Uv0) != 0) mesh->uvs[0] = listed(record.uvs[0]);
  if ((record.arrays & Uv1) != 0) mesh->uvs[1] = listed(record.uvs[1]);
  if ((record.arrays & Colors) != 0) mesh->colors = listed(record.colors);
  if ((record.arrays & Tangents) != 0) mesh->tangents = listed(record.tangents);
  mesh->triangles = {{0, 1, 2}};
  mesh->material = material;
  return mesh;
}

std::shared_ptr<const Mesh> RemoteTriangles::find(std::uint32_t surface) {
  Shard& shard = shard_of(surface);
  const std::lock_guard lock(shard.mutex);
  if (const auto found = shard.recent.find(surface); found != shard.recent.end()) return found->second;
  const auto found = shard.older.find(surface);
  if (found == shard.older.end()) return nullptr;
  std::shared_ptr<const Mesh> triangle = found->second;
  keep(shard, surface, triangle);
  return triangle;
}

void RemoteTriangles::add(std::uint32_t surface, std::shared_ptr<const Mesh> triangle) {
  Shard& shard = shard_of(surface);
  const std::lock_guard lock(shard.mutex);
  keep(shard, surface, std::move(triangle));
}

void RemoteTriangles::keep(Shard& shard, std::uint32_t surface, std::shared_ptr<const Mesh> triangle) const {
  if (shard.recent.size() >= per_shard_) shard.older = std::exchange(shard.recent, {});
  shard.recent.insert_or_assign(surface, std::move(triangle));
}

SurfaceOwners::SurfaceOwners(std::span<const std::vector<SurfaceRange>> parts) {
  for (std::size_t holder = 0; holder < parts.size(); ++holder) {
    for (const SurfaceRange& range : parts[holder]) ranges_.push_back({range.first, range.last, holder});
  }
  std::ranges::sort(ranges_, {}, &Range::first);
}

std::size_t SurfaceOwners::holder_of(std::uint32_t surface) const {
  const auto range = std::ranges::upper_bound(ranges_, surface, {}, &Range::last);
  HPR_CHECK(range != ranges_.end() && range->first <= surface);
  return range->holder;
}

}  // namespace hpr
