#include "rt/passes/half_resolution.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <span>

#include "core/error.h"

namespace hpr {
namespace {

constexpr int kBlockSide = 2;
constexpr int kBlocksPerRow = kTileSide / kBlockSide;

/// Of one pixel of a block, in the order in which they lend: diagonals first.
constexpr std::array<int, 4> kLenderX{0, 1, 1, 0};
constexpr std::array<int, 4> kLenderY{0, 1, 0, 1};

/// Cosine of the largest angle between the normals of pixels that share light.
constexpr double kLeastCosine = 0.9;
/// How far one may lie off the other's tangent plane, in distances between the two: what normals that differ so much
/// make of a curved surface.
constexpr double kMostBent = 0.25;
/// How far apart they may lie, in distances from the eye.
constexpr double kMostApart = 0.1;
/// How many times as much of the light a borrower may scatter.
constexpr float kMostBrighter = 4.0F;

std::size_t block_of(std::uint32_t pixel) {
  const std::uint32_t x = pixel % kTileSide / kBlockSide;
  const std::uint32_t y = pixel / kTileSide / kBlockSide;
  return static_cast<std::size_t>(y) * kBlocksPerRow + x;
}

glm::dvec3 made_up_for(const glm::vec3& borrower, const glm::vec3& lender) {
  const auto ratio = [](float a, float b) { return b > 0.0F ? static_cast<double>(a) / static_cast<double>(b) : 0.0; };
  return {ratio(borrower.r, lender.r), ratio(borrower.g, lender.g), ratio(borrower.b, lender.b)};
}

}  // namespace

void SharedLight::start(ComponentSet shared, const LightContext& context, const TileJob& job) {
  shared_ = shared;
  glossy_cutoff_ = context.settings.glossy_cutoff;
  const std::size_t turn = job.number.sample % kLenderX.size();
  lender_x_ = kLenderX.at(turn);
  lender_y_ = kLenderY.at(turn);
  eye_ = context.view->eye;
  lender_of_.assign(static_cast<std::size_t>(kBlocksPerRow) * kBlocksPerRow, kNobody);
  lenders_.clear();
  borrowers_.clear();
}

SharedLight::Seen SharedLight::look_at(const PathPoint& point) const {
  Seen seen{.position = point.surface.position,
            .normal = point.material.normal,
            .material = point.surface.material,
            .pixel = point.pixel};
  for (const PassInfo& pass : all_passes()) {
    if ((pass.half_resolution.components & shared_) == 0) continue;
    const glm::vec3 scattered = pass.half_resolution.scattered(point, glossy_cutoff_);
    for (std::size_t i = 0; i < kComponents; ++i) {
      if (contains(pass.half_resolution.components, static_cast<Component>(i))) seen.weights.at(i) = scattered;
    }
  }
  return seen;
}

bool SharedLight::alike(const Seen& lender, const Seen& borrower) const {
  if (lender.material != borrower.material) return false;
  if (glm::dot(lender.normal, borrower.normal) < kLeastCosine) return false;
  const glm::dvec3 apart = borrower.position - lender.position;
  const double distance = glm::length(apart);
  if (std::abs(glm::dot(apart, lender.normal)) > kMostBent * distance) return false;
  if (distance > kMostApart * glm::distance(borrower.position, eye_)) return false;
  for (std::size_t i = 0; i < kComponents; ++i) {
    if (!contains(shared_, static_cast<Component>(i))) continue;
    if (glm::any(glm::greaterThan(borrower.weights[i], kMostBrighter * lender.weights[i]))) return false;
  }
  return true;
}

void SharedLight::choose(std::vector<PathPoint>& points, int first_row) {
  // A pixel that sees several surfaces, each in part, keeps to itself.
  std::array<std::uint8_t, kTilePixels> surfaces{};
  for (const PathPoint& point : points) surfaces.at(point.pixel) = surfaces.at(point.pixel) == 0 ? 1 : 2;
  const auto sees_one = [&](const PathPoint& point) {
    return surfaces.at(point.pixel) == 1 && point.throughput == glm::dvec3(1.0);
  };
  const auto lends = [&](const PathPoint& point) {
    const auto x = static_cast<int>(point.pixel % kTileSide);
    const auto y = static_cast<int>(point.pixel / kTileSide);
    return x % kBlockSide == lender_x_ && y % kBlockSide == lender_y_;
  };
  HPR_CHECK(first_row % kBlockSide == 0);
  for (const PathPoint& point : points) {
    // What glows is no light that falls on it.
    if (!lends(point) || !sees_one(point) || point.material.emission != glm::dvec3(0.0)) continue;
    lender_of_[block_of(point.pixel)] = static_cast<std::uint16_t>(lenders_.size());
    lenders_.push_back(look_at(point));
  }
  for (PathPoint& point : points) {
    const std::uint16_t lender = lender_of_[block_of(point.pixel)];
    if (lender != kNobody && !lends(point) && sees_one(point)) borrow(lenders_[lender], point);
  }
}

void SharedLight::borrow(const Seen& lender, PathPoint& point) {
  const Seen seen = look_at(point);
  if (!alike(lender, seen)) return;
  borrowers_.push_back(seen);
  point.borrows = shared_;
  for (const PassInfo& pass : all_passes()) {
    if (pass.lobe && point.borrows_light(pass.component)) point.follows.at(static_cast<std::size_t>(*pass.lobe)) = 0.0F;
  }
}

SharedLight::Lenders SharedLight::lenders_about(const Seen& borrower) const {
  // Lenders stand on a lattice two pixels wide: a borrower lies on one of its lines, or half way between two.
  const int x = static_cast<int>(borrower.pixel % kTileSide) - lender_x_;
  const int y = static_cast<int>(borrower.pixel / kTileSide) - lender_y_;
  const int left = x >= 0 ? x / kBlockSide : -1;
  const int above = y >= 0 ? y / kBlockSide : -1;
  Lenders found;
  for (int row = above; row <= above + y - above * kBlockSide; ++row) {
    for (int column = left; column <= left + x - left * kBlockSide; ++column) {
      if (row < 0 || column < 0 || row >= kBlocksPerRow || column >= kBlocksPerRow) continue;
      const std::uint16_t lender =
          lender_of_[static_cast<std::size_t>(row) * kBlocksPerRow + static_cast<std::size_t>(column)];
      if (lender != kNobody && alike(lenders_[lender], borrower)) found.at.at(found.count++) = &lenders_[lender];
    }
  }
  return found;
}

void SharedLight::spread(PixelSums& sums) const {
  for (const Seen& borrower : borrowers_) {
    const Lenders about = lenders_about(borrower);
    for (std::size_t part = 0; part < kComponents; ++part) {
      if (!contains(shared_, static_cast<Component>(part))) continue;
      glm::dvec3 sum(0.0);
      for (const Seen* const lender : std::span(about.at).first(about.count)) {
        sum += made_up_for(borrower.weights[part], lender->weights[part]) * sums.components[part][lender->pixel];
      }
      sums.add(borrower.pixel, static_cast<Component>(part), sum / static_cast<double>(about.count));
    }
  }
}

}  // namespace hpr
