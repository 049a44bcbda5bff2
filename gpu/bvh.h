#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace hpr {

/// An axis-aligned box in single precision.
struct FloatBox {
  std::array<float, 3> low{};
  std::array<float, 3> high{};
};

/// A node of a binary tree of boxes, as shaders read it (gpu/shaders/bvh.glsl): its two children's boxes lie in it.
struct BvhNode {
  std::array<float, 3> low{};
  /// Inner nodes: the index of the first child, behind which the second one lies; leaves: of the first item in
  /// Bvh::items.
  std::uint32_t first = 0;
  std::array<float, 3> high{};
  std::uint32_t items = 0;  ///< 0: an inner node
};
static_assert(sizeof(BvhNode) == 32);

/// Boxes sorted into a tree, by the surface area heuristic (MacDonald and Booth, "Heuristics for Ray Tracing Using
/// Space Subdivision", 1990), as Embree's rtcBuildBVH builds it. Node 0 is the root; no nodes: no boxes.
struct Bvh {
  std::vector<BvhNode> nodes;
  std::vector<std::uint32_t> items;  ///< indices of boxes, leaf after leaf
};

/// Builds trees, with Embree's threads.
class BvhBuilder {
 public:
  explicit BvhBuilder(int threads);
  ~BvhBuilder();
  BvhBuilder(const BvhBuilder&) = delete;
  BvhBuilder& operator=(const BvhBuilder&) = delete;

  /// Boxes that hold nothing (low > high), or are not finite, are left out. Throws Error (Limit) where memory ends.
  [[nodiscard]] Bvh build(std::span<const FloatBox> boxes) const;

 private:
  struct Embree;
  std::unique_ptr<Embree> embree_;
};

/// How deep trees get: what a shader's stack holds.
inline constexpr std::uint32_t kMaxBvhDepth = 48;

}  // namespace hpr
