#include "engine/plan.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace hpr {
namespace {

constexpr std::uint64_t kFullHd = std::uint64_t{1920} * 1080;

/// Of meshes without instances, drawn by a CPU, in a scene whose light takes rays as well.
KeyWork work_of(std::uint64_t triangles, std::uint64_t pixels) {
  return {.triangles = triangles, .own_triangles = triangles, .pixels = pixels, .software_gl = true};
}

Primary choice_of(const KeyWork& work) {
  return choose_primary(work).primary;
}

TEST(PrimaryChoice, IsRaysWhereSoftwareWouldRasteriseMoreTrianglesThanThereArePixels) {
  EXPECT_EQ(choice_of(work_of(10'000'000, kFullHd)), Primary::Rays);
  EXPECT_EQ(choice_of(work_of(100'000'000, kFullHd)), Primary::Rays);
  EXPECT_EQ(choice_of(work_of(38, kFullHd)), Primary::Raster);
  EXPECT_EQ(choice_of(work_of(200'000, kFullHd)), Primary::Raster);
  EXPECT_EQ(choice_of(work_of(10'000'000, 16 * kFullHd)), Primary::Raster);
}

TEST(PrimaryChoice, IsRaysForPicturesTooSmallToStartOpenGl) {
  EXPECT_EQ(choice_of(work_of(38, 32 * 32)), Primary::Rays);
  EXPECT_EQ(choice_of(work_of(0, 65'000)), Primary::Rays);
  EXPECT_EQ(choice_of(work_of(38, 66'000)), Primary::Raster);
}

TEST(PrimaryChoice, ChangesOnceAsPicturesGrow) {
  for (const std::uint64_t triangles : {0ULL, 1'000ULL, 100'000ULL, 10'000'000ULL}) {
    Primary last = Primary::Rays;
    for (std::uint64_t pixels = 1; pixels < (std::uint64_t{1} << 40); pixels *= 2) {
      const Primary chosen = choice_of(work_of(triangles, pixels));
      EXPECT_NE(chosen, Primary::Auto);
      EXPECT_FALSE(last == Primary::Raster && chosen == Primary::Rays) << triangles << " triangles, " << pixels;
      last = chosen;
    }
    EXPECT_EQ(last, Primary::Raster);
  }
}

TEST(PrimaryChoice, IsRasterOnAGpuAndWhereDepthsAreRounded) {
  KeyWork work = work_of(100'000'000, 32 * 32);
  work.software_gl = false;
  EXPECT_EQ(choice_of(work), Primary::Raster);
  work.software_gl = true;
  work.rounds_depth = true;
  EXPECT_EQ(choice_of(work), Primary::Raster);
}

TEST(PrimaryChoice, CountsTheRaySceneThatIsBuiltForTheKeysAlone) {
  KeyWork work = work_of(4'000'000, kFullHd);
  EXPECT_EQ(choice_of(work), Primary::Rays);
  work.ray_scene_is_for_keys = true;
  EXPECT_EQ(choice_of(work), Primary::Rays) << "many frames share it";
  work.single_picture = true;
  EXPECT_EQ(choice_of(work), Primary::Raster);
  work.own_triangles = 10'000;
  EXPECT_EQ(choice_of(work), Primary::Rays) << "instances cost little to build";
  work.own_triangles = work.triangles;
  work.ray_scene_is_for_keys = false;
  EXPECT_EQ(choice_of(work), Primary::Rays) << "passes need it as well";
}

TEST(PrimaryChoice, SaysWhy) {
  const std::string why = choose_primary(work_of(10'000'000, kFullHd)).why;
  EXPECT_NE(why.find("2073600 pixels are few beside 10000000 triangles"), std::string::npos) << why;
  EXPECT_NE(choose_primary(work_of(38, 1024)).why.find("too few to start OpenGL"), std::string::npos);
  EXPECT_NE(choose_primary(work_of(38, kFullHd)).why.find("2073600 pixels are many"), std::string::npos);
  EXPECT_NE(choose_primary({}).why.find("GPU"), std::string::npos);
}

}  // namespace
}  // namespace hpr
