#include "engine/economies.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

using Names = std::vector<std::string>;

const std::vector<PassPlan> kAllRun{
    {PassId::Shadow, true, ""}, {PassId::Reflection, true, ""}, {PassId::Photon, true, ""}};

TEST(Economies, AreThoseThatSaveSomething) {
  EXPECT_EQ(economies_of({}, kAllRun), (Names{"half-resolution", "photons", "glossy-cutoff"}));
  EXPECT_EQ(economies_of({}, {}), (Names{"half-resolution"}));
  FrameSettings local;
  local.shading = Shading::Local;
  EXPECT_EQ(economies_of(local, {}), Names{});
  FrameSettings reference;
  reference.rays.reference = true;
  EXPECT_EQ(economies_of(reference, kAllRun), Names{});
  FrameSettings draft;
  draft.rays.glossy_cutoff = 0.1;
  draft.rays.max_depth = 2;
  EXPECT_EQ(economies_of(draft, kAllRun), (Names{"half-resolution", "photons"}));
}

TEST(Economies, WithoutPhotonsNoOtherPassStarts) {
  FrameSettings settings;
  settings.rays.passes = {PassId::Photon};
  settings.rays.photons = 5;
  settings.rays.global_photons = true;
  const FrameSettings less = economize(settings, Names{"photons"});
  EXPECT_TRUE(less.rays.passes.empty());
  EXPECT_FALSE(less.rays.auto_passes);
  EXPECT_FALSE(less.rays.global_photons);
  EXPECT_TRUE(economize({}, Names{"photons"}).rays.auto_passes);
}

TEST(Economies, NeverMakeAFrameDearer) {
  FrameSettings settings;
  settings.rays.glossy_cutoff = 0.05;
  settings.rays.max_depth = 1;
  const FrameSettings less = economize(settings, Names{"half-resolution", "glossy-cutoff"});
  EXPECT_EQ(less.rays.glossy_cutoff, 0.05);
  EXPECT_EQ(less.rays.max_depth, 1);
  EXPECT_EQ(less.rays.half_resolution.size(), 5U);
  EXPECT_EQ(economize(settings, {}).rays, settings.rays);
}

}  // namespace
}  // namespace hpr
