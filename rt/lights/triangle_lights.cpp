#include "rt/lights/triangle_lights.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <span>
#include <utility>

#include "rt/materials/material_point.h"
#include "rt/sampling/sampling.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/requirements.h"

namespace hpr {
namespace {

constexpr double kMinSolidAngle = 1e-6;
constexpr double kMinSine = 1e-4;

/// The part of `v` that is perpendicular to `axis`, at unit length.
glm::dvec3 perpendicular(const glm::dvec3& v, const glm::dvec3& axis) {
  return glm::normalize(v - glm::dot(v, axis) * axis);
}

}  // namespace

SphericalTriangle::SphericalTriangle(const glm::dvec3& position, const glm::dvec3& v0, const glm::dvec3& e1,
                                     const glm::dvec3& e2) {
  const glm::dvec3 to_a = v0 - position;
  const glm::dvec3 to_b = to_a + e1;
  const glm::dvec3 to_c = to_a + e2;
  const double la = glm::length(to_a);
  const double lb = glm::length(to_b);
  const double lc = glm::length(to_c);
  const double product = la * lb * lc;
  if (!(product > 0.0) || !std::isfinite(product)) return;
  a_ = to_a / la;
  b_ = to_b / lb;
  c_ = to_c / lc;
  const double determinant = std::abs(glm::dot(to_a, glm::cross(e1, e2))) / product;
  const double sum = 1.0 + glm::dot(a_, b_) + glm::dot(b_, c_) + glm::dot(c_, a_);
  solid_angle_ = 2.0 * std::atan2(determinant, sum);
  const glm::dvec3 normal_ab = glm::cross(to_a, e1);
  const glm::dvec3 normal_ac = glm::cross(to_a, e2);
  alpha_ = std::atan2(glm::length(glm::cross(normal_ab, normal_ac)), glm::dot(normal_ab, normal_ac));
  const double sine2 = glm::dot(normal_ab, normal_ab) / (la * la * lb * lb);
  const double cosine = glm::dot(a_, b_);
  below_cos_c_ = cosine > 0.0 ? sine2 / (1.0 + cosine) : 1.0 - cosine;
}

bool SphericalTriangle::can_sample() const {
  return solid_angle_ >= kMinSolidAngle && std::sin(alpha_) > kMinSine && below_cos_c_ < 2.0 - 1e-6;
}

glm::dvec3 SphericalTriangle::sample(const glm::dvec2& u) const {
  // A smaller triangle with the share u.x of the area, cut off by the arc from b to a point d on the arc from a to c.
  const double s = u.x * solid_angle_;
  const double sin_alpha = std::sin(alpha_);
  const double cos_alpha = std::cos(alpha_);
  const double sin_phi = std::sin(alpha_ - s);
  const double cos_phi = -std::cos(alpha_ - s);
  const double half = std::sin(0.5 * s);
  const double k1 = -2.0 * std::sin(alpha_ - 0.5 * s) * half;  // cos alpha + cos phi
  const double k2 = -2.0 * std::cos(alpha_ - 0.5 * s) * half + sin_alpha * below_cos_c_;
  const double cos_ad = std::clamp(
      (k2 + (k2 * cos_phi - k1 * sin_phi) * cos_alpha) / ((k2 * sin_phi + k1 * cos_phi) * sin_alpha), -1.0, 1.0);
  const glm::dvec3 d = cos_ad * a_ + std::sqrt((1.0 - cos_ad) * (1.0 + cos_ad)) * perpendicular(c_, a_);
  // A point of the arc from b to d, uniform in the cosine.
  const double bd = glm::length(d - b_);
  const double below = u.y * 0.5 * bd * bd;  // 1 - cos
  if (!(below > 0.0)) return b_;
  const double across = std::sqrt(below * (2.0 - below));
  return glm::normalize((1.0 - below) * b_ + across * perpendicular(d, b_));
}

namespace {

/// A texture is looked at texel by texel where a triangle shows no more of them.
constexpr double kMaxTexels = 1024.0;
/// The quadrature of a triangle's mean radiance: so many parts a side.
constexpr int kMaxParts = 16;
/// What a triangle is chosen by is never below this share of its brightest spot, which the quadrature may miss.
constexpr double kMinShare = 0.01;

double mean_of(const glm::dvec3& color) {
  return (color.r + color.g + color.b) / 3.0;
}

glm::dvec2 uv_at(const Mesh& mesh, std::uint32_t set, const glm::uvec3& corners, const glm::dvec2& at) {
  if (set >= mesh.uvs.size() || mesh.uvs[set].empty()) return glm::dvec2(0.0);
  const auto& uvs = mesh.uvs[set];
  return (1.0 - at.x - at.y) * glm::dvec2(uvs[corners.x]) + at.x * glm::dvec2(uvs[corners.y]) +
         at.y * glm::dvec2(uvs[corners.z]);
}

glm::dvec4 read(const Scene& scene, const TextureRef& reference, Encoding encoding, const glm::dvec2& uv) {
  return sample_texture(scene.textures[static_cast<std::size_t>(reference.texture)], encoding,
                        transformed_uv(reference, glm::vec2(uv)));
}

/// How much of the surface is there: what is cut out emits nothing.
double coverage(const Scene& scene, const Material& material, const Mesh& mesh, const glm::uvec3& corners,
                const glm::dvec2& at) {
  if (material.alpha_mode == AlphaMode::Opaque) return 1.0;
  double alpha = 1.0;
  if (!mesh.colors.empty()) {
    const auto vertex = [&](std::uint32_t corner) { return static_cast<double>(mesh.colors[corner].a); };
    alpha = (1.0 - at.x - at.y) * vertex(corners.x) + at.x * vertex(corners.y) + at.y * vertex(corners.z);
  }
  return evaluate_alpha(scene, material,
                        {glm::vec2(uv_at(mesh, 0, corners, at)), glm::vec2(uv_at(mesh, 1, corners, at))}, alpha);
}

/// No place of the triangle has more.
double max_coverage(const Material& material, const Mesh& mesh, const glm::uvec3& corners) {
  auto alpha = static_cast<double>(material.base_color.a);
  if (!mesh.colors.empty()) {
    alpha *=
        static_cast<double>(std::max({mesh.colors[corners.x].a, mesh.colors[corners.y].a, mesh.colors[corners.z].a}));
  }
  return coverage_of(material, alpha);
}

/// The texels a triangle may show, bilinear neighbours included: [low, high] in texels, not yet wrapped.
struct TexelBox {
  glm::dvec2 low{0.0};
  glm::dvec2 high{0.0};
  [[nodiscard]] double count() const { return (high.x - low.x + 1.0) * (high.y - low.y + 1.0); }
};

TexelBox texels_of(const Texture& texture, const TextureRef& reference, const Mesh& mesh, const glm::uvec3& corners) {
  TexelBox box{glm::dvec2(1e300), glm::dvec2(-1e300)};
  const glm::dvec2 size(texture.image.width(), texture.image.height());
  for (const glm::dvec2 corner : {glm::dvec2(0, 0), glm::dvec2(1, 0), glm::dvec2(0, 1)}) {
    const glm::dvec2 at = transformed_uv(reference, glm::vec2(uv_at(mesh, reference.uv_set, corners, corner))) * size;
    box.low = glm::min(box.low, glm::floor(at - 1.0));
    box.high = glm::max(box.high, glm::floor(at + 1.0));
  }
  return box;
}

/// Möller and Trumbore 1997: where the direction meets the triangle's plane, moved onto the triangle.
glm::dvec2 met_at(const TriangleLight& triangle, const glm::dvec3& position, const glm::dvec3& direction) {
  const glm::dvec3 from_v0 = position - triangle.v0;
  const glm::dvec3 p = glm::cross(direction, triangle.e2);
  const double determinant = glm::dot(triangle.e1, p);
  glm::dvec2 at(glm::dot(from_v0, p) / determinant,
                glm::dot(direction, glm::cross(from_v0, triangle.e1)) / determinant);
  if (!std::isfinite(at.x) || !std::isfinite(at.y)) return glm::dvec2(1.0 / 3.0);
  at = glm::max(at, glm::dvec2(0.0));
  const double sum = at.x + at.y;
  return sum > 1.0 ? at / sum : at;
}

glm::dvec2 uniform_in_triangle(const glm::dvec2& u) {
  const double root = std::sqrt(1.0 - u.x);
  return {(1.0 - root), root * u.y};
}

/// Per solid angle, of a point uniform over the area; 0 when it is seen edge-on.
double area_pdf(const TriangleLight& triangle, const glm::dvec3& to_point) {
  const double distance = glm::length(to_point);
  if (!(distance > 0.0)) return 0.0;
  const double cosine = std::abs(glm::dot(triangle.normal, to_point / distance));
  const double pdf = distance * distance / (triangle.area * cosine);
  return cosine > 0.0 && std::isfinite(pdf) ? pdf : 0.0;
}

bool is_coated(const Material& material) {
  return material.extensions && material.extensions->clearcoat > 0.0F;
}

std::unique_ptr<const Surfaces> kept_for_coats(std::unique_ptr<const Surfaces> surfaces,
                                               std::span<const TriangleLight> triangles) {
  return std::ranges::any_of(triangles, &TriangleLight::is_coated) ? std::move(surfaces) : nullptr;
}

}  // namespace

TriangleLights::TriangleLights(const Scene& scene) : scene_(&scene) {
  std::vector<std::uint8_t> emitting;
  for (const Material& material : scene.materials) emitting.push_back(emits(scene, material) ? 1 : 0);
  if (std::ranges::count(emitting, 1) == 0) return;  // Surfaces looks at every vertex
  auto all = std::make_unique<const Surfaces>(scene, RaySpace(scene));
  const Surfaces& surfaces = *all;
  WorldTriangle world;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Mesh& mesh = scene.mesh_of(scene.instances[i]);
    if (emitting[mesh.material] == 0) continue;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      surfaces.load(scene.instances[i].first_surface + static_cast<std::uint32_t>(t), world);
      TriangleLight light{world.v0, world.e1, world.e2, world.normal};
      light.area = 0.5 * glm::length(glm::cross(world.e1, world.e2));
      if (!(light.area > 0.0) || !std::isfinite(light.area) || world.normal == glm::dvec3(0.0)) continue;
      light.offset = world.offset;
      const Material& material = scene.materials[mesh.material];
      light.two_sided = shows_both_sides(material);
      light.is_coated = is_coated(material);
      if (!light.two_sided && is_mirrored(scene.instances[i])) light.normal = -light.normal;
      light.surface = world.surface;
      light.instance = static_cast<std::uint32_t>(i);
      light.index = static_cast<std::uint32_t>(t);
      estimate_brightness(light);
      if (light.brightness > 0.0) triangles_.push_back(light);
    }
  }
  coated_ = kept_for_coats(std::move(all), triangles_);
}

