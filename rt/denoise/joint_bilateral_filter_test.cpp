#include "rt/denoise/joint_bilateral_filter.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <random>
#include <utility>

namespace hpr {
namespace {

constexpr std::size_t kPlanes = 2;

template <typename T>
struct Tile {
  std::unique_ptr<NeighborFeatures<T>> taps = std::make_unique<NeighborFeatures<T>>();
  std::unique_ptr<TapVectors<double>> light = std::make_unique<TapVectors<double>>();
};

glm::vec3 about(std::mt19937& random, const glm::vec3& center, float spread) {
  std::uniform_real_distribution<float> off(-spread, spread);
  return center + glm::vec3(off(random), off(random), off(random));
}

/// A pixel of a slab of two materials a metre off, a centimetre a pixel; every ninth is no tap and shows garbage.
template <typename T>
void set_pixel(Tile<T>& tile, std::mt19937& random, int x, int y) {
  NeighborFeatures<T>& taps = *tile.taps;
  const std::size_t i = TapPlanes::index(x, y);
  const bool is_tap = random() % 9 != 0;
  const glm::vec3 nothing(std::numeric_limits<float>::quiet_NaN());
  const glm::vec3 position(0.01F * static_cast<float>(x), 0.01F * static_cast<float>(y), -1.0F);
  const glm::vec3 normal = glm::normalize(about(random, {0, 0, 1}, 0.3F));
  taps.kinds[i] = is_tap ? tap_kind(random() % 2, random() % 4 == 0) : NeighborFeatures<T>::kNoTap;
  taps.position.set(i, is_tap ? about(random, position, 0.002F) : nothing);
  taps.normal.set(i, is_tap ? normal : nothing);
  taps.shading_normal.set(i, is_tap ? about(random, normal, 0.1F) : nothing);
  taps.scattering[0].set(i, about(random, glm::vec3(0.2F), 0.19F));
  taps.scattering[1].set(i, about(random, glm::vec3(0.5F), 0.45F));
  taps.sharpness[i] = random() % 3 == 0 ? 9.0F : 1.0F;
  tile.light->set(i, is_tap ? glm::dvec3(about(random, glm::vec3(2.0F), 1.5F)) : glm::dvec3(0.0));
}

template <typename T>
Tile<T> make_tile() {
  Tile<T> tile;
  tile.taps->scattering.resize(kPlanes);
  std::mt19937 random(7);
  for (int y = 0; y < kTileSide; ++y) {
    for (int x = 0; x < kTileSide; ++x) set_pixel(tile, random, x, y);
  }
  return tile;
}

struct Expected {
  std::array<glm::dvec3, kPlanes> mean{};  ///< by term
  double sum = 0.0;
};

/// The weight of a pixel and the ratio of each term, as the members of FilterCenter define them.
template <typename T>
std::pair<T, std::array<glm::vec<3, T>, kPlanes>> weight_and_ratios(const NeighborFeatures<T>& taps,
                                                                    const FilterCenter<T>& center,
                                                                    const glm::ivec2& pixel) {
  using Vector = glm::vec<3, T>;
  const std::pair<T, std::array<Vector, kPlanes>> nothing{T{0}, {}};
  const std::size_t i = TapPlanes::index(pixel.x, pixel.y);
  const bool is_same = taps.kinds[i] == tap_kind(center.material, center.separate_diffuse) ||
                       (!center.is_pixel && taps.kinds[i] == tap_kind(center.material, !center.separate_diffuse));
  if (!is_same) return nothing;
  const glm::vec2 off = glm::vec2(pixel - center.pixel) - center.offset;
  const T spatial = T{1} - static_cast<T>(glm::dot(off, off)) / (center.reach * center.reach);
  const Vector offset = taps.position.at(i) - center.position;
  const T bend = glm::dot(offset, taps.normal.at(i));
  if (glm::dot(offset, offset) > center.max_distance2 || bend * bend > center.max_bend2 * glm::dot(offset, offset))
    return nothing;
  const Vector turned = (center.is_pixel ? taps.shading_normal : taps.normal).at(i) - center.normal;
  const T sharpness = center.sharpness * (center.is_pixel ? T{1} : taps.sharpness[i]);
  const T alike = T{1} - glm::dot(turned, turned) * sharpness;
  if ((!center.is_box && spatial <= 0) || alike <= 0) return nothing;
  std::pair<T, std::array<Vector, kPlanes>> found{T{1}, {Vector(1), Vector(1)}};
  for (std::size_t term = 0; term < center.term_count; ++term) {
    const Vector ratio = center.terms[term].own / taps.scattering[center.terms[term].plane].at(i);
    if (std::max({ratio.x, ratio.y, ratio.z}) > center.max_ratio) return nothing;
    if (std::min({ratio.x, ratio.y, ratio.z}) < center.min_ratio) return nothing;
    found.second[term] = ratio;
  }
  if (center.is_box || (center.is_pixel && pixel == center.pixel)) return found;
  found.first = center.neighbor_weight * spatial * alike * alike;
  return found;
}

template <typename T>
Expected expected(const Tile<T>& tile, const FilterCenter<T>& center) {
  Expected found;
  for (int y = center.window.first.y; y < center.window.first.y + center.window.rows; ++y) {
    for (int x = center.window.first.x; x < center.window.first.x + center.window.columns; ++x) {
      if (x < 0 || y < 0 || x >= kTileSide || y >= kTileSide) continue;
      const auto [weight, ratios] = weight_and_ratios(*tile.taps, center, {x, y});
      found.sum += static_cast<double>(weight);
      for (std::size_t term = 0; term < kPlanes; ++term) {
        found.mean[term] += glm::dvec3(weight * ratios[term]) * tile.light->at(TapPlanes::index(x, y));
      }
    }
  }
  for (glm::dvec3& mean : found.mean) mean /= found.sum;
  return found;
}

void expect_near(const glm::dvec3& mean, const glm::dvec3& right, const glm::ivec2& pixel) {
  for (const int i : {0, 1, 2}) ASSERT_NEAR(mean[i], right[i], 1e-5) << pixel.x << ' ' << pixel.y;
}

void compare(const Tile<float>& tile, const FilterCenter<float>& center) {
  TapWeights<float> weights;
  joint_bilateral_weights(*tile.taps, center, weights);
  const Expected right = expected(tile, center);
  ASSERT_NEAR(static_cast<double>(weights.sum), right.sum, 1e-5);
  if (right.sum > 0.0) expect_near(filtered_mean(weights, *tile.light), right.mean[0], center.pixel);
}

void compare(const Tile<double>& tile, const FilterCenter<double>& center) {
  TapWeights<double> weights;
  joint_bilateral_weights(*tile.taps, center, weights);
  const Expected right = expected(tile, center);
  ASSERT_NEAR(weights.sum, right.sum, 1e-12);
  if (right.sum == 0.0) return;
  for (std::size_t term = 0; term < center.term_count; ++term) {
    const glm::dvec3 mean = filtered_mean(weights, term, [&](std::size_t i) { return tile.light->at(i); });
    expect_near(mean, right.mean[term], center.pixel);
  }
}

template <typename T>
FilterCenter<T> center_at(const Tile<T>& tile, int x, int y) {
  const std::size_t own = TapPlanes::index(x, y);
  FilterCenter<T> center;
  center.material = static_cast<std::uint32_t>(tile.taps->kinds[own] / 2);
  center.separate_diffuse = tile.taps->kinds[own] % 2 != 0;
  center.position = tile.taps->position.at(own);
  center.normal = tile.taps->shading_normal.at(own);
  center.max_distance2 = T{0.0005F};
  center.max_bend2 = T{0.25F};
  center.sharpness = 4;
  center.max_ratio = 3;
  center.pixel = {x, y};
  return center;
}

TEST(JointBilateralFilter, WeighsPixelsAsEachOfThemWould) {
  const Tile<float> tile = make_tile<float>();
  int compared = 0;
  for (const std::size_t plane : {0U, 1U}) {
    for (const int radius : {1, 2, 3}) {
      for (int y = 0; y < kTileSide; y += 3) {
        for (const int x : {0, 1, 2, 3, 20, 31, 60, 61, 62, 63}) {
          const std::size_t own = TapPlanes::index(x, y);
          if (tile.taps->kinds[own] == NeighborFeatures<float>::kNoTap) continue;
          FilterCenter<float> center = center_at(tile, x, y);
          center.neighbor_weight = 0.7F;
          center.terms[0] = {plane, tile.taps->scattering[plane].at(own)};
          center.term_count = 1;
          center.min_ratio = 1.0F / 3.0F;
          center.window = window_about(center.pixel, center.offset, radius);
          center.reach = static_cast<float>(radius) + 1.0F;
          compare(tile, center);
          ++compared;
        }
      }
    }
  }
  EXPECT_GT(compared, 1000);
}

/// Wherever wide filters look, past the tile too.
TEST(JointBilateralFilter, WeighsForSubpixelSamplesByTheTapsOwnSharpness) {
  const Tile<float> tile = make_tile<float>();
  std::mt19937 random(11);
  std::uniform_real_distribution<float> off(-5.0F, 5.0F);
  for (int i = 0; i < 2000; ++i) {
    const int radius = 1 + static_cast<int>(random() % 2);
    FilterCenter<float> center;
    center.pixel = {random() % kTileSide, random() % kTileSide};
    center.offset = {off(random), off(random)};
    center.material = static_cast<std::uint32_t>(random() % 2);
    center.position = {0.01F * (glm::vec2(center.pixel) + center.offset), -1.0F};
    center.normal = about(random, {0, 0, 1}, 0.1F);
    center.max_distance2 = std::numeric_limits<float>::infinity();
    center.max_bend2 = 0.25F;
    center.sharpness = 2.0F;
    center.window = window_about(center.pixel, center.offset, radius);
    center.reach = static_cast<float>(radius) + 1.0F;
    center.is_pixel = false;
    compare(tile, center);
  }
}

TEST(JointBilateralFilter, ABoxTakesTapsThatAllTermsAccept) {
  const Tile<double> tile = make_tile<double>();
  int compared = 0;
  for (int y = 0; y < kTileSide; ++y) {
    for (const int x : {0, 1, 30, 62, 63}) {
      const std::size_t own = TapPlanes::index(x, y);
      if (tile.taps->kinds[own] == NeighborFeatures<double>::kNoTap) continue;
      FilterCenter<double> center = center_at(tile, x, y);
      center.is_box = true;
      for (const std::size_t plane : {0U, 1U}) center.terms.at(plane) = {plane, tile.taps->scattering[plane].at(own)};
      center.term_count = kPlanes;
      center.window = {{x - y % 2, y - 1}, 1 + y % 2, 2};
      compare(tile, center);
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
}

}  // namespace
}  // namespace hpr
