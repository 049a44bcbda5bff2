#include "rt/trace/surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <tuple>

#include "core/error.h"
#include "rt/materials/material_point.h"
#include "rt/trace/ray_forwarding.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/refined_triangles.h"

namespace hpr {
namespace {

/// For each vertex the first one at its place.
std::vector<std::uint32_t> welded(const Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto position = [&](std::uint32_t vertex) {
    const glm::vec3& p = mesh.positions[vertex];
    return std::tuple(p.x, p.y, p.z);
  };
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
    return position(a) != position(b) ? position(a) < position(b) : a < b;
  });
  std::vector<std::uint32_t> first(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool again = i > 0 && position(order[i]) == position(order[i - 1]);
    first[order[i]] = again ? first[order[i - 1]] : order[i];
  }
  return first;
}

/// Vertices that are joined, as trees (Tarjan 1975, with halved paths).
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : above_(count) { std::iota(above_.begin(), above_.end(), 0U); }

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
  DisjointSets joined(first.size());
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

namespace {

double largest(const glm::dvec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

bool finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Whether a vector of this squared length can be divided by its length as it is.
bool plain(double length2) {
  return length2 > 1e-200 && length2 < 1e200;
}

/// unit() of a vector that is not plain.
glm::dvec3 unit_of_extreme(const glm::dvec3& v, const glm::dvec3& otherwise) {
  const double size = largest(v);
  if (!(size > 0.0) || !finite(v)) return otherwise;
  return glm::normalize(v / size);
}

/// `v` at unit length; `otherwise` where it has none. Tiny and huge vectors are scaled first, so that they keep their
/// direction.
inline glm::dvec3 unit(const glm::dvec3& v, const glm::dvec3& otherwise) {
  const double length2 = glm::dot(v, v);
  return plain(length2) ? v * (1.0 / std::sqrt(length2)) : unit_of_extreme(v, otherwise);
}

/// The direction of the cross product, of tiny and huge vectors too; 0 where it has none.
glm::dvec3 direction_of_cross(const glm::dvec3& a, const glm::dvec3& b) {
  const glm::dvec3 cross = glm::cross(a, b);
  const double length2 = glm::dot(cross, cross);
  if (plain(length2)) return cross * (1.0 / std::sqrt(length2));
  const double sa = largest(a);
  const double sb = largest(b);
  if (!(sa > 0.0) || !(sb > 0.0)) return glm::dvec3(0.0);
  return unit(glm::cross(a / sa, b / sb), glm::dvec3(0.0));
}

glm::dmat3 cofactors(const glm::dmat3& m) {
  return {glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])};
}

glm::dmat3 magnitudes(const glm::dmat3& m) {
  return {glm::abs(m[0]), glm::abs(m[1]), glm::abs(m[2])};
}

double row_sum_norm(const glm::dmat3& m) {
  double norm = 0.0;
  for (int row = 0; row < 3; ++row)
    norm = std::max(norm, std::abs(m[0][row]) + std::abs(m[1][row]) + std::abs(m[2][row]));
  return norm;
}

void prefetch_vertex(const Mesh& mesh, std::uint32_t vertex) {
  __builtin_prefetch(&mesh.positions[vertex]);
  __builtin_prefetch(&mesh.normals[vertex]);
  for (const auto& uvs : mesh.uvs) {
    if (!uvs.empty()) __builtin_prefetch(&uvs[vertex]);
  }
}

}  // namespace

