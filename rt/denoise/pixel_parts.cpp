#include "rt/denoise/pixel_parts.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>

#include "image/filter.h"

namespace hpr {
namespace {

/// A number of a screen that no wall has: looks have a stream of their own.
constexpr std::uint32_t kLookScreen = 0xFFFFFFFEU;
/// Pixels squared that are added to how far sights lie apart: those close to each other tell nothing of what is
/// farther.
constexpr float kRidge = 0.01F;
/// Pixels whose looks are traced together.
constexpr std::size_t kPixelsTogether = 32;
/// What has more parts than that is not told apart.
constexpr std::size_t kMostParts = 4;

bool goes_through_the_same(const std::optional<PixelPoints>& a, const std::optional<PixelPoints>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->map == b->map && a->eye == b->eye && a->axes == b->axes && a->orthographic == b->orthographic &&
         a->scale == b->scale;
}

/// But for the place in the pixels.
bool shows_the_same(const View& a, const View& b) {
  return a.eye == b.eye && a.axes == b.axes && a.left == b.left && a.right == b.right && a.bottom == b.bottom &&
         a.top == b.top && a.near_distance == b.near_distance && a.far_distance == b.far_distance &&
         a.orthographic == b.orthographic && a.screen == b.screen && a.block == b.block &&
         a.screen_number == b.screen_number && goes_through_the_same(a.points, b.points);
}

}  // namespace

Patch PartFinder::patch_of(const TileJob& job, std::uint32_t pixel, std::span<const Known> known,
                           std::span<const Sight> sights) {
  return {known, sights, -ray_through(view_, job, pixel, {}).direction};
}

void PartFinder::add_sides(const TileJob& job, const TileOutlines::Pixel& pixel, TileParts& found) {
  std::uint32_t left_looks = 0;
  for (std::uint32_t i = 0; i < found.places->size(); ++i) {
    left_looks |= static_cast<std::uint32_t>(pixel.is_left(found.places->at(i))) << i;
  }
  for (const bool is_left : {true, false}) {
    const std::size_t side = is_left ? 0 : 1;
    const std::span<const Known> known = std::span(pixel.known.at(side)).first(pixel.counts.at(side));
    PixelPart part;
    part.pixel = pixel.pixel;
    part.looks = is_left ? left_looks : ~left_looks;
    part.share = is_left ? pixel.share : 1.0F - pixel.share;
    if (part.share <= 0.0F) continue;
    part.middle = is_left ? pixel.middle : glm::clamp(-pixel.share / part.share * pixel.middle, -0.5F, 0.5F);
    if (outlines_.sights()[known.front().sight].is_surface) {
      part.shows = PixelPart::Shows::Surface;
      part.patch = patch_of(job, pixel.pixel, known, outlines_.sights());
    }
    found.parts.push_back(part);
  }
}

void PartFinder::ask(const LightContext& context, RayBuffers& buffers, const TileJob& job, TileParts& found) {
  const Looks& places = *found.places;
  buffers.requests.clear();
  for (const std::uint32_t pixel : asked_) {
    for (const glm::vec2& place : places) buffers.requests.push_back(ray_through(view_, job, pixel, place));
  }
  look_from_eye(context, buffers, view_.eye, seen_, Coherence::High);
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    group(job, asked_[i], std::span(seen_).subspan(i * places.size(), places.size()), found);
  }
  asked_.clear();
}

void PartFinder::group(const TileJob& job, std::uint32_t pixel, std::span<const Sight> seen, TileParts& found) {
  kinds_.clear();
  for (std::uint32_t i = 0; i < seen.size(); ++i) {
    const auto like =
        std::ranges::find_if(kinds_, [&](const Kind& kind) { return !is_outline(view_, seen[kind.first], seen[i]); });
    Kind& kind = like != kinds_.end() ? *like : kinds_.emplace_back(Kind{i});
    kind.looks |= 1U << i;
  }
  if (kinds_.size() > kMostParts) {
    found.parts.push_back({.pixel = pixel, .looks = ~0U, .share = 1.0F, .shows = PixelPart::Shows::Many});
    return;
  }
  for (const Kind& kind : kinds_) {
    PixelPart& part = found.parts.emplace_back();
    part.pixel = pixel;
    part.looks = kind.looks;
    part.share = static_cast<float>(std::popcount(kind.looks)) / static_cast<float>(seen.size());
    if (!seen[kind.first].is_surface) continue;
    known_.clear();
    for (std::uint32_t i = 0; i < seen.size(); ++i) {
      if ((kind.looks >> i & 1U) != 0) known_.push_back({found.places->at(i), i});
    }
    part.shows = PixelPart::Shows::Surface;
    part.patch = patch_of(job, pixel, known_, seen);
  }
}

