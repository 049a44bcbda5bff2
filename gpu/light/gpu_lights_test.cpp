#include "gpu/light/gpu_lights.h"

#include <hpr/shaders/environment_samples.h>
#include <hpr/shaders/light_samples.h>
#include <hpr/shaders/photon_starts.h>
#include <hpr/shaders/punctual_samples.h>
#include <hpr/shaders/tree_choices.h>
#include <hpr/shaders/triangle_samples.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "gpu/light/gpu_materials.h"
#include "gpu/light/light_tables.h"
#include "gpu/light/test_lights.h"
#include "rt/lights/environment_map.h"
#include "rt/lights/light_sampler.h"
#include "rt/lights/light_tree.h"
#include "rt/lights/punctual_light.h"
#include "rt/lights/triangle_lights.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

using test::any_normal;
using test::Errors;
using test::kInputs;
using test::Random;
using test::spread;
using GpuLightsTest = test::OnGpu;

/// As tree_choices.comp has them.
struct TreeQuery {
  glm::dvec3 position;
  glm::dvec3 normal;
  double u;
  std::uint32_t light;
  std::uint32_t padding;
};
struct TreeAnswer {
  double importance;
  double probability;
  double probability_of_light;
  std::uint32_t light;
  std::uint32_t chosen;
};

/// Points, boxes and spots, with and without an end, strong and weak.
std::vector<LightBounds> random_lights(Random& random, std::size_t count) {
  std::vector<LightBounds> lights(count);
  for (LightBounds& light : lights) {
    const glm::dvec3 center = 10.0 * random.number() * random.direction();
    const glm::dvec3 half = random.chance(0.5) ? glm::dvec3(0.0) : spread(random, 1e-6, 1.0) * abs(random.direction());
    light.low = center - half;
    light.high = center + half;
    light.strength = spread(random, 1e-6, 1e3);
    light.axis = random.direction();
    if (random.chance(0.3)) light.spread_radians = std::numbers::pi * random.number();
    if (random.chance(0.3)) light.emission_radians = random.number();
    light.two_sided = random.chance(0.3);
    if (random.chance(0.2)) light.reach = spread(random, 0.1, 30.0);
  }
  return lights;
}

TEST_F(GpuLightsTest, TreesChooseAsOnTheCpu) {
  Random random(11);
  std::size_t chosen = 0;
  std::size_t others = 0;
  Errors errors;
  for (const std::size_t count : {1U, 2U, 40U, 3000U}) {
    const std::vector<LightBounds> lights = random_lights(random, count);
    const LightTree tree(lights);
    GpuTables tables(device());
    const GpuLightTree there = upload_light_tree(tables, tree);
    std::vector<TreeQuery> queries(kInputs / 4);
    for (TreeQuery& query : queries) {
      query.position = spread(random, 1e-3, 1e3) * random.direction();
      query.light = random.below(count);
      const LightBounds& near = lights[query.light];
      if (random.chance(0.3))
        query.position = 0.5 * (near.low + near.high) + spread(random, 1e-9, 1.0) * random.direction();
      if (random.chance(0.01)) query.position = near.low;
      query.normal = any_normal(random);
      query.u = random.number();
    }
    const auto found = test::map_on_gpu<TreeAnswer>(device(), tree_choices, std::span<const TreeQuery>(queries),
                                                    tables.upload(std::span(&there, 1)));
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const TreeQuery& query = queries[i];
      errors.add(found[i].importance, tree.importance(query.position, query.normal));
      errors.add(found[i].probability_of_light, tree.probability(query.position, query.normal, query.light), 1e-12);
      const auto choice = tree.choose(query.position, query.normal, query.u);
      if (choice.has_value() != (found[i].chosen != 0) || (choice && choice->light != found[i].light)) {
        ++others;
        continue;
      }
      if (!choice) continue;
      ++chosen;
      errors.add(found[i].probability, choice->probability);
    }
  }
  EXPECT_EQ(errors.large(), 0U) << errors.largest();
  EXPECT_LE(others, 3U) << "random numbers at the edge of two choices";
  EXPECT_GT(chosen, kInputs / 3);
}

