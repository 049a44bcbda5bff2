#include "rt/passes/half_resolution.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "core/error.h"

namespace hpr {
namespace {

constexpr int kBlockSide = 2;
constexpr int kBlocksPerRow = kTileSide / kBlockSide;

/// The tap's place in its block, sample after sample: diagonals first.
constexpr std::array<int, 4> kTapX{0, 1, 1, 0};
constexpr std::array<int, 4> kTapY{0, 1, 0, 1};

/// Cosine of the largest angle between the normals of pixels that share light.
constexpr double kMinCosine = 0.9;
/// How far one may lie off the other's tangent plane, in distances between the two: what normals that differ so much
/// make of a curved surface.
constexpr double kMaxBend = 0.25;
/// How far apart they may lie, in distances from the eye.
constexpr double kMaxDistance = 0.1;
/// How many times as much of the light a pixel may scatter as the tap.
constexpr double kMaxRatio = 4.0;

static_assert(kPasses <= FilterCenter<double>::kMaxTerms);

glm::ivec2 block_of(std::uint32_t pixel) {
  return {static_cast<int>(pixel % kTileSide) / kBlockSide, static_cast<int>(pixel / kTileSide) / kBlockSide};
}

}  // namespace

void HalfResShading::start(ComponentSet shared, const LightContext& context, const TileJob& job) {
  shared_ = shared;
  passes_.clear();
  for (const PassInfo& pass : all_passes()) {
    if ((pass.half_resolution.components & shared) != 0) passes_.push_back(&pass);
  }
  glossy_cutoff_ = context.settings.glossy_cutoff;
  const std::size_t turn = job.number.sample % kTapX.size();
  tap_x_ = kTapX.at(turn);
  tap_y_ = kTapY.at(turn);
  eye_ = context.view->eye;
  if (!taps_) taps_ = std::make_unique<NeighborFeatures<double>>();
  taps_->kinds.fill(NeighborFeatures<double>::kNoTap);
  taps_->scattering.resize(passes_.size());
  upsampled_.clear();
}

HalfResShading::Feature HalfResShading::feature_of(const PathVertex& point) const {
  Feature feature{.position = point.surface.position,
                  .normal = point.material.normal,
                  .material = point.surface.material,
                  .pixel = point.pixel};
  for (std::size_t i = 0; i < passes_.size(); ++i) {
    const glm::vec3 scattered = passes_[i]->half_resolution.scattered(point, glossy_cutoff_);
    feature.scattering.at(i) = scattered;
  }
  return feature;
}

void HalfResShading::set_tap(const Feature& feature) {
  const glm::ivec2 block = block_of(feature.pixel);
  const std::size_t at = TapPlanes::index(block.x, block.y);
  taps_->kinds.at(at) = tap_kind(feature.material, false);
  taps_->position.set(at, feature.position);
  taps_->normal.set(at, feature.normal);
  taps_->shading_normal.set(at, feature.normal);
  for (std::size_t i = 0; i < passes_.size(); ++i) taps_->scattering[i].set(at, glm::dvec3(feature.scattering.at(i)));
}

FilterCenter<double> HalfResShading::center_of(const Feature& feature) const {
  const glm::dvec3 from_eye = feature.position - eye_;
  FilterCenter<double> center;
  center.material = feature.material;
  center.position = feature.position;
  center.normal = feature.normal;
  center.max_distance2 = kMaxDistance * kMaxDistance * glm::dot(from_eye, from_eye);
  center.max_bend2 = kMaxBend * kMaxBend;
  center.sharpness = 0.5 / (1.0 - kMinCosine);
  for (std::size_t i = 0; i < passes_.size(); ++i) center.terms.at(i) = {i, glm::dvec3(feature.scattering.at(i))};
  center.term_count = passes_.size();
  center.max_ratio = kMaxRatio;
  center.is_box = true;
  return center;
}

bool HalfResShading::is_tap(const PathVertex& point) const {
  return static_cast<int>(point.pixel % kTileSide) % kBlockSide == tap_x_ &&
         static_cast<int>(point.pixel / kTileSide) % kBlockSide == tap_y_;
}

void HalfResShading::choose(std::vector<PathVertex>& points, int first_row) {
  // A pixel that shows several surfaces, each in part, keeps to itself.
  std::array<std::uint8_t, kTilePixels> surfaces{};
  for (const PathVertex& point : points) surfaces.at(point.pixel) = surfaces.at(point.pixel) == 0 ? 1 : 2;
  const auto shows_one = [&](const PathVertex& point) {
    return surfaces.at(point.pixel) == 1 && point.throughput == glm::dvec3(1.0);
  };
  HPR_CHECK(first_row % kBlockSide == 0);
  for (const PathVertex& point : points) {
    // What glows is no light that falls on it.
    if (is_tap(point) && shows_one(point) && point.material.emission == glm::dvec3(0.0)) set_tap(feature_of(point));
  }
  for (PathVertex& point : points) {
    const glm::ivec2 block = block_of(point.pixel);
    const bool has_tap = taps_->kinds.at(TapPlanes::index(block.x, block.y)) != NeighborFeatures<double>::kNoTap;
    if (!has_tap || is_tap(point) || !shows_one(point)) continue;
    const Feature feature = feature_of(point);
    FilterCenter<double> center = center_of(feature);
    center.window.first = block;
    joint_bilateral_weights(*taps_, center, weights_);
    if (weights_.sum == 0.0) continue;
    upsampled_.push_back(feature);
    point.upsampled = shared_;
    for (const PassInfo* const pass : passes_) {
      if (!pass->lobe) continue;
      point.lobe_weights.at(static_cast<std::size_t>(*pass->lobe)) = 0.0F;
      point.lobe_weights.at(static_cast<std::size_t>(extension_of(*pass->lobe))) = 0.0F;
    }
  }
}

/// Taps stand on a lattice two pixels wide: a pixel lies on one of its lines, or half way between two.
FilterWindow HalfResShading::taps_about(std::uint32_t pixel) const {
  const glm::ivec2 position(static_cast<int>(pixel % kTileSide) - tap_x_, static_cast<int>(pixel / kTileSide) - tap_y_);
  const glm::ivec2 first(position.x >= 0 ? position.x / kBlockSide : -1,
                         position.y >= 0 ? position.y / kBlockSide : -1);
  return {first, 1 + position.x - first.x * kBlockSide, 1 + position.y - first.y * kBlockSide};
}

void HalfResShading::upsample(PixelSums& sums) {
  for (const Feature& feature : upsampled_) {
    FilterCenter<double> center = center_of(feature);
    center.window = taps_about(feature.pixel);
    joint_bilateral_weights(*taps_, center, weights_);
    for (std::size_t part = 0; part < kComponents; ++part) {
      const auto component = static_cast<Component>(part);
      if (!contains(shared_, component)) continue;
      const auto pass = std::ranges::find_if(
          passes_, [&](const PassInfo* each) { return contains(each->half_resolution.components, component); });
      const auto term = static_cast<std::size_t>(pass - passes_.begin());
      const auto light = [&](std::size_t i) {
        const auto x = static_cast<int>(i % TapPlanes::kStride) - TapPlanes::kMargin;
        const auto y = static_cast<int>(i / TapPlanes::kStride) - TapPlanes::kMargin;
        const int tap = (kBlockSide * y + tap_y_) * kTileSide + kBlockSide * x + tap_x_;
        // A surface that scatters nothing of such light has none to be scaled.
        const glm::dvec3 scatters = glm::sign(taps_->scattering[term].at(i));
        return scatters * sums.components.at(part)[static_cast<std::size_t>(tap)];
      };
      sums.add(feature.pixel, component, filtered_mean(weights_, term, light));
    }
  }
}

}  // namespace hpr
