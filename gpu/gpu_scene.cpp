#include "gpu/gpu_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "gpu/bvh.h"
#include "gpu/device/gpu_tables.h"

namespace hpr {
namespace {

/// As in scene.glsl.
struct GpuInstance {
  std::array<glm::dvec3, 4> to_world{};
  glm::dmat3 to_boxes{1.0};
  glm::dvec3 box_origin{0.0};
  std::uint64_t positions = 0;
  std::uint64_t triangles = 0;
  std::uint64_t nodes = 0;
  std::uint64_t items = 0;
  std::uint32_t first_surface = 0;
  float largest = 0.0F;
  float front = 0.0F;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuInstance) == 240);

/// As in scene.glsl.
struct GpuSceneTree {
  std::uint64_t nodes = 0;
  std::uint64_t items = 0;
  std::uint64_t instances = 0;
  glm::dvec3 center{0.0};
  float largest = 0.0F;
  std::uint32_t is_empty = 1;
};
static_assert(sizeof(GpuSceneTree) == 56);

/// A tree among others: where its nodes and items begin, and its root.
struct PlacedTree {
  std::size_t nodes = 0;
  std::size_t items = 0;
  BvhNode root;
};

/// A mesh among others: where its arrays begin.
struct PlacedMesh {
  std::size_t positions = 0;
  std::size_t triangles = 0;
};

float largest_of(const BvhNode& root) {
  float largest = 0.0F;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    largest = std::max({largest, std::abs(root.low.at(axis)), std::abs(root.high.at(axis))});
  }
  return largest;
}

/// The smallest one in single precision that holds the box.
FloatBox rounded(const Bounds& box) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  FloatBox about;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    about.low.at(i) = std::nextafter(static_cast<float>(box.low[axis]), -kInfinity);
    about.high.at(i) = std::nextafter(static_cast<float>(box.high[axis]), kInfinity);
  }
  return about;
}

/// Puts a scene on a device: all of a kind in one buffer, as devices have few.
class Builder {
 public:
  Builder(const Scene& scene, int threads, GpuTables& tables) : scene_(scene), bvhs_(threads), tables_(tables) {
    tree_.center = 0.5 * scene.bounds.low + 0.5 * scene.bounds.high;
  }

  void add(const InstanceRange& part) {
    const Instance& instance = scene_.instances[part.instance];
    const Mesh& mesh = scene_.mesh_of(instance);
    const glm::dmat3 linear(instance.to_world);
    const std::optional<glm::dmat3> inverse = usable_inverse(linear);
    const std::optional<PlacedTree> placed = inverse ? shared_tree(instance, part) : tree_in_world(instance, part);
    if (!placed) return;

    GpuInstance& made = instances_.emplace_back();
    for (int column = 0; column < 4; ++column) {
      made.to_world.at(static_cast<std::size_t>(column)) = glm::dvec3(instance.to_world[column]);
    }
    made.to_boxes = inverse.value_or(glm::dmat3(1.0));
    made.box_origin = inverse ? glm::dvec3(instance.to_world[3]) : tree_.center;
    const PlacedMesh& arrays = placed_mesh(instance.mesh);
    made.positions = arrays.positions;
    made.triangles = arrays.triangles;
    made.nodes = placed->nodes;
    made.items = placed->items;
    made.first_surface = instance.first_surface;
    made.largest = largest_of(placed->root);
    if (!shows_both_sides(scene_.materials[mesh.material])) made.front = glm::determinant(linear) < 0.0 ? -1.0F : 1.0F;

    const BvhNode& root = placed->root;
    const Bounds box{{root.low[0], root.low[1], root.low[2]}, {root.high[0], root.high[1], root.high[2]}};
    const Bounds in_world = inverse ? transformed(instance.to_world, box) : box;
    const glm::dvec3 moved = inverse ? tree_.center : glm::dvec3(0.0);
    boxes_.push_back(rounded({in_world.low - moved, in_world.high - moved}));
  }

  /// Returns the address of the scene's tree.
  [[nodiscard]] std::uint64_t finish() {
    const Bvh bvh = bvhs_.build(boxes_);
    if (!bvh.nodes.empty()) {
      const PlacedTree placed = place(bvh);
      const std::uint64_t nodes = tables_.upload(nodes_);
      const std::uint64_t items = tables_.upload(items_);
      const std::uint64_t positions = tables_.upload(positions_);
      const std::uint64_t triangles = tables_.upload(triangles_);
      for (GpuInstance& instance : instances_) {  // from indices to addresses
        instance.nodes = nodes + instance.nodes * sizeof(BvhNode);
        instance.items = items + instance.items * sizeof(std::uint32_t);
        instance.positions = positions + instance.positions * sizeof(glm::vec3);
        instance.triangles = triangles + instance.triangles * sizeof(glm::uvec3);
      }
      tree_.nodes = nodes + placed.nodes * sizeof(BvhNode);
      tree_.items = items + placed.items * sizeof(std::uint32_t);
      tree_.instances = tables_.upload(instances_);
      tree_.largest = largest_of(placed.root);
      tree_.is_empty = 0;
    }
    return tables_.upload_one(tree_);
  }

