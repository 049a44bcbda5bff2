#include "engine/settings_table.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "core/error.h"

namespace hpr {
namespace {

TEST(SettingsTable, EachSettingTakesTheFirstValueThatItNames) {
  std::set<std::string_view> names;
  for (const Setting& setting : all_settings()) {
    EXPECT_TRUE(names.insert(setting.name).second) << setting.name << " stands there twice";
    EXPECT_FALSE(setting.help.empty()) << setting.name;
    if (!setting.is_tradeoff()) continue;
    RenderSettings settings;
    const std::string first = setting.value.takes.substr(0, setting.value.takes.find_first_of(",: "));
    EXPECT_NO_THROW(set_setting(settings, setting.name, first)) << setting.name;
    EXPECT_TRUE(settings.is_given(setting.name));
  }
}

TEST(SettingsTable, WhatASettingWritesIsWhatItReads) {
  for (const Setting& setting : all_settings()) {
    RenderSettings settings;
    const std::string written = setting.value.write(settings);
    if (written.empty()) continue;
    RenderSettings again;
    ASSERT_NO_THROW(setting.value.parse(again, written)) << setting.name << " " << written;
    EXPECT_EQ(setting.value.write(again), written) << setting.name;
    if (!setting.initial.empty()) {
      setting.value.parse(again, std::string(setting.initial));
      EXPECT_EQ(setting.value.write(again), written) << setting.name << ": help shows another value than the default";
    }
  }
}

TEST(SettingsTable, EachSettingTouchesItsOwnValueAlone) {
  const RenderSettings untouched;
  for (const Setting& setting : all_settings()) {
    RenderSettings settings;
    for (const char* const value :
         {"true", "7",        "0.5",  "1,2,3", "shadow", "local",       "rays", "hybrid", "16", "8",      "low",
          "off",  "gaussian", "best", "depth", "tree",   "partitioned", "aces", "none",   "uv", "static", "x"}) {
      try {
        setting.value.parse(settings, value);
      } catch (const Error&) {
        continue;
      }
      if (setting.value.write(settings) != setting.value.write(untouched)) break;
    }
    EXPECT_NE(setting.value.write(settings), setting.value.write(untouched)) << setting.name << " never changed";
    for (const Setting& other : all_settings()) {
      if (&other == &setting) continue;
      EXPECT_EQ(other.value.write(settings), other.value.write(untouched)) << setting.name << " changed " << other.name;
    }
    settings.specified.insert(setting.name);
    reset_setting(settings, setting.name);
    EXPECT_EQ(setting.value.write(settings), setting.value.write(untouched)) << setting.name;
    EXPECT_FALSE(settings.is_given(setting.name));
  }
}

TEST(SettingsTable, UnknownNamesAndBadValuesAreRefusedWithChoices) {
  RenderSettings settings;
  try {
    set_setting(settings, "max-dept", "3");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.hint().find("did you mean 'max-depth'"), std::string::npos) << error.hint();
  }
  for (const auto& [name, value] : {std::pair{"max-depth", "0"},
                                    {"max-depth", "many"},
                                    {"glossy-cutoff", "nan"},
                                    {"primary", "ray"},
                                    {"passes", "auto,shadow"},
                                    {"eye", "1,2"},
                                    {"spp", "0"},
                                    {"adaptive", "yes"},
                                    {"codec-error", "256"},
                                    {"fov", "180"}}) {
    try {
      set_setting(settings, name, value);
      ADD_FAILURE() << name << " took " << value;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Usage);
      EXPECT_EQ(std::string(error.what()).rfind(std::string("--") + name, 0), 0U) << error.what();
    }
  }
  EXPECT_TRUE(settings.specified.empty());
}

TEST(TradeoffSettings, ThoseOfPicturesOnTheirWayToDisplaysAreNotVaried) {
  EXPECT_TRUE(find_setting("codec")->is_tradeoff());
  try {
    (void)find_tradeoff_setting("codec");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.hint().find("bench codec"), std::string::npos);
  }
  EXPECT_THROW((void)find_tradeoff_setting("camera"), Error);
  EXPECT_NO_THROW((void)find_tradeoff_setting("spp"));
}

