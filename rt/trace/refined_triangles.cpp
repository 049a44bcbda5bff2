#include "rt/trace/refined_triangles.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <optional>
#include <tuple>

#include "core/error.h"
#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

using Corners = std::array<glm::dvec3, 3>;

/// Ray space: edges up to this length stay whole wherever they are.
constexpr double kMinEdge = 0x1p-24;
/// How often a triangle is divided at the most: halving the longest edges down to kMinEdge takes about half as often.
constexpr int kMaxDivisions = 64;
/// Parts of all refined instances together: some 20 MB in Embree.
constexpr std::size_t kMaxParts = std::size_t{1} << 18;
/// Triangles of a mesh up to which one of its instances has triangles of its own, so that these can be refined.
constexpr std::size_t kMaxUnshared = 4096;
/// Float steps of the distance from ray space's origin. A part's edges are at most 7.5 times as long as a place of it
/// is far away, as they are no longer than their own distance, which is at most that of the place and 0.87 of the
/// longest edge. So its corners are at most 8.5 times as far, both together 16 times, and 28 by the largest coordinate.
constexpr double kPlaneSteps = 32.0;
/// How many times less refining must move a plane to be worth it.
constexpr double kMinGain = 100.0;
/// How many times as long as its distance an edge must be for refining to be worth it: what is met beside an edge is
/// off by the distance of the edge's ends.
constexpr double kMinWideness = 1000.0;
/// Ray space: triangles with edges below this are none that other things stand on.
constexpr double kMinWide = 0x1p-4;
/// What Embree's edge test is off by, in float steps of the distance between a ray's origin and the farthest corner:
/// seven roundings of products of |D|, |e| and 2 |s|, against 2 |D| |e| for a metre (docs/numerics.md, Watertight).
constexpr double kEdgeSteps = 5.0;

double largest(const glm::dvec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// Of the segment from ray space's origin.
double distance_of(const glm::dvec3& a, const glm::dvec3& b) {
  const glm::dvec3 edge = b - a;
  const double length2 = glm::dot(edge, edge);
  const double at = length2 > 0.0 ? std::clamp(-glm::dot(a, edge) / length2, 0.0, 1.0) : 0.0;
  return glm::length(a + at * edge);
}

/// Whether an edge is halved; the same for both triangles that share it, whichever end each begins with.
bool is_long(const glm::dvec3& a, const glm::dvec3& b) {
  if (std::tuple(b.x, b.y, b.z) < std::tuple(a.x, a.y, a.z)) return is_long(b, a);
  const double length = glm::length(b - a);
  return length > kMinEdge && length > distance_of(a, b);
}

/// False too for what floats do not hold at all.
bool is_divided(const Corners& c) {
  const double farthest = std::max({largest(c[0]), largest(c[1]), largest(c[2])});
  if (!(farthest < static_cast<double>(kMaxRayDistance))) return false;
  return is_long(c[0], c[1]) || is_long(c[1], c[2]) || is_long(c[2], c[0]);
}

/// Calls visit(part) for every part. Turns corners round, and keeps the winding.
template <typename Visit>
void divide(const Corners& c, int divisions, Visit&& visit) {
  const std::array<bool, 3> halved{is_long(c[0], c[1]), is_long(c[1], c[2]), is_long(c[2], c[0])};
  const auto count = std::ranges::count(halved, true);
  if (count == 0 || divisions == 0) {
    visit(c);
    return;
  }
  const auto divide_on = [&](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& d) {
    divide({a, b, d}, divisions - 1, visit);
  };
  const auto midpoint = [](const glm::dvec3& a, const glm::dvec3& b) { return 0.5 * (a + b); };
  if (count == 3) {
    const glm::dvec3 m0 = midpoint(c[0], c[1]);
    const glm::dvec3 m1 = midpoint(c[1], c[2]);
    const glm::dvec3 m2 = midpoint(c[2], c[0]);
    divide_on(c[0], m0, m2);
    divide_on(m0, c[1], m1);
    divide_on(m2, m1, c[2]);
    divide_on(m0, m1, m2);
    return;
  }
  // From here on a b is halved; where two edges are, b d is the other one.
  std::size_t first = 0;
  while (!halved[first] || (count == 2 && !halved[(first + 1) % 3])) ++first;
  const glm::dvec3& a = c[first];
  const glm::dvec3& b = c[(first + 1) % 3];
  const glm::dvec3& d = c[(first + 2) % 3];
  const glm::dvec3 ab = midpoint(a, b);
  if (count == 1) {
    divide_on(a, ab, d);
    divide_on(ab, b, d);
    return;
  }
  const glm::dvec3 bd = midpoint(b, d);
  divide_on(ab, b, bd);
  if (glm::distance(a, bd) < glm::distance(ab, d)) {
    divide_on(a, ab, bd);
    divide_on(a, bd, d);
  } else {
    divide_on(a, ab, d);
    divide_on(ab, bd, d);
  }
}

Corners corners_of(const Mesh& mesh, const Instance& instance, const glm::uvec3& t, const RaySpace& space) {
  Corners corners;
  for (int i = 0; i < 3; ++i) {
    corners[static_cast<std::size_t>(i)] = space.from_world(world_position(instance, mesh.positions[t[i]]));
  }
  return corners;
}

/// From ray space's origin.
double distance_of(const Corners& c) {
  const glm::dvec3 e1 = c[1] - c[0];
  const glm::dvec3 e2 = c[2] - c[0];
  const glm::dvec3 cross = glm::cross(e1, e2);
  const double area2 = glm::dot(cross, cross);
  if (area2 > 0.0) {
    // Barycentric coordinates of the place that faces the origin.
    const double u = glm::dot(glm::cross(-c[0], e2), cross) / area2;
    const double v = glm::dot(glm::cross(e1, -c[0]), cross) / area2;
    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0) return std::abs(glm::dot(c[0], cross)) / std::sqrt(area2);
  }
  return std::min({distance_of(c[0], c[1]), distance_of(c[1], c[2]), distance_of(c[2], c[0])});
}

