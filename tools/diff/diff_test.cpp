#include "tools/diff/diff.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "tools/report/canvas.h"

namespace hpr {
namespace {

FloatImage picture(std::vector<float> values) {
  return {{static_cast<int>(values.size() / 3), 1}, {"R", "G", "B"}, std::move(values)};
}

DiffReport diff(const FloatImage& a, const FloatImage& b, const DiffTolerance& tolerance = {}) {
  return diff_pictures(a, "a", b, "b", tolerance);
}

class DiffFiles : public testing::Test {
 protected:
  DiffFiles() : folder_(testing::TempDir() + "hpr_diff_" + std::to_string(::getpid())) {
    std::filesystem::create_directory(folder_);
  }
  ~DiffFiles() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path path(const char* name) const { return folder_ / name; }
  [[nodiscard]] std::filesystem::path keys_file(const char* name, const std::vector<Key>& keys) const {
    write_file_atomically(path(name), std::as_bytes(std::span(keys)));
    return path(name);
  }

 private:
  std::filesystem::path folder_;
};

ExitCode code_of(const std::filesystem::path& a, const std::filesystem::path& b, const DiffTolerance& tolerance = {}) {
  try {
    (void)diff_files(a, b, tolerance, {});
  } catch (const Error& error) {
    return error.code();
  }
  return ExitCode::Done;
}

TEST(Diff, EqualPicturesPassAndOneBitDoesNot) {
  const FloatImage a = picture({0, 0.5F, 1, 0.25F, 0.25F, 0.25F});
  EXPECT_TRUE(diff(a, a).passed);
  FloatImage b = a;
  b.values[4] = std::nextafter(0.25F, 1.0F);
  const DiffReport report = diff(a, b);
  EXPECT_FALSE(report.passed);
  EXPECT_EQ(report.difference.differing, 1U);
  EXPECT_EQ(report.beyond, 1U);
  EXPECT_EQ(report.largest[0], 0.0F);
  EXPECT_GT(report.largest[1], 0.0F);
}

TEST(Diff, TheToleranceIsPerValueAndThePercentagePerPixel) {
  const FloatImage a = picture({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  const FloatImage b = picture({0.25F, 0, 0, 0, 0.5F, 0.5F, 0, 0, 0, 0, 0, 0});
  EXPECT_TRUE(diff(a, b, {0.5, 0.0}).passed) << "the bound itself is allowed";
  EXPECT_FALSE(diff(a, b, {0.49, 0.0}).passed);
  EXPECT_EQ(diff(a, b, {0.25, 0.0}).beyond, 1U) << "two values of one pixel are one pixel";
  EXPECT_TRUE(diff(a, b, {0.25, 25.0}).passed);
  EXPECT_FALSE(diff(a, b, {0.25, 24.9}).passed);
  EXPECT_FALSE(diff(a, b, {0.0, 49.0}).passed);
  EXPECT_TRUE(diff(a, b, {0.0, 50.0}).passed);
}

TEST(Diff, MeanIsTheBiasOfTheSecondPicture) {
  const DiffReport report = diff(picture({0.5F, 0.5F, 0.5F}), picture({0.75F, 0.75F, 0.75F}));
  EXPECT_DOUBLE_EQ(report.difference.mean, 0.25);
}

TEST(Diff, OneSidedNotANumberIsNeverWithinTolerance) {
  const FloatImage a = picture({0, 0, 0});
  const FloatImage b = picture({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  EXPECT_FALSE(diff(a, b, {1e30, 0.0}).passed);
  EXPECT_TRUE(diff(b, b).passed);
  EXPECT_EQ(heat_map(diff(a, b)).at(0, 0), (Rgba8{0, 255, 255, 255}));
}

TEST(Diff, ChannelsAreMatchedByName) {
  const FloatImage a{{1, 1}, {"R", "G", "B"}, {1, 2, 3}};
  const FloatImage b{{1, 1}, {"B", "G", "R"}, {3, 2, 1}};
  EXPECT_TRUE(diff(a, b).passed);
}

TEST(Diff, APictureWithoutAlphaIsOpaque) {
  const FloatImage plain{{1, 1}, {"R", "G", "B"}, {0.1F, 0.2F, 0.3F}};
  const FloatImage opaque{{1, 1}, {"R", "G", "B", "A"}, {0.1F, 0.2F, 0.3F, 1.0F}};
  const FloatImage veil{{1, 1}, {"A", "R", "G", "B"}, {0.5F, 0.1F, 0.2F, 0.3F}};
  EXPECT_TRUE(diff(plain, opaque).passed);
  EXPECT_TRUE(diff(opaque, plain).passed);
  EXPECT_EQ(diff(plain, veil).difference.max, 0.5);
}

TEST(Diff, ErrorsOfColoursTakeNothingFromOtherChannels) {
  const float kFar = std::numeric_limits<float>::infinity();
  const FloatImage a{{1, 1}, {"R", "G", "B", "A", "depth.Z"}, {0.0F, 0.0F, 0.0F, 1.0F, kFar}};
  const FloatImage b{{1, 1}, {"R", "G", "B", "A", "depth.Z"}, {0.1F, 0.1F, 0.1F, 1.0F, 2.0F}};
  const Difference difference = diff(a, b).difference;
  EXPECT_NEAR(difference.rmse, 0.1, 1e-8);
  EXPECT_NEAR(difference.psnr, 20.0, 1e-5);
  EXPECT_NEAR(difference.mean, 0.1, 1e-8);
  EXPECT_EQ(difference.max, HUGE_VAL);
}

TEST(Diff, OtherSizesOrChannelsAreBadInputThatNamesBoth) {
  const FloatImage a{{2, 1}, {"R"}, {0, 0}};
  const FloatImage tall{{1, 2}, {"R"}, {0, 0}};
  const FloatImage other{{2, 1}, {"Z"}, {0, 0}};
  for (const FloatImage& b : {tall, other}) {
    try {
      (void)diff_pictures(a, "first.png", b, "second.png", {});
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput);
      EXPECT_NE(std::string(error.what()).find("first.png is 2x1 R"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("second.png"), std::string::npos) << error.what();
    }
  }
}

TEST(Diff, TheHeatMapIsBlackWhereEqualAndLighterWhereMoreDiffers) {
  const FloatImage a = picture(std::vector<float>(12, 0.0F));
  const FloatImage b = picture({0, 0, 0, 0.001F, 0, 0, 0, 0.5F, 0, 0, 0, 1});
  const Image<Rgba8> heat = heat_map(diff(a, b));
  EXPECT_EQ(heat.at(0, 0), (Rgba8{0, 0, 0, 255}));
  const auto lightness = [&](int x) {
    const Rgba8 c = heat.at(x, 0);
    return 0.2126F * srgb_to_linear(c.r) + 0.7152F * srgb_to_linear(c.g) + 0.0722F * srgb_to_linear(c.b);
  };
  EXPECT_GT(lightness(1), lightness(0));
  EXPECT_GT(lightness(2), lightness(1));
  EXPECT_GT(lightness(3), lightness(2));
}

TEST(Diff, TheTableAndTheJsonHoldWhatWasAskedFor) {
  const DiffReport report = diff(picture({0, 0, 0}), picture({0.5F, 0, 0}));
  const std::vector<std::string> some{"max", "differing"};
  const std::string table = diff_table(report, some);
  EXPECT_NE(table.find("max        0.5 at 0,0\n"), std::string::npos) << table;
  EXPECT_NE(table.find("1 of 1 pixels (100 %)"), std::string::npos) << table;
  EXPECT_EQ(table.find("rmse"), std::string::npos) << table;
  EXPECT_NE(table.find("different"), std::string::npos) << table;
  const auto json = Json::parse(diff_json(report, some, "a.png", "b.png", {}));
  EXPECT_EQ(json["schema"], "hpr.diff/1");
  EXPECT_EQ(json["differing"], 1);
  EXPECT_EQ(json["max"], 0.5);
  EXPECT_EQ(json["passed"], false);
  EXPECT_FALSE(json.contains("psnr"));
  const auto equal =
      Json::parse(diff_json(diff(picture({1, 1, 1}), picture({1, 1, 1})), diff_metrics(), "a.png", "b.png", {}));
  EXPECT_TRUE(equal["psnr"].is_null()) << "infinite";
  EXPECT_EQ(equal["passed"], true);
}

TEST(Diff, TheWorstPixelAndTheErrorOfTheMeanAreReported) {
  FloatImage a{{2, 2}, {"R", "G", "B"}, std::vector<float>(12, 0.0F)};
  FloatImage b = a;
  b.values[7] = -0.5F;
  const DiffReport report = diff(a, b);
  const auto json = Json::parse(diff_json(report, diff_metrics(), "a", "b", {}));
  EXPECT_EQ(json["worst"], Json::parse(R"({"x": 0, "y": 1, "value": 0.5})"));
  EXPECT_NEAR(json["mean_error"].get<double>(), 0.5 / 3.0 / 4.0, 1e-12);
  const std::string table = diff_table(report, diff_metrics());
  EXPECT_NE(table.find("max        0.5 at 0,1\n"), std::string::npos) << table;
  EXPECT_NE(table.find("mean       -0.0416667 +- 0.042\n"), std::string::npos) << table;
  EXPECT_TRUE(Json::parse(diff_json(diff(a, a), diff_metrics(), "a", "a", {}))["worst"].is_null());
}

TEST(Diff, ColorsAreComparedAsFarAsAskedFor) {
  const FloatImage a{{20, 20}, {"R", "G", "B"}, std::vector<float>(1200, 0.5F)};
  FloatImage b = a;
  std::ranges::fill(b.values, 0.75F);
  const std::vector<std::string> some{"ssim", "rmse"};
  const DiffReport part = diff_pictures(a, "a", b, "b", {}, some);
  EXPECT_NEAR(part.colors->ssim, (2 * 0.375 + 1e-4) / (0.25 + 0.5625 + 1e-4), 1e-6);
  EXPECT_TRUE(std::isnan(part.colors->flip));
  const std::vector<std::string> plain{"rmse"};
  EXPECT_FALSE(diff_pictures(a, "a", b, "b", {}, plain).colors.has_value());

  const DiffReport report = diff(a, b);
  EXPECT_NEAR(report.colors->relative.trimmed, 0.0625 / 0.26, 1e-6);
  EXPECT_GT(report.colors->flip, 0.1);
  const auto json = Json::parse(diff_json(report, diff_metrics(), "a", "b", {}));
  EXPECT_EQ(json["relmse"], report.colors->relative.trimmed);
  EXPECT_EQ(json["relmse_untrimmed"], report.colors->relative.all);
  EXPECT_EQ(json["ssim"], report.colors->ssim);
  EXPECT_EQ(json["flip"], report.colors->flip);
  const std::string table = diff_table(report, diff_metrics());
  for (const char* name : {"\nrelmse     0.24038", "\nssim       0.923", "\nflip       0."}) {
    EXPECT_NE(table.find(name), std::string::npos) << table;
  }
  // One firefly of a thousand pixels.
  const FloatImage black = picture(std::vector<float>(3000, 0.0F));
  FloatImage firefly = black;
  firefly.values[99] = 1000.0F;
  const auto trimmed = Json::parse(diff_json(diff(black, firefly), diff_metrics(), "a", "b", {}));
  EXPECT_EQ(trimmed["relmse"], 0.0);
  EXPECT_NEAR(trimmed["relmse_untrimmed"].get<double>(), 1e6 / 0.01 / 3000.0, 1e-3);

  const auto equal = diff(a, a).colors;
  EXPECT_EQ(equal->relative.trimmed, 0.0);
  EXPECT_EQ(equal->ssim, 1.0);
  EXPECT_EQ(equal->flip, 0.0);
}

TEST(Diff, LinearColorsAreSeenAsDisplaysShowThem) {
  // On a display 0.5 is 0.735357, and 1 and 4 are the same white.
  FloatImage a{{1, 1}, {"R", "G", "B"}, {0.5F, 0.5F, 0.5F}, true};
  FloatImage b{{1, 1}, {"R", "G", "B"}, {4, 4, 4}, true};
  const double level = 0.735357;
  const DiffReport report = diff(a, b);
  EXPECT_NEAR(report.colors->ssim, (2 * level + 1e-4) / (level * level + 1.0 + 1e-4), 1e-6);
  EXPECT_NEAR(report.colors->relative.all, 3.5 * 3.5 / 0.26, 1e-4) << "of radiance";
  a.values = {1, 1, 1};
  EXPECT_EQ(diff(a, b).colors->flip, 0.0);
  EXPECT_EQ(diff(a, b).colors->ssim, 1.0);
  a.linear = false;
  EXPECT_THROW((void)diff(a, b), Error);
}

TEST(Diff, WhereColorsAreNotFiniteThereIsNoNumber) {
  FloatImage a = picture({0, 0, 0, 1, 1, 1});
  a.values[4] = std::numeric_limits<float>::quiet_NaN();
  const DiffReport report = diff(a, a);
  const auto json = Json::parse(diff_json(report, diff_metrics(), "a", "b", {}));
  for (const char* metric : {"relmse", "relmse_untrimmed", "ssim", "flip"})
    EXPECT_TRUE(json[metric].is_null()) << metric;
  EXPECT_EQ(json["not_finite"], 1);
  const std::string table = diff_table(report, diff_metrics());
  EXPECT_NE(table.find("flip       none: 1 pixels are not finite\n"), std::string::npos) << table;
  EXPECT_TRUE(report.passed) << "equal all the same";
  // Clamped for a display, an infinity would be white.
  a.values[4] = std::numeric_limits<float>::infinity();
  a.linear = true;
  EXPECT_TRUE(std::isnan(diff(a, a).colors->ssim));
  EXPECT_EQ(diff(a, a).colors->not_finite, 1U);
}

TEST(Diff, ColorsAreThoseOfRgbOrGreyAndNothingElse) {
  const FloatImage depth{{1, 1}, {"Z"}, {0.5F}};
  const DiffReport none = diff(depth, depth);
  EXPECT_FALSE(none.colors.has_value());
  EXPECT_NE(diff_table(none, diff_metrics()).find("ssim       none: the pictures have no channels"), std::string::npos);
  EXPECT_TRUE(Json::parse(diff_json(none, diff_metrics(), "a", "b", {}))["ssim"].is_null());
  const FloatImage grey{{1, 1}, {"Y"}, {0.5F}};
  const FloatImage light{{1, 1}, {"Y"}, {0.6F}};
  const DiffReport of_grey = diff(grey, light);
  EXPECT_EQ(of_grey.colors->flip, diff(picture({0.5F, 0.5F, 0.5F}), picture({0.6F, 0.6F, 0.6F})).colors->flip);
  // Neither alpha nor depth counts, wherever they stand.
  const FloatImage a{{1, 1}, {"Z", "B", "G", "R", "A"}, {0, 0.1F, 0.2F, 0.3F, 1}};
  const FloatImage b{{1, 1}, {"R", "G", "B", "A", "Z"}, {0.3F, 0.2F, 0.1F, 0, 9}};
  EXPECT_EQ(diff(a, b).colors->relative.all, 0.0);
  EXPECT_EQ(diff(a, b).colors->flip, 0.0);
}

TEST_F(DiffFiles, LevelsDifferByWholeSteps) {
  for (int level = 0; level < 255; ++level) {
    const auto low = static_cast<std::uint8_t>(level);
    write_png(path("a.png"), Image<Rgba8>({1, 1}, {low, low, low, 255}));
    write_png(path("b.png"), Image<Rgba8>({1, 1}, Rgba8{static_cast<std::uint8_t>(level + 1), low, low, 255}));
    const DiffReport report = diff_files(path("a.png"), path("b.png"), {1.0 / 255.0, 0.0}, {});
    EXPECT_EQ(report.difference.max, 1.0 / 255.0) << level;
    EXPECT_TRUE(report.passed) << level;
  }
}

TEST_F(DiffFiles, IntegersAreComparedByTheirBits) {
  const auto write = [&](const char* name, std::vector<ExrLayer> layers) {
    write_file_atomically(path(name), encode_exr(Image<Rgb>({1, 1}), {}, layers));
    return path(name);
  };
  const auto a = write("a.exr", {{{"id.X"}, {}, {0x01000000U}}});
  const auto b = write("b.exr", {{{"id.X"}, {}, {0x01000001U}}});  // the same float
  EXPECT_TRUE(diff_files(a, a, {}, {}).passed);
  const DiffReport report = diff_files(a, b, {0.5, 0.0}, {});
  EXPECT_FALSE(report.passed);
  EXPECT_EQ(report.difference.max, 1.0);
  EXPECT_EQ(report.difference.rmse, 0.0) << "of colours";
  EXPECT_EQ(code_of(a, write("c.exr", {{{"id.X"}, {1.0F}}})), ExitCode::BadInput);
}

TEST(Diff, LevelsOf8AndOf16BitsThatAreTheSameDifferInNothing) {
  constexpr int kSide = 16;
  FloatImage a{{kSide, kSide}, {"R", "G", "B"}, {}, false, 255};
  FloatImage b{{kSide, kSide}, {"R", "G", "B"}, {}, false, 65535};
  for (int i = 0; i < 3 * kSide * kSide; ++i) {  // as decoders have them: a last bit apart
    const int level = i * 37 % 256;
    a.values.push_back(static_cast<float>(level) * (1.0F / 255.0F));
    b.values.push_back(static_cast<float>(257 * level) / 65535.0F);
  }
  ASSERT_NE(a.values, b.values);
  const DiffReport report = diff(a, b);
  EXPECT_EQ(report.difference.differing, 0U);
  ASSERT_TRUE(report.colors);
  EXPECT_EQ(report.colors->relative.all, 0.0);
  EXPECT_EQ(report.colors->flip, 0.0);
  EXPECT_EQ(report.colors->ssim, 1.0);
}

TEST(Diff, FarValuesAreTakenApartInDoublePrecision) {
  const FloatImage a = picture({3e38F, 0, 0});
  const FloatImage b = picture({-3e38F, 0, 0});
  EXPECT_TRUE(diff(a, b, {1e39, 0.0}).passed);
  EXPECT_FALSE(diff(a, b, {5e38, 0.0}).passed);
  EXPECT_EQ(heat_map(diff(a, b)).at(0, 0), heat_color(1.0));
}

TEST_F(DiffFiles, ExtensionsMayBeOfCapitals) {
  write_image(path("a.exr"), Image<Rgb>({2, 1}, {1, 2, 3}));
  std::filesystem::copy_file(path("a.exr"), path("B.EXR"));
  EXPECT_TRUE(diff_files(path("a.exr"), path("B.EXR"), {}, {}).passed);
  EXPECT_TRUE(diff_files(keys_file("a.keys", {1, 2}), keys_file("B.KEYS", {1, 2}), {}, {}).keys);
}

TEST_F(DiffFiles, KeysAreComparedOneByOne) {
  const auto a = keys_file("a.keys", {make_key(0.5F, 7), make_key(0.5F, 8), kNoKey, kNoKey});
  const auto b = keys_file("b.keys", {make_key(0.5F, 7), make_key(0.25F, 8), make_key(0.125F, 1), kNoKey});
  const DiffReport report = diff_files(a, b, {}, {});
  EXPECT_TRUE(report.keys);
  EXPECT_EQ(report.difference.pixels, 4U);
  EXPECT_EQ(report.difference.differing, 2U);
  EXPECT_EQ(report.other_surface, 1U);
  EXPECT_EQ(report.difference.max, 0.25);
  EXPECT_FALSE(report.passed);
  EXPECT_TRUE(diff_files(a, b, {0.0, 50.0}, {}).passed);
  EXPECT_TRUE(diff_files(a, a, {}, {}).passed);
}

TEST_F(DiffFiles, WhatCannotBeComparedHasItsExitCode) {
  const auto keys = keys_file("a.keys", {1, 2});
  write_file_atomically(path("odd.keys"), "1234567890");
  write_png(path("a.png"), Image<Rgba8>({2, 1}));
  EXPECT_EQ(code_of(keys, keys_file("longer.keys", {1, 2, 3})), ExitCode::BadInput);
  EXPECT_EQ(code_of(keys, path("odd.keys")), ExitCode::BadInput);
  EXPECT_EQ(code_of(keys, path("a.png")), ExitCode::BadInput);
  EXPECT_EQ(code_of(keys, keys, {0.1, 0.0}), ExitCode::Usage);
  EXPECT_EQ(code_of(path("a.png"), path("missing.png")), ExitCode::Io);
}

TEST_F(DiffFiles, PicturesAreReadFromPngAndExr) {
  write_png(path("a.png"), Image<Rgba8>({2, 1}, {10, 20, 30, 255}));
  write_png(path("b.png"), Image<Rgba8>({2, 1}, {10, 20, 31, 255}));
  const DiffReport report = diff_files(path("a.png"), path("b.png"), {}, {});
  EXPECT_EQ(report.difference.differing, 2U);
  EXPECT_EQ(report.difference.max, 1.0 / 255.0);
  write_image(path("a.exr"), Image<Rgb>({2, 1}, {1, 2, 3}));
  EXPECT_TRUE(diff_files(path("a.exr"), path("a.exr"), {}, {}).passed);
  EXPECT_EQ(code_of(path("a.png"), path("a.exr")), ExitCode::BadInput) << "sRGB against linear";
}

}  // namespace
}  // namespace hpr