 private:
  PlacedTree place(const Bvh& bvh) {
    const PlacedTree placed{nodes_.size(), items_.size(), bvh.nodes.front()};
    nodes_.insert(nodes_.end(), bvh.nodes.begin(), bvh.nodes.end());
    items_.insert(items_.end(), bvh.items.begin(), bvh.items.end());
    return placed;
  }

  /// A tree of some triangles of a mesh; none where they are none. `at(position)`: where boxes have a vertex.
  template <typename At>
  std::optional<PlacedTree> tree_of(const Mesh& mesh, const SurfaceRange& range, const At& at) {
    std::vector<FloatBox> boxes;
    boxes.reserve(range.last - range.first);
    for (std::uint32_t t = range.first; t < range.last; ++t) {
      const glm::uvec3& corners = mesh.triangle(t);
      Bounds box = empty_bounds();
      for (int corner = 0; corner < 3; ++corner) {
        const glm::dvec3 moved = at(mesh.positions[corners[corner]]);
        box.low = glm::min(box.low, moved);
        box.high = glm::max(box.high, moved);
      }
      boxes.push_back(rounded(box));
    }
    Bvh bvh = bvhs_.build(boxes);
    if (bvh.nodes.empty()) return std::nullopt;
    for (std::uint32_t& item : bvh.items) item += range.first;
    return place(bvh);
  }

  std::optional<PlacedTree> tree_in_world(const Instance& instance, const InstanceRange& part) {
    return tree_of(scene_.mesh_of(instance), part.range, [&](const glm::vec3& position) {
      return glm::dvec3(instance.to_world * glm::dvec4(position, 1.0)) - tree_.center;
    });
  }

  /// In the mesh's own coordinates, the same for all its instances.
  std::optional<PlacedTree> shared_tree(const Instance& instance, const InstanceRange& part) {
    const std::array<std::uint32_t, 3> which{instance.mesh, part.range.first, part.range.last};
    const auto known = trees_.find(which);
    if (known != trees_.end()) return known->second;
    const auto tree = tree_of(scene_.mesh_of(instance), part.range, [](const glm::vec3& p) { return glm::dvec3(p); });
    trees_.emplace(which, tree);
    return tree;
  }

  const PlacedMesh& placed_mesh(std::uint32_t mesh) {
    const auto known = meshes_.find(mesh);
    if (known != meshes_.end()) return known->second;
    const Mesh& of = scene_.meshes[mesh];
    const PlacedMesh placed{positions_.size(), triangles_.size()};
    positions_.insert(positions_.end(), of.positions.begin(), of.positions.end());
    triangles_.insert(triangles_.end(), of.triangles.begin(), of.triangles.end());
    return meshes_.emplace(mesh, placed).first->second;
  }

  const Scene& scene_;
  BvhBuilder bvhs_;
  GpuTables& tables_;
  GpuSceneTree tree_;
  std::vector<GpuInstance> instances_;
  std::vector<FloatBox> boxes_;  ///< of instances, relative to the tree's centre
  std::vector<BvhNode> nodes_;
  std::vector<std::uint32_t> items_;
  std::vector<glm::vec3> positions_;
  std::vector<glm::uvec3> triangles_;
  std::map<std::array<std::uint32_t, 3>, std::optional<PlacedTree>> trees_;
  std::map<std::uint32_t, PlacedMesh> meshes_;
};

}  // namespace

GpuScene::GpuScene(const GpuDevice& device, const Scene& scene, std::span<const SurfaceRange> objects, int threads)
    : tables_(device) {
  Builder builder(scene, threads, tables_);
  const auto ranges = merged_ranges({objects.begin(), objects.end()}, scene.triangles);
  for (const InstanceRange& part : split_by_instance(scene, ranges)) {
    HPR_CHECK(!scene.mesh_of(scene.instances[part.instance]).partial);
    builder.add(part);
  }
  address_ = builder.finish();
}

std::optional<glm::dmat3> usable_inverse(const glm::dmat3& linear) {
  constexpr double kMaxCondition = 1e6;
  const glm::dmat3 inverse = glm::inverse(linear);
  double size = 0.0;
  double inverse_size = 0.0;
  for (int column = 0; column < 3; ++column) {
    size += glm::length(linear[column]);
    inverse_size += glm::length(inverse[column]);
  }
  if (!(size * inverse_size < kMaxCondition)) return std::nullopt;  // nor where that is no number
  return inverse;
}

}  // namespace hpr
