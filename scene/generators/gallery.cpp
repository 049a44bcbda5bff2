#include <fmt/format.h>

#include <array>

#include "scene/generators/generators.h"
#include "scene/generators/portable_math.h"
#include "scene/generators/shapes.h"

// A museum hall of 48 x 6 x 12 m. It is closed: every surface of the room faces inwards.
namespace hpr {
namespace {

constexpr double kHalfLength = 24.0;
constexpr double kHeight = 6.0;
constexpr double kHalfWidth = 6.0;
constexpr int kPanels = 12;
constexpr int kExhibits = 20;
constexpr int kPaintings = 24;

struct GallerySize {
  int s = 2;  ///< sphereflake generations, and a quarter of the vases' n
  int k = 4;  ///< icosphere level
  int n = 4;  ///< squares along a cube face of the sphereflakes' spheres
  int cases = 0;
};

std::uint64_t triangle_count(const GallerySize& size) {
  const auto power = [](std::uint64_t base, int exponent) {
    std::uint64_t result = 1;
    for (int i = 0; i < exponent; ++i) result *= base;
    return result;
  };
  const std::uint64_t balls = (power(9, size.s + 1) - 1) / 8;
  const auto n = static_cast<std::uint64_t>(size.n);
  const auto v = 4 * static_cast<std::uint64_t>(size.s);
  constexpr std::uint64_t kRoom = 2 + 10 + 4 + 24 + 240 + 48;
  constexpr std::uint64_t kKnot = std::uint64_t{2} * 256 * 32;
  return kRoom + 60 * static_cast<std::uint64_t>(size.cases) + 4 * (12 * n * n * balls) + 8 * (20 * power(4, size.k)) +
         4 * kKnot + 4 * (64 * v * v - 8 * v);
}

Mesh quad(const std::array<glm::dvec3, 4>& corners, const glm::dvec2& repeat = {1.0, 1.0}) {
  Mesh mesh;
  shapes::add_quad(mesh, corners, repeat);
  return mesh;
}

std::int32_t add_texture(Scene& scene, std::string name, Image<Rgba8> image, bool nearest) {
  Texture texture;
  texture.name = std::move(name);
  texture.image = std::move(image);
  texture.nearest = nearest;
  scene.textures.push_back(std::move(texture));
  return static_cast<std::int32_t>(scene.textures.size() - 1);
}

void add_room(Scene& scene) {
  const double x = kHalfLength;
  const double y = kHeight;
  const double z = kHalfWidth;
  Material checker = plastic("floor", glm::vec3(1.0F), 0.05F);
  checker.base_color_texture.texture =
      add_texture(scene, "checker", patterns::checker({0.05F, 0.05F, 0.05F}, {0.6F, 0.6F, 0.6F}), true);
  const std::uint32_t floor = add_material(scene, std::move(checker));
  const std::uint32_t wall = add_material(scene, plastic("wall", glm::vec3(0.75F), 0.9F));
  const std::uint32_t mirror = add_material(scene, metal("mirror", glm::vec3(0.95F), 0.0F));
  Material glow = plastic("panel", glm::vec3(0.8F), 1.0F);
  glow.emissive = glm::vec3(12.0F);
  const std::uint32_t panel = add_material(scene, std::move(glow));

  // Two squares of a metre per repetition of the checker.
  add_single(scene, quad({{{-x, 0, z}, {x, 0, z}, {x, 0, -z}, {-x, 0, -z}}}, {kHalfLength, kHalfWidth}), "floor",
             floor);
  Mesh walls;
  shapes::add_quad(walls, {{{-x, 0, -z}, {x, 0, -z}, {x, y, -z}, {-x, y, -z}}});
  shapes::add_quad(walls, {{{x, 0, z}, {-x, 0, z}, {-x, y, z}, {x, y, z}}});
  shapes::add_quad(walls, {{{-x, 0, z}, {-x, 0, -z}, {-x, y, -z}, {-x, y, z}}});
  shapes::add_quad(walls, {{{x, 0, -z}, {x, 0, z}, {x, y, z}, {x, y, -z}}});
  shapes::add_quad(walls, {{{-x, y, -z}, {x, y, -z}, {x, y, z}, {-x, y, z}}});
  add_single(scene, std::move(walls), "walls and ceiling", wall);

  Mesh mirrors;
  const double m = 5.95;
  shapes::add_quad(mirrors, {{{-8, 0.3, -m}, {8, 0.3, -m}, {8, 4.3, -m}, {-8, 4.3, -m}}});
  shapes::add_quad(mirrors, {{{8, 0.3, m}, {-8, 0.3, m}, {-8, 4.3, m}, {8, 4.3, m}}});
  add_single(scene, std::move(mirrors), "mirrors", mirror);

  Mesh panels;
  for (int i = 0; i < kPanels; ++i) {
    const double c = -22.0 + 4.0 * i;
    const double h = 5.99;
    shapes::add_quad(panels, {{{c - 0.5, h, -0.15}, {c + 0.5, h, -0.15}, {c + 0.5, h, 0.15}, {c - 0.5, h, 0.15}}});
  }
  add_single(scene, std::move(panels), "panels", panel);
}

/// Points below the ceiling that stand for the panels in passes that know only punctual lights. Together they shine
/// downwards five times as bright as the panels, for the light that the white walls would give back.
void add_stand_ins(Scene& scene, int count) {
  constexpr double kPanelRadiance = 12.0;
  constexpr double kPanelArea = 0.3;
  constexpr double kReturned = 5.0;
  for (int i = 0; i < count; ++i) {
    const double x = kHalfLength * ((2.0 * i + 1.0) / count - 1.0);
    add_point_light(scene, fmt::format("panel stand-in {}", i), {x, 5.6, 0.0},
                    glm::vec3(static_cast<float>(kReturned * kPanels * kPanelRadiance * kPanelArea / count)));
  }
}

glm::dmat4 turned_about_y(const glm::dvec3& position, bool half_turn) {
  glm::dmat4 matrix(1.0);
  if (half_turn) matrix[0][0] = matrix[2][2] = -1.0;
  matrix[3] = glm::dvec4(position, 1.0);
  return matrix;
}

/// Twelve a wall: four above the mirror, four on either side of it; all five patterns in turn.
void add_paintings(Scene& scene) {
  constexpr Size kTexels{512, 320};
  constexpr std::array<const char*, 5> kNames{"zone plate", "texel grid", "siemens star", "grey wedge", "tile ruler"};
  const std::array<Image<Rgba8>, 5> pictures{patterns::zone_plate(kTexels), patterns::texel_grid(kTexels, 8),
                                             patterns::siemens_star(kTexels, 18), patterns::grey_wedge(kTexels, 64),
                                             patterns::tile_ruler(kTexels)};
  std::array<std::uint32_t, 5> meshes{};
  for (std::size_t i = 0; i < 5; ++i) {
    Material paint = plastic(kNames[i], glm::vec3(1.0F), 0.8F);
    paint.base_color_texture.texture = add_texture(scene, kNames[i], pictures[i], false);
    const std::uint32_t material = add_material(scene, std::move(paint));
    meshes[i] =
        add_mesh(scene, quad({{{-0.8, -0.5, 0}, {0.8, -0.5, 0}, {0.8, 0.5, 0}, {-0.8, 0.5, 0}}}), kNames[i], material);
  }
  for (int i = 0; i < kPaintings; ++i) {
    const bool front = i >= kPaintings / 2;
    const int column = i % (kPaintings / 2);
    const bool above_mirror = column >= 4 && column < 8;
    const double x = above_mirror ? -6.0 + 4.0 * (column - 4)
                     : column < 4 ? -20.8 + 3.6 * column
                                  : 10.0 + 3.6 * (column - 8);
    const glm::dvec3 position(front ? -x : x, above_mirror ? 4.95 : 1.7, front ? 5.99 : -5.99);
    add_instance(scene, meshes[static_cast<std::size_t>(i % 5)], turned_about_y(position, front));
  }
}

/// Four slabs of 8 mm and a lid, 1.2 x 1.2 x 1.8 m, half a millimetre apart so that no two faces coincide.
Mesh glass_case() {
  const double r = 0.6;
  const double t = 0.008;
  const double gap = 0.0005;
  const double top = 1.8;
  Mesh mesh;
  shapes::add_box(mesh, {-r, gap, -r}, {-r + t, top - t - gap, r});
  shapes::add_box(mesh, {r - t, gap, -r}, {r, top - t - gap, r});
  shapes::add_box(mesh, {-r + t + gap, gap, -r}, {r - t - gap, top - t - gap, -r + t});
  shapes::add_box(mesh, {-r + t + gap, gap, r - t}, {r - t - gap, top - t - gap, r});
  shapes::add_box(mesh, {-r, top - t, -r}, {r, top, r});
  return mesh;
}

void add_exhibits(Scene& scene, const GallerySize& size) {
  const std::uint32_t stone = add_material(scene, plastic("plinth", {0.22F, 0.23F, 0.26F}, 0.35F));
  const std::uint32_t gold = add_material(scene, metal("gold", {1.0F, 0.77F, 0.34F}, 0.1F));
  const std::uint32_t chrome = add_material(scene, metal("chrome", glm::vec3(0.9F), 0.0F));
  const std::uint32_t clear = add_material(scene, glass("glass", 1.5F));
  const std::uint32_t glaze = add_material(scene, plastic("glaze", {0.03F, 0.13F, 0.42F}, 0.1F));

  Mesh box;
  shapes::add_box(box, {-0.4, 0.0, -0.4}, {0.4, 1.0, 0.4});
  const std::uint32_t plinth = add_mesh(scene, std::move(box), "plinth", stone);
  const std::uint32_t ball = add_mesh(scene, shapes::cube_sphere(size.n), "sphere", gold);
  const std::uint32_t mirror_ball = add_mesh(scene, shapes::icosphere(size.k), "mirror sphere", chrome);
  const std::uint32_t glass_ball = add_mesh(scene, shapes::icosphere(size.k), "glass sphere", clear);
  const std::uint32_t pot = add_mesh(scene, shapes::vase(4 * size.s), "vase", glaze);
  const std::uint32_t cover = size.cases > 0 ? add_mesh(scene, glass_case(), "case", clear) : 0;
  const Mesh knot = shapes::torus_knot(2, 3, 256, 32, 0.17);
  const std::vector<FlakeSphere> flake = sphereflake(size.s);

  int cases = 0;
  for (int i = 0; i < kExhibits; ++i) {
    const int pair = i / 2;
    const glm::dvec3 foot(-21.6 + 4.8 * pair, 0.0, i % 2 == 0 ? -2.5 : 2.5);
    const glm::dvec3 top = foot + glm::dvec3(0, 1, 0);
    add_instance(scene, plinth, shapes::placed(foot, 1.0));
    switch (i % 5) {
      case 0: {
        constexpr double kScale = 0.7;
        const glm::dvec3 center = top + glm::dvec3(0, 0.5 * kScale, 0);
        for (const FlakeSphere& s : flake) {
          add_instance(scene, ball, shapes::placed(center + kScale * from_spd(s.center), kScale * s.radius));
        }
        break;
      }
      case 1:
        add_instance(scene, mirror_ball, shapes::placed(top + glm::dvec3(0, 0.55, 0), 0.55));
        break;
      case 2:
        add_instance(scene, glass_ball, shapes::placed(top + glm::dvec3(0, 0.55, 0), 0.55));
        break;
      case 3: {
        const double roughness = (i / 19.0) * (i / 19.0);
        const std::uint32_t copper = add_material(
            scene, metal(fmt::format("copper {}", i), {0.95F, 0.64F, 0.54F}, static_cast<float>(roughness)));
        // The ring of the knot stands upright and faces along z.
        constexpr double kScale = 0.45;
        glm::dmat4 upright(0.0);
        upright[0][0] = kScale;
        upright[1][2] = kScale;
        upright[2][1] = -kScale;
        upright[3] = glm::dvec4(top + glm::dvec3(0, 1.17 * kScale, 0), 1.0);
        add_instance(scene, add_mesh(scene, knot, fmt::format("torus knot {}", i), copper), upright);
        break;
      }
      default:
        add_instance(scene, pot, shapes::placed(top, 0.7));
        if (cases < size.cases) {
          add_instance(scene, cover, shapes::placed(foot, 1.0));
          ++cases;
        }
    }
  }
}

void add_cameras(Scene& scene) {
  const glm::dvec3 up(0, 1, 0);
  add_camera(scene, "main", {0, 1.7, 5.0}, {0, 1.6, -6}, up, 38.0);
  // On the round walk x = 18 cos t, z = 1.5 sin t with the gaze along its tangent, a twentieth of a turn in.
  const double turns = 0.05;
  const glm::dvec3 eye(18.0 * portable::cos_turns(turns), 1.7, 1.5 * portable::sin_turns(turns));
  const glm::dvec3 gaze(-18.0 * portable::sin_turns(turns), 0.0, 1.5 * portable::cos_turns(turns));
  add_camera(scene, "walk", eye, eye + gaze, up, 50.0);
  add_camera(scene, "overview", {-22.5, 4.6, 5.2}, {2.0, 0.4, -2.0}, up, 50.0);
  add_camera(scene, "mirrors", {-6.5, 1.8, -3.5}, {4.0, 1.5, -5.95}, up, 50.0);
  add_camera(scene, "exhibit", {2.4, 1.75, 0.3}, {2.4, 1.45, -2.5}, up, 40.0);
}

void fill_gallery(Scene& scene, const OptionReader& options) {
  GallerySize size;
  size.s = options.integer("s", size.s, 1, 5);
  size.k = options.integer("k", size.k, 0, 8);
  size.n = options.integer("n", size.n, 1, 64);
  size.cases = options.integer("cases", size.cases, 0, 4);
  add_room(scene);
  add_paintings(scene);
  add_exhibits(scene, size);
  add_stand_ins(scene, options.integer("lights", 4, 0, kPanels));
  add_cameras(scene);
}

GeneratorOptions sized(std::uint64_t triangles) {
  std::vector<SceneSize> sizes;
  for (int s = 1; s <= 5; ++s) {
    for (int k = 0; k <= 8; ++k) {
      // Spheres grow finer with everything else: a flake of coarse balls beside smooth ones looks wrong.
      for (int n = 2; n <= 8; ++n) {
        sizes.push_back({triangle_count({s, k, n, 0}),
                         {{"s", std::to_string(s)}, {"k", std::to_string(k)}, {"n", std::to_string(n)}}});
      }
    }
  }
  return nearest_size(sizes, triangles);
}

}  // namespace

Generator gallery_generator() {
  Generator generator;
  generator.name = "gallery";
  generator.summary = "a museum hall for wide walls: facing mirrors, a shiny floor, 20 exhibits, 24 test pictures";
  generator.options = {
      {"s", "sphereflake generations, and a quarter of the vases' n, 1 to 5 (default 2)"},
      {"k", "level of the mirror and glass icospheres, 0 to 8 (default 4)"},
      {"n", "squares along a cube face of each sphereflake sphere, 1 to 64 (default 4)"},
      {"cases", "glass cases over the vases, 0 to 4 (default 0); a renderer without refraction draws them opaque"},
      {"lights", "point lights that stand for the 12 emissive panels, 0 to 12 (default 4)"}};
  generator.sized = sized;
  return filled_by(std::move(generator), fill_gallery);
}

}  // namespace hpr
