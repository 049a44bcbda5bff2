#include <gtest/gtest.h>

#include <vector>

#include "rt/passes/pass_list.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

// Indirect light along rays, held to the reference as all passes are.
namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::mean_of;
using test::place_mesh;
using test::quad;
using test::room;

/// A floor, a wall and a ball in the open, under a sky that is all the light there is.
Scene terrace(const Material& thing) {
  Scene scene;
  const std::uint32_t white = add_material(scene, test::diffuse(glm::vec3(0.8F)));
  const std::uint32_t red = add_material(scene, test::diffuse({0.7F, 0.2F, 0.1F}));
  const std::uint32_t special = add_material(scene, thing);
  place_mesh(scene, add_mesh(scene, quad({-1, -1, 1}, {2, 0, 0}, {0, 0, -2}, white)));
  place_mesh(scene, add_mesh(scene, quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, red)));
  place_mesh(scene, add_mesh(scene, test::sphere(0.45, 64, special)),
             glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.5, 0, 1));
  scene.environment = test::even_light({1.0F, 0.9F, 0.7F});
  finish_scene(scene);
  return scene;
}

TEST(Gather, RaysBringTheLightOfAnEvenSky) {
  Material rough = test::mirror(0.9F);
  rough.roughness = 0.7F;
  Material polished = test::mirror(0.9F);
  polished.roughness = 0.2F;
  Material frosted = test::clear_glass(1.5F, 0.0F);
  frosted.roughness = 0.4F;
  Material sign = test::diffuse({0.9F, 0.8F, 0.1F});
  sign.unlit = true;  // lights nothing
  for (const Material& thing : {test::diffuse({0.3F, 0.6F, 0.9F}), rough, polished, frosted, sign}) {
    const Scene scene = terrace(thing);
    const RaySettings best{
        .max_depth = 24, .photons = 1000, .global_photons = true, .gather = true, .terminator_fix = false};
    const std::vector<PassPlan> plan = plan_passes(requirements_of(scene), best);
    ASSERT_TRUE(runs_pass(plan, PassId::Gather));
    const View view = test::view_from({0.3, 0.1, 0.95}, {-0.2, -0.4, -1}, {16, 16}, scene, 1.0);
    const glm::dvec3 reference =
        mean_of(scene, view, {.max_depth = 25, .terminator_fix = false, .reference = true}, 512);
    const glm::dvec3 hybrid = mean_of(scene, view, best, 512);
    // Frosted glass under a white sky has fireflies by paths.
    const double tolerance = thing.transmission > 0.0F ? 0.01 : 0.002;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(hybrid[c] / reference[c], 1.0, tolerance) << "channel " << c;
  }
}

/// No pass but gather runs: it follows mirrors too, and no light goes missing.
TEST(Gather, RaysBringWhatNoOtherPassFollows) {
  Material polished = test::mirror(0.9F);
  polished.roughness = 0.2F;
  Scene scene = terrace(polished);
  const View view = test::view_from({0.3, 0.1, 0.95}, {-0.2, -0.4, -1}, {16, 16}, scene, 1.0);
  const glm::dvec3 reference = mean_of(scene, view, {.max_depth = 25, .terminator_fix = false, .reference = true}, 512);
  for (const double cutoff : {0.1, 0.3}) {
    const glm::dvec3 gathered =
        mean_of(scene, view,
                {.passes = {PassId::Gather}, .max_depth = 1, .glossy_cutoff = cutoff, .terminator_fix = false}, 512);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(gathered[c] / reference[c], 1.0, 0.002) << cutoff << " channel " << c;
  }
  // Where nothing scatters light it does not run, and lights find the sky.
  scene.materials.assign(3, polished);
  const glm::dvec3 lit =
      mean_of(scene, view, {.passes = {PassId::Gather}, .glossy_cutoff = 0.1, .terminator_fix = false}, 64);
  EXPECT_GT(lit.g, 0.3);
}

/// Neither a backdrop nor the headlight are light to anything: as the passes have it.
TEST(Gather, RaysBringNothingFromABackdrop) {
  Scene scene = terrace(test::diffuse({0.3F, 0.6F, 0.9F}));
  scene.environment.reset();
  scene.background = {5.0F, 5.0F, 5.0F};
  const View view = test::view_from({0.3, 0.1, 0.95}, {-0.2, -0.4, -1}, {16, 16}, scene, 1.0);
  const RaySettings asked{.passes = {PassId::Gather}, .terminator_fix = false};
  const glm::dvec3 gathered = mean_of(scene, view, asked, 64);
  const glm::dvec3 none = mean_of(scene, view, {.auto_passes = false, .terminator_fix = false}, 64);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(gathered[c] / none[c], 1.0, 1e-6) << "channel " << c;
}

/// Where nothing decides for rays, they may be asked for: they meet a lamp too, and ask it.
TEST(Gather, RaysBringTheLightOfALamp) {
  const Scene scene = room(test::diffuse({0.3F, 0.4F, 0.6F}), false);
  const View view = test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {16, 16}, scene, 1.3);
  const glm::dvec3 reference =
      mean_of(scene, view, {.max_depth = 64, .terminator_fix = false, .reference = true}, 1500);
  const glm::dvec3 hybrid = mean_of(
      scene, view,
      {.passes = {PassId::Shadow, PassId::Reflection, PassId::Gather}, .max_depth = 64, .terminator_fix = false}, 1500);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(hybrid[c] / reference[c], 1.0, 0.015) << "channel " << c;
}

}  // namespace
}  // namespace hpr