Surfaces::Surfaces(const Scene& scene, const RaySpace& space, bool lifts, RayForwarding* others)
    : scene_(scene), space_(space), lifts_(lifts), others_(is_shared_out(scene) ? others : nullptr) {
  std::vector<glm::dvec3> mesh_reach(scene.meshes.size(), glm::dvec3(0.0));
  parts_.resize(scene.meshes.size());
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const Mesh& mesh = scene.meshes[i];
    if (scene.materials[mesh.material].alpha_mode == AlphaMode::Blend) parts_[i] = parts_of(mesh);
    if (mesh.partial) mesh_reach[i] = mesh.partial->reach;
    for (const glm::vec3& p : mesh.positions) mesh_reach[i] = glm::max(mesh_reach[i], glm::abs(glm::dvec3(p)));
  }
  const std::vector<std::uint8_t> shared = shared_instances(scene);
  const std::vector<std::uint8_t> refined = refined_instances(scene, space);
  placed_.resize(scene.instances.size());
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    const glm::dmat4& to_world = scene.instances[i].to_world;
    const glm::dmat3 linear(to_world);
    const glm::dmat3 scaled = linear / std::max(row_sum_norm(linear), 1e-300);
    placed_[i].normal_matrix = cofactors(scaled);
    placed_[i].swaps_handedness = is_mirrored(scene.instances[i]);
    placed_[i].is_refined = refined[i] != 0;
    if (shared[i] == 0 || placed_[i].is_refined) continue;
    placed_[i].is_instanced = true;
    placed_[i].spread = magnitudes(linear) * magnitudes(glm::inverse(linear));
    placed_[i].reach = magnitudes(linear) * mesh_reach[scene.instances[i].mesh] +
                       placed_[i].spread * glm::abs(glm::dvec3(to_world[3]) - space.origin);
  }
}

void Surfaces::load(std::uint32_t id, WorldTriangle& triangle) const {
  HPR_CHECK(id < scene_.triangles);  // keys come from other ranks: a wrong one must not pass for a picture
  if (triangle.surface == id) return;
  const Instance* instance = &scene_.instances[triangle.instance];
  if (id >= instance->first_surface && id - instance->first_surface < scene_.mesh_of(*instance).triangle_count()) {
    triangle.index = id - instance->first_surface;
  } else {
    const SurfaceLocation location = locate_surface(scene_, id);
    triangle.instance = location.instance;
    triangle.index = location.triangle;
    instance = &scene_.instances[location.instance];
  }
  triangle.surface = id;
  if (triangle.remote) triangle.remote = nullptr;
  if (!scene_.mesh_of(*instance).holds(triangle.index)) {
    HPR_CHECK(others_ != nullptr);
    triangle.remote = others_->triangle(id);
  }
  const Mesh& mesh = mesh_of(triangle);
  const Placed& placed = placed_[triangle.instance];
  const glm::uvec3& corners = corners_of(mesh, triangle);
  triangle.v0 = world_position(*instance, mesh.positions[corners.x]);
  // Edges come from differences of the mesh's own coordinates: a far translation does not round them.
  const glm::dmat3 linear(instance->to_world);
  const glm::dvec3 p0(mesh.positions[corners.x]);
  triangle.e1 = linear * (glm::dvec3(mesh.positions[corners.y]) - p0);
  triangle.e2 = linear * (glm::dvec3(mesh.positions[corners.z]) - p0);
  triangle.normal = direction_of_cross(triangle.e1, triangle.e2);
  for (int corner = 0; corner < 3; ++corner) {
    triangle.normals[static_cast<std::size_t>(corner)] =
        unit(placed.normal_matrix * glm::dvec3(mesh.normals[corners[corner]]), triangle.normal);
  }
  triangle.offset = offset_of(triangle);
}

/// By axis, so that a level ground keeps the shadows of what stands on it however wide it is.
double Surfaces::offset_of(const WorldTriangle& triangle) const {
  constexpr double kStep = kOriginSteps * kFloatStep;
  constexpr double kMinOffset = 0x1p-40;  // ray space: a ray that starts on a plane through its origin leaves it
  const glm::dvec3 extent = glm::max(glm::abs(triangle.e1), glm::abs(triangle.e2));
  const glm::dvec3 from_origin = glm::abs(triangle.v0 - space_.origin);
  glm::dvec3 corners = from_origin + extent;
  // More is never needed: measured, see kOriginSteps.
  double most = largest(from_origin) + largest(extent);
  if (const Placed& placed = placed_[triangle.instance]; placed.is_instanced) {
    most = std::max(most, row_sum_norm(placed.spread) * most + largest(placed.reach));
    corners = glm::max(corners, placed.spread * corners + placed.reach);
  }
  const double along = plane_rounding(triangle.e1, triangle.e2, triangle.normal, corners);
  // Where that is no number, as of needles without an area, `most` stays.
  return std::max(kStep * (along < most ? along : most), kMinOffset / space_.scale);
}