/// Sets the mean radiance, and what the triangle is chosen by; both 0 when it surely emits nothing.
void TriangleLights::estimate_brightness(TriangleLight& triangle) const {
  const Mesh& mesh = scene_->mesh_of(scene_->instances[triangle.instance]);
  const Material& material = scene_->materials[mesh.material];
  const glm::uvec3& corners = mesh.triangles[triangle.index];
  double peak = mean_of(glm::dvec3(material.emissive));
  int parts = material.alpha_mode == AlphaMode::Opaque ? 1 : kMaxParts;
  if (const TextureRef& reference = material.emissive_texture; reference.present()) {
    const Texture& texture = scene_->textures[static_cast<std::size_t>(reference.texture)];
    const TexelBox box = texels_of(texture, reference, mesh, corners);
    const double side = std::max(box.high.x - box.low.x, box.high.y - box.low.y);
    parts = std::max(parts, static_cast<int>(std::clamp(side, 1.0, static_cast<double>(kMaxParts))));
    if (texture.image.size().area() > 0 && box.count() <= kMaxTexels) {
      peak = 0.0;
      const glm::dvec2 size(texture.image.width(), texture.image.height());
      for (double y = box.low.y; y <= box.high.y; ++y) {
        for (double x = box.low.x; x <= box.high.x; ++x) {
          const glm::dvec4 texel = sample_texture(texture, Encoding::Srgb, (glm::dvec2(x, y) + 0.5) / size);
          peak = std::max(peak, mean_of(glm::dvec3(material.emissive) * glm::dvec3(texel)));
        }
      }
    }
  }
  peak *= max_coverage(material, mesh, corners);
  if (!(peak > 0.0)) return;
  // The middles of parts^2 equal triangles.
  glm::dvec3 sum(0.0);
  for (int row = 0; row < parts; ++row) {
    for (int column = 0; column < 2 * (parts - row) - 1; ++column) {
      const double third = column % 2 == 0 ? 1.0 / 3.0 : 2.0 / 3.0;
      const int pair = column / 2;
      sum += radiance(triangle, glm::dvec2(pair + third, row + third) / static_cast<double>(parts));
    }
  }
  triangle.mean = sum / static_cast<double>(parts * parts);
  triangle.brightness = std::max(mean_of(triangle.mean), kMinShare * peak);
}

