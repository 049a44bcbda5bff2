#include "rt/trace/ray_boxes.h"

#include <cmath>
#include <cstdint>
#include <limits>

namespace hpr {
namespace {

constexpr int kHalvings = 4;
constexpr std::uint32_t kBoxTriangles = 64;

void widen(RayBox& box, const RayBox& by) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] = std::min(box.low[axis], by.low[axis]);
    box.high[axis] = std::max(box.high[axis], by.high[axis]);
  }
}

RayBox empty_box() {
  RayBox box;
  box.low.fill(std::numeric_limits<float>::infinity());
  box.high.fill(-std::numeric_limits<float>::infinity());
  return box;
}

RayBox box_of(const Scene& scene, const RaySpace& space, const InstanceRange& part) {
  const Instance& instance = scene.instances[part.instance];
  const Mesh& mesh = scene.mesh_of(instance);
  RayBox box = empty_box();
  for (std::uint32_t i = part.range.first; i < part.range.last; ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const glm::dvec3 position = space.from_world(world_position(instance, mesh.positions[mesh.triangle(i)[corner]]));
      const std::array<float, 3> at{static_cast<float>(position.x), static_cast<float>(position.y),
                                    static_cast<float>(position.z)};
      widen(box, {at, at});
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] -= kBoxSlack * std::max(1.0F, std::abs(box.low[axis]));
    box.high[axis] += kBoxSlack * std::max(1.0F, std::abs(box.high[axis]));
  }
  return box;
}

/// Halves them about the middle of the longest axis, and again, and puts boxes about what is left together.
void merge_near(std::span<RayBox> boxes, int halvings, std::vector<RayBox>& merged) {
  if (boxes.empty()) return;
  RayBox all = enclosing_box(boxes);
  if (halvings == 0 || boxes.size() == 1) {
    merged.push_back(all);
    return;
  }
  std::size_t longest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (all.high[axis] - all.low[axis] > all.high[longest] - all.low[longest]) longest = axis;
  }
  const auto median = boxes.begin() + static_cast<std::ptrdiff_t>(boxes.size() / 2);
  std::ranges::nth_element(boxes, median, {}, [&](const RayBox& box) { return box.low[longest] + box.high[longest]; });
  merge_near({boxes.begin(), median}, halvings - 1, merged);
  merge_near({median, boxes.end()}, halvings - 1, merged);
}

}  // namespace

RayBox enclosing_box(std::span<const RayBox> boxes) {
  RayBox all = empty_box();
  for (const RayBox& box : boxes) widen(all, box);
  return all;
}

std::vector<RayBox> enclosing_boxes(const Scene& scene, const RaySpace& space, std::span<const SurfaceRange> part) {
  std::vector<RayBox> small;
  for (InstanceRange piece : split_by_instance(scene, merged_ranges({part.begin(), part.end()}, scene.triangles))) {
    const std::uint32_t last = piece.range.last;
    for (std::uint32_t first = piece.range.first; first < last; first += kBoxTriangles) {
      piece.range = {first, std::min(first + kBoxTriangles, last)};
      small.push_back(box_of(scene, space, piece));
    }
  }
  std::vector<RayBox> boxes;
  merge_near(small, kHalvings, boxes);
  return boxes;
}

}  // namespace hpr