std::vector<std::uint8_t> PartFinder::find(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                           TileParts& found) {
  std::vector<std::uint8_t> crossed(kTilePixels, 0);
  if (context.rays->has_holes()) return crossed;
  view_ = unjittered(job);
  asked_.clear();
  found.parts.clear();
  outlines_.find(context, buffers, job);
  found.parts.reserve(2 * outlines_.crossed().size());
  for (const TileOutlines::Pixel& pixel : outlines_.crossed()) {
    crossed[pixel.pixel] = 1;
    if (pixel.has_sides && context.settings.filter == PixelFilter::Box) {  // others reach beyond the pixel
      add_sides(job, pixel, found);
      continue;
    }
    asked_.push_back(pixel.pixel);
    if (asked_.size() == kPixelsTogether) ask(context, buffers, job, found);
  }
  ask(context, buffers, job, found);
  return crossed;
}

Patch::Patch(std::span<const Known> known, std::span<const Sight> sights, const glm::vec3& to_eye)
    : material_(sights[known.front().sight].material), to_eye_(to_eye) {
  const auto across = [&](const Sight& sight) { return sight.normal - glm::dot(sight.normal, to_eye_) * to_eye_; };
  const float part = 1.0F / static_cast<float>(known.size());
  glm::vec2 middle(0.0F);
  for (const Known& each : known) {
    middle += part * each.place;
    place_[0] += part * sights[each.sight].place;
    across_[0] += part * across(sights[each.sight]);
  }
  float xx = kRidge;
  float yy = kRidge;
  float xy = 0.0F;
  Plane place_by{};
  Plane across_by{};
  for (const Known& each : known) {
    const glm::vec2 way = each.place - middle;
    xx += part * way.x * way.x;
    xy += part * way.x * way.y;
    yy += part * way.y * way.y;
    for (const int axis : {0, 1}) {
      place_by.at(static_cast<std::size_t>(axis)) += part * way[axis] * (sights[each.sight].place - place_[0]);
      across_by.at(static_cast<std::size_t>(axis)) += part * way[axis] * (across(sights[each.sight]) - across_[0]);
    }
  }
  const float determinant = xx * yy - xy * xy;
  const auto tilt = [&](Plane& plane, const Plane& by) {
    plane[1] = (yy * by[0] - xy * by[1]) / determinant;
    plane[2] = (xx * by[1] - xy * by[0]) / determinant;
    plane[0] -= middle.x * plane[1] + middle.y * plane[2];
  };
  tilt(place_, place_by);
  tilt(across_, across_by);
}

Sight Patch::at(const glm::vec2& place) const {
  Sight sight;
  sight.is_surface = true;
  sight.material = material_;
  sight.place = place_[0] + place.x * place_[1] + place.y * place_[2];
  const glm::vec3 across = across_[0] + place.x * across_[1] + place.y * across_[2];
  const float across2 = glm::dot(across, across);
  sight.normal = across2 < 1.0F ? across + std::sqrt(1.0F - across2) * to_eye_ : across / std::sqrt(across2);
  return sight;
}

glm::vec2 PixelPart::place(const Looks& places, std::uint32_t number) const {
  if (looks == 0) return middle;
  std::uint32_t left = looks;
  for (std::uint32_t skipped = number % count(); skipped > 0; --skipped) left &= left - 1;
  return places.at(static_cast<std::size_t>(std::countr_zero(left)));
}

bool PixelPart::is_like(const View& view, const Sight& sight, const glm::vec2& place) const {
  switch (shows) {
    case Shows::Background:
      return !sight.is_surface;
    case Shows::Surface:  // the two lie one behind the other at most: what is beside tells nothing
      return sight.is_surface && is_near(view, patch.at(place), sight);
    case Shows::Many:
      return true;
  }
  return false;
}

void PixelParts::prepare(const FrameLayout& layout, std::span<const View> views, const RaySettings& settings) {
  if (layout_ == layout && std::ranges::equal(views_, views, shows_the_same)) return;
  layout_ = layout;
  views_.assign(views.begin(), views.end());
  tiles_.assign(layout.tiles(), {});
  for (std::uint32_t i = 0; i < places_.size(); ++i) {
    Sampler sampler(pixel_stream({settings.seed, 0}, kLookScreen, 0, 0), i);
    places_.at(i) = sample_filter(settings.filter, sampler.two()).offset;
  }
}

const TileParts& PixelParts::of_tile(const LightContext& context, RayBuffers& buffers, const TileJob& job,
                                     std::size_t tile, PartFinder& finder) {
  TileParts& found = tiles_[tile];
  found.places = &places_;
  if (found.crossed.empty()) found.crossed = finder.find(context, buffers, job, found);
  return found;
}

}  // namespace hpr
