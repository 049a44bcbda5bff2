#include "rt/denoise/coverage_fragments.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>

#include "image/filter.h"

namespace hpr {
namespace {

/// A number of a screen that no wall has: subpixel offsets have a stream of their own.
constexpr std::uint32_t kSubpixelScreen = 0xFFFFFFFEU;
/// Pixels squared that are added to how far features lie apart: close ones determine no slope.
constexpr float kRidge = 0.01F;
/// Pixels that are traced together: more where each trace waits for other ranks.
constexpr std::size_t kPixelsTogether = 32;
constexpr std::size_t kSharedPixelsTogether = 256;
/// Pixels with more fragments get one of Shows::Many.
constexpr std::size_t kMaxFragments = 4;

bool same_points(const std::optional<PixelPoints>& a, const std::optional<PixelPoints>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->map == b->map && a->eye == b->eye && a->axes == b->axes && a->orthographic == b->orthographic &&
         a->scale == b->scale;
}

/// But for the place in the pixels.
bool same_but_jitter(const View& a, const View& b) {
  return a.eye == b.eye && a.axes == b.axes && a.left == b.left && a.right == b.right && a.bottom == b.bottom &&
         a.top == b.top && a.near_distance == b.near_distance && a.far_distance == b.far_distance &&
         a.orthographic == b.orthographic && a.screen == b.screen && a.block == b.block &&
         a.screen_number == b.screen_number && same_points(a.points, b.points);
}

}  // namespace

Patch FragmentFinder::patch_of(const TileJob& job, std::uint32_t pixel, std::span<const KnownFeature> known,
                               std::span<const SurfaceFeature> features) {
  return {known, features, -ray_through(view_, job, pixel, {}).direction};
}

void FragmentFinder::add_sides(const TileJob& job, const SilhouetteEdges::Pixel& pixel, TileFragments& found) {
  std::uint32_t left_samples = 0;
  for (std::uint32_t i = 0; i < found.positions->size(); ++i) {
    left_samples |= static_cast<std::uint32_t>(pixel.is_left(found.positions->at(i))) << i;
  }
  for (const bool is_left : {true, false}) {
    const std::size_t side = is_left ? 0 : 1;
    const std::span<const KnownFeature> known = std::span(pixel.known.at(side)).first(pixel.counts.at(side));
    CoverageFragment fragment;
    fragment.pixel = pixel.pixel;
    fragment.samples = is_left ? left_samples : ~left_samples;
    fragment.fraction = is_left ? pixel.fraction : 1.0F - pixel.fraction;
    if (fragment.fraction <= 0.0F) continue;
    fragment.centroid =
        is_left ? pixel.centroid : glm::clamp(-pixel.fraction / fragment.fraction * pixel.centroid, -0.5F, 0.5F);
    if (silhouettes_.features()[known.front().feature].is_surface) {
      fragment.shows = CoverageFragment::Shows::Surface;
      fragment.patch = patch_of(job, pixel.pixel, known, silhouettes_.features());
    }
    found.fragments.push_back(fragment);
  }
}

void FragmentFinder::trace_pending(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                   TileFragments& found) {
  const SubpixelOffsets& positions = *found.positions;
  buffers.requests.clear();
  for (const std::uint32_t pixel : pending_) {
    for (const glm::vec2& position : positions) buffers.requests.push_back(ray_through(view_, job, pixel, position));
  }
  trace_features(context, buffers, view_.eye, traced_features_, Coherence::High);
  for (std::size_t i = 0; i < pending_.size(); ++i) {
    group(job, pending_[i], std::span(traced_features_).subspan(i * positions.size(), positions.size()), found);
  }
  pending_.clear();
}

void FragmentFinder::group(const TileJob& job, std::uint32_t pixel, std::span<const SurfaceFeature> seen,
                           TileFragments& found) {
  kinds_.clear();
  for (std::uint32_t i = 0; i < seen.size(); ++i) {
    const auto like = std::ranges::find_if(
        kinds_, [&](const Kind& kind) { return !is_silhouette(view_, seen[kind.first], seen[i]); });
    Kind& kind = like != kinds_.end() ? *like : kinds_.emplace_back(Kind{i});
    kind.samples |= 1U << i;
  }
  if (kinds_.size() > kMaxFragments) {
    found.fragments.push_back(
        {.pixel = pixel, .samples = ~0U, .fraction = 1.0F, .shows = CoverageFragment::Shows::Many});
    return;
  }
  for (const Kind& kind : kinds_) {
    CoverageFragment& fragment = found.fragments.emplace_back();
    fragment.pixel = pixel;
    fragment.samples = kind.samples;
    fragment.fraction = static_cast<float>(std::popcount(kind.samples)) / static_cast<float>(seen.size());
    if (!seen[kind.first].is_surface) continue;
    known_.clear();
    for (std::uint32_t i = 0; i < seen.size(); ++i) {
      if ((kind.samples >> i & 1U) != 0) known_.push_back({found.positions->at(i), i});
    }
    fragment.shows = CoverageFragment::Shows::Surface;
    fragment.patch = patch_of(job, pixel, known_, seen);
  }
}

std::vector<std::uint8_t> FragmentFinder::find(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                               TileFragments& found) {
  std::vector<std::uint8_t> crossed(kTilePixels, 0);
  if (context.rays->has_alpha_tested()) return crossed;
  view_ = unjittered(job);
  pending_.clear();
  found.fragments.clear();
  silhouettes_.find(context, buffers, job);
  const std::size_t together = context.surfaces.are_shared_out() ? kSharedPixelsTogether : kPixelsTogether;
  found.fragments.reserve(2 * silhouettes_.crossed().size());
  for (const SilhouetteEdges::Pixel& pixel : silhouettes_.crossed()) {
    crossed[pixel.pixel] = 1;
    if (pixel.has_sides && context.settings.filter == PixelFilter::Box) {  // others reach beyond the pixel
      add_sides(job, pixel, found);
      continue;
    }
    pending_.push_back(pixel.pixel);
    if (pending_.size() == together) trace_pending(context, buffers, job, found);
  }
  trace_pending(context, buffers, job, found);
  return crossed;
}

Patch::Patch(std::span<const KnownFeature> known, std::span<const SurfaceFeature> features, const glm::vec3& to_eye)
    : material_(features[known.front().feature].material), to_eye_(to_eye) {
  const auto across = [&](const SurfaceFeature& feature) {
    return feature.normal - glm::dot(feature.normal, to_eye_) * to_eye_;
  };
  const float weight = 1.0F / static_cast<float>(known.size());
  glm::vec2 centroid(0.0F);
  for (const KnownFeature& each : known) {
    centroid += weight * each.position;
    position_[0] += weight * features[each.feature].position;
    across_[0] += weight * across(features[each.feature]);
  }
  float xx = kRidge;
  float yy = kRidge;
  float xy = 0.0F;
  Plane place_by{};
  Plane across_by{};
  for (const KnownFeature& each : known) {
    const glm::vec2 offset = each.position - centroid;
    xx += weight * offset.x * offset.x;
    xy += weight * offset.x * offset.y;
    yy += weight * offset.y * offset.y;
    for (const int axis : {0, 1}) {
      place_by.at(static_cast<std::size_t>(axis)) +=
          weight * offset[axis] * (features[each.feature].position - position_[0]);
      across_by.at(static_cast<std::size_t>(axis)) +=
          weight * offset[axis] * (across(features[each.feature]) - across_[0]);
    }
  }
  const float determinant = xx * yy - xy * xy;
  const auto tilt = [&](Plane& plane, const Plane& by) {
    plane[1] = (yy * by[0] - xy * by[1]) / determinant;
    plane[2] = (xx * by[1] - xy * by[0]) / determinant;
    plane[0] -= centroid.x * plane[1] + centroid.y * plane[2];
  };
  tilt(position_, place_by);
  tilt(across_, across_by);
}

SurfaceFeature Patch::at(const glm::vec2& position) const {
  SurfaceFeature feature;
  feature.is_surface = true;
  feature.material = material_;
  feature.position = position_[0] + position.x * position_[1] + position.y * position_[2];
  const glm::vec3 across = across_[0] + position.x * across_[1] + position.y * across_[2];
  const float across2 = glm::dot(across, across);
  feature.normal = across2 < 1.0F ? across + std::sqrt(1.0F - across2) * to_eye_ : across / std::sqrt(across2);
  return feature;
}

glm::vec2 CoverageFragment::position_at(const SubpixelOffsets& positions, std::uint32_t number) const {
  if (samples == 0) return centroid;
  std::uint32_t left = samples;
  for (std::uint32_t skipped = number % count(); skipped > 0; --skipped) left &= left - 1;
  return positions.at(static_cast<std::size_t>(std::countr_zero(left)));
}

bool CoverageFragment::matches(const View& view, const SurfaceFeature& feature, const glm::vec2& position) const {
  switch (shows) {
    case Shows::Background:
      return !feature.is_surface;
    case Shows::Surface:  // the two lie one behind the other at most: neighbors on the screen do not matter
      return feature.is_surface && is_within_depth(view, patch.at(position), feature);
    case Shows::Many:
      return true;
  }
  return false;
}

void CoverageFragments::prepare(const FrameLayout& layout, std::span<const View> views, const RaySettings& settings) {
  if (layout_ == layout && std::ranges::equal(views_, views, same_but_jitter)) return;
  layout_ = layout;
  views_.assign(views.begin(), views.end());
  tiles_.assign(layout.tiles(), {});
  for (std::uint32_t i = 0; i < positions_.size(); ++i) {
    Sampler sampler(pixel_stream({settings.seed, 0}, kSubpixelScreen, 0, 0), i);
    positions_.at(i) = sample_filter(settings.filter, sampler.two()).offset;
  }
}

const TileFragments& CoverageFragments::of_tile(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                                std::size_t tile, FragmentFinder& finder) {
  TileFragments& found = tiles_[tile];
  found.positions = &positions_;
  if (found.crossed.empty()) found.crossed = finder.find(context, buffers, job, found);
  return found;
}

}  // namespace hpr
