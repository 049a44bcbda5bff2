#include <gtest/gtest.h>

#include "rt/photons/test_photons.h"

// Light of photons alone, where a series says how bright all is.
namespace hpr {
namespace {

class PhotonFurnace : public testing::TestWithParam<double> {};

TEST_P(PhotonFurnace, IsAsBrightAsItsSeriesSums) {
  const double albedo = GetParam();
  const Scene scene = test::furnace(static_cast<float>(albedo), 1.0F);
  const View view = test::view_from({0, 0, 0.5}, {0.1, 0.2, -1}, {8, 8}, scene, 0.5);
  const RaySettings settings{.photons = 100'000, .global_photons = true};
  const glm::dvec3 mean = test::mean_pixel(scene, view, 4, 4, 32, settings);
  EXPECT_NEAR(mean.g * (1.0 - albedo), 1.0, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Albedos, PhotonFurnace, testing::Values(0.5, 0.8));

}  // namespace
}  // namespace hpr