TEST(RenderSettings, WhatIsNotGivenComesFromTheQuality) {
  RenderSettings settings;
  EXPECT_EQ(resolve(settings, 1).frame.rays.max_depth, 8);
  EXPECT_FALSE(resolve(settings, 1).frame.rays.global_photons);
  set_setting(settings, "quality", "best");
  EXPECT_EQ(resolve(settings, 1).sampling.goal.samples, 64U);
  EXPECT_TRUE(resolve(settings, 1).frame.rays.global_photons);
  set_setting(settings, "indirect", "false");
  EXPECT_FALSE(resolve(settings, 1).frame.rays.global_photons);
  set_setting(settings, "indirect", "true");
  set_setting(settings, "quality", "good");
  EXPECT_TRUE(resolve(settings, 1).frame.rays.global_photons);
  set_setting(settings, "reference", "true");
  EXPECT_EQ(resolve(settings, 7).frame.rays.max_depth, 64);
  EXPECT_EQ(resolve(settings, 7).frame.rays.seed, 7U);
}

TEST(RenderSettings, RaysGatherWhereSamplesAreMany) {
  const auto gathers = [](std::initializer_list<std::pair<const char*, const char*>> asked_for) {
    RenderSettings settings;
    for (const auto& [name, value] : asked_for) set_setting(settings, name, value);
    return resolve(settings, 1).frame.rays.final_gather;
  };
  EXPECT_FALSE(gathers({}));
  EXPECT_TRUE(gathers({{"quality", "best"}}));
  EXPECT_FALSE(gathers({{"quality", "best"}, {"spp", "31"}}));
  EXPECT_TRUE(gathers({{"quality", "best"}, {"spp", "32"}}));
  EXPECT_TRUE(gathers({{"spp", "1"}, {"final-gather", "true"}}));
  EXPECT_FALSE(gathers({{"quality", "best"}, {"final-gather", "false"}}));
}

TEST(RenderSettings, FiltersCrossTilesFromFourSamplesOn) {
  const auto crosses = [](std::initializer_list<std::pair<const char*, const char*>> asked_for, bool finishes = false) {
    RenderSettings settings;
    settings.finishes = finishes;
    for (const auto& [name, value] : asked_for) set_setting(settings, name, value);
    return resolve(settings, 1).frame.rays.filter_across_tiles;
  };
  EXPECT_TRUE(crosses({}, true));
  EXPECT_FALSE(crosses({{"spp", "8"}}));
  EXPECT_FALSE(crosses({{"spp", "3"}, {"denoise", "true"}}));
  EXPECT_TRUE(crosses({{"spp", "4"}, {"denoise", "true"}}));
  EXPECT_TRUE(crosses({{"spp", "4"}, {"half-resolution", "shadow"}}));
}

/// Samples, denoiser and indirect light of a picture for looking at.
std::tuple<std::optional<std::uint32_t>, bool, bool> finished(
    std::initializer_list<std::pair<const char*, const char*>> asked_for) {
  RenderSettings settings;
  settings.finishes = true;
  for (const auto& [name, value] : asked_for) set_setting(settings, name, value);
  const RenderSettings resolved = resolve(settings, 1);
  return {resolved.sampling.goal.samples, resolved.frame.rays.denoise, resolved.frame.rays.global_photons};
}

TEST(RenderSettings, APictureForLookingAtIsFinishedUnlessItsSamplesAreGiven) {
  EXPECT_EQ(finished({}), std::tuple(8U, true, true));
  EXPECT_EQ(finished({{"spp", "1"}}), std::tuple(1U, false, false));
  EXPECT_EQ(finished({{"spp", "16"}}), std::tuple(16U, false, false));
  EXPECT_EQ(finished({{"quality", "draft"}}), std::tuple(1U, false, false));
  EXPECT_EQ(finished({{"quality", "best"}}), std::tuple(64U, false, true));
  EXPECT_EQ(finished({{"denoise", "false"}}), std::tuple(8U, false, true));
  EXPECT_EQ(finished({{"indirect", "false"}}), std::tuple(8U, true, false));
  const RenderSettings measured = resolve(RenderSettings(), 1);
  EXPECT_EQ(measured.sampling.goal.samples, 1U);
  EXPECT_FALSE(measured.frame.rays.denoise || measured.frame.rays.global_photons);
}