double Surfaces::coplanar_tolerance(const WorldTriangle& triangle, double offset) const {
  const Instance& instance = scene_.instances[triangle.instance];
  const Mesh& mesh = mesh_of(triangle);
  const glm::uvec3& corners = corners_of(mesh, triangle);
  glm::dvec3 farthest(0.0);
  for (int corner = 0; corner < 3; ++corner) {
    farthest = glm::max(farthest, glm::abs(glm::dvec3(mesh.positions[corners[corner]])));
  }
  const glm::dvec3 stored = magnitudes(glm::dmat3(instance.to_world)) * farthest;
  return offset + kOriginSteps * kFloatStep * glm::dot(glm::abs(triangle.normal), stored);
}

void Surfaces::prefetch(std::span<const std::uint32_t> ids, std::uint16_t generation) const {
  if (others_ != nullptr) others_->fetch_triangles(ids, generation);
  constexpr std::size_t kAhead = 64;
  std::array<const Mesh*, kAhead> meshes;
  std::array<const glm::uvec3*, kAhead> corners;
  std::uint32_t instance = 0;
  for (std::size_t first = 0; first < ids.size(); first += kAhead) {
    std::size_t count = 0;
    for (const std::uint32_t id : ids.subspan(first, std::min(kAhead, ids.size() - first))) {
      if (id >= scene_.triangles) continue;
      const Instance* at = &scene_.instances[instance];
      if (id < at->first_surface || id - at->first_surface >= scene_.mesh_of(*at).triangle_count()) {
        instance = locate_surface(scene_, id).instance;
        at = &scene_.instances[instance];
      }
      const Mesh& mesh = scene_.mesh_of(*at);
      if (!mesh.holds(id - at->first_surface)) continue;
      meshes[count] = &mesh;
      corners[count] = &mesh.triangle(id - at->first_surface);
      __builtin_prefetch(corners[count++]);
    }
    for (std::size_t i = 0; i < count; ++i) {
      for (int corner = 0; corner < 3; ++corner) prefetch_vertex(*meshes[i], (*corners[i])[corner]);
    }
  }
}

/// Neighbours differ: instances that stand 1 to 126 apart, and a mesh's first 127 parts.
std::uint8_t Surfaces::layer_of(const WorldTriangle& triangle, bool inside) const {
  const auto& parts = parts_[scene_.instances[triangle.instance].mesh];
  if (parts.empty()) return 0;
  const std::uint64_t number = std::uint64_t{triangle.instance} * 31 + parts[triangle.index];
  return static_cast<std::uint8_t>(2 * (1 + number % 127) + (inside ? 1 : 0));
}

bool needs_tangents(const Material& material) {
  if (material.normal_texture.present()) return true;
  if (!material.extensions) return false;
  return material.extensions->clearcoat_normal_texture.present() || material.extensions->anisotropy > 0.0F;
}

const TextureRef& map_of_tangents(const Material& material) {
  if (material.normal_texture.present() || !material.extensions) return material.normal_texture;
  const MaterialExtensions& extensions = *material.extensions;
  return extensions.clearcoat_normal_texture.present() ? extensions.clearcoat_normal_texture
                                                       : extensions.anisotropy_texture;
}

