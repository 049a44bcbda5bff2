#include "tools/stability/tools.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include "cluster/transport/local_communicator.h"
#include "core/parallel.h"
#include "engine/frame.h"
#include "engine/session.h"
#include "raster/rasterizer.h"
#include "rt/deferred_shader.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/ray_scene.h"
#include "scene/generators/shapes.h"

namespace hpr::stability {
namespace {

/// The share of pixels for which `differs(x, y, neighbour's x, neighbour's y)` with any of its four neighbours.
template <typename Pixel, typename Differs>
double fraction_at_edges(const Image<Pixel>& image, const Differs& differs) {
  constexpr std::array<std::array<int, 2>, 4> kNeighbors{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
  std::size_t found = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      found += std::ranges::any_of(kNeighbors, [&](const std::array<int, 2>& step) {
        const int nx = std::clamp(x + step[0], 0, image.width() - 1);
        const int ny = std::clamp(y + step[1], 0, image.height() - 1);
        return differs(image.at(x, y), image.at(nx, ny));
      });
    }
  }
  return static_cast<double>(found) / static_cast<double>(image.pixels().size());
}

template <typename Pixel, typename Differs>
double differing_fraction(const Image<Pixel>& a, const Image<Pixel>& b, const Differs& differs) {
  HPR_CHECK(a.size() == b.size());
  std::size_t found = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) found += differs(a.pixels()[i], b.pixels()[i]) ? 1U : 0U;
  return static_cast<double>(found) / static_cast<double>(a.pixels().size());
}

bool another_surface(Key a, Key b) {
  return static_cast<std::uint32_t>(a) != static_cast<std::uint32_t>(b);
}

bool another_color(const Rgb& a, const Rgb& b) {
  const Rgba8 x = to_srgb(a);
  const Rgba8 y = to_srgb(b);
  return std::abs(x.r - y.r) > 1 || std::abs(x.g - y.g) > 1 || std::abs(x.b - y.b) > 1;
}

Rect whole(const View& view) {
  return {0, 0, view.size().width, view.size().height};
}

glm::dvec3 snapped(const glm::dvec3& position, double steps_per_metre) {
  return steps_per_metre > 0.0 ? glm::round(position * steps_per_metre) / steps_per_metre : position;
}

std::uint32_t add_material(Scene& scene, const glm::vec3& color, float metallic, float roughness) {
  Material material;
  material.base_color = glm::vec4(color, 1.0F);
  material.metallic = metallic;
  material.roughness = roughness;
  scene.materials.push_back(material);
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

void scale_lights(Scene& scene, double factor) {
  for (Light& light : scene.lights) {
    light.position *= factor;
    light.range *= factor;
    light.radius *= factor;
    if (light.type == LightType::Point || light.type == LightType::Spot) {
      light.intensity *= static_cast<float>(factor * factor);
    }
  }
  for (Material& material : scene.materials) {
    material.thickness *= static_cast<float>(factor);
    material.attenuation_distance *= static_cast<float>(factor);
  }
}

}  // namespace

double worse(double a, double b) {
  constexpr double kWorst = std::numeric_limits<double>::infinity();
  return std::isnan(a) || std::isnan(b) ? kWorst : std::max(a, b);
}

StabilityFinding make_finding(std::string name, std::string parameter, double limit, std::string unit,
                              std::string why) {
  StabilityFinding finding;
  finding.name = std::move(name);
  finding.parameter = std::move(parameter);
  finding.limit = limit;
  finding.unit = std::move(unit);
  finding.why = std::move(why);
  return finding;
}

void add_point(StabilityFinding& finding, double parameter, double measured, bool promised) {
  finding.curve.points.emplace_back(parameter, measured);
  if (promised) finding.measured = worse(finding.measured, measured);
}

void add(Scene& scene, Mesh mesh, const glm::dmat4& to_world) {
  if (mesh.normals.empty()) mesh.normals = smooth_normals(mesh.positions, mesh.triangles);
  scene.meshes.push_back(std::move(mesh));
  scene.instances.push_back({static_cast<std::uint32_t>(scene.meshes.size() - 1), to_world, 0});
}

