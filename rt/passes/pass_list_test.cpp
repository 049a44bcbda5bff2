#include "rt/passes/pass_list.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "rt/deferred_shader.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

Scene scene_with(const Material& material, std::size_t lights) {
  Scene scene;
  test::add_material(scene, material);
  test::place_mesh(scene, test::add_mesh(scene, test::quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0)));
  scene.lights.resize(lights);
  finish_scene(scene);
  return scene;
}

bool runs(const Scene& scene, const RaySettings& settings, PassId pass) {
  return runs_pass(plan_passes(requirements_of(scene), settings), pass);
}

TEST(Passes, RunOnlyWhereTheSceneCanShowThem) {
  EXPECT_FALSE(runs(scene_with(test::diffuse(), 0), {}, PassId::Shadow));
  EXPECT_TRUE(runs(scene_with(test::diffuse(), 1), {}, PassId::Shadow));
  EXPECT_FALSE(runs(scene_with(test::diffuse(), 1), {}, PassId::Reflection));
  EXPECT_TRUE(runs(scene_with(test::mirror(0.5F), 0), {}, PassId::Reflection));
  EXPECT_FALSE(runs(Scene{}, {}, PassId::Reflection));
}

TEST(Passes, RunWhenNamedAndNotWhenOthersAre) {
  const Scene scene = scene_with(test::mirror(0.5F), 1);
  const RaySettings shadow_only{.passes = {PassId::Shadow}};
  EXPECT_TRUE(runs(scene, shadow_only, PassId::Shadow));
  EXPECT_FALSE(runs(scene, shadow_only, PassId::Reflection));
  EXPECT_FALSE(runs(scene, {.auto_passes = false}, PassId::Shadow));
  EXPECT_FALSE(runs(scene_with(test::diffuse(), 1), {.passes = {PassId::Reflection}}, PassId::Reflection));
}

TEST(Passes, FollowWhatTheGlossyCutoffSays) {
  Material metal = test::mirror(0.5F);
  for (const float roughness : {0.2F, 0.5F}) {
    metal.roughness = roughness;
    Scene scene = scene_with(metal, 1);
    test::add_material(scene, test::diffuse());  // to show caustics
    test::place_mesh(scene, test::add_mesh(scene, test::quad({0, 0, -1}, {1, 0, 0}, {0, 1, 0}, 1)));
    finish_scene(scene);
    for (const double cutoff : {0.0, 0.1, 0.3, 1.0}) {
      const RaySettings settings{.glossy_cutoff = cutoff, .photons = 1000};
      EXPECT_EQ(runs(scene, settings, PassId::Reflection), roughness < cutoff) << roughness << ' ' << cutoff;
      EXPECT_EQ(runs(scene, settings, PassId::Photon), roughness < cutoff) << roughness << ' ' << cutoff;
      EXPECT_FALSE(runs(scene_with(metal, 1), settings, PassId::Photon)) << "a metal is followed or bundles nothing";
    }
  }
  metal.roughness = 0.0F;
  EXPECT_TRUE(runs(scene_with(metal, 1), {.glossy_cutoff = 0.0}, PassId::Reflection)) << "a mirror is followed anyhow";
}

TEST(Passes, RaysGatherIndirectLightWhereAnEvenSkyIsAllThereIs) {
  Scene scene = scene_with(test::diffuse(), 0);
  scene.lights.clear();
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  const RaySettings best{.photons = 1000, .global_photons = true, .gather = true};
  EXPECT_TRUE(runs(scene, best, PassId::Gather));
  EXPECT_FALSE(runs(scene, best, PassId::Photon));
  EXPECT_FALSE(runs(scene, best, PassId::Shadow)) << "no light is left to be sampled";
  RaySettings all = best;
  all.all_passes = true;
  EXPECT_TRUE(runs(scene, all, PassId::Gather));
  EXPECT_FALSE(runs(scene, all, PassId::Photon)) << "light would count twice";
  for (const RaySettings& other :
       {RaySettings{.photons = 1000, .gather = true}, RaySettings{.photons = 1000, .global_photons = true},
        RaySettings{.passes = {PassId::Photon}, .photons = 1000, .global_photons = true, .gather = true},
        RaySettings{.photons = 1000, .global_photons = true, .gather = true, .half_resolution = {PassId::Photon}}}) {
    EXPECT_FALSE(runs(scene, other, PassId::Gather));
  }
  EXPECT_TRUE(runs(scene, {.passes = {PassId::Gather}}, PassId::Gather));
  scene.lights.emplace_back();
  EXPECT_FALSE(runs(scene, best, PassId::Gather)) << "rays do not meet a point";
  EXPECT_TRUE(runs(scene, best, PassId::Photon));
  EXPECT_TRUE(runs(scene, best, PassId::Shadow));
  EXPECT_TRUE(runs(scene, {.passes = {PassId::Gather}}, PassId::Gather)) << "as asked";
  scene.lights.clear();
  scene.environment = Environment{Image<Rgb>({8, 4}, {0.5F, 0.6F, 0.9F})};
  EXPECT_TRUE(runs(scene, best, PassId::Gather));
  EXPECT_TRUE(runs(scene, best, PassId::Shadow)) << "what is no one radiance is sampled too";
  scene.environment->image.at(3, 1) = {50.0F, 50.0F, 50.0F};
  EXPECT_FALSE(runs(scene, best, PassId::Gather)) << "it holds a sun";
  EXPECT_THROW((void)plan_passes(requirements_of(scene), {.passes = {PassId::Gather, PassId::Photon}}), Error);
  EXPECT_THROW(
      (void)plan_passes(requirements_of(scene), {.passes = {PassId::Gather}, .half_resolution = {PassId::Shadow}}),
      Error);
}