glm::dvec3 TriangleLights::radiance(const TriangleLight& triangle, const glm::dvec2& at) const {
  const Mesh& mesh = scene_->mesh_of(scene_->instances[triangle.instance]);
  const Material& material = scene_->materials[mesh.material];
  const glm::uvec3& corners = mesh.triangles[triangle.index];
  glm::dvec3 radiance(material.emissive);
  if (const TextureRef& texture = material.emissive_texture; texture.present()) {
    radiance *= glm::dvec3(read(*scene_, texture, Encoding::Srgb, uv_at(mesh, texture.uv_set, corners, at)));
  }
  return radiance * coverage(*scene_, material, mesh, corners, at);
}

/// What leaves a place of the triangle along `direction`, of unit length: as for a ray that comes from there.
glm::dvec3 TriangleLights::radiance_along(const TriangleLight& triangle, const glm::dvec2& at,
                                          const glm::dvec3& position, const glm::dvec3& direction) const {
  if (!triangle.is_coated) return radiance(triangle, at);
  WorldTriangle world;
  coated_->load(triangle.surface, world);
  const MaterialPoint point = evaluate_material(*scene_, coated_->meet(world, position + direction, -direction));
  return point.alpha * point.emission;
}

std::optional<std::size_t> TriangleLights::find(std::uint32_t surface) const {
  const auto found = std::ranges::lower_bound(triangles_, surface, {}, &TriangleLight::surface);
  if (found == triangles_.end() || found->surface != surface) return std::nullopt;
  return static_cast<std::size_t>(found - triangles_.begin());
}