Mesh rectangle(const glm::vec2& low, const glm::vec2& high) {
  Mesh mesh;
  mesh.positions = {{low.x, low.y, 0.0F}, {high.x, low.y, 0.0F}, {high.x, high.y, 0.0F}, {low.x, high.y, 0.0F}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

View head_on(Size size, double slope, double near_distance) {
  View view;
  view.right = slope;
  view.left = -slope;
  view.top = slope * size.height / size.width;
  view.bottom = -view.top;
  view.near_distance = near_distance;
  view.screen = size;
  view.block = {0, 0, size.width, size.height};
  return view;
}

Drawer::Drawer(const Globals& globals)
    : context_(make_gl_context({.backend = globals.backend, .device = globals.device, .threads = globals.threads})) {}

Image<Key> Drawer::draw(const Scene& scene, const View& view) {
  return to_image(draw(scene, view, std::array{SurfaceRange{0, scene.triangles}}), 0);
}

TileLayer<Key> Drawer::draw(const Scene& scene, const View& view, std::span<const SurfaceRange> objects) {
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer(*context_, scene, objects, 1).draw(view, 0, std::array{whole(view)}, layer);
  return layer;
}

TileLayer<Key> Drawer::draw_parts(const Scene& scene, const View& view, std::span<const Rect> parts) {
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer(*context_, scene, std::array{SurfaceRange{0, scene.triangles}}, 1).draw(view, 0, parts, layer);
  return layer;
}

Coverage coverage(Drawer& drawer, const Mesh& mesh, const glm::dmat4& to_world, const View& view) {
  constexpr std::size_t kClasses = 24;
  std::array<Mesh, kClasses> classes;
  std::vector<std::uint32_t> used_classes(mesh.positions.size(), 0);
  std::size_t turn = 0;
  for (const glm::uvec3& triangle : mesh.triangles) {
    const std::uint32_t used = used_classes[triangle.x] | used_classes[triangle.y] | used_classes[triangle.z];
    const auto free = static_cast<std::size_t>(std::countr_one(used));
    const std::size_t chosen = free < kClasses ? free : turn++ % kClasses;
    for (int corner = 0; corner < 3; ++corner) used_classes[triangle[corner]] |= 1U << chosen;
    classes.at(chosen).triangles.push_back(triangle);
  }
  std::vector<int> times(view.size().area(), 0);
  for (Mesh& part : classes) {
    if (part.triangles.empty()) continue;
    part.positions = mesh.positions;
    part.normals.assign(part.positions.size(), glm::vec3(0.0F, 0.0F, 1.0F));
    Scene scene;
    add(scene, std::move(part), to_world);
    finish_scene(scene);
    const Image<Key> keys = drawer.draw(scene, view);
    for (std::size_t i = 0; i < times.size(); ++i) times[i] += keys.pixels()[i] != kNoKey ? 1 : 0;
  }
  Coverage found;
  for (const int count : times) {
    found.missed += count == 0 ? 1U : 0U;
    found.twice += count > 1 ? 1U : 0U;
  }
  return found;
}

double other_surfaces(const Image<Key>& a, const Image<Key>& b) {
  return differing_fraction(a, b, another_surface);
}

double edges(const Image<Key>& keys) {
  return fraction_at_edges(keys, another_surface);
}

Picture make_picture(const Globals& globals, const Scene& scene, const View& view, const RaySettings& settings) {
  Picture picture;
  run_local_ranks(1, [&](Communicator& comm) {
    Session session(comm, globals.session(), [&] { return scene; });
    FrameSettings frame_settings;
    frame_settings.rays = settings;
    const std::array views{view};
    const FramePlan plan = plan_frame(session, frame_settings, views);
    FrameTimes times;
    const Frame frame = make_frame(session, plan, views, &times);
    picture = {to_image(*frame.keys, 0), to_image(frame.radiance, 0), times.rays};
  });
  return picture;
}

double other_colors(const Image<Rgb>& a, const Image<Rgb>& b) {
  return differing_fraction(a, b, another_color);
}

double color_edges(const Image<Rgb>& colors) {
  return fraction_at_edges(colors, another_color);
}

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

int threads_of(const Globals& globals) {
  return globals.threads > 0 ? globals.threads : usable_cores();
}

Material diffuse(const glm::vec3& color) {
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
  LitPicture picture{TileLayer<Key>(FrameLayout({view.size()})), {}, {}};
  const RayScene rays(scene, RaySpace(scene), settings.threads);
  PrimaryRays(scene, rays, settings.threads).draw(view, 0, std::array{whole(view)}, picture.keys);
  TileLayer<Rgb> radiance(picture.keys.layout());
  DeferredShader shader(scene, settings);
  shader.shade(std::span(&view, 1), picture.keys, all_tiles(picture.keys.layout()), {.radiance = &radiance});
  picture.image = to_image(radiance, 0);
  picture.counts = shader.counts();
  return picture;
}

View glance(const Scene& scene, const glm::dvec3& eye, const glm::dvec3& at) {
  const glm::dvec3 direction = glm::normalize(at - eye);
  const glm::dvec3 up = std::abs(direction.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
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

Scene exhibits(double steps_per_metre) {
  Scene scene;
  const std::uint32_t floor = add_material(scene, {0.6F, 0.55F, 0.5F}, 0.0F, 0.6F);
  const std::uint32_t diffuse = add_material(scene, {0.7F, 0.2F, 0.15F}, 0.0F, 1.0F);
  const std::uint32_t mirror = add_material(scene, {0.9F, 0.9F, 0.9F}, 1.0F, 0.0F);
  const std::uint32_t glass = add_material(scene, {1.0F, 1.0F, 1.0F}, 0.0F, 0.0F);
  scene.materials[glass].transmission = 1.0F;
  scene.materials[glass].thickness = 1.0F;
  scene.materials[glass].attenuation_color = {0.4F, 0.8F, 0.5F};
  scene.materials[glass].attenuation_distance = 0.5F;
  const std::uint32_t panel = add_material(scene, {0.0F, 0.0F, 0.0F}, 0.0F, 1.0F);
  scene.materials[panel].emissive = {3.0F, 2.5F, 2.0F};

  const auto placed = [&](Mesh mesh, std::uint32_t material, const glm::dvec3& at, double scale, double turned) {
    mesh.material = material;
    const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), snapped(at, steps_per_metre));
    const glm::dmat4 rotated = glm::rotate(moved, turned, glm::dvec3(0.6, 0.8, 0.0));
    add(scene, std::move(mesh), glm::scale(rotated, glm::dvec3(scale)));
  };
  Mesh ground;
  shapes::add_quad(ground, {glm::dvec3(-3, 0, 3), {3, 0, 3}, {3, 0, -3}, {-3, 0, -3}});
  placed(ground, floor, {0.0123, 0.0, 0.0345}, 1.0, 0.0);
  placed(shapes::icosphere(3), diffuse, {-1.1037, 0.5013, -0.3071}, 0.5, 0.3);
  placed(shapes::icosphere(3), mirror, {0.1279, 0.6117, -1.0093}, 0.61, 0.0);
  placed(shapes::icosphere(3), glass, {0.9531, 0.4711, 0.2113}, 0.45, 1.1);
  Mesh box;
  shapes::add_box(box, {-0.3, -0.3, -0.3}, {0.3, 0.3, 0.3});
  placed(box, diffuse, {-0.4173, 0.4519, 0.8067}, 1.0, 0.7);
  Mesh lamp;
  shapes::add_quad(lamp, {glm::dvec3(-0.5, 0, -0.5), {0.5, 0, -0.5}, {0.5, 0, 0.5}, {-0.5, 0, 0.5}});
  placed(lamp, panel, {-1.5071, 2.6031, 0.5013}, 1.0, 0.0);

  Light point;
  point.position = snapped({1.7011, 2.4037, 1.2093}, steps_per_metre);
  point.intensity = glm::vec3(6.0F);
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = glm::normalize(glm::vec3(-0.4F, -1.0F, -0.6F));
  sun.intensity = glm::vec3(0.8F);
  scene.lights = {point, sun};
  scene.background = {0.15F, 0.2F, 0.3F};
  finish_scene(scene);
  return scene;
}

View exhibits_view(double steps_per_metre) {
  const glm::dvec3 eye = snapped({0.3071, 1.6019, 3.7033}, steps_per_metre);
  const glm::dvec3 at = snapped({-0.1013, 0.5017, -0.2051}, steps_per_metre);
  View view = make_view(look_at(eye, at, {0.0, 1.0, 0.0}, 0.8), {256, 192}, {});
  view.near_distance = 0x1p-7;
  return view;
}

RaySettings exhibits_light() {
  RaySettings settings;
  settings.passes = {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::Photon};
  settings.photons = 20'000;
  return settings;
}

void scale_placements(Scene& scene, double factor) {
  for (Instance& instance : scene.instances) {
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) instance.to_world[column][row] *= factor;
    }
  }
  scale_lights(scene, factor);
  finish_scene(scene);
}

