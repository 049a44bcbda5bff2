#include <array>
#include <glm/geometric.hpp>

#include "scene/generators/generators.h"
#include "scene/generators/shapes.h"

// Cornell University Program of Computer Graphics, "Cornell Box Data": measured vertices in millimetres, y up. Seen
// along +z with y up, x grows to the left: that is right-handed, so nothing is mirrored and only the unit changes.
namespace hpr {
namespace {

using Quad = std::array<glm::dvec3, 4>;

constexpr Quad kFloor{{{552.8, 0, 0}, {0, 0, 0}, {0, 0, 559.2}, {549.6, 0, 559.2}}};
constexpr Quad kLamp{{{343, 548.8, 227}, {343, 548.8, 332}, {213, 548.8, 332}, {213, 548.8, 227}}};
constexpr Quad kCeiling{{{556, 548.8, 0}, {556, 548.8, 559.2}, {0, 548.8, 559.2}, {0, 548.8, 0}}};
constexpr Quad kBack{{{549.6, 0, 559.2}, {0, 0, 559.2}, {0, 548.8, 559.2}, {556, 548.8, 559.2}}};
constexpr Quad kRight{{{0, 0, 559.2}, {0, 0, 0}, {0, 548.8, 0}, {0, 548.8, 559.2}}};
constexpr Quad kLeft{{{552.8, 0, 0}, {549.6, 0, 559.2}, {556, 548.8, 559.2}, {556, 548.8, 0}}};
constexpr Quad kShortTop{{{130, 165, 65}, {82, 165, 225}, {240, 165, 272}, {290, 165, 114}}};
constexpr Quad kTallTop{{{423, 330, 247}, {265, 330, 296}, {314, 330, 456}, {472, 330, 406}}};

void add_quad_mm(Mesh& mesh, const Quad& quad) {
  shapes::add_quad(mesh, {quad[0] * 1e-3, quad[1] * 1e-3, quad[2] * 1e-3, quad[3] * 1e-3});
}

Mesh single(const Quad& quad) {
  Mesh mesh;
  add_quad_mm(mesh, quad);
  return mesh;
}

/// The ceiling with a hole where the lamp is: four quads from its corners to the lamp's, corner i to corner i.
Mesh ceiling_with_hole() {
  Mesh mesh;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t next = (i + 1) % 4;
    add_quad_mm(mesh, {kCeiling[i], kCeiling[next], kLamp[next], kLamp[i]});
  }
  return mesh;
}

/// A block from its top down to the floor, without a footprint.
Mesh block(const Quad& top) {
  Mesh mesh;
  add_quad_mm(mesh, top);
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 a = top[i];
    const glm::dvec3 b = top[(i + 1) % 4];
    add_quad_mm(mesh, {a, {a.x, 0, a.z}, {b.x, 0, b.z}, b});
  }
  return mesh;
}

void fill_cornell(Scene& scene, const OptionReader& options) {
  const std::string variant = options.choice("variant", {"plain", "mirror", "glass"});
  const std::string lamp = options.choice("lamp", {"hole", "coplanar"});

  // Linear sRGB of the measured spectra under the measured lamp.
  const std::uint32_t white = add_material(scene, plastic("white", {0.739F, 0.735F, 0.751F}, 1.0F));
  const std::uint32_t red = add_material(scene, plastic("red", {0.449F, 0.039F, 0.010F}, 1.0F));
  const std::uint32_t green = add_material(scene, plastic("green", {0.119F, 0.382F, 0.024F}, 1.0F));
  constexpr glm::vec3 kLampRadiance{20.66F, 10.90F, 2.77F};
  Material glow = plastic("lamp", {0.78F, 0.78F, 0.78F}, 1.0F);
  glow.emissive = kLampRadiance;
  const std::uint32_t lamp_paint = add_material(scene, std::move(glow));

  add_single(scene, single(kFloor), "floor", white);
  add_single(scene, single(kLamp), "lamp", lamp_paint);
  add_single(scene, lamp == "hole" ? ceiling_with_hole() : single(kCeiling), "ceiling", white);
  add_single(scene, single(kBack), "back", white);
  add_single(scene, single(kRight), "right", green);
  add_single(scene, single(kLeft), "left", red);
  if (variant == "glass") {
    const std::uint32_t clear = add_material(scene, glass("glass", 1.5F));
    const std::uint32_t ball = add_mesh(scene, shapes::icosphere(5), "glass sphere", clear);
    add_instance(scene, ball, shapes::placed({0.190, 0.090, 0.190}, 0.090));
  } else {
    add_single(scene, block(kShortTop), "short block", white);
  }
  const std::uint32_t tall =
      variant == "mirror" ? add_material(scene, metal("mirror", {0.95F, 0.95F, 0.95F}, 0.0F)) : white;
  add_single(scene, block(kTallTop), "tall block", tall);

  // 25 mm of film behind a 35 mm lens.
  add_camera(scene, "main", {0.278, 0.273, -0.800}, {0.278, 0.273, 0.0}, {0, 1, 0}, 39.3076518);
  add_camera(scene, "corner", {0.480, 0.480, -0.300}, {0.200, 0.150, 0.300}, {0, 1, 0}, 55.0);
}

}  // namespace

Generator cornell_generator() {
  Generator generator;
  generator.name = "cornell";
  generator.summary = "the Cornell box from its measured data: colour bleeding, an area lamp, a closed room";
  generator.options = {
      {"variant", "plain, mirror (the tall block) or glass (a sphere for the short block) (default plain)"},
      {"lamp", "hole: cut out of the ceiling; coplanar: in one plane with it, as published (default hole)"}};
  return filled_by(std::move(generator), fill_cornell);
}

}  // namespace hpr