double longest_edge(const Corners& c) {
  return std::max({glm::distance(c[0], c[1]), glm::distance(c[1], c[2]), glm::distance(c[2], c[0])});
}

/// Whether refining is worth it for that triangle: for its plane, or for its edges.
bool is_coarse(const Corners& c) {
  const double distance = std::max(distance_of(c), kMinEdge);
  const glm::dvec3 e1 = c[1] - c[0];
  const glm::dvec3 e2 = c[2] - c[0];
  const double longest = longest_edge(c);
  if (longest >= kMinWide && longest > kMinWideness * distance) return true;
  const double rounding =
      plane_rounding(e1, e2, glm::normalize(glm::cross(e1, e2)), glm::abs(c[0]) + glm::max(glm::abs(e1), glm::abs(e2)));
  return rounding > kMinGain * kPlaneSteps * distance;
}

/// Which instances are refined, one after the other, while parts are left.
class Refining {
 public:
  Refining(const Scene& scene, const RaySpace& space) : scene_(scene), space_(space) {}

  /// `is_shared`: Embree would hold it as an instance of a mesh.
  bool refines(const Instance& instance, bool is_shared) {
    if (is_shared && !may_be_unshared(instance)) return false;
    const std::optional<Divided> divided =
        find_divided(instance, {0, scene_.mesh_of(instance).triangle_count()}, parts_left_);
    if (!divided || !divided->is_worth_it) return false;
    const std::size_t parts = count_parts(*divided, parts_left_);
    if (parts > parts_left_) return false;
    parts_left_ -= parts;
    return true;
  }

  /// What `range` of its mesh's triangles tells about an instance.
  [[nodiscard]] RefinementCount count(std::uint32_t index, bool is_shared, const SurfaceRange& range) const {
    RefinementCount counted{index};
    const Instance& instance = scene_.instances[index];
    if (is_shared && !may_be_unshared(instance)) return counted;
    const std::optional<Divided> divided = find_divided(instance, range, kMaxParts);
    counted.parts = divided ? count_parts(*divided, kMaxParts) : kMaxParts + 1;
    counted.is_worth_it = divided && divided->is_worth_it ? 1 : 0;
    return counted;
  }