/// As punctual_samples.comp has them.
struct PunctualQuery {
  glm::dvec3 position;
  glm::dvec2 u;
  glm::dvec3 eye;
  glm::dvec3 back;
  std::uint32_t orthographic;
  std::uint32_t padding;
  GpuPunctualLight light;
};
struct PunctualAnswer {
  glm::dvec3 to_light;
  double distance;
  glm::dvec3 goal;
  glm::dvec3 weight;
  std::uint32_t casts_shadows;
  std::uint32_t is_fixed;
};

/// Near, far, inside the light's sphere, on its very place, in and at the edge of its cone.
glm::dvec3 random_position(Random& random, const Light& light) {
  if (random.chance(0.01)) return light.position;
  if (random.chance(0.2) && light.radius > 0.0) {
    return light.position + light.radius * spread(random, 0.5, 2.0) * random.direction();
  }
  if (random.chance(0.5)) {
    const double angle = light.outer_cone_radians * (random.chance(0.2) ? 1.0 : random.number());
    return light.position + spread(random, 1e-2, 1e3) * warp::in_cone(glm::dvec3(light.direction),
                                                                      1.0 - std::cos(angle), {1.0, random.number()});
  }
  return light.position + spread(random, 1e-6, 1e6) * random.direction();
}

TEST_F(GpuLightsTest, PunctualLightsAreSampledAsOnTheCpu) {
  Random random(12);
  std::vector<Light> lights(kInputs);
  std::vector<PunctualQuery> queries(kInputs);
  for (std::size_t i = 0; i < kInputs; ++i) {
    lights[i] = test::random_light(random);
    PunctualQuery& query = queries[i];
    query.position = random_position(random, lights[i]);
    query.u = random.chance(0.05) ? glm::dvec2(0.0) : random.two();
    query.eye = random.chance(0.01) ? query.position : spread(random, 0.1, 1e3) * random.direction();
    query.back = random.direction();
    query.orthographic = random.chance(0.3) ? 1 : 0;
    query.light = punctual_light_of(lights[i]);
  }
  const auto found =
      test::map_on_gpu<PunctualAnswer>(device(), punctual_samples, std::span<const PunctualQuery>(queries));
  Errors errors;
  std::array<std::size_t, 4> lit{};
  for (std::size_t i = 0; i < kInputs; ++i) {
    const PunctualQuery& query = queries[i];
    View view;
    view.eye = query.eye;
    view.axes[2] = query.back;
    view.orthographic = query.orthographic != 0;
    const LightSample expected = sample_punctual(lights[i], query.position, view, query.u);
    const double size = glm::length(lights[i].position) + glm::length(query.position);
    errors.add(found[i].to_light, expected.to_light);
    errors.add(found[i].distance, expected.distance, 1e-6 * size);
    errors.add(found[i].goal, expected.goal, size);
    // At the foot of its ramp a spot's light is a difference of nearly equal cosines.
    errors.add(found[i].weight, expected.weight,
               1e-6 * glm::length(lights[i].intensity) / std::max(expected.distance * expected.distance, 1e-12));
    ASSERT_EQ(found[i].casts_shadows != 0, expected.casts_shadows) << i;
    ASSERT_EQ(found[i].is_fixed != 0, is_fixed(lights[i])) << i;
    if (expected.weight != glm::dvec3(0.0)) ++lit.at(static_cast<std::size_t>(lights[i].type));
  }
  EXPECT_EQ(errors.large(), 0U) << errors.largest();
  for (const std::size_t each : lit) EXPECT_GT(each, kInputs / 20);
}

/// As environment_samples.comp has them.
struct EnvironmentQuery {
  glm::dvec3 normal;
  glm::dvec3 direction;
  double choice;
  glm::dvec2 u;
};
struct EnvironmentAnswer {
  glm::dvec3 sampled;
  glm::dvec3 radiance;
  glm::dvec3 radiance_alone;
  double pdf;
  double sampled_pdf;
  std::uint32_t chosen;
  std::uint32_t padding;
};

/// How far a direction lies from where its texel or the rounding of a normal changes: there the density jumps.
bool jumps(const EnvironmentMap& map, const glm::dvec3& direction, const glm::dvec3& normal, double pdf) {
  for (int k = 0; k < 6; ++k) {
    glm::dvec3 moved = direction;
    moved[k / 2] += k % 2 == 0 ? 1e-12 : -1e-12;
    if (std::abs(map.evaluate(moved, normal).pdf - pdf) > 1e-6 * pdf) return true;
  }
  return false;
}

