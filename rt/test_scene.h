#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"
#include "rt/deferred_shader.h"
#include "scene/requirements.h"
#include "scene/scene.h"
#include "scene/view.h"

/// Small scenes and keys for the tests of rt/, by the most direct means: no GL, no Embree.
namespace hpr::test {

inline std::uint32_t add_material(Scene& scene, const Material& material) {
  scene.materials.push_back(material);
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

/// White Lambert: no specular layer (an ior of 1 reflects nothing).
inline Material diffuse(glm::vec3 color = glm::vec3(1.0F)) {
  Material material;
  material.base_color = glm::vec4(color, 1.0F);
  material.metallic = 0.0F;
  material.ior = 1.0F;
  return material;
}

inline Material mirror(float reflectance) {
  Material material;
  material.base_color = glm::vec4(glm::vec3(reflectance), 1.0F);
  material.metallic = 1.0F;
  material.roughness = 0.0F;
  return material;
}

inline Material glowing(glm::vec3 radiance) {
  Material material = diffuse(glm::vec3(0.0F));
  material.emissive = radiance;
  return material;
}

/// Smooth and colourless: `thickness` 0 is a sheet, anything else bounds a volume.
inline Material clear_glass(float ior, float thickness) {
  Material material;
  material.metallic = 0.0F;
  material.roughness = 0.0F;
  material.transmission = 1.0F;
  material.ior = ior;
  material.thickness = thickness;
  return material;
}

inline Environment even_light(const Rgb& radiance) {
  Environment environment;
  environment.image = Image<Rgb>({1, 1});
  environment.image.at(0, 0) = radiance;
  return environment;
}

inline std::uint32_t add_mesh(Scene& scene, Mesh mesh) {
  if (mesh.normals.empty()) mesh.normals = smooth_normals(mesh.positions, mesh.triangles);
  scene.meshes.push_back(std::move(mesh));
  return static_cast<std::uint32_t>(scene.meshes.size() - 1);
}

inline void place_mesh(Scene& scene, std::uint32_t mesh, const glm::dmat4& to_world = glm::dmat4(1.0)) {
  scene.instances.push_back({mesh, to_world, 0});
}

/// The parallelogram corner, corner + a, corner + a + b, corner + b; its normal is a x b.
inline Mesh quad(glm::vec3 corner, glm::vec3 a, glm::vec3 b, std::uint32_t material) {
  Mesh mesh;
  mesh.positions = {corner, corner + a, corner + a + b, corner + b};
  mesh.uvs[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.material = material;
  return mesh;
}

inline Mesh sphere(double radius, int rings, std::uint32_t material) {
  Mesh mesh;
  const int sides = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j <= sides; ++j) {
      const double polar = std::numbers::pi * i / rings;
      const double around = 2.0 * std::numbers::pi * j / sides;
      const glm::dvec3 normal(std::sin(polar) * std::cos(around), std::cos(polar), std::sin(polar) * std::sin(around));
      mesh.positions.emplace_back(radius * normal);
      mesh.normals.emplace_back(normal);
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * (sides + 1) + j); };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sides; ++j) {
      if (i > 0) mesh.triangles.emplace_back(at(i, j), at(i, j + 1), at(i + 1, j));
      if (i + 1 < rings) mesh.triangles.emplace_back(at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
    }
  }
  mesh.material = material;
  return mesh;
}

/// A diffuse white square in the plane y = 0, metres 8 x 8.
inline Scene white_floor() {
  Scene scene;
  add_material(scene, diffuse());
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  finish_scene(scene);
  return scene;
}

struct Met {
  double distance = std::numeric_limits<double>::infinity();
  std::uint32_t surface = 0;
};