 private:
  struct Divided {
    std::vector<Corners> triangles;
    bool is_worth_it = false;
  };

  /// So that many small instances cost no look at each of their triangles.
  [[nodiscard]] bool may_be_unshared(const Instance& instance) const {
    const Mesh& mesh = scene_.mesh_of(instance);
    if (mesh.triangle_count() > kMaxUnshared) return false;
    if (!longest_edges_.contains(instance.mesh)) longest_edges_[instance.mesh] = longest_edge(mesh);
    double stretch2 = 0.0;  // Frobenius
    for (int column = 0; column < 3; ++column) {
      const glm::dvec3 axis(instance.to_world[column]);
      stretch2 += glm::dot(axis, axis);
    }
    return longest_edges_[instance.mesh] * std::sqrt(stretch2) * space_.scale >= kMinWide;
  }

  /// The triangles that are divided; nothing where they are more than `most`.
  [[nodiscard]] std::optional<Divided> find_divided(const Instance& instance, const SurfaceRange& range,
                                                    std::size_t most) const {
    const Mesh& mesh = scene_.mesh_of(instance);
    const glm::dmat3 linear(instance.to_world);
    const glm::dvec3 origin = glm::inverse(linear) * (space_.origin - glm::dvec3(instance.to_world[3]));
    // In the mesh's own coordinates, which shrink lengths by up to the distortion against each other: most triangles
    // are far too small for their distance.
    const double reach = 2.0 * distortion(linear);
    Divided divided;
    if (!std::isfinite(reach * largest(origin))) return divided;
    for (std::uint32_t i = range.first; i < range.last; ++i) {
      const glm::uvec3& t = mesh.triangle(i);
      const glm::dvec3 p0(mesh.positions[t.x]);
      const double size =
          std::max(largest(glm::dvec3(mesh.positions[t.y]) - p0), largest(glm::dvec3(mesh.positions[t.z]) - p0));
      if (!(largest(p0 - origin) < reach * size)) continue;
      const Corners corners = corners_of(mesh, instance, t, space_);
      if (!is_divided(corners)) continue;
      if (divided.triangles.size() >= most) return std::nullopt;
      divided.triangles.push_back(corners);
      divided.is_worth_it = divided.is_worth_it || is_coarse(corners);
    }
    return divided;
  }

  /// How many parts they have, or some number above `most`.
  [[nodiscard]] static std::size_t count_parts(const Divided& divided, std::size_t most) {
    std::size_t parts = 0;
    for (const Corners& corners : divided.triangles) {
      divide(corners, kMaxDivisions, [&](const Corners& /*part*/) { ++parts; });
      if (parts > most) break;
    }
    return parts;
  }

  const Scene& scene_;
  const RaySpace& space_;
  mutable std::map<std::uint32_t, double> longest_edges_;  ///< by mesh
  std::size_t parts_left_ = kMaxParts;
};

}  // namespace

std::vector<std::uint8_t> refined_instances(const Scene& scene, const RaySpace& space) {
  if (is_shared_out(scene)) {
    HPR_CHECK(scene.refined.size() == scene.instances.size());
    return scene.refined;
  }
  const std::vector<std::uint8_t> shared = shared_instances(scene);
  std::vector<std::uint8_t> refined(shared.size(), 0);
  Refining refining(scene, space);
  for (std::size_t i = 0; i < refined.size(); ++i) {
    refined[i] = refining.refines(scene.instances[i], shared[i] != 0) ? 1 : 0;
  }
  return refined;
}