TEST_F(GpuLightsTest, EnvironmentsAreSampledAsOnTheCpu) {
  Random random(13);
  const std::vector<Environment> all = test::environments();
  for (const Environment& environment : all) {
    const EnvironmentMap map(environment);
    GpuTables tables(device());
    const GpuEnvironment there = upload_environment(tables, map);
    std::vector<EnvironmentQuery> queries(kInputs / all.size());
    for (EnvironmentQuery& query : queries) {
      query.normal = any_normal(random);
      query.choice = random.number();
      query.u = random.two();
      query.direction = random.direction();
      if (random.chance(0.3))
        query.direction = map.sample(query.normal, query.choice, random.two()).value_or(query.direction);
      if (random.chance(0.01)) query.direction = {0.0, random.chance(0.5) ? 1.0 : -1.0, 0.0};
    }
    const auto found = test::map_on_gpu<EnvironmentAnswer>(
        device(), environment_samples, std::span<const EnvironmentQuery>(queries), tables.upload(std::span(&there, 1)));
    Errors errors;
    std::size_t sampled = 0;
    std::size_t dense = 0;
    std::size_t on_edges = 0;
    const double brightest = glm::length(map.mean());
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const EnvironmentQuery& query = queries[i];
      const auto seen = map.evaluate(query.direction, query.normal);
      errors.add(found[i].radiance, seen.radiance, 1e-3 * brightest);
      errors.add(found[i].radiance_alone, map.radiance(query.direction), 1e-3 * brightest);
      const auto add_density = [&](double pdf, const glm::dvec3& direction, double expected) {
        if (errors.of(pdf, expected, 1e-6) > 1e-9 && jumps(map, direction, query.normal, expected)) {
          ++on_edges;
        } else {
          errors.add(pdf, expected, 1e-6);
        }
      };
      add_density(found[i].pdf, query.direction, seen.pdf);
      if (seen.pdf > 0.0) ++dense;
      const auto direction = map.sample(query.normal, query.choice, query.u);
      ASSERT_EQ(direction.has_value(), found[i].chosen != 0) << i;
      if (!direction) continue;
      ++sampled;
      errors.add(found[i].sampled, *direction);
      add_density(found[i].sampled_pdf, *direction, map.evaluate(*direction, query.normal).pdf);
    }
    const std::string size = std::to_string(there.size.x) + " x " + std::to_string(there.size.y);
    EXPECT_EQ(errors.large(), 0U) << errors.largest() << ", " << size;
    EXPECT_LE(on_edges, 3U) << size;
    EXPECT_GT(sampled, queries.size() / 4) << size;
    EXPECT_GE(dense, brightest > 0.0 ? queries.size() / 5 : 0) << size;
  }
}

/// As triangle_samples.comp has them.
struct TriangleQuery {
  glm::dvec3 position;
  glm::dvec2 u;
  std::uint32_t triangle;
  std::uint32_t surface;
};
struct TriangleAnswer {
  glm::dvec3 to_light;
  double distance;
  glm::dvec3 goal;
  double offset;
  glm::dvec3 weight;
  double pdf;
  double pdf_of_goal;
  double solid_angle;
  std::uint32_t found;
  std::uint32_t can_sample;
};

