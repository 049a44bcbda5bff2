#include "tools/stability/light_tools.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include "core/parallel.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/ray_scene.h"
#include "tools/stability/tools.h"

namespace hpr::stability {

glm::dvec3 RandomStream::on_sphere() {
  const double z = 2.0 * one() - 1.0;
  const double angle = 2.0 * std::numbers::pi * one();
  const double radius = std::sqrt(std::max(0.0, 1.0 - z * z));
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

glm::dvec3 RandomStream::in_ball() {
  const glm::dvec3 direction = on_sphere();
  return std::cbrt(one()) * direction;
}

StabilityFinding finding(std::string name, std::string parameter, double limit, std::string unit, std::string why) {
  StabilityFinding made;
  made.name = std::move(name);
  made.parameter = std::move(parameter);
  made.limit = limit;
  made.unit = std::move(unit);
  made.why = std::move(why);
  return made;
}

int threads_of(const Globals& globals) {
  return globals.threads > 0 ? globals.threads : usable_cores();
}

Material matte(const glm::vec3& color) {
  Material material;
  material.base_color = glm::vec4(color, 1.0F);
  material.metallic = 0.0F;
  material.ior = 1.0F;
  return material;
}

Material mirror(float reflectance) {
  Material material;
  material.base_color = glm::vec4(glm::vec3(reflectance), 1.0F);
  material.metallic = 1.0F;
  material.roughness = 0.0F;
  return material;
}

std::uint32_t add_placed(Scene& scene, Mesh mesh, const Material& material, const glm::dmat4& to_world) {
  mesh.material = static_cast<std::uint32_t>(scene.materials.size());
  scene.materials.push_back(material);
  add(scene, std::move(mesh), to_world);
  return static_cast<std::uint32_t>(scene.meshes.size() - 1);
}

Mesh parallelogram(const glm::dvec3& corner, const glm::dvec3& a, const glm::dvec3& b) {
  Mesh mesh;
  mesh.positions = {corner, corner + a, corner + a + b, corner + b};
  mesh.normals.assign(4, glm::vec3(glm::normalize(glm::cross(a, b))));
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

LitPicture lit_picture(const Scene& scene, const View& view, const RaySettings& settings) {
  const Size size = view.size();
  LitPicture picture{TileLayer<Key>(FrameLayout({size})), {}, {}};
  const RayScene rays(scene, RaySpace(scene.bounds), settings.threads);
  const Rect whole{0, 0, size.width, size.height};
  PrimaryRays(scene, rays, settings.threads).draw(view, 0, std::span(&whole, 1), picture.keys);
  TileLayer<Rgb> radiance(picture.keys.layout());
  DeferredShader shader(scene, settings);
  shader.shade(std::span(&view, 1), picture.keys, all_tiles(picture.keys.layout()), {.radiance = &radiance});
  picture.image = to_image(radiance, 0);
  picture.counts = shader.counts();
  return picture;
}

View glance(const Scene& scene, const glm::dvec3& eye, const glm::dvec3& at) {
  const glm::dvec3 way = glm::normalize(at - eye);
  const glm::dvec3 up = std::abs(way.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  Camera camera = look_at(eye, at, up, 1e-3);
  std::get<PerspectiveLens>(camera.lens).near_distance = 1e-3 * glm::distance(eye, at);
  return make_view(camera, {1, 1}, scene.bounds);
}

double glanced(const Scene& scene, const View& view, const RaySettings& settings) {
  return static_cast<double>(lit_picture(scene, view, settings).image.at(0, 0).r);
}

RaySettings only(std::vector<PassId> passes, int threads) {
  RaySettings settings;
  settings.auto_passes = false;
  settings.passes = std::move(passes);
  settings.threads = threads;
  return settings;
}

double worse(double a, double b) {
  constexpr double kWorst = std::numeric_limits<double>::infinity();
  return std::isnan(a) || std::isnan(b) ? kWorst : std::max(a, b);
}

}  // namespace hpr::stability
