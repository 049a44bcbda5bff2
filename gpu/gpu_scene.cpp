#include "gpu/gpu_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "gpu/bvh.h"
#include "gpu/gpu_batch.h"

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

/// A tree on the device.
struct PlacedTree {
  std::uint64_t nodes = 0;
  std::uint64_t items = 0;
  BvhNode root;
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

/// A matrix that undoes `linear`; none where that flattens what it places, or nearly so: boxes in the mesh's own
/// coordinates would lose all digits.
std::optional<glm::dmat3> inverse_of(const glm::dmat3& linear) {
  constexpr double kMaxCondition = 1e6;
  const glm::dmat3 inverse = glm::inverse(linear);
  double size = 0.0;
  double inverse_size = 0.0;
  for (int column = 0; column < 3; ++column) {
    size = std::max(size, glm::length(linear[column]));
    inverse_size = std::max(inverse_size, glm::length(inverse[column]));
  }
  if (!(size * inverse_size < kMaxCondition)) return std::nullopt;  // nor where that is no number
  return inverse;
}

/// Puts a scene on a device, buffer by buffer.
class Builder {
 public:
  Builder(const GpuDevice& device, const Scene& scene, std::vector<GpuBuffer>& buffers)
      : device_(device), scene_(scene), buffers_(buffers), batch_(device) {
    tree_.center = 0.5 * scene.bounds.low + 0.5 * scene.bounds.high;
  }

  void add(const InstanceRange& part) {
    const Instance& instance = scene_.instances[part.instance];
    const Mesh& mesh = scene_.mesh_of(instance);
    const glm::dmat3 linear(instance.to_world);
    const std::optional<glm::dmat3> inverse = inverse_of(linear);
    const std::optional<PlacedTree> placed = inverse ? shared_tree(instance, part) : tree_in_world(instance, part);
    if (!placed) return;

    GpuInstance& made = instances_.emplace_back();
    for (int column = 0; column < 4; ++column) {
      made.to_world.at(static_cast<std::size_t>(column)) = glm::dvec3(instance.to_world[column]);
    }
    made.to_boxes = inverse.value_or(glm::dmat3(1.0));
    made.box_origin = inverse ? glm::dvec3(instance.to_world[3]) : tree_.center;
    const auto& [positions, triangles] = arrays_of(instance.mesh);
    made.positions = positions;
    made.triangles = triangles;
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

  void finish() {
    const Bvh bvh = build_bvh(boxes_);
    if (!bvh.nodes.empty()) {
      const PlacedTree placed = place(bvh);
      tree_.nodes = placed.nodes;
      tree_.items = placed.items;
      tree_.instances = upload(std::span<const GpuInstance>(instances_));
      tree_.largest = largest_of(placed.root);
      tree_.is_empty = 0;
    }
    upload(std::span<const GpuSceneTree>(&tree_, 1));
  }

 private:
  /// Returns the address.
  template <typename T>
  std::uint64_t upload(std::span<const T> values) {
    const auto bytes = std::as_bytes(values);
    const GpuBuffer staging(device_, bytes.size(), GpuMemory::Upload);
    std::memcpy(staging.mapped().data(), bytes.data(), bytes.size());
    const GpuBuffer& there = buffers_.emplace_back(device_, bytes.size(), GpuMemory::Device);
    batch_.copy(staging, there, bytes.size());
    batch_.submit();
    batch_.wait();
    return there.address();
  }

  PlacedTree place(const Bvh& bvh) {
    PlacedTree placed;
    placed.nodes = upload(std::span<const BvhNode>(bvh.nodes));
    placed.items = upload(std::span<const std::uint32_t>(bvh.items));
    placed.root = bvh.nodes.front();
    return placed;
  }

  /// A tree of some triangles of a mesh; none where they are none. `at(corner)`: where a vertex lies.
  template <typename At>
  std::optional<PlacedTree> tree_of(const Mesh& mesh, const SurfaceRange& range, const At& at) {
    std::vector<FloatBox> boxes;
    boxes.reserve(range.last - range.first);
    for (std::uint32_t t = range.first; t < range.last; ++t) {
      const glm::uvec3& corners = mesh.triangle(t);
      Bounds box = empty_bounds();
      for (int corner = 0; corner < 3; ++corner) {
        const glm::dvec3 place = at(mesh.positions[corners[corner]]);
        box.low = glm::min(box.low, place);
        box.high = glm::max(box.high, place);
      }
      boxes.push_back(rounded(box));
    }
    Bvh bvh = build_bvh(boxes);
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

  /// Addresses of positions and triangles.
  const std::pair<std::uint64_t, std::uint64_t>& arrays_of(std::uint32_t mesh) {
    const auto known = arrays_.find(mesh);
    if (known != arrays_.end()) return known->second;
    const Mesh& of = scene_.meshes[mesh];
    const std::uint64_t positions = upload(std::span<const glm::vec3>(of.positions));
    const std::uint64_t triangles = upload(std::span<const glm::uvec3>(of.triangles));
    return arrays_.emplace(mesh, std::pair(positions, triangles)).first->second;
  }

  const GpuDevice& device_;
  const Scene& scene_;
  std::vector<GpuBuffer>& buffers_;
  GpuBatch batch_;
  GpuSceneTree tree_;
  std::vector<GpuInstance> instances_;
  std::vector<FloatBox> boxes_;  ///< of instances, relative to the tree's centre
  std::map<std::array<std::uint32_t, 3>, std::optional<PlacedTree>> trees_;
  std::map<std::uint32_t, std::pair<std::uint64_t, std::uint64_t>> arrays_;
};

}  // namespace

GpuScene::GpuScene(const GpuDevice& device, const Scene& scene, std::span<const SurfaceRange> objects) {
  Builder builder(device, scene, buffers_);
  const auto ranges = merged_ranges({objects.begin(), objects.end()}, scene.triangles);
  for (const InstanceRange& part : split_by_instance(scene, ranges)) {
    HPR_CHECK(!scene.mesh_of(scene.instances[part.instance]).partial);
    builder.add(part);
  }
  builder.finish();
}

std::size_t GpuScene::bytes() const {
  std::size_t bytes = 0;
  for (const GpuBuffer& buffer : buffers_) bytes += buffer.bytes();
  return bytes;
}

}  // namespace hpr