TEST_F(GpuLightsTest, TrianglesAreSampledAsOnTheCpu) {
  Random random(14);
  const Scene scene = test::with_triangles(random, 40);
  const TriangleLights triangles(scene);
  ASSERT_GT(triangles.size(), 300U);
  const GpuMaterials materials(device(), scene);
  GpuTables tables(device());
  const std::vector<GpuTriangleLight> there = triangle_lights_of(scene, triangles);
  std::vector<TriangleQuery> queries(kInputs);
  for (TriangleQuery& query : queries) {
    query.triangle = random.below(triangles.size());
    query.position = test::position_about(random, triangles[query.triangle]);
    query.u = random.two();
    query.surface = random.below(scene.triangles + 3);
  }
  const auto found = test::map_on_gpu<TriangleAnswer>(
      device(), triangle_samples, std::span<const TriangleQuery>(queries), tables.upload(std::span(there)),
      materials.address(), std::uint64_t{there.size()});
  Errors errors;
  Errors textured;
  std::size_t others = 0;
  std::size_t by_angle = 0;
  std::size_t by_area = 0;
  std::array<std::size_t, 5> lit{};
  for (std::size_t i = 0; i < kInputs; ++i) {
    const TriangleQuery& query = queries[i];
    const TriangleLight& triangle = triangles[query.triangle];
    const LightSample expected = triangles.sample(query.triangle, query.position, query.u);
    const SphericalTriangle seen(query.position, triangle.v0, triangle.e1, triangle.e2);
    const auto which = triangles.find(query.surface);
    ASSERT_EQ(found[i].found, which ? static_cast<std::uint32_t>(*which) : 0xFFFFFFFFU) << i;
    // Seen edge-on, as a difference of nearly equal numbers.
    errors.add(found[i].solid_angle, seen.solid_angle(), 1e-6);
    if ((found[i].can_sample != 0) != seen.can_sample()) {
      ++others;
      continue;
    }
    errors.add(found[i].pdf_of_goal,
               triangles.pdf(query.triangle, query.position, triangle.v0 + 0.25 * triangle.e1 + 0.25 * triangle.e2));
    const double size = glm::length(triangle.e1) + glm::length(triangle.e2) + expected.distance;
    // Points are rounded by the triangle's size, directions to near ones the more.
    errors.add(found[i].to_light, expected.to_light, size / expected.distance);
    errors.add(found[i].distance, expected.distance, size);
    errors.add(found[i].goal, expected.goal, size);
    errors.add(found[i].offset, expected.offset);
    errors.add(found[i].pdf, expected.pdf);
    const std::uint32_t material = scene.mesh_of(scene.instances[triangle.instance]).material;
    const bool is_lit = expected.weight != glm::dvec3(0.0);
    if (is_lit != (found[i].weight != glm::dvec3(0.0))) {
      ++others;
    } else {
      (material < 2 ? errors : textured).add(found[i].weight, expected.weight, 1e-3 / std::max(expected.pdf, 1e-3));
    }
    if (!is_lit) continue;
    ++(seen.can_sample() ? by_angle : by_area);
    ++lit.at(material);
  }
  // Where u.x cuts off next to nothing of a small triangle, both have few digits of how much that is.
  EXPECT_LE(errors.large(), 10U) << errors.largest();
  EXPECT_LT(errors.largest(), 1e-6);
  EXPECT_LT(textured.large(), kInputs / 100) << "coordinates are rounded to single precision: " << textured.largest();
  EXPECT_LT(textured.largest(), 1e-3);
  EXPECT_LE(others, 3U) << "triangles at the edge of what is sampled by angle, or of what is cut out";
  EXPECT_GT(by_angle, kInputs / 5);
  EXPECT_GT(by_area, kInputs / 20);
  for (const std::size_t each : lit) EXPECT_GT(each, kInputs / 40);
}

/// As light_samples.comp has them.
struct LightQuery {
  glm::dvec3 position;
  glm::dvec3 normal;
  glm::dvec3 direction;
  glm::dvec3 hit;
  double choice;
  glm::dvec2 u;
  std::uint32_t surface;
  std::uint32_t enumerated;
};
struct GpuLightSample {
  glm::dvec3 to_light;
  double distance;
  glm::dvec3 goal;
  double offset;
  glm::dvec3 weight;
  double pdf;
  std::uint32_t casts_shadows;
  std::uint32_t chosen;
};
struct LightAnswer {
  GpuLightSample one;
  GpuLightSample enumerated;
  glm::dvec3 environment;
  double environment_pdf;
  double surface_pdf;
  std::uint32_t enumerated_count;
  std::uint32_t enumerated_is_fixed;
  std::uint32_t has_tree;
  std::uint32_t padding;
};