TEST(Passes, RaysGatherWhatPhotonsTellWhereLampsAreSmall) {
  Scene scene = scene_with(test::diffuse(), 1);
  const RaySettings best{.photons = 1000, .global_photons = true, .final_gather = true};
  for (const PassId pass : {PassId::Shadow, PassId::Gather, PassId::Photon}) EXPECT_TRUE(runs(scene, best, pass));
  for (const RaySettings& other :
       {RaySettings{.photons = 1000, .final_gather = true}, RaySettings{.photons = 1000, .global_photons = true},
        RaySettings{.passes = {PassId::Photon}, .photons = 1000, .global_photons = true, .final_gather = true},
        RaySettings{
            .photons = 1000, .global_photons = true, .final_gather = true, .half_resolution = {PassId::Photon}}}) {
    EXPECT_FALSE(runs(scene, other, PassId::Gather));
  }
  scene.lights.clear();
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  RaySettings even = best;
  even.gather = true;
  EXPECT_TRUE(runs(scene, even, PassId::Gather));
  EXPECT_FALSE(runs(scene, even, PassId::Photon)) << "rays find an even sky by themselves";
}

TEST(Passes, SayWhy) {
  for (const PassPlan& plan : plan_passes(requirements_of(scene_with(test::diffuse(), 2)), {}))
    EXPECT_FALSE(plan.why.empty());
  EXPECT_EQ(plan_passes(requirements_of(scene_with(test::diffuse(), 2)), {})[0].why, "2 lights cast shadows");
}

TEST(Passes, AreFoundByTheirNames) {
  for (const PassInfo& pass : all_passes()) {
    EXPECT_EQ(find_pass(pass.name), pass.id) << pass.name;
    EXPECT_EQ(parse_pass(pass.name), pass.id) << pass.name;
    EXPECT_EQ(&info_of(pass.id), &pass) << pass.name;
    EXPECT_NE(pass.make, nullptr) << pass.name;
  }
  EXPECT_EQ(find_pass("Shadow"), std::nullopt);
  EXPECT_EQ(find_pass(""), std::nullopt);
}

TEST(Passes, EveryComponentButDirectLightHasThePassItIsNamedAfter) {
  EXPECT_EQ(name_of(Component::Direct), "direct");
  for (std::size_t i = 1; i < kComponents; ++i) {
    const auto component = static_cast<Component>(i);
    const std::optional<PassId> pass = find_pass(name_of(component));
    ASSERT_TRUE(pass) << i;
    EXPECT_EQ(info_of(*pass).component, component);
  }
}

TEST(Passes, EveryPassCountsItsOwnRays) {
  RayCounts counts;
  for (const PassInfo& pass : all_passes()) counts[pass.id] = 1 + static_cast<std::size_t>(pass.id);
  RayCounts sum = counts;
  sum += counts;
  for (const PassInfo& pass : all_passes()) {
    EXPECT_EQ(sum[pass.id], 2 * (1 + static_cast<std::size_t>(pass.id))) << pass.name;
  }
  EXPECT_EQ(sum.primary, 0U);
}

TEST(Passes, AnUnknownNameIsRefusedWithTheNearest) {
  try {
    (void)parse_pass("shadwo");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("'shadow'"), std::string::npos) << error.hint();
  }
}

}  // namespace
}  // namespace hpr
