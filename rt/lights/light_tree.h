#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

namespace hpr {

/// Where lights stand, which way they shine, and how strongly.
struct LightBounds {
  glm::dvec3 low{0.0};
  glm::dvec3 high{0.0};
  double strength = 0.0;           ///< W/sr towards where they shine most
  glm::dvec3 axis{0.0, 0.0, 1.0};  ///< unit length
  double spread_radians = 0.0;     ///< theta_o: how far normals lie off the axis; pi: they shine everywhere
  double emission_radians =
      1.570797;            ///< theta_e: how far off a normal light goes, a little more than pi/2 for lamberts
  bool two_sided = false;  ///< normals count in both directions
  double reach = 0.0;      ///< metres from the lights to where they end; 0: they never do
};

/// The bounds of both.
[[nodiscard]] LightBounds united(const LightBounds& a, const LightBounds& b);

/// LightBounds with all that their importance needs, computed once.
struct LightCluster {
  glm::dvec3 center{0.0};
  double radius = 0.0;  ///< of the sphere about the box
  glm::dvec3 half{0.0};
  double reach = 0.0;
  glm::dvec3 axis{0.0};
  double strength = 0.0;
  double cos_spread = 1.0;
  double sin_spread = 0.0;
  double cos_emission = 0.0;
  bool two_sided = false;

  LightCluster() = default;
  explicit LightCluster(const LightBounds& bounds);

  /// An estimate of the irradiance the lights give to a surface, zero only where they surely give none: Conty and Kulla
  /// (see LightTree), section 4. A zero `normal` takes light from all sides.
  [[nodiscard]] double importance(const glm::dvec3& position, const glm::dvec3& normal) const;
};

/// Chooses among many lights by what they may give to a place: a binary tree over them in which either branch is
/// taken in proportion to its importance. Conty and Kulla, "Importance Sampling of Many Lights with Adaptive Tree
/// Splitting", 2018, without the splitting; their cost of a split, with the squared diagonal of a box in place of its
/// area, which is zero for lights in a row.
class LightTree {
 public:
  LightTree() = default;
  /// O(n log n); the same for the same lights. Each has a strength above 0.
  explicit LightTree(std::span<const LightBounds> lights);

  [[nodiscard]] bool empty() const { return nodes_.empty(); }
  /// Of all lights together; the tree must not be empty.
  [[nodiscard]] double importance(const glm::dvec3& position, const glm::dvec3& normal) const {
    return nodes_.front().lights.importance(position, normal);
  }

  struct Choice {
    std::size_t light = 0;
    double probability = 0.0;
  };
  /// None when no light reaches the place; the branch taken may find out late, so the probabilities of all lights may
  /// add up to less than 1. O(log n).
  [[nodiscard]] std::optional<Choice> choose(const glm::dvec3& position, const glm::dvec3& normal, double u) const;
  /// With which choose() returns `light`: the same bits. O(log n).
  [[nodiscard]] double probability(const glm::dvec3& position, const glm::dvec3& normal, std::size_t light) const;

  struct Node {
    LightCluster lights;
    std::uint32_t second = 0;  ///< the other child; the first one follows its parent. 0: a leaf
    std::uint32_t parent = 0;
    std::uint32_t light = 0;  ///< of a leaf
  };
  /// In depth-first order, as devices have them.
  [[nodiscard]] std::span<const Node> nodes() const { return nodes_; }
  /// The node of each light.
  [[nodiscard]] std::span<const std::uint32_t> leaves() const { return leaf_of_; }

 private:
  struct Builder;

  [[nodiscard]] double share_of_first(std::uint32_t node, const glm::dvec3& position, const glm::dvec3& normal) const;

  std::vector<Node> nodes_;  ///< in depth-first order
  std::vector<std::uint32_t> leaf_of_;
};

}  // namespace hpr