/// Whether all but the weight of a sample is the same but for rounding; adds the errors of weight and density.
bool add_sample(Errors& errors, const GpuLightSample& found, const LightSample& expected, double size) {
  const double apart = glm::length(found.to_light - expected.to_light);
  if (!(apart < 1e-6)) return false;  // of another light, or another part of one
  errors.add(found.to_light, expected.to_light, std::max(1.0, 10.0 / expected.distance));
  errors.add(found.distance, expected.distance, 1e-3 * size);
  errors.add(found.goal, expected.goal, size);
  errors.add(found.offset, expected.offset);
  errors.add(found.pdf, expected.pdf, 1e-6);
  errors.add(found.weight, expected.weight, 1e-6);
  return (found.casts_shadows != 0) == expected.casts_shadows;
}

struct LightScene {
  Scene scene;
  ConstantEnvironment constant = ConstantEnvironment::Sampled;
};

/// None but the headlight; few lights of all kinds; many of them; an environment and nothing else; a constant one left
/// to rays; triangles alone.
std::vector<LightScene> light_scenes(Random& random) {
  std::vector<LightScene> all(6);
  all[0].scene = test::white_floor();
  all[1].scene = test::with_triangles(random, 5, 2);
  all[2].scene = test::with_triangles(random, 5, 2);
  all[3].scene = test::white_floor();
  all[4].scene = test::with_triangles(random, 1, 2);
  all[5].scene = test::with_triangles(random, 50, 2);
  const std::vector<Environment> skies = test::environments();
  all[1].scene.environment = skies[5];
  all[1].scene.environment->scale = 1e-5;  // less than triangles give to what is near
  all[2].scene.environment = skies[4];
  all[3].scene.environment = skies[0];
  all[4].scene.environment = skies[0];
  all[4].constant = ConstantEnvironment::LeftToRays;
  for (Scene* scene : {&all[1].scene, &all[2].scene}) {
    const std::size_t count = scene == &all[1].scene ? 20 : 300;
    while (scene->lights.size() < count) {
      Light light = test::random_light(random);
      if (light.type == LightType::Headlight) continue;
      light.position = 10.0 * random.number() * random.direction();
      scene->lights.push_back(light);
    }
  }
  all[5].scene.background = {0.1F, 0.2F, 0.3F};
  return all;
}

TEST_F(GpuLightsTest, ScenesAreLitAsOnTheCpu) {
  Random random(15);
  const std::vector<LightScene> all = light_scenes(random);
  View view;
  view.eye = {1.0, 2.0, 3.0};
  for (std::size_t number = 0; number < all.size(); ++number) {
    const Scene& scene = all[number].scene;
    const LightSampler sampler(scene, all[number].constant);
    const GpuMaterials materials(device(), scene);
    const GpuLights lights(device(), scene, sampler, materials);
    std::vector<LightQuery> queries(kInputs / all.size());
    for (LightQuery& query : queries) {
      query.position = spread(random, 1e-2, 100.0) * random.direction();
      query.normal = any_normal(random);
      query.direction = random.direction();
      query.choice = random.number();
      query.u = random.two();
      query.surface = random.below(scene.triangles);
      query.enumerated = random.below(20);
      if (sampler.triangles().size() > 0 && random.chance(0.9)) {
        const TriangleLight& triangle = sampler.triangles()[random.below(sampler.triangles().size())];
        if (random.chance(0.3)) query.position = test::position_about(random, triangle);
        query.surface = triangle.surface;
        query.hit = triangle.v0 + 0.25 * (triangle.e1 + triangle.e2);
      }
    }
    const auto found =
        test::map_on_gpu<LightAnswer>(device(), light_samples, std::span<const LightQuery>(queries), lights.address());
    Errors errors;
    std::size_t sampled = 0;
    std::size_t met = 0;
    std::size_t others = 0;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const LightQuery& query = queries[i];
      const LightAnswer& answer = found[i];
      const double size = 40.0 + glm::length(query.position);
      ASSERT_EQ(answer.enumerated_count, sampler.enumerated());
      ASSERT_EQ(answer.has_tree != 0, sampler.has_tree());
      if (query.enumerated < sampler.enumerated()) {
        const LightSample expected = sampler.sample_enumerated(query.enumerated, query.position, view, query.u);
        ASSERT_EQ(answer.enumerated_is_fixed != 0, sampler.enumerated_is_fixed(query.enumerated));
        if (!add_sample(errors, answer.enumerated, expected, size)) ++others;
      }
      const auto expected = sampler.sample(query.position, query.normal, view, query.choice, query.u);
      if (expected.has_value() != (answer.one.chosen != 0)) {
        ++others;
      } else if (expected) {
        ++sampled;
        if (!add_sample(errors, answer.one, *expected, size)) ++others;
      }
      errors.add(answer.environment, sampler.environment(query.direction), 1e-3);
      errors.add(answer.environment_pdf, sampler.environment_pdf(query.position, query.normal, query.direction), 1e-6);
      SurfacePoint hit;
      hit.position = query.hit;
      const double pdf = sampler.surface_pdf(query.position, query.normal, query.surface, hit);
      errors.add(answer.surface_pdf, pdf, 1e-9);
      if (pdf > 0.0) ++met;
    }
    EXPECT_LE(errors.large(), 2U) << errors.largest() << ", scene " << number;
    EXPECT_LE(others, 5U) << "at the edge of two choices, scene " << number;
    if (sampler.has_tree()) {
      EXPECT_GT(sampled, queries.size() / 20) << number;
    }
    if (sampler.triangles().size() > 0) {
      EXPECT_GT(met, queries.size() / 10) << number;
    }
  }
}