TEST(RenderSettings, WhatIsLeftOutIsNamedUnlessItWasAskedFor) {
  RenderSettings settings;
  EXPECT_EQ(what_is_left_out(resolve(settings, 1)), "antialiasing (--spp 8), indirect light (--indirect)");
  set_setting(settings, "quality", "draft");
  EXPECT_EQ(what_is_left_out(resolve(settings, 1)),
            "antialiasing (--spp 8), indirect light (--indirect), caustics (--photons 100000)");
  set_setting(settings, "spp", "1");
  set_setting(settings, "passes", "shadow");
  EXPECT_EQ(what_is_left_out(resolve(settings, 1)), "");
  RenderSettings finished_ones;
  finished_ones.finishes = true;
  EXPECT_EQ(what_is_left_out(resolve(finished_ones, 1)), "");
}

TEST(RenderSettings, WhatIsAskedForKeepsOutWhatItExcludes) {
  EXPECT_EQ(finished({{"reference", "true"}}), std::tuple(1U, false, false));
  EXPECT_EQ(finished({{"shading", "local"}}), std::tuple(8U, false, true));
  EXPECT_EQ(finished({{"half-resolution", "shadow"}}), std::tuple(8U, false, true));
  EXPECT_EQ(finished({{"filter", "mitchell"}}), std::tuple(16U, false, true));
  EXPECT_EQ(finished({{"passes", "shadow"}}), std::tuple(8U, true, false));
  EXPECT_EQ(finished({{"photons", "0"}}), std::tuple(8U, true, false));
}

TEST(RenderSettings, AQualityWithoutPhotonsSendsThoseOfTheNextWhereItMust) {
  RenderSettings settings;
  set_setting(settings, "quality", "draft");
  EXPECT_EQ(resolve(settings, 1).frame.rays.photons, 0U);
  set_setting(settings, "passes", "shadow,photon");
  EXPECT_EQ(resolve(settings, 1).frame.rays.photons, 100'000U);
  EXPECT_TRUE(resolve(settings, 1).frame.rays.global_photons);
  EXPECT_TRUE(resolve(settings, 1).frame.photons_fit_frame);
  set_setting(settings, "photons", "0");
  EXPECT_THROW((void)resolve(settings, 1), Error);
}

TEST(RenderSettings, WhatExcludesEachOtherIsRefused) {
  using Pairs = std::vector<std::pair<const char*, const char*>>;
  for (const Pairs& pairs :
       {Pairs{{"eye", "0,0,0"}}, Pairs{{"at", "0,0,0"}}, Pairs{{"eye", "0,0,0"}, {"at", "1,0,0"}, {"camera", "a"}},
        Pairs{{"depth-format", "16"}, {"primary", "rays"}},
        Pairs{{"data", "partitioned"}, {"distribute", "sort-first"}},
        Pairs{{"reference", "true"}, {"shading", "local"}}, Pairs{{"reference", "true"}, {"aov", "normal"}},
        Pairs{{"adaptive", "true"}, {"half-resolution", "shadow"}}, Pairs{{"aov", "depth"}, {"shading", "local"}},
        Pairs{{"aov", "depth"}, {"resolution-scale", "0.5"}},
        Pairs{{"half-resolution", "shadow"}, {"shading", "local"}}, Pairs{{"denoise", "true"}, {"reference", "true"}},
        Pairs{{"denoise", "true"}, {"filter", "mitchell"}}, Pairs{{"verify", "1"}, {"shading", "local"}},
        Pairs{{"verify", "1"}, {"data", "partitioned"}}, Pairs{{"verify", "1"}, {"deterministic", "off"}}}) {
    RenderSettings settings;
    std::string all;
    for (const auto& [name, value] : pairs) {
      set_setting(settings, name, value);
      all += std::string(" --") + name + " " + value;
    }
    EXPECT_THROW((void)resolve(settings, 1), Error) << all;
  }
}

TEST(RenderSettings, SettingsWithoutUseAreNamed) {
  RenderSettings settings;
  set_setting(settings, "photons", "5");
  EXPECT_TRUE(unused_settings(settings).empty());
  set_setting(settings, "passes", "none");
  EXPECT_EQ(unused_settings(settings), std::vector<std::string>{"--passes none has no use for --photons"});
  set_setting(settings, "reference", "true");
  EXPECT_EQ(unused_settings(settings),
            (std::vector<std::string>{"--reference has no use for --passes", "--reference has no use for --photons"}));
}

}  // namespace
}  // namespace hpr