std::vector<RefinementCount> count_refined_parts(const Scene& scene, const RaySpace& space,
                                                 std::span<const SurfaceRange> part) {
  const std::vector<std::uint8_t> shared = shared_instances(scene);
  const Refining refining(scene, space);
  std::vector<RefinementCount> counts;
  for (const InstanceRange& range :
       split_by_instance(scene, merged_ranges({part.begin(), part.end()}, scene.triangles))) {
    counts.push_back(refining.count(range.instance, shared[range.instance] != 0, range.range));
    if (counts.back().parts == 0) counts.pop_back();
  }
  return counts;
}

std::vector<std::uint8_t> refined_by_counts(const Scene& scene, std::span<const RefinementCount> counts) {
  std::vector<RefinementCount> sums(scene.instances.size());
  for (const RefinementCount& count : counts) {
    sums[count.instance].parts += count.parts;
    sums[count.instance].is_worth_it += count.is_worth_it;
  }
  std::vector<std::uint8_t> refined(sums.size(), 0);
  std::size_t parts_left = kMaxParts;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (sums[i].is_worth_it == 0 || sums[i].parts > parts_left) continue;
    refined[i] = 1;
    parts_left -= sums[i].parts;
  }
  return refined;
}

double refined_offset(const RaySpace& space, const glm::dvec3& position) {
  constexpr double kStep = kOriginSteps * kFloatStep;
  return kPlaneSteps * std::max(space.rounding_at(position), kStep * kMinEdge / space.scale);
}

double plane_rounding(const glm::dvec3& e1, const glm::dvec3& e2, const glm::dvec3& normal, const glm::dvec3& corners) {
  const glm::dvec3 a = glm::abs(e1);
  const glm::dvec3 b = glm::abs(e2);
  const glm::dvec3 products(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x);
  const double area2 = std::abs(glm::dot(normal, glm::cross(e1, e2)));
  return glm::dot(glm::abs(normal), corners) + glm::dot(glm::max(a, b), products) / area2;
}

glm::dvec2 onto_refined(const RaySpace& space, const glm::dvec2& at, const RayOnTriangle& from) {
  if (at.x >= 0.0 && at.y >= 0.0 && at.x + at.y <= 1.0) return at;
  constexpr double kMinCosine = 0x1p-12;
  constexpr double kCorners = 8.5;  // times as far as a place of a part, see kPlaneSteps
  const glm::dvec3 normal = glm::cross(from.e1, from.e2);
  const double area = glm::length(normal);
  const double distance = glm::length(from.v0 + at.x * from.e1 + at.y * from.e2);
  const double start = std::min(glm::length(from.ray_origin), 8.0 / space.scale);
  // Corners, the ray's origin and its direction.
  const double steps = kEdgeSteps * (kCorners * distance + start) + start + (distance + start);
  const double cosine = std::abs(glm::dot(normal, from.direction)) / (area * glm::length(from.direction));
  const double margin = kFloatStep * steps / std::max(cosine, kMinCosine);
  // Of each edge, as a share of the triangle's height over it.
  const double below_v = margin * glm::length(from.e1) / area;
  const double below_u = margin * glm::length(from.e2) / area;
  const double past = margin * glm::distance(from.e1, from.e2) / area;
  if (!std::isfinite(at.x) || !std::isfinite(at.y) || !std::isfinite(below_u + below_v + past)) {
    return onto_triangle(at.x, at.y);
  }
  const glm::dvec2 moved(std::max(at.x, -below_u), std::max(at.y, -below_v));
  const double sum = moved.x + moved.y;
  return sum > 1.0 + past ? moved * ((1.0 + past) / sum) : moved;
}

RefinedTriangles refine(const Scene& scene, const Instance& instance, SurfaceRange triangles, const RaySpace& space) {
  const Mesh& mesh = scene.mesh_of(instance);
  RefinedTriangles refined;
  for (std::uint32_t i = triangles.first; i < triangles.last; ++i) {
    const Corners whole = corners_of(mesh, instance, mesh.triangle(i), space);
    divide(whole, is_divided(whole) ? kMaxDivisions : 0, [&](const Corners& part) {
      refined.parts.push_back(part);
      refined.triangle_of.push_back(i - triangles.first);
    });
  }
  return refined;
}

}  // namespace hpr
