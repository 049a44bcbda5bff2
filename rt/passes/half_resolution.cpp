#include "rt/passes/half_resolution.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "core/error.h"

namespace hpr {
namespace {

constexpr int kBlockSide = 2;

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

/// `position`: no more than a pixel before the first block.
glm::ivec2 block_of(const glm::ivec2& position) {
  return (position + kBlockSide) / kBlockSide - 1;
}

/// The pixels of which a primary vertex is all that is seen.
class SingleSurfaces {
 public:
  SingleSurfaces(const std::vector<PathVertex>& points, std::uint32_t first_pixel) : first_pixel_(first_pixel) {
    for (const PathVertex& point : points) {
      std::uint8_t& count = counts_.at(point.pixel - first_pixel_);
      count = count == 0 ? 1 : 2;
    }
  }

  [[nodiscard]] bool has(const PathVertex& point) const {
    return counts_.at(point.pixel - first_pixel_) == 1 && point.throughput == glm::dvec3(1.0);
  }

 private:
  std::uint32_t first_pixel_;
  std::array<std::uint8_t, kTilePixels> counts_{};
};

}  // namespace

void HalfResShading::start(ComponentSet shared, const LightContext& context, const TileJob& job) {
  shared_ = shared;
  passes_.clear();
  for (const PassInfo& pass : all_passes()) {
    if ((pass.half_resolution.components & shared) != 0) passes_.push_back(&pass);
  }
  glossy_cutoff_ = context.settings.glossy_cutoff;
  const std::size_t turn = job.number.sample % kTapX.size();
  tap_ = {kTapX.at(turn), kTapY.at(turn)};
  rect_ = job.rect;
  before_ = job.origin() % kBlockSide;
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

void HalfResShading::set_tap(const glm::ivec2& block, const Feature& feature) {
  const std::size_t at = TapPlanes::index(block.x, block.y);
  tap_pixels_.at(at) = feature.pixel;
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

glm::ivec2 HalfResShading::position_of(std::uint32_t pixel) const {
  return before_ + glm::ivec2(pixel % kTileSide, pixel / kTileSide);
}

bool HalfResShading::is_tap(const glm::ivec2& position) const {
  return (position + kBlockSide) % kBlockSide == tap_;
}

void HalfResShading::add_margin(const TileJob& strip, std::vector<PathVertex>& points) {
  const SingleSurfaces seen(points, strip.first_pixel);
  const glm::ivec2 offset = glm::ivec2(strip.rect.x0, strip.rect.y0) - glm::ivec2(rect_.x0, rect_.y0);
  std::erase_if(points, [&](const PathVertex& point) {
    const glm::ivec2 position = position_of(point.pixel - strip.first_pixel) + offset;
    const bool lends = is_tap(position) && seen.has(point) && point.material.emission == glm::dvec3(0.0);
    if (lends) set_tap(block_of(position), feature_of(point));
    return !lends;
  });
}

void HalfResShading::choose(std::vector<PathVertex>& points, int first_row) {
  // A pixel that shows several surfaces, each in part, keeps to itself.
  const SingleSurfaces seen(points, 0);
  HPR_CHECK(first_row == 0 || (before_.y + first_row) % kBlockSide == 0);
  for (const PathVertex& point : points) {
    const glm::ivec2 position = position_of(point.pixel);
    // What glows is no light that falls on it.
    if (is_tap(position) && seen.has(point) && point.material.emission == glm::dvec3(0.0)) {
      set_tap(block_of(position), feature_of(point));
    }
  }
  for (PathVertex& point : points) {
    const glm::ivec2 position = position_of(point.pixel);
    const glm::ivec2 block = block_of(position);
    const bool has_tap = taps_->kinds.at(TapPlanes::index(block.x, block.y)) != NeighborFeatures<double>::kNoTap;
    if (!has_tap || is_tap(position) || !seen.has(point)) continue;
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
  const glm::ivec2 position = position_of(pixel) - tap_;
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
        // A surface that scatters nothing of such light has none to be scaled.
        const glm::dvec3 scatters = glm::sign(taps_->scattering[term].at(i));
        return scatters * sums.components.at(part)[tap_pixels_.at(i)];
      };
      sums.add(feature.pixel, component, filtered_mean(weights_, term, light));
    }
  }
}

}  // namespace hpr