/// As photon_starts.comp has them.
struct PhotonQuery {
  double choice;
  glm::dvec2 u_place;
  glm::dvec2 u_direction;
};
struct PhotonAnswer {
  glm::dvec3 origin;
  glm::dvec3 direction;
  glm::dvec3 flux;
  double offset;
  glm::dvec3 center;
  double range;
  Media media;
  std::uint32_t surface;
  std::uint32_t endless;
  std::uint32_t emitted;
  std::uint32_t padding;
};

/// A solid that absorbs about all lights.
void add_solid(Scene& scene) {
  Material glass = test::clear_glass(1.0F, 1.0F);
  glass.attenuation_distance = 10.0F;
  glass.attenuation_color = {0.5F, 0.25F, 0.75F};
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(60.0, 8, test::add_material(scene, glass))));
  finish_scene(scene);
}

TEST_F(GpuLightsTest, PhotonsStartAsOnTheCpu) {
  Random random(16);
  std::vector<LightScene> all = light_scenes(random);
  add_solid(all[2].scene);
  add_solid(all[5].scene);
  for (std::size_t number = 0; number < all.size(); ++number) {
    const Scene& scene = all[number].scene;
    const LightSampler sampler(scene, all[number].constant);
    const GpuMaterials materials(device(), scene);
    const GpuLights lights(device(), scene, sampler, materials);
    std::vector<PhotonQuery> queries(kInputs / all.size());
    for (PhotonQuery& query : queries) query = {random.number(), random.two(), random.two()};
    const auto found = test::map_on_gpu<PhotonAnswer>(device(), photon_starts, std::span<const PhotonQuery>(queries),
                                                      lights.address());
    Errors errors;
    std::size_t emitted = 0;
    std::size_t in_media = 0;
    const double size = sampler.lit_sphere().radius;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const auto expected = sampler.emit(queries[i].choice, queries[i].u_place, queries[i].u_direction);
      ASSERT_EQ(found[i].emitted != 0, expected.has_value()) << i;
      if (!expected) continue;
      ++emitted;
      errors.add(found[i].origin, expected->origin, size);
      errors.add(found[i].direction, expected->direction);
      errors.add(found[i].flux, expected->flux, 1e-6);
      errors.add(found[i].offset, expected->offset);
      errors.add(found[i].center, expected->center);
      errors.add(found[i].range, expected->range);
      ASSERT_EQ(found[i].media, expected->media) << i;
      ASSERT_EQ(found[i].surface, expected->surface) << i;
      ASSERT_EQ(found[i].endless != 0, expected->endless) << i;
      if (expected->media != Media{}) ++in_media;
    }
    EXPECT_EQ(errors.large(), 0U) << errors.largest() << ", scene " << number;
    EXPECT_EQ(emitted, number == 0 ? 0 : queries.size());
    if (number == 5) {
      EXPECT_EQ(in_media, queries.size());
    }
  }
}

}  // namespace
}  // namespace hpr
