#include "gpu/light/gpu_surfaces.h"

#include <array>
#include <cstddef>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>

#include "core/error.h"
#include "gpu/device/gpu_tables.h"
#include "scene/bounds.h"

namespace hpr {
namespace {

/// As in surfaces.glsl; the first members are addresses of a mesh's arrays.
struct MeshArrays {
  std::uint64_t positions = 0;
  std::uint64_t triangles = 0;
  std::uint64_t normals = 0;
  std::array<std::uint64_t, 2> uvs{};
  std::uint64_t colors = 0;
  std::uint64_t tangents = 0;
  std::uint64_t parts = 0;
};
struct GpuPlacement {
  std::array<glm::dvec3, 4> to_world{};
  glm::dmat3 normal_matrix{1.0};
  glm::dmat3 spread{0.0};
  glm::dvec3 reach{0.0};
  std::array<glm::dvec2, 3> map{};
  MeshArrays arrays;
  std::uint32_t first_surface = 0;
  std::uint32_t material = 0;
  std::uint32_t map_uv_set = 0;
  std::uint32_t traits = 0;
};
static_assert(sizeof(GpuPlacement) == 392);
constexpr std::uint32_t kSwapsHandedness = 1;
constexpr std::uint32_t kIsRefined = 2;
constexpr std::uint32_t kIsInstanced = 4;
constexpr std::uint32_t kNeedsTangents = 8;

struct GpuSurfaceTable {
  std::uint64_t placements = 0;
  glm::dvec3 space_origin{0.0};
  double space_scale = 1.0;
  std::uint32_t count = 0;
  std::uint32_t lifts = 0;
};
static_assert(sizeof(GpuSurfaceTable) == 48);

/// Arrays of all meshes one behind the other, as devices have few buffers.
template <typename T>
class JoinedArrays {
 public:
  /// Returns one more than where the values begin; 0 for none.
  std::uint64_t add(std::span<const T> values) {
    if (values.empty()) return 0;
    const std::uint64_t first = all_.size() + 1;
    all_.insert(all_.end(), values.begin(), values.end());
    return first;
  }
  void put(GpuTables& tables) { base_ = tables.upload(all_); }
  void to_address(std::uint64_t& first) const {
    if (first != 0) first = base_ + (first - 1) * sizeof(T);
  }

 private:
  std::vector<T> all_;
  std::uint64_t base_ = 0;
};

/// All arrays of all meshes.
class MeshUploads {
 public:
  MeshArrays add(const Mesh& mesh, std::span<const std::uint32_t> parts) {
    HPR_CHECK(!mesh.partial);
    return {positions_.add(mesh.positions),
            triangles_.add(mesh.triangles),
            positions_.add(mesh.normals),
            {uvs_.add(mesh.uvs[0]), uvs_.add(mesh.uvs[1])},
            vectors_.add(mesh.colors),
            vectors_.add(mesh.tangents),
            parts_.add(parts)};
  }
  void put(GpuTables& tables) {
    positions_.put(tables);
    triangles_.put(tables);
    uvs_.put(tables);
    vectors_.put(tables);
    parts_.put(tables);
  }
  [[nodiscard]] MeshArrays addresses(MeshArrays arrays) const {
    positions_.to_address(arrays.positions);
    triangles_.to_address(arrays.triangles);
    positions_.to_address(arrays.normals);
    for (std::uint64_t& uvs : arrays.uvs) uvs_.to_address(uvs);
    vectors_.to_address(arrays.colors);
    vectors_.to_address(arrays.tangents);
    parts_.to_address(arrays.parts);
    return arrays;
  }

 private:
  JoinedArrays<glm::vec3> positions_;
  JoinedArrays<glm::uvec3> triangles_;
  JoinedArrays<glm::vec2> uvs_;
  JoinedArrays<glm::vec4> vectors_;
  JoinedArrays<std::uint32_t> parts_;
};

GpuPlacement placement_of(const Scene& scene, std::size_t index, const Surfaces::Placed& placed) {
  const Instance& instance = scene.instances[index];
  const Mesh& mesh = scene.mesh_of(instance);
  const Material& material = scene.materials[mesh.material];
  GpuPlacement made;
  for (int column = 0; column < 4; ++column) {
    made.to_world.at(static_cast<std::size_t>(column)) = glm::dvec3(instance.to_world[column]);
  }
  made.normal_matrix = placed.normal_matrix;
  made.spread = placed.spread;
  made.reach = placed.reach;
  const TextureRef& map = map_of_tangents(material);
  for (std::size_t column = 0; column < 3; ++column) {
    made.map.at(column) = {map.transform.at(2 * column), map.transform.at(2 * column + 1)};
  }
  made.map_uv_set = map.uv_set;
  made.first_surface = instance.first_surface;
  made.material = mesh.material;
  made.traits = (placed.swaps_handedness ? kSwapsHandedness : 0U) | (placed.is_refined ? kIsRefined : 0U) |
                (placed.is_instanced ? kIsInstanced : 0U) | (needs_tangents(material) ? kNeedsTangents : 0U);
  return made;
}

}  // namespace

GpuSurfaces::GpuSurfaces(const GpuDevice& device, const Scene& scene, const Surfaces& surfaces) : tables_(device) {
  MeshUploads meshes;
  std::vector<MeshArrays> arrays;
  for (std::uint32_t i = 0; i < scene.meshes.size(); ++i) {
    arrays.push_back(meshes.add(scene.meshes[i], surfaces.parts(i)));
  }
  meshes.put(tables_);
  std::vector<GpuPlacement> placements;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    placements.push_back(placement_of(scene, i, surfaces.placed()[i]));
    placements.back().arrays = meshes.addresses(arrays[scene.instances[i].mesh]);
  }
  const RaySpace& space = surfaces.space();
  address_ =
      tables_.upload_one(GpuSurfaceTable{tables_.upload(placements), space.origin, space.scale,
                                         static_cast<std::uint32_t>(placements.size()), surfaces.lifts() ? 1U : 0U});
}

}  // namespace hpr