void scale_vertices(Scene& scene, double factor) {
  for (Mesh& mesh : scene.meshes) {
    for (glm::vec3& position : mesh.positions) position = glm::vec3(glm::dvec3(position) * factor);
  }
  for (Instance& instance : scene.instances) {
    for (int row = 0; row < 3; ++row) instance.to_world[3][row] *= factor;
  }
  scale_lights(scene, factor);
  finish_scene(scene);
}

void scale_view(View& view, double factor) {
  view.eye *= factor;
  view.near_distance *= factor;
}

void move_placements(Scene& scene, const glm::dvec3& offset) {
  for (Instance& instance : scene.instances) instance.to_world[3] += glm::dvec4(offset, 0.0);
  for (Light& light : scene.lights) light.position += offset;
  finish_scene(scene);
}

void move_vertices(Scene& scene, const glm::dvec3& offset) {
  for (Instance& instance : scene.instances) {
    Mesh& mesh = scene.meshes[instance.mesh];
    for (glm::vec3& position : mesh.positions) position = glm::vec3(world_position(instance, position) + offset);
    const glm::dmat3 linear(instance.to_world);
    for (glm::vec3& normal : mesh.normals) normal = glm::vec3(glm::normalize(linear * glm::dvec3(normal)));
    instance.to_world = glm::dmat4(1.0);
  }
  for (Light& light : scene.lights) light.position += offset;
  finish_scene(scene);
}

}  // namespace hpr::stability
