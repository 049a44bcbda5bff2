#include <gtest/gtest.h>

#include <algorithm>

#include "core/error.h"
#include "rt/lighter.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

Scene scene_with(const Material& material, std::size_t lights) {
  Scene scene;
  test::add_material(scene, material);
  test::place(scene, test::add_mesh(scene, test::quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0)));
  scene.lights.resize(lights);
  finish_scene(scene);
  return scene;
}

bool runs(const Scene& scene, const RaySettings& settings, const std::string& name) {
  return runs_pass(plan_passes(requirements_of(scene), settings), name);
}

TEST(Passes, RunOnlyWhereTheSceneCanShowThem) {
  EXPECT_FALSE(runs(scene_with(test::matte(), 0), {}, "shadow"));
  EXPECT_TRUE(runs(scene_with(test::matte(), 1), {}, "shadow"));
  EXPECT_FALSE(runs(scene_with(test::matte(), 1), {}, "reflection"));
  EXPECT_TRUE(runs(scene_with(test::mirror(0.5F), 0), {}, "reflection"));
  EXPECT_FALSE(runs(Scene{}, {}, "reflection"));
}

TEST(Passes, RunWhenNamedAndNotWhenOthersAre) {
  const Scene scene = scene_with(test::mirror(0.5F), 1);
  const RaySettings shadow_only{.passes = {"shadow"}};
  EXPECT_TRUE(runs(scene, shadow_only, "shadow"));
  EXPECT_FALSE(runs(scene, shadow_only, "reflection"));
  EXPECT_FALSE(runs(scene, {.auto_passes = false}, "shadow"));
  EXPECT_FALSE(runs(scene_with(test::matte(), 1), {.passes = {"reflection"}}, "reflection"));
}

TEST(Passes, FollowWhatTheGlossyCutoffSays) {
  Material metal = test::mirror(0.5F);
  for (const float roughness : {0.2F, 0.5F}) {
    metal.roughness = roughness;
    Scene scene = scene_with(metal, 1);
    test::add_material(scene, test::matte());  // to show caustics
    test::place(scene, test::add_mesh(scene, test::quad({0, 0, -1}, {1, 0, 0}, {0, 1, 0}, 1)));
    finish_scene(scene);
    for (const double cutoff : {0.0, 0.1, 0.3, 1.0}) {
      const RaySettings settings{.glossy_cutoff = cutoff, .photons = 1000};
      EXPECT_EQ(runs(scene, settings, "reflection"), roughness < cutoff) << roughness << ' ' << cutoff;
      EXPECT_EQ(runs(scene, settings, "photon"), roughness < cutoff) << roughness << ' ' << cutoff;
      EXPECT_FALSE(runs(scene_with(metal, 1), settings, "photon")) << "a metal is followed or bundles nothing";
    }
  }
  metal.roughness = 0.0F;
  EXPECT_TRUE(runs(scene_with(metal, 1), {.glossy_cutoff = 0.0}, "reflection")) << "a mirror is followed anyhow";
}

TEST(Passes, RaysGatherIndirectLightWhereAnEvenSkyIsAllThereIs) {
  Scene scene = scene_with(test::matte(), 0);
  scene.lights.clear();
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  const RaySettings best{.photons = 1000, .global_photons = true, .gather = true};
  EXPECT_TRUE(runs(scene, best, "gather"));
  EXPECT_FALSE(runs(scene, best, "photon"));
  EXPECT_FALSE(runs(scene, best, "shadow")) << "no light is left to be sampled";
  RaySettings all = best;
  all.all_passes = true;
  EXPECT_TRUE(runs(scene, all, "gather"));
  EXPECT_FALSE(runs(scene, all, "photon")) << "light would count twice";
  for (const RaySettings& other :
       {RaySettings{.photons = 1000, .gather = true}, RaySettings{.photons = 1000, .global_photons = true},
        RaySettings{.passes = {"photon"}, .photons = 1000, .global_photons = true, .gather = true},
        RaySettings{.photons = 1000, .global_photons = true, .gather = true, .half_resolution = {"photon"}}}) {
    EXPECT_FALSE(runs(scene, other, "gather"));
  }
  EXPECT_TRUE(runs(scene, {.passes = {"gather"}}, "gather"));
  scene.lights.emplace_back();
  EXPECT_FALSE(runs(scene, best, "gather")) << "rays do not meet a point";
  EXPECT_TRUE(runs(scene, best, "photon"));
  EXPECT_TRUE(runs(scene, best, "shadow"));
  EXPECT_TRUE(runs(scene, {.passes = {"gather"}}, "gather")) << "as asked";
  scene.lights.clear();
  scene.environment = Environment{Image<Rgb>({8, 4}, {0.5F, 0.6F, 0.9F})};
  EXPECT_FALSE(runs(scene, best, "gather")) << "a picture may hold a sun";
  EXPECT_THROW((void)plan_passes(requirements_of(scene), {.passes = {"gather", "photon"}}), Error);
  EXPECT_THROW((void)plan_passes(requirements_of(scene), {.passes = {"gather"}, .half_resolution = {"shadow"}}), Error);
}

TEST(Passes, SayWhy) {
  for (const PassPlan& plan : plan_passes(requirements_of(scene_with(test::matte(), 2)), {}))
    EXPECT_FALSE(plan.why.empty());
  EXPECT_EQ(plan_passes(requirements_of(scene_with(test::matte(), 2)), {})[0].why, "2 lights cast shadows");
}

TEST(Passes, AnUnknownNameIsRefusedWithTheNearest) {
  try {
    (void)plan_passes({}, {.passes = {"shadwo"}});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("'shadow'"), std::string::npos) << error.hint();
  }
}

}  // namespace
}  // namespace hpr
