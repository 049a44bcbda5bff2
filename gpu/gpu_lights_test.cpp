#include <hpr/shaders/environment_samples.h>
#include <hpr/shaders/punctual_samples.h>
#include <hpr/shaders/tree_choices.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "gpu/light_tables.h"
#include "gpu/test_kernels.h"
#include "rt/lights/environment_map.h"
#include "rt/lights/light_tree.h"
#include "rt/lights/punctual_light.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

using GpuLightsTest = test::OnGpu;

constexpr std::size_t kInputs = 100'000;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Random numbers of the kinds lights and places have.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1).
  double one() { return std::generate_canonical<double, 53>(engine_); }
  std::uint32_t below(std::uint32_t count) { return static_cast<std::uint32_t>(one() * count); }
  bool chance(double probability) { return one() < probability; }
  glm::dvec2 two() {
    const double x = one();
    return {x, one()};
  }
  /// Between two positive numbers, each power of ten as often.
  double spread(double low, double high) { return low * std::pow(high / low, one()); }
  glm::dvec3 direction() {
    const double x = one();
    return warp::on_sphere({x, one()});
  }
  /// Of a surface: zero, along an axis, or any.
  glm::dvec3 normal() {
    if (chance(0.1)) return glm::dvec3(0.0);
    if (chance(0.1)) {
      glm::dvec3 axis(0.0);
      axis[static_cast<int>(below(3))] = chance(0.5) ? 1.0 : -1.0;
      return axis;
    }
    return direction();
  }

 private:
  std::mt19937_64 engine_;
};

/// Keeps the largest error of many numbers, relative to the expected ones; below `floor` to that.
class Errors {
 public:
  double of(double found, double expected, double floor = 1e-300) {
    if (found == expected) return 0.0;
    const double error = std::abs(found - expected) / std::max(std::abs(expected), floor);
    return std::isfinite(error) ? error : kInfinity;
  }
  void add(double found, double expected, double floor = 1e-300) { add(of(found, expected, floor)); }
  /// Relative to the vector's length.
  void add(const glm::dvec3& found, const glm::dvec3& expected, double floor = 1e-300) {
    const double size = std::max(glm::length(expected), floor);
    for (int k = 0; k < 3; ++k) add(of(found[k], expected[k], size));
  }
  [[nodiscard]] double largest() const { return largest_; }
  /// How many exceed 1e-9.
  [[nodiscard]] std::size_t large() const { return large_; }

 private:
  void add(double error) {
    largest_ = std::max(largest_, error);
    if (error > 1e-9) ++large_;
  }

  double largest_ = 0.0;
  std::size_t large_ = 0;
};

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
    const glm::dvec3 center = 10.0 * random.one() * random.direction();
    const glm::dvec3 half = random.chance(0.5) ? glm::dvec3(0.0) : random.spread(1e-6, 1.0) * abs(random.direction());
    light.low = center - half;
    light.high = center + half;
    light.strength = random.spread(1e-6, 1e3);
    light.axis = random.direction();
    if (random.chance(0.3)) light.spread_radians = std::numbers::pi * random.one();
    if (random.chance(0.3)) light.emission_radians = random.one();
    light.two_sided = random.chance(0.3);
    if (random.chance(0.2)) light.reach = random.spread(0.1, 30.0);
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
      query.position = random.spread(1e-3, 1e3) * random.direction();
      query.light = random.below(static_cast<std::uint32_t>(count));
      const LightBounds& near = lights[query.light];
      if (random.chance(0.3))
        query.position = 0.5 * (near.low + near.high) + random.spread(1e-9, 1.0) * random.direction();
      if (random.chance(0.01)) query.position = near.low;
      query.normal = random.normal();
      query.u = random.one();
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
  EXPECT_GT(chosen, kInputs / 2);
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

