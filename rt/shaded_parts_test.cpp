#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <random>
#include <vector>

#include "core/error.h"
#include "rt/deferred_shader.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

/// Layers of a frame that something is shaded into.
struct Layers {
  explicit Layers(const FrameLayout& layout)
      : radiance(layout), direct(layout), normal(layout), albedo(layout), cost(layout), coverage(layout) {}

  LightOutput output() {
    LightOutput output{
        .radiance = &radiance, .normal = &normal, .albedo = &albedo, .cost = &cost, .coverage = &coverage};
    output.components[static_cast<std::size_t>(Component::Direct)] = &direct;
    return output;
  }

  TileLayer<Rgb> radiance;
  TileLayer<Rgb> direct;
  TileLayer<Rgb> normal;
  TileLayer<Rgb> albedo;
  TileLayer<float> cost;
  TileLayer<float> coverage;
};

template <typename Pixel>
void expect_equal(const TileLayer<Pixel>& a, const TileLayer<Pixel>& b, const PixelMask* wanted) {
  for (const std::size_t tile : all_tiles(a.layout())) {
    const auto mask = mask_of(wanted, tile);
    const Rect& rect = a.layout().place(tile).pixels;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      const bool is_shown =
          static_cast<int>(i) % kTileSide < rect.width() && static_cast<int>(i) / kTileSide < rect.height();
      if (!is_shown || (!mask.empty() && mask[i] == 0)) continue;
      ASSERT_EQ(std::memcmp(&a.tile(tile)[i], &b.tile(tile)[i], sizeof(Pixel)), 0)
          << "tile " << tile << ", pixel " << i;
    }
  }
}

class ShadedParts : public testing::Test {
 protected:
  ShadedParts() : scene_(test::room(test::mirror(0.7F), true)) {
    scene_.materials.back().alpha_mode = AlphaMode::Blend;
    scene_.materials.back().base_color.a = 0.5F;
    view_ = test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {150, 130}, scene_, 1.3);
    keys_ = test::cast_keys(scene_, std::span(&view_, 1));
  }

  /// All tiles in parts of 1, 2, 4 ... rows, in a random order.
  [[nodiscard]] std::vector<ShadedPart> parts() const {
    std::vector<ShadedPart> parts;
    for (const std::size_t tile : all_tiles(keys_.layout())) {
      const int rows = 1 << (tile % 7);
      for (int row = 0; row < kTileSide; row += rows)
        parts.push_back({.tile = tile, .first_row = row, .end_row = row + rows});
    }
    std::ranges::shuffle(parts, std::mt19937(5));
    return parts;
  }

  /// Shades `parts` into `layers` as any thread asks for them.
  static void shade(DeferredShader& shader, const ShadedSample& sample, const std::vector<ShadedPart>& parts) {
    std::atomic<std::size_t> next = 0;
    shader.shade(std::span(&sample, 1), [&]() -> std::optional<ShadedPart> {
      const std::size_t i = next++;
      return i < parts.size() ? std::optional(parts[i]) : std::nullopt;
    });
  }

  Scene scene_;
  View view_;
  TileLayer<Key> keys_;
};

TEST_F(ShadedParts, AreTheRowsOfWholeTiles) {
  DeferredShader shader(scene_, {.threads = 3});
  Layers whole(keys_.layout());
  shader.shade(std::span(&view_, 1), keys_, all_tiles(keys_.layout()), whole.output(), {7, 2});
  const RayCounts counts = shader.counts();
  Layers rows(keys_.layout());
  shade(shader, {std::span(&view_, 1), &keys_, rows.output(), {7, 2}}, parts());
  EXPECT_EQ(shader.counts(), counts);
  EXPECT_EQ(shader.costs().size(), parts().size());
  expect_equal(whole.radiance, rows.radiance, nullptr);
  expect_equal(whole.direct, rows.direct, nullptr);
  expect_equal(whole.normal, rows.normal, nullptr);
  expect_equal(whole.albedo, rows.albedo, nullptr);
  expect_equal(whole.cost, rows.cost, nullptr);
  expect_equal(whole.coverage, rows.coverage, nullptr);
}

TEST_F(ShadedParts, MayBringTheirKeysAndTheirMask) {
  PixelMask wanted(keys_.layout());
  for (const std::size_t tile : all_tiles(keys_.layout())) {
    if (tile == 2) continue;  // there all are wanted
    for (std::size_t i = 0; i < kTilePixels; ++i) wanted.tile(tile)[i] = i * 7919 % 3 == 0 ? 1 : 0;
    wanted.set_active(tile);
  }
  DeferredShader shader(scene_, {.threads = 2});
  Layers whole(keys_.layout());
  const ShadedSample sample{std::span(&view_, 1), &keys_, whole.output(), {7, 2}, &wanted};
  shader.shade(std::span(&sample, 1), all_tiles(keys_.layout()));
  Layers rows(keys_.layout());
  const TileLayer<Key> none(keys_.layout());
  std::vector<ShadedPart> lent = parts();
  for (ShadedPart& part : lent) {
    part.keys = keys_.tile(part.tile).data();
    part.wanted = mask_of(&wanted, part.tile);
  }
  shade(shader, {std::span(&view_, 1), &none, rows.output(), {7, 2}}, lent);
  expect_equal(whole.radiance, rows.radiance, &wanted);
  expect_equal(whole.coverage, rows.coverage, &wanted);
}

TEST_F(ShadedParts, OfSurfacesShownInPlaceOfLight) {
  DeferredShader shader(scene_, {.show = Show::Normal, .threads = 2});
  Layers whole(keys_.layout());
  shader.shade(std::span(&view_, 1), keys_, all_tiles(keys_.layout()), {.radiance = &whole.radiance}, {7, 2});
  Layers rows(keys_.layout());
  shade(shader, {std::span(&view_, 1), &keys_, {.radiance = &rows.radiance}, {7, 2}}, parts());
  expect_equal(whole.radiance, rows.radiance, nullptr);
}

TEST_F(ShadedParts, WhatCannotBeCutSaysSo) {
  EXPECT_FALSE(DeferredShader(scene_, {.threads = 1}).shades_whole_tiles());
  EXPECT_TRUE(DeferredShader(scene_, {.denoise = true, .threads = 1}).shades_whole_tiles());
  EXPECT_FALSE(DeferredShader(scene_, {.threads = 1}).is_whole());
  EXPECT_TRUE(DeferredShader(scene_, {.reference = true, .threads = 1}).is_whole());
}

}  // namespace
}  // namespace hpr