LightSample TriangleLights::sample(std::size_t index, const glm::dvec3& position, const glm::dvec2& u) const {
  const TriangleLight& triangle = triangles_[index];
  if (!triangle.shines_on(position)) return LightSample{};
  const SphericalTriangle seen(position, triangle.v0, triangle.e1, triangle.e2);
  const bool by_angle = seen.can_sample();
  const glm::dvec2 at = by_angle ? met_at(triangle, position, seen.sample(u)) : uniform_in_triangle(u);
  LightSample sample;
  sample.goal = triangle.v0 + at.x * triangle.e1 + at.y * triangle.e2;
  const glm::dvec3 to_goal = sample.goal - position;
  sample.distance = glm::length(to_goal);
  if (!(sample.distance > 0.0) || !std::isfinite(sample.distance)) return LightSample{};
  sample.to_light = to_goal / sample.distance;
  sample.pdf = by_angle ? 1.0 / seen.solid_angle() : area_pdf(triangle, to_goal);
  sample.offset = triangle.offset;
  if (sample.pdf > 0.0) sample.weight = radiance_along(triangle, at, sample.goal, -sample.to_light) / sample.pdf;
  return sample;
}

double TriangleLights::pdf(std::size_t index, const glm::dvec3& position, const glm::dvec3& point) const {
  const TriangleLight& triangle = triangles_[index];
  if (!triangle.shines_on(position)) return 0.0;
  const SphericalTriangle seen(position, triangle.v0, triangle.e1, triangle.e2);
  return seen.can_sample() ? 1.0 / seen.solid_angle() : area_pdf(triangle, point - position);
}

PhotonStart TriangleLights::emit(std::size_t index, double u_side, const glm::dvec2& u_place,
                                 const glm::dvec2& u_direction) const {
  const TriangleLight& triangle = triangles_[index];
  const glm::dvec2 at = uniform_in_triangle(u_place);
  PhotonStart start;
  start.origin = triangle.v0 + at.x * triangle.e1 + at.y * triangle.e2;
  const bool is_front = !triangle.two_sided || u_side < 0.5;
  start.direction = warp::cosine_lobe(is_front ? triangle.normal : -triangle.normal, u_direction);
  start.flux =
      triangle.sides() * std::numbers::pi * triangle.area * radiance_along(triangle, at, start.origin, start.direction);
  start.surface = triangle.surface;
  start.offset = triangle.offset;
  return start;
}

glm::dvec3 TriangleLights::power(std::size_t index) const {
  return triangles_[index].sides() * std::numbers::pi * triangles_[index].area * triangles_[index].mean;
}

LightBounds TriangleLights::bounds(std::size_t index) const {
  const TriangleLight& triangle = triangles_[index];
  const glm::dvec3 v1 = triangle.v0 + triangle.e1;
  const glm::dvec3 v2 = triangle.v0 + triangle.e2;
  LightBounds bounds;
  bounds.low = glm::min(triangle.v0, glm::min(v1, v2));
  bounds.high = glm::max(triangle.v0, glm::max(v1, v2));
  bounds.strength = triangle.brightness * triangle.area;
  bounds.axis = triangle.normal;
  bounds.two_sided = triangle.two_sided;
  return bounds;
}

}  // namespace hpr
