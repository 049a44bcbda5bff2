#include "rt/denoise/lenders.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <random>
#include <utility>

namespace hpr {
namespace {

struct Planes {
  std::unique_ptr<LenderSights> sights = std::make_unique<LenderSights>();
  std::unique_ptr<LenderVectors<double>> light = std::make_unique<LenderVectors<double>>();
};

glm::vec3 about(std::mt19937& random, const glm::vec3& middle, float spread) {
  std::uniform_real_distribution<float> off(-spread, spread);
  return middle + glm::vec3(off(random), off(random), off(random));
}

/// A pixel of a slab of two materials a metre off, a centimetre a pixel; every ninth lends nothing and shows garbage.
void set_pixel(Planes& planes, std::mt19937& random, int x, int y) {
  LenderSights& sights = *planes.sights;
  const std::size_t i = LenderPlanes::index(x, y);
  const bool lends = random() % 9 != 0;
  const glm::vec3 nothing(std::numeric_limits<float>::quiet_NaN());
  const glm::vec3 place(0.01F * static_cast<float>(x), 0.01F * static_cast<float>(y), -1.0F);
  const glm::vec3 normal = glm::normalize(about(random, {0, 0, 1}, 0.3F));
  sights.lends[i] = lends ? kind_of_lender(random() % 2, random() % 4 == 0) : LenderSights::kLendsNothing;
  sights.place.set(i, lends ? about(random, place, 0.002F) : nothing);
  sights.normal.set(i, lends ? normal : nothing);
  sights.mapped.set(i, lends ? about(random, normal, 0.1F) : nothing);
  sights.mirrored.set(i, about(random, glm::vec3(0.2F), 0.19F));
  sights.matte.set(i, about(random, glm::vec3(0.5F), 0.45F));
  sights.sharpness[i] = random() % 3 == 0 ? 9.0F : 1.0F;
  planes.light->set(i, lends ? glm::dvec3(about(random, glm::vec3(2.0F), 1.5F)) : glm::dvec3(0.0));
}

Planes make_planes() {
  Planes planes;
  std::mt19937 random(7);
  for (int y = 0; y < kTileSide; ++y) {
    for (int x = 0; x < kTileSide; ++x) set_pixel(planes, random, x, y);
  }
  return planes;
}

struct Expected {
  glm::dvec3 mean{0.0};
  double sum = 0.0;
};

glm::vec3 weight_of(const LenderSights& sights, Lent lent, std::size_t i) {
  if (lent == Lent::Mirrored) return sights.mirrored.at(i);
  return lent == Lent::Matte ? sights.matte.at(i) : sights.mirrored.at(i) + sights.matte.at(i);
}

/// What pixel (x, y) gives by itself, as the Borrower's members say: its weight, and what its light is multiplied by.
std::pair<float, glm::vec3> given(const LenderSights& sights, const Borrower& borrower, const glm::ivec2& pixel) {
  constexpr std::pair<float, glm::vec3> kNothing{0.0F, glm::vec3(0.0F)};
  const std::size_t i = LenderPlanes::index(pixel.x, pixel.y);
  const bool is_alike =
      sights.lends[i] == kind_of_lender(borrower.material, borrower.is_split) ||
      (!borrower.is_pixel && sights.lends[i] == kind_of_lender(borrower.material, !borrower.is_split));
  if (!is_alike) return kNothing;
  const glm::vec2 off = glm::vec2(pixel - borrower.pixel) - borrower.way;
  const float reach = static_cast<float>(borrower.radius) + 1.0F;
  const float spatial = 1.0F - glm::dot(off, off) / (reach * reach);
  const glm::vec3 way = sights.place.at(i) - borrower.place;
  const float bent = glm::dot(way, sights.normal.at(i));
  if (glm::dot(way, way) > borrower.most_apart2 || bent * bent > borrower.most_bent2 * glm::dot(way, way)) {
    return kNothing;
  }
  const glm::vec3 turned = (borrower.is_pixel ? sights.mapped : sights.normal).at(i) - borrower.normal;
  const float sharpness = borrower.sharpness * (borrower.is_pixel ? 1.0F : sights.sharpness[i]);
  const float alike = 1.0F - glm::dot(turned, turned) * sharpness;
  if (spatial <= 0.0F || alike <= 0.0F) return kNothing;
  const float weight = borrower.others * spatial * alike * alike;
  if (!borrower.is_pixel) return {weight, glm::vec3(1.0F)};
  const glm::vec3 ratio = borrower.weight / weight_of(sights, borrower.lent, i);
  const float most = std::max({ratio.x, ratio.y, ratio.z, 1.0F / ratio.x, 1.0F / ratio.y, 1.0F / ratio.z});
  if (most > borrower.most_brighter) return kNothing;
  return {pixel == borrower.pixel ? 1.0F : weight, ratio};
}

Expected expected(const Planes& planes, const Borrower& borrower) {
  Expected found;
  const glm::ivec2 middle = borrower.pixel + glm::ivec2(std::lround(borrower.way.x), std::lround(borrower.way.y));
  const glm::ivec2 first = glm::max(middle - borrower.radius, glm::ivec2(0));
  const glm::ivec2 last = glm::min(middle + borrower.radius, glm::ivec2(kTileSide - 1));
  for (int y = first.y; y <= last.y; ++y) {
    for (int x = first.x; x <= last.x; ++x) {
      const auto [weight, ratio] = given(*planes.sights, borrower, {x, y});
      found.sum += static_cast<double>(weight);
      found.mean += glm::dvec3(weight * ratio) * planes.light->at(LenderPlanes::index(x, y));
    }
  }
  found.mean /= found.sum;
  return found;
}

/// Also by the instructions of lesser processors, to the bit.
void compare(const Planes& planes, const Borrower& borrower) {
  LenderWeights weights;
  weigh_lenders(*planes.sights, borrower, weights);
  const Expected right = expected(planes, borrower);
  ASSERT_NEAR(static_cast<double>(weights.sum), right.sum, 1e-5);
  if (right.sum == 0.0) return;
  const glm::dvec3 mean = mean_of(weights, *planes.light);
  for (const int i : {0, 1, 2})
    ASSERT_NEAR(mean[i], right.mean[i], 1e-5) << borrower.pixel.x << ' ' << borrower.pixel.y;
}

TEST(Lenders, LendToPixelsAsEachOfThemWould) {
  const Planes planes = make_planes();
  int lent = 0;
  for (const Lent what : {Lent::All, Lent::Mirrored, Lent::Matte}) {
    for (const int radius : {1, 2, 3}) {
      for (int y = 0; y < kTileSide; y += 3) {
        for (const int x : {0, 1, 2, 3, 20, 31, 60, 61, 62, 63}) {
          const std::size_t own = LenderPlanes::index(x, y);
          if (planes.sights->lends[own] == LenderSights::kLendsNothing) continue;
          compare(planes, {.material = static_cast<std::uint32_t>(planes.sights->lends[own] / 2),
                           .is_split = planes.sights->lends[own] % 2 != 0,
                           .place = planes.sights->place.at(own),
                           .normal = planes.sights->mapped.at(own),
                           .most_apart2 = 0.0005F,
                           .most_bent2 = 0.25F,
                           .sharpness = 4.0F,
                           .others = 0.7F,
                           .weight = weight_of(*planes.sights, what, own),
                           .lent = what,
                           .most_brighter = 3.0F,
                           .pixel = {x, y},
                           .radius = radius});
          ++lent;
        }
      }
    }
  }
  EXPECT_GT(lent, 1000);
}

/// Wherever wide filters look, past the tile too.
TEST(Lenders, LendToLooksByTheirOwnWidth) {
  const Planes planes = make_planes();
  std::mt19937 random(11);
  std::uniform_real_distribution<float> off(-5.0F, 5.0F);
  for (int i = 0; i < 2000; ++i) {
    const glm::ivec2 pixel(random() % kTileSide, random() % kTileSide);
    const glm::vec2 way(off(random), off(random));
    const glm::vec2 at = 0.01F * (glm::vec2(pixel) + way);
    compare(planes, {.material = static_cast<std::uint32_t>(random() % 2),
                     .place = {at, -1.0F},
                     .normal = about(random, {0, 0, 1}, 0.1F),
                     .most_apart2 = std::numeric_limits<float>::infinity(),
                     .most_bent2 = 0.25F,
                     .sharpness = 2.0F,
                     .pixel = pixel,
                     .way = way,
                     .radius = 1 + static_cast<int>(random() % 2),
                     .is_pixel = false});
  }
}

}  // namespace
}  // namespace hpr
