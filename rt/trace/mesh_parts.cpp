#include "rt/trace/mesh_parts.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace hpr {
namespace {

/// For each vertex the first one at its place.
std::vector<std::uint32_t> welded(const Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto place = [&](std::uint32_t vertex) {
    const glm::vec3& p = mesh.positions[vertex];
    return std::tuple(p.x, p.y, p.z);
  };
  std::ranges::sort(
      order, [&](std::uint32_t a, std::uint32_t b) { return place(a) != place(b) ? place(a) < place(b) : a < b; });
  std::vector<std::uint32_t> first(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool again = i > 0 && place(order[i]) == place(order[i - 1]);
    first[order[i]] = again ? first[order[i - 1]] : order[i];
  }
  return first;
}

/// Vertices that are joined, as trees (Tarjan 1975, with halved paths).
class Joined {
 public:
  explicit Joined(std::size_t count) : above_(count) { std::iota(above_.begin(), above_.end(), 0U); }

  std::uint32_t root(std::uint32_t vertex) {
    while (above_[vertex] != vertex) vertex = above_[vertex] = above_[above_[vertex]];
    return vertex;
  }
  void join(std::uint32_t a, std::uint32_t b) { above_[root(a)] = root(b); }

 private:
  std::vector<std::uint32_t> above_;
};

}  // namespace

std::vector<std::uint32_t> parts_of(const Mesh& mesh) {
  const std::vector<std::uint32_t> first = welded(mesh);
  Joined joined(first.size());
  for (const glm::uvec3& corners : mesh.triangles) {
    joined.join(first[corners.x], first[corners.y]);
    joined.join(first[corners.x], first[corners.z]);
  }
  constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  std::vector<std::uint32_t> numbers(first.size(), kNone);
  std::uint32_t next = 0;
  std::vector<std::uint32_t> parts;
  parts.reserve(mesh.triangles.size());
  for (const glm::uvec3& corners : mesh.triangles) {
    std::uint32_t& number = numbers[joined.root(first[corners.x])];
    if (number == kNone) number = next++;
    parts.push_back(number);
  }
  return parts;
}

}  // namespace hpr