Light random_light(Random& random) {
  Light light;
  light.type = static_cast<LightType>(random.below(4));
  light.position = random.spread(1e-2, 1e4) * random.direction();
  light.direction = glm::vec3(random.direction());
  light.intensity = glm::vec3(random.spread(1e-3, 1e5) * abs(random.direction()));
  if (random.chance(0.3)) light.range = random.spread(0.1, 1e3);
  light.outer_cone_radians = static_cast<float>(random.chance(0.2) ? random.spread(1e-4, 0.1) : 1.57 * random.one());
  light.inner_cone_radians = light.outer_cone_radians * static_cast<float>(random.one());
  if (random.chance(0.5)) light.radius = random.spread(1e-9, 10.0);
  if (random.chance(0.5)) light.angular_radius_radians = static_cast<float>(random.spread(1e-4, 1.57));
  return light;
}

/// Near, far, inside the light's sphere, on its very place, in and at the edge of its cone.
glm::dvec3 random_position(Random& random, const Light& light) {
  if (random.chance(0.01)) return light.position;
  if (random.chance(0.2) && light.radius > 0.0) {
    return light.position + light.radius * random.spread(0.5, 2.0) * random.direction();
  }
  if (random.chance(0.5)) {
    const double angle = light.outer_cone_radians * (random.chance(0.2) ? 1.0 : random.one());
    return light.position + random.spread(1e-2, 1e3) *
                                warp::in_cone(glm::dvec3(light.direction), 1.0 - std::cos(angle), {1.0, random.one()});
  }
  return light.position + random.spread(1e-6, 1e6) * random.direction();
}

TEST_F(GpuLightsTest, PunctualLightsAreSampledAsOnTheCpu) {
  Random random(12);
  std::vector<Light> lights(kInputs);
  std::vector<PunctualQuery> queries(kInputs);
  for (std::size_t i = 0; i < kInputs; ++i) {
    lights[i] = random_light(random);
    PunctualQuery& query = queries[i];
    query.position = random_position(random, lights[i]);
    query.u = random.chance(0.05) ? glm::dvec2(0.0) : random.two();
    query.eye = random.chance(0.01) ? query.position : random.spread(0.1, 1e3) * random.direction();
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

/// One pixel; an even picture; a pattern of few pixels; one bright texel in a dim sky, and in a black one; a column.
std::vector<Environment> environments() {
  std::vector<Environment> all;
  all.push_back({Image<Rgb>({1, 1}, {0.5F, 1.0F, 2.0F})});
  all.push_back({Image<Rgb>({1, 1})});
  all.push_back({Image<Rgb>({64, 32}, {1.0F, 0.5F, 0.25F})});
  Environment pattern{Image<Rgb>({7, 5})};
  Environment hills{Image<Rgb>({200, 100})};
  for (Environment* each : {&pattern, &hills}) {
    const Size size = each->image.size();
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto value = static_cast<float>((x * 5 + y * 3) % 7);
        each->image.at(x, y) = {value, static_cast<float>(x % 3), y < size.height / 2 ? 0.25F * value : 0.0F};
      }
    }
    each->rotation_radians = 0.7;
    each->scale = 2.0;
  }
  all.push_back(pattern);
  all.push_back(hills);
  Environment sunny{Image<Rgb>({128, 64}, {0.1F, 0.2F, 0.3F})};
  sunny.image.at(40, 11) = {5e4F, 4e4F, 3e4F};
  sunny.rotation_radians = -2.0;
  all.push_back(sunny);
  Environment night{Image<Rgb>({16, 8})};
  night.image.at(15, 7) = {5.0F, 5.0F, 5.0F};
  all.push_back(night);
  Environment bands{Image<Rgb>({1, 9})};
  for (int y = 0; y < 9; ++y) bands.image.at(0, y) = {static_cast<float>(y % 4), 1.0F, 0.0F};
  all.push_back(bands);
  return all;
}

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
  const std::vector<Environment> all = environments();
  for (const Environment& environment : all) {
    const EnvironmentMap map(environment);
    GpuTables tables(device());
    const GpuEnvironment there = upload_environment(tables, map);
    std::vector<EnvironmentQuery> queries(kInputs / all.size());
    for (EnvironmentQuery& query : queries) {
      query.normal = random.normal();
      query.choice = random.one();
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

}  // namespace
}  // namespace hpr
