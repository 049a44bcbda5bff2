#include "gpu/bvh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <type_traits>

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

#include "core/error.h"

namespace hpr {
namespace {

constexpr unsigned int kMaxLeafItems = 4;

/// A node as Embree's callbacks make it, in memory of Embree's.
struct BuildNode {
  std::array<FloatBox, 2> boxes{};  ///< of the children
  std::array<BuildNode*, 2> children{};
  const std::uint32_t* items = nullptr;  ///< of a leaf
  std::uint32_t count = 0;
};

void* create_node(RTCThreadLocalAllocator allocator, unsigned int /*children*/, void* /*user*/) {
  return new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), alignof(BuildNode))) BuildNode;
}

void set_children(void* node, void** children, unsigned int count, void* /*user*/) {
  for (unsigned int i = 0; i < count; ++i) {
    static_cast<BuildNode*>(node)->children.at(i) = static_cast<BuildNode*>(children[i]);
  }
}

void set_bounds(void* node, const RTCBounds** bounds, unsigned int count, void* /*user*/) {
  for (unsigned int i = 0; i < count; ++i) {
    static_cast<BuildNode*>(node)->boxes.at(i) = {{bounds[i]->lower_x, bounds[i]->lower_y, bounds[i]->lower_z},
                                                  {bounds[i]->upper_x, bounds[i]->upper_y, bounds[i]->upper_z}};
  }
}

void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives, std::size_t count,
                  void* /*user*/) {
  auto* const items = static_cast<std::uint32_t*>(
      rtcThreadLocalAlloc(allocator, count * sizeof(std::uint32_t), alignof(std::uint32_t)));
  for (std::size_t i = 0; i < count; ++i) items[i] = primitives[i].primID;
  std::ranges::sort(std::span(items, count));
  auto* const leaf = new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), alignof(BuildNode))) BuildNode;
  leaf->items = items;
  leaf->count = static_cast<std::uint32_t>(count);
  return leaf;
}

bool holds_something(const FloatBox& box) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(box.low.at(axis) <= box.high.at(axis)) || !std::isfinite(box.low.at(axis)) ||
        !std::isfinite(box.high.at(axis))) {
      return false;
    }
  }
  return true;
}

FloatBox united(const FloatBox& a, const FloatBox& b) {
  FloatBox both;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    both.low.at(axis) = std::min(a.low.at(axis), b.low.at(axis));
    both.high.at(axis) = std::max(a.high.at(axis), b.high.at(axis));
  }
  return both;
}

/// Writes Embree's tree to `bvh`, both children of a node side by side.
void flatten(const BuildNode& root, const FloatBox& box, Bvh& bvh) {
  struct Open {
    const BuildNode* from;
    std::uint32_t to;
  };
  bvh.nodes.push_back({box.low, 0, box.high, 0});
  std::vector<Open> open{{&root, 0}};
  while (!open.empty()) {
    const Open next = open.back();
    open.pop_back();
    if (next.from->items != nullptr) {
      bvh.nodes[next.to].first = static_cast<std::uint32_t>(bvh.items.size());
      bvh.nodes[next.to].items = next.from->count;
      bvh.items.insert(bvh.items.end(), next.from->items, next.from->items + next.from->count);
      continue;
    }
    const auto first = static_cast<std::uint32_t>(bvh.nodes.size());
    bvh.nodes[next.to].first = first;
    for (std::size_t i = 0; i < 2; ++i) {
      const FloatBox& bounds = next.from->boxes.at(i);
      bvh.nodes.push_back({bounds.low, 0, bounds.high, 0});
    }
    for (std::uint32_t i = 2; i-- > 0;) open.push_back({next.from->children.at(i), first + i});
  }
}

struct DeviceEnd {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct BvhEnd {
  void operator()(RTCBVH bvh) const { rtcReleaseBVH(bvh); }
};

}  // namespace

struct BvhBuilder::Embree {
  std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceEnd> device;
};

BvhBuilder::BvhBuilder(int threads) : embree_(std::make_unique<Embree>()) {
  embree_->device.reset(rtcNewDevice(fmt::format("threads={}", threads).c_str()));
  if (!embree_->device) {
    throw Error(ExitCode::NoDevice, "Embree does not start", "hpr doctor says what this machine has");
  }
}

BvhBuilder::~BvhBuilder() = default;

Bvh BvhBuilder::build(std::span<const FloatBox> boxes) const {
  Bvh built;
  std::vector<RTCBuildPrimitive> primitives;
  primitives.reserve(boxes.size());
  FloatBox all{{1, 1, 1}, {-1, -1, -1}};
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const FloatBox& box = boxes[i];
    if (!holds_something(box)) continue;
    all = primitives.empty() ? box : united(all, box);
    RTCBuildPrimitive& primitive = primitives.emplace_back();
    primitive.lower_x = box.low[0];
    primitive.lower_y = box.low[1];
    primitive.lower_z = box.low[2];
    primitive.geomID = 0;
    primitive.upper_x = box.high[0];
    primitive.upper_y = box.high[1];
    primitive.upper_z = box.high[2];
    primitive.primID = static_cast<unsigned int>(i);
  }
  if (primitives.empty()) return built;
  const std::unique_ptr<std::remove_pointer_t<RTCBVH>, BvhEnd> bvh(rtcNewBVH(embree_->device.get()));
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.byteSize = sizeof(arguments);
  arguments.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
  arguments.maxBranchingFactor = 2;
  arguments.maxDepth = kMaxBvhDepth - 2;
  arguments.minLeafSize = 1;
  arguments.maxLeafSize = kMaxLeafItems;
  arguments.bvh = bvh.get();
  arguments.primitives = primitives.data();
  arguments.primitiveCount = primitives.size();
  arguments.primitiveArrayCapacity = primitives.capacity();
  arguments.createNode = create_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = set_bounds;
  arguments.createLeaf = create_leaf;
  const auto* const root = static_cast<const BuildNode*>(rtcBuildBVH(&arguments));
  if (root == nullptr) throw Error(ExitCode::Limit, "a tree of boxes does not fit into memory", "give hpr more memory");
  built.nodes.reserve(primitives.size());
  built.items.reserve(primitives.size());
  flatten(*root, all, built);
  return built;
}

}  // namespace hpr
