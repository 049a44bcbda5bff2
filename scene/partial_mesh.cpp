#include "scene/partial_mesh.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "core/error.h"
#include "scene/mesh_reader.h"
#include "scene/requirements.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// The run that holds triangle `t`, or else the one after it.
const PartialMesh::Run* find_run(const PartialMesh& partial, std::uint32_t t) {
  const auto run = std::ranges::upper_bound(partial.runs, t, {}, &PartialMesh::Run::last);
  return run == partial.runs.end() ? nullptr : &*run;
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
  HPR_CHECK(!whole.partial && whole.kind == MeshKind::Triangles);
  WholeMeshReader reader(&whole);
  return without_triangles(reader);
}

Mesh part_of_mesh(const Mesh& whole, std::span<const SurfaceRange> ranges, const PartialMesh& partial) {
  HPR_CHECK(!whole.partial && whole.kind == MeshKind::Triangles);
  WholeMeshReader reader(&whole);
  PartPieces pieces(reader, ranges, partial);
  Mesh part;
  while (std::optional<Mesh> piece = pieces.next()) {
    append_piece(part, *std::move(piece), pieces.vertices(), pieces.triangles());
  }
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