/// Finds the nearest surface along a ray by trying every triangle.
class Caster {
 public:
  explicit Caster(const Scene& scene) {
    for (const Instance& instance : scene.instances) {
      const Mesh& mesh = scene.mesh_of(instance);
      for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 v0 = world_position(instance, mesh.positions[t.x]);
        const glm::dvec3 e1 = world_position(instance, mesh.positions[t.y]) - v0;
        const glm::dvec3 e2 = world_position(instance, mesh.positions[t.z]) - v0;
        triangles_.push_back({v0, e1, e2, glm::cross(e1, e2)});
      }
    }
  }

  [[nodiscard]] Met cast(const glm::dvec3& origin, const glm::dvec3& direction) const {
    Met met;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      const Triangle& triangle = triangles_[i];
      const double t = glm::dot(triangle.normal, triangle.v0 - origin) / glm::dot(triangle.normal, direction);
      if (!(t > 0.0) || !(t < met.distance)) continue;
      const glm::dvec3 p = origin + t * direction - triangle.v0;
      const double area2 = glm::dot(triangle.normal, triangle.normal);
      const double u = glm::dot(glm::cross(p, triangle.e2), triangle.normal) / area2;
      const double v = glm::dot(glm::cross(triangle.e1, p), triangle.normal) / area2;
      if (u >= 0.0 && v >= 0.0 && u + v <= 1.0) met = {t, static_cast<std::uint32_t>(i)};
    }
    return met;
  }

 private:
  struct Triangle {
    glm::dvec3 v0, e1, e2, normal;
  };
  std::vector<Triangle> triangles_;
};

inline TileLayer<Key> cast_keys(const Scene& scene, std::span<const View> views) {
  std::vector<Size> sizes;
  for (const View& view : views) sizes.push_back(view.size());
  TileLayer<Key> keys{FrameLayout(sizes)};
  const Caster caster(scene);
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    for (int y = 0; y < sizes[screen].height; ++y) {
      for (int x = 0; x < sizes[screen].width; ++x) {
        const Ray ray = view_ray(views[screen], x + 0.5, y + 0.5);
        const Met met = caster.cast(ray.origin, ray.direction);
        if (!std::isfinite(met.distance)) continue;
        const double depth = reversed_depth(views[screen], met.distance);
        keys.at(screen, x, y) = make_key(static_cast<float>(depth), met.surface);
        keys.set_active(keys.layout().tile_at(screen, x, y));
      }
    }
  }
  return keys;
}

struct Shaded {
  Image<Rgb> image;
  RayCounts counts;
};

inline Shaded shade(const Scene& scene, const View& view, const RaySettings& settings = {},
                    const MakeTileShader& make_device = {}) {
  const TileLayer<Key> keys = cast_keys(scene, std::span(&view, 1));
  TileLayer<Rgb> radiance(keys.layout());
  DeferredShader shader(scene, settings, requirements_of(scene), {}, nullptr, make_device);
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance});
  return {to_image(radiance, 0), shader.counts()};
}

/// The mean of a picture's green.
inline double mean(const Image<Rgb>& image) {
  double sum = 0.0;
  for (const Rgb& color : image.pixels()) sum += static_cast<double>(color.g);
  return sum / static_cast<double>(image.pixels().size());
}

/// The mean of a pixel over many samples.
inline glm::dvec3 mean_pixel(const Scene& scene, const View& view, int x, int y, std::uint32_t samples,
                             const RaySettings& settings = {}) {
  const TileLayer<Key> keys = cast_keys(scene, std::span(&view, 1));
  DeferredShader shader(scene, settings);
  glm::dvec3 sum(0.0);
  for (std::uint32_t sample = 0; sample < samples; ++sample) {
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = sample});
    const Rgb& color = radiance.at(0, x, y);
    sum += glm::dvec3(color.r, color.g, color.b);
  }
  return sum / static_cast<double>(samples);
}

inline View view_from(const glm::dvec3& eye, const glm::dvec3& at, Size size, const Scene& scene, double fov = 0.8,
                      const glm::dvec3& up = {0.0, 1.0, 0.0}) {
  return make_view(look_at(eye, at, up, fov), size, scene.bounds);
}

}  // namespace hpr::test
