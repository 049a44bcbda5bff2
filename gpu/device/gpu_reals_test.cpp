#include <hpr/shaders/reals.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/vec4.hpp>
#include <random>
#include <span>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

using GpuReals = test::OnGpu;

/// As reals.comp writes them.
struct Reals {
  glm::dvec2 circle;
  double arc_tangent;
  double exponential;
  double logarithm;
  double cube_root;
  glm::dvec3 lobe;
  glm::dvec3 cone;
  glm::dvec3 sphere;
};

Reals reals_of(const glm::dvec4& x) {
  const glm::dvec2 u(x.z, x.w);
  const glm::dvec3 axis = glm::normalize(glm::dvec3(x.x, x.y, 0.25));
  return {{std::cos(x.x), std::sin(x.x)},
          std::atan2(x.x, x.y),
          std::exp(x.x),
          std::log(std::abs(x.y)),
          std::cbrt(x.y),
          warp::cosine_lobe(axis, u),
          warp::in_cone(-axis, 0.3 * x.z, u),
          warp::on_sphere(u)};
}

TEST_F(GpuReals, AreThoseOfTheCpu) {
  std::mt19937_64 random(7);
  std::vector<glm::dvec4> numbers(100'000);
  for (glm::dvec4& each : numbers) {
    const auto number = [&] { return std::generate_canonical<double, 53>(random); };
    const auto wide = [&] { return (number() < 0.5 ? -1.0 : 1.0) * std::exp(40.0 * number() - 35.0); };
    each = {wide(), wide(), number(), number()};
  }
  numbers[0] = {0.0, -1.0, 0.0, 0.0};
  numbers[1] = {-0.0, -1.0, 0.5, 0.5};
  numbers[2] = {0.0, 1.0, 1.0 - 0x1p-32, 0.25};
  const std::vector<Reals> found = test::map_on_gpu<Reals>(device(), reals, std::span<const glm::dvec4>(numbers));
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const Reals expected = reals_of(numbers[i]);
    const auto near = [&](double a, double b) { return std::abs(a - b) <= 4e-15 * std::max(std::abs(b), 1e-3); };
    const auto all_near = [&](const auto& a, const auto& b) {
      for (int k = 0; k < a.length(); ++k) {
        if (!(std::abs(a[k] - b[k]) <= 1e-14)) return false;
      }
      return true;
    };
    ASSERT_TRUE(all_near(found[i].circle, expected.circle)) << numbers[i].x;
    ASSERT_TRUE(near(found[i].arc_tangent, expected.arc_tangent)) << numbers[i].x << " " << numbers[i].y;
    ASSERT_TRUE(near(found[i].exponential, expected.exponential)) << numbers[i].x;
    ASSERT_TRUE(near(found[i].logarithm, expected.logarithm)) << numbers[i].y;
    ASSERT_TRUE(near(found[i].cube_root, expected.cube_root)) << numbers[i].y;
    ASSERT_TRUE(all_near(found[i].lobe, expected.lobe)) << i;
    ASSERT_TRUE(all_near(found[i].cone, expected.cone)) << i;
    ASSERT_TRUE(all_near(found[i].sphere, expected.sphere)) << i;
  }
}

}  // namespace
}  // namespace hpr