/// Inline in both functions that have it: a call costs a tenth of meet().
[[gnu::always_inline]] inline Surfaces::PlanePoint Surfaces::plane_point(const WorldTriangle& triangle,
                                                                         const glm::dvec3& origin,
                                                                         const glm::dvec3& direction) const {
  // Moeller and Trumbore 1997, relative to the ray's origin.
  const glm::dvec3 from_v0 = origin - triangle.v0;
  const glm::dvec3 p = glm::cross(direction, triangle.e2);
  const glm::dvec3 q = glm::cross(from_v0, triangle.e1);
  const double determinant = glm::dot(triangle.e1, p);
  const glm::dvec2 met(glm::dot(from_v0, p) / determinant, glm::dot(direction, q) / determinant);
  const bool is_refined = placed_[triangle.instance].is_refined;

  PlanePoint hit;
  hit.on_triangle = onto_triangle(met.x, met.y);
  hit.at = is_refined ? onto_refined(
                            space_, met,
                            {triangle.v0 - space_.origin, triangle.e1, triangle.e2, origin - space_.origin, direction})
                      : hit.on_triangle;
  hit.position = triangle.v0 + hit.at.x * triangle.e1 + hit.at.y * triangle.e2;
  hit.to_viewer = unit(-direction, glm::dvec3(0.0, 0.0, 1.0));
  hit.against_winding = glm::dot(triangle.normal, hit.to_viewer) < 0.0;
  hit.offset = std::max(triangle.offset, space_.rounding_at(hit.position));
  if (is_refined) hit.offset = std::min(hit.offset, refined_offset(space_, hit.position));
  return hit;
}

SurfacePlane Surfaces::plane(const WorldTriangle& triangle, const glm::dvec3& origin,
                             const glm::dvec3& direction) const {
  const PlanePoint hit = plane_point(triangle, origin, direction);
  return {hit.position, hit.against_winding ? -triangle.normal : triangle.normal,
          coplanar_tolerance(triangle, hit.offset)};
}

SurfacePoint Surfaces::meet(const WorldTriangle& triangle, const glm::dvec3& origin,
                            const glm::dvec3& direction) const {
  const PlanePoint hit = plane_point(triangle, origin, direction);
  const glm::dvec2& on = hit.on_triangle;
  const glm::dvec2& at = hit.at;
  const double b0 = 1.0 - at.x - at.y;

  SurfacePoint point;
  point.position = hit.position;
  point.to_viewer = hit.to_viewer;
  point.geometric_normal = hit.against_winding ? -triangle.normal : triangle.normal;
  point.inside = hit.against_winding != placed_[triangle.instance].swaps_handedness;
  const auto& corner = triangle.normals;
  const Weights weight{1.0 - on.x - on.y, on.x, on.y};
  const glm::dvec3 smooth = unit(weight[0] * corner[0] + on.x * corner[1] + on.y * corner[2], triangle.normal);
  const double side = glm::dot(smooth, point.geometric_normal) < 0.0 ? -1.0 : 1.0;
  point.shading_normal = side * smooth;

  if (lifts_) lift(triangle, weight, side, point);
  point.offset = hit.offset;

  const Mesh& mesh = mesh_of(triangle);
  const glm::uvec3& corners = corners_of(mesh, triangle);
  for (std::size_t set = 0; set < point.uv.size(); ++set) {
    const auto& uvs = mesh.uvs[set];
    if (uvs.empty()) continue;
    point.uv[set] = glm::vec2(b0 * glm::dvec2(uvs[corners.x]) + at.x * glm::dvec2(uvs[corners.y]) +
                              at.y * glm::dvec2(uvs[corners.z]));
  }
  if (!mesh.colors.empty()) {
    point.color = weight[0] * glm::dvec4(mesh.colors[corners.x]) + on.x * glm::dvec4(mesh.colors[corners.y]) +
                  on.y * glm::dvec4(mesh.colors[corners.z]);
  }
  point.surface = triangle.surface;
  point.material = mesh.material;
  point.layer = layer_of(triangle, point.inside);
  if (needs_tangents(scene_.materials[mesh.material])) add_tangents(triangle, weight, point);
  return point;
}

/// Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, chapter 4: the origin is lifted to where the corners'
/// tangent planes are, as far as they lie above the triangle.
void Surfaces::lift(const WorldTriangle& triangle, const Weights& weights, double side, SurfacePoint& point) {
  const glm::dvec3 in_triangle = weights[1] * triangle.e1 + weights[2] * triangle.e2;
  const std::array<glm::dvec3, 3> from_corner{in_triangle, in_triangle - triangle.e1, in_triangle - triangle.e2};
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3 normal = side * triangle.normals[i];
    point.lift -= weights[i] * std::min(0.0, glm::dot(from_corner[i], normal)) * normal;
  }
}

void Surfaces::add_tangents(const WorldTriangle& triangle, const Weights& weights, SurfacePoint& point) const {
  const Instance& instance = scene_.instances[triangle.instance];
  const Mesh& mesh = mesh_of(triangle);
  const glm::uvec3& corners = corners_of(mesh, triangle);
  // Seen from behind, the mapped normal turns round as a whole.
  const double side = point.inside ? -1.0 : 1.0;
  const auto between = [&](const auto& of_vertices) {
    glm::dvec3 sum(0.0);
    for (int corner = 0; corner < 3; ++corner) {
      sum += weights[static_cast<std::size_t>(corner)] * glm::dvec3(of_vertices[corners[corner]]);
    }
    return sum;
  };
  if (!mesh.tangents.empty()) {
    const glm::dvec3 along = between(mesh.tangents);
    const glm::dvec3 normal = between(mesh.normals);
    // glTF 2.0, section 3.7.2.1; both carried into the world, so that mirroring mirrors them.
    const glm::dvec3 across = static_cast<double>(mesh.tangents[corners.x].w) * glm::cross(normal, along);
    const glm::dmat3 linear(instance.to_world);
    const glm::dvec3 tangent = unit(linear * along, glm::dvec3(0.0));
    const glm::dvec3 bitangent = unit(linear * across, glm::dvec3(0.0));
    if (tangent != glm::dvec3(0.0) && bitangent != glm::dvec3(0.0)) {
      point.tangent = side * tangent;
      point.bitangent = side * bitangent;
      return;
    }
  }
  const TextureRef& map = map_of_tangents(scene_.materials[mesh.material]);
  const auto& uvs = mesh.uvs[std::min<std::size_t>(map.uv_set, mesh.uvs.size() - 1)];
  if (uvs.empty()) return;
  const glm::dvec2 uv0 = transformed_uv(map, uvs[corners.x]);
  const glm::dvec2 d1 = transformed_uv(map, uvs[corners.y]) - uv0;
  const glm::dvec2 d2 = transformed_uv(map, uvs[corners.z]) - uv0;
  // In the mesh's own coordinates and carried into the world as the file's are, so that stretching treats both alike.
  const glm::dvec3 p0(mesh.positions[corners.x]);
  const glm::dvec3 e1 = glm::dvec3(mesh.positions[corners.y]) - p0;
  const glm::dvec3 e2 = glm::dvec3(mesh.positions[corners.z]) - p0;
  const glm::dvec3 normal = unit(between(mesh.normals), direction_of_cross(e1, e2));
  // Positions as a linear function of u and v, times the determinant of the differences.
  const double turn = d1.x * d2.y - d1.y * d2.x < 0.0 ? -1.0 : 1.0;
  const glm::dvec3 by_u = turn * (d2.y * e1 - d1.y * e2);
  const glm::dvec3 by_v = turn * (d1.x * e2 - d2.x * e1);
  const glm::dvec3 along = unit(by_u - glm::dot(by_u, normal) * normal, glm::dvec3(0.0));
  const glm::dvec3 across = glm::cross(normal, along);
  const glm::dmat3 linear(instance.to_world);
  point.tangent = side * unit(linear * along, glm::dvec3(0.0));
  // The map's y points up, v points down.
  point.bitangent = (glm::dot(across, by_v) > 0.0 ? -side : side) * unit(linear * across, glm::dvec3(0.0));
}

}  // namespace hpr
