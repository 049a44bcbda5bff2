#include "tools/stability/tools.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>

#include "cluster/transport/local_communicator.h"
#include "engine/frame.h"
#include "engine/session.h"
#include "raster/rasterizer.h"

namespace hpr::stability {
namespace {

/// The share of pixels for which `differs(x, y, neighbour's x, neighbour's y)` with any of its four neighbours.
template <typename Pixel, typename Differs>
double share_at_edges(const Image<Pixel>& image, const Differs& differs) {
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
double differing_share(const Image<Pixel>& a, const Image<Pixel>& b, const Differs& differs) {
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

}  // namespace

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
  std::vector<std::uint32_t> taken(mesh.positions.size(), 0);
  std::size_t turn = 0;
  for (const glm::uvec3& triangle : mesh.triangles) {
    const std::uint32_t used = taken[triangle.x] | taken[triangle.y] | taken[triangle.z];
    const auto free = static_cast<std::size_t>(std::countr_one(used));
    const std::size_t chosen = free < kClasses ? free : turn++ % kClasses;
    for (int corner = 0; corner < 3; ++corner) taken[triangle[corner]] |= 1U << chosen;
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
  return differing_share(a, b, another_surface);
}

double edges(const Image<Key>& keys) {
  return share_at_edges(keys, another_surface);
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
  return differing_share(a, b, another_color);
}

double color_edges(const Image<Rgb>& colors) {
  return share_at_edges(colors, another_color);
}

}  // namespace hpr::stability
