#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr::test {

inline View look(const Scene& scene, Size size = {139, 71}) {
  return view_from({0.5, 2, 7}, {0, 1, 0}, size, scene);
}

inline RaySettings denoised(RaySettings settings) {
  settings.denoise = true;
  return settings;
}

/// The mean over its samples of a picture whose keys are found for each.
inline Image<Rgb> mean_picture(const Scene& scene, View view, const RaySettings& settings, std::uint32_t samples) {
  Image<Rgb> sum(view.size());
  DeferredShader shader(scene, settings);
  for (std::uint32_t i = 0; i < samples; ++i) {
    view.jitter = Sampler(7, i).two() - 0.5;
    const TileLayer<Key> keys = cast_keys(scene, std::span(&view, 1));
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = i});
    for (int y = 0; y < sum.height(); ++y) {
      for (int x = 0; x < sum.width(); ++x) {
        const Rgb& color = radiance.at(0, x, y);
        Rgb& to = sum.at(x, y);
        const auto fraction = 1.0F / static_cast<float>(samples);
        to = {to.r + fraction * color.r, to.g + fraction * color.g, to.b + fraction * color.b};
      }
    }
  }
  return sum;
}

inline double squared_error(const Image<Rgb>& image, const Image<Rgb>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    sum += std::pow(static_cast<double>(image.pixels()[i].g - truth.pixels()[i].g), 2.0);
  }
  return sum / static_cast<double>(image.pixels().size());
}

/// Pixels over so many times as bright as all about them.
inline std::size_t count_salt(const Image<Rgb>& image, float times = 3.0F) {
  std::size_t count = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      float brightest = 0.0F;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, image.height() - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, image.width() - 1); ++u) {
          if (u != x || v != y) brightest = std::max(brightest, image.at(u, v).g);
        }
      }
      if (image.at(x, y).g > times * brightest) ++count;
    }
  }
  return count;
}

inline const RaySettings kGathered{.passes = {PassId::Gather}, .max_depth = 4};

/// A sheet alone under an even sky, which sends back its base colour.
inline Scene painted_floor() {
  Scene scene;
  add_material(scene, diffuse());
  Mesh floor = quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0);
  floor.colors = {
      {0.2F, 0.9F, 0.5F, 1.0F}, {0.9F, 0.8F, 0.5F, 1.0F}, {0.5F, 0.5F, 0.5F, 1.0F}, {0.7F, 0.3F, 0.5F, 1.0F}};
  place_mesh(scene, add_mesh(scene, floor));
  scene.environment = even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  return scene;
}

inline void expect_same_inside(const Image<Rgb>& smooth, const Image<Rgb>& plain, float most) {
  for (int y = 12; y < 54; ++y) {
    for (int x = 12; x < 78; ++x) {
      ASSERT_NEAR(smooth.at(x, y).r, plain.at(x, y).r, most) << x << ' ' << y;
      ASSERT_NEAR(smooth.at(x, y).g, plain.at(x, y).g, most) << x << ' ' << y;
    }
  }
}

}  // namespace hpr::test
