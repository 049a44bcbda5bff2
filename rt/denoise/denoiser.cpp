#include "rt/denoise/denoiser.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "rt/passes/pixel_sums.h"

namespace hpr {
namespace {

/// Branches of a pixel's sampler.
constexpr std::uint32_t kLookBranch = 0x4C4F4F4BU;

/// Distance of unit normals from which on two places are not alike, in a frame's first sample.
constexpr float kNormalWidth = 0.9F;
/// On surfaces smoother than this roughness normals must be closer and neighbours count less, in proportion down to a
/// tenth: what mirrors show changes quickly with their normal and with the place.
constexpr float kSmooth = 0.5F;
constexpr float kLeastWidth = 0.1F;
/// At so many places of a pixel's part that shows a surface a sample looks again, and of one that shows many.
constexpr std::uint32_t kLooksAgain = 2;
constexpr std::uint32_t kLooksAtMany = 4;
/// Samples after which neighbours count less.
constexpr float kNeighbourSamples = 16.0F;
/// What is so many times as bright as all pixels about is rare light, whose share chance has not yet settled: blotches
/// if it were lent.
constexpr double kFarBrighter = 3.0;
/// How many times as much light one may scatter as the other.
constexpr float kMostBrighter = 4.0F;
/// One for each FilterLobe.
constexpr std::size_t kLobePlanes = 3;
constexpr auto kDirect = static_cast<std::size_t>(Component::Direct);
constexpr auto kShadow = static_cast<std::size_t>(Component::Shadow);

float square(float value) {
  return value * value;
}

/// FilterCenter::sharpness for so narrow a width, in parts of kNormalWidth.
float sharpness_of(float width) {
  return 1.0F / square(kNormalWidth * width);
}

std::size_t index_of(int column, int row) {
  return static_cast<std::size_t>(row) * kTileSide + static_cast<std::size_t>(column);
}

std::size_t plane_index(std::uint32_t pixel) {
  return TapPlanes::index(static_cast<int>(pixel) % kTileSide, static_cast<int>(pixel) / kTileSide);
}

/// Sum i, see Denoiser::each_sum.
std::vector<glm::dvec3>& sum_of(PixelSums& sums, std::size_t i) {
  return i == 0 ? sums.radiance : sums.components.at(i - 1);
}
const std::vector<glm::dvec3>& sum_of(const PixelSums& sums, std::size_t i) {
  return i == 0 ? sums.radiance : sums.components.at(i - 1);
}
const std::vector<glm::dvec3>& diffuse_of(const PixelSums& sums, std::size_t i) {
  return i == 0 ? sums.diffuse : sums.diffuse_components.at(i - 1);
}

}  // namespace

void Denoiser::start(std::size_t samples, bool with_components) {
  sums_ = with_components ? 1 + kComponents : 1;
  states_.assign(samples * kTilePixels, State::Unlit);
  seen_.resize(states_.size());
  some_split_ = false;
  if (!taps_) {
    taps_ = std::make_unique<NeighborFeatures<float>>();
    taps_->scattering.resize(kLobePlanes);
  }
  spare_ = static_cast<std::uint32_t>(states_.size());
}

/// Light that is sampled comes by all lobes together: where it does not stay with its pixel, matte light is not known.
bool Denoiser::tells_matte(const LightContext& context) {
  return keeps_direct(context.scene) || (context.lights.listed() == 0 && !context.lights.has_sampled());
}

void Denoiser::note(const LightContext& context, std::span<const PathPoint> points) {
  for (const PathPoint& point : points) {
    State& state = states_[point.pixel];
    const bool lends = state == State::Unlit && point.throughput == glm::dvec3(1.0) && point.share == 1.0 &&
                       point.material.emission == glm::dvec3(0.0);
    Seen& seen = seen_[point.pixel];
    if (state == State::Unlit) seen.sight = sight_of(point.surface, context.view->eye);
    state = lends ? State::Lends : State::KeepsToItself;
    if (!lends) continue;
    seen.mapped = point.material.normal;
    seen.width = std::clamp(static_cast<float>(point.material.roughness) / kSmooth, kLeastWidth, 1.0F);
    seen.matte = glm::vec3(point.bsdf.weight(Lobe::Diffuse));
    seen.mirrored = glm::vec3(0.0F);
    seen.is_split = seen.width < 1.0F && seen.matte != glm::vec3(0.0F) && tells_matte(context);
    for (const Lobe lobe : {Lobe::Reflection, Lobe::Transmission}) {
      seen.mirrored += glm::vec3(point.bsdf.weight(lobe));
      if (point.bsdf.present(lobe) && !context.follows_for_itself(point.bsdf, lobe)) seen.is_split = false;
    }
    some_split_ |= seen.is_split;
  }
}

FilterCenter<float> Denoiser::center_of(const View& view, const Sight& sight, std::uint32_t pixel) {
  FilterCenter<float> center;
  center.material = sight.material;
  center.position = sight.place;
  center.max_distance2 = most_apart2(view, sight.place);
  center.max_bend2 = square(kMostBent);
  center.max_ratio = kMostBrighter;
  center.min_ratio = 1.0F / kMostBrighter;
  center.pixel = {pixel % kTileSide, pixel / kTileSide};
  return center;
}

template <typename Body>
void Denoiser::each_sum(const Body& body) const {
  for (std::size_t i = 0; i < sums_; ++i) body(i);
}

/// Light of small lights has no noise that sharing would take, and shadows with edges.
bool Denoiser::keeps(const LightContext& context, std::size_t sum) {
  return keeps_direct(context.scene) && (sum == 0 || sum == 1 + kDirect || sum == 1 + kShadow);
}

void Denoiser::set_sights(const TileJob& job) {
  NeighborFeatures<float>& taps = *taps_;
  for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) {
    const std::uint32_t own = job.first_pixel + pixel;
    const std::size_t at = plane_index(pixel);
    taps.kinds.at(at) = NeighborFeatures<float>::kNoTap;
    if (states_[own] != State::Lends) continue;
    const Seen& seen = seen_[own];
    taps.kinds.at(at) = tap_kind(seen.sight.material, seen.is_split);
    taps.position.set(at, seen.sight.place);
    taps.normal.set(at, seen.sight.normal);
    taps.shading_normal.set(at, seen.mapped);
    for (const FilterLobe lobe : {FilterLobe::All, FilterLobe::Specular, FilterLobe::Diffuse}) {
      taps.scattering[static_cast<std::size_t>(lobe)].set(at, scattering_of(seen, lobe));
    }
    taps.sharpness.at(at) = 1.0F / square(seen.width);
  }
}

void Denoiser::set_lent(const LightContext& context, const TileJob& job, const PixelSums& sums) {
  const auto set = [&](TapVectors<double>& lent, const auto& light_of) {
    for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) {
      const std::uint32_t own = job.first_pixel + pixel;
      lent.set(plane_index(pixel), states_[own] == State::Lends ? light_of(own) : glm::dvec3(0.0));
    }
  };
  const auto kept = [&](std::size_t part, std::uint32_t pixel) {
    return sums.components.at(part)[pixel] - sums.diffuse_components.at(part)[pixel];
  };
  lent_.resize(sums_);
  if (some_split_) matte_.resize(sums_);
  if (keeps_direct(context.scene)) kept_.resize(sums_);
  each_sum([&](std::size_t i) {
    set(lent_[i], [&](std::uint32_t pixel) { return sum_of(sums, i)[pixel]; });
    if (some_split_) set(matte_[i], [&](std::uint32_t pixel) { return diffuse_of(sums, i)[pixel]; });
    if (!keeps(context, i)) return;
    set(kept_[i],
        [&](std::uint32_t pixel) { return i == 0 ? kept(kDirect, pixel) + kept(kShadow, pixel) : kept(i - 1, pixel); });
  });
}

void Denoiser::add_background(const LightContext& context, const Look& look, const glm::dvec3& direction) {
  const glm::dvec3 light = look.share * context.lights.environment(direction);
  filtered_[0][look.pixel] += light;
  if (sums_ > 1) filtered_[1 + static_cast<std::size_t>(Component::Direct)][look.pixel] += light;
}

bool Denoiser::add_lent(const LightContext& context, const TileJob& job, const Look& look, const Sight& seen) {
  const Material& material = context.scene.materials[seen.material];
  if (material.unlit || material.emissive != glm::vec3(0.0F)) return false;  // what emits lends nothing
  const int radius = job.number.sample == 0 ? 2 : 1;
  FilterCenter<float> center = center_of(*job.view, seen, look.pixel);
  center.normal = seen.normal;
  center.sharpness = sharpness_of(narrowed_);
  center.offset = look.place - glm::vec2(job.view->jitter);  // from what the pixel's own sample sees
  center.window = window_about(center.pixel, center.offset, radius);
  center.reach = static_cast<float>(radius) + 1.0F;
  center.is_pixel = false;
  joint_bilateral_weights(*taps_, center, weights_);
  if (weights_.sum == 0.0F) return false;
  each_sum([&](std::size_t i) { filtered_.at(i)[look.pixel] += look.share * filtered_mean(weights_, lent_[i]); });
  return true;
}

/// What one of the rays traced sees, which is one of the looks at a pixel.
void Denoiser::add_look(const LightContext& context, const TileJob& job, RayBuffers& buffers, const Look& look,
                        std::size_t ray, std::vector<PathPoint>& alone) {
  const RayRequest& request = buffers.requests[ray];
  if (buffers.hits[ray] == kNoSurface) return add_background(context, look, request.direction);
  const WorldTriangle& triangle = buffers.triangles.load(context.surfaces, buffers.hits[ray]);
  const SurfacePoint surface = context.surfaces.meet(triangle, request.origin, request.direction);
  if (add_lent(context, job, look, sight_of(surface, job.view->eye))) return;
  PathPoint& point = alone.emplace_back();
  point.surface = surface;
  start_point(context, job, static_cast<int>(look.pixel) % kTileSide, static_cast<int>(look.pixel) / kTileSide,
              look.share, point);
  point.sampler = point.sampler.branch(kLookBranch + look.number);
  point.pixel = spare_ + look.pixel;
}

/// The brightest of the pixels about one that are lit.
double Denoiser::brightest_about(const PixelSums& sums, const TileJob& job, int column, int row) {
  const Rect about{column - 1, row - 1, column + 2, row + 2};
  const Rect pixels = intersection(about, {0, 0, job.place.width(), job.place.height()});
  double found = 0.0;
  for (int y = pixels.y0; y < pixels.y1; ++y) {
    for (int x = pixels.x0; x < pixels.x1; ++x) {
      const std::size_t pixel = index_of(x, y);
      if ((x == column && y == row) || !job.wants(pixel)) continue;
      found = std::max(found, brightness(sums.radiance[job.first_pixel + pixel]));
    }
  }
  return found;
}

void Denoiser::set_apart(const PixelSums& sums, const TileJob& job) {
  std::vector<std::size_t> apart;
  for (int y = 0; y < job.place.height(); ++y) {
    for (int x = 0; x < job.place.width(); ++x) {
      const std::size_t own = job.first_pixel + index_of(x, y);
      if (states_[own] == State::Unlit) continue;
      const glm::dvec3& light = sums.radiance[own];
      const bool is_far_brighter =
          states_[own] == State::Lends && brightness(light) > kFarBrighter * brightest_about(sums, job, x, y);
      if (!fits_floats(light) || is_far_brighter) apart.push_back(own);
    }
  }
  for (const std::size_t pixel : apart) states_[pixel] = State::Apart;
}

void Denoiser::set_unexpected_apart(const TileJob& job, std::span<const PixelPart> parts) {
  const glm::vec2 place(job.view->jitter);
  for (auto part = parts.begin(); part != parts.end();) {
    const std::uint32_t pixel = part->pixel;
    const auto next = std::find_if(part, parts.end(), [&](const PixelPart& each) { return each.pixel != pixel; });
    const std::uint32_t own = job.first_pixel + pixel;
    const Sight seen = states_[own] == State::Unlit ? Sight{} : seen_[own].sight;
    const bool is_expected =
        std::any_of(part, next, [&](const PixelPart& each) { return each.is_like(*job.view, seen, place); });
    if (job.wants(pixel) && !is_expected) states_[own] = State::Apart;
    part = next;
  }
}

void Denoiser::look_again(const LightContext& context, const TileJob& job, const TileParts& again, RayBuffers& buffers,
                          PixelSums& sums, std::vector<PathPoint>& alone) {
  set_apart(sums, job);
  each_sum([&](std::size_t i) {
    filtered_.at(i).assign(kTilePixels, glm::dvec3(0.0));
    std::fill_n(sum_of(sums, i).begin() + spare_, kTilePixels, glm::dvec3(0.0));
  });
  narrowed_ = 1.0F / std::sqrt(std::sqrt(1.0F + static_cast<float>(job.number.sample)));
  set_unexpected_apart(job, again.parts);
  set_sights(job);
  set_lent(context, job, sums);
  View view = unjittered(job);
  buffers.requests.clear();
  looks_.clear();
  for (const PixelPart& part : again.parts) {
    if (!job.wants(part.pixel) || states_[job.first_pixel + part.pixel] == State::Apart) continue;
    look_at_part(context, job, buffers, sums, view, part, *again.places);
  }
  trace_from_eye(context, buffers);
  for (std::size_t i = 0; i < looks_.size(); ++i) add_look(context, job, buffers, looks_[i], i, alone);
  for (PathPoint& point : alone) finish_point(context, point);
}

/// Asks for a ray where nobody lends.
void Denoiser::look_at_part(const LightContext& context, const TileJob& job, RayBuffers& buffers, PixelSums& sums,
                            View& view, const PixelPart& part, const Looks& places) {
  if (part.shows == PixelPart::Shows::Background) {
    const Look look{part.pixel, 0, part.place(places, job.number.sample), part.share};
    return add_background(context, look, ray_through(view, job, look.pixel, look.place).direction);
  }
  const bool is_surface = part.shows == PixelPart::Shows::Surface;
  const std::uint32_t count = is_surface ? std::clamp(part.count(), 1U, kLooksAgain) : kLooksAtMany;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t number = looks_.empty() || looks_.back().pixel != part.pixel ? 0 : looks_.back().number + 1;
    const glm::vec2 place = part.place(places, job.number.sample * count + i);
    const Look look{part.pixel, number, place, part.share / static_cast<float>(count)};
    if (is_surface && add_lent(context, job, look, part.patch.at(place))) continue;
    looks_.push_back(look);
    buffers.requests.push_back(ray_through(view, job, look.pixel, place));
    sums.charge_ray(job.first_pixel + look.pixel);
  }
}

glm::vec3 Denoiser::scattering_of(const Seen& seen, FilterLobe lobe) {
  if (lobe == FilterLobe::All) return seen.mirrored + seen.matte;
  return lobe == FilterLobe::Diffuse ? seen.matte : seen.mirrored;
}

FilterCenter<float> Denoiser::center_at(const TileJob& job, std::uint32_t pixel, FilterLobe lobe) const {
  const Seen& seen = seen_[job.first_pixel + pixel];
  const float width = lobe == FilterLobe::Diffuse ? 1.0F : seen.width;
  const int radius = (width < 1.0F ? 1 : 2) + (job.number.sample == 0 ? 1 : 0);
  FilterCenter<float> center = center_of(*job.view, seen.sight, pixel);
  center.separate_diffuse = seen.is_split;
  center.normal = seen.mapped;
  center.sharpness = sharpness_of(narrowed_ * width);
  center.neighbor_weight = width / (1.0F + static_cast<float>(job.number.sample) / kNeighbourSamples);
  center.terms[0] = {static_cast<std::size_t>(lobe), scattering_of(seen, lobe)};
  center.term_count = 1;
  center.window = window_about(center.pixel, center.offset, radius);
  center.reach = static_cast<float>(radius) + 1.0F;
  return center;
}

void Denoiser::share(const LightContext& context, const TileJob& job, std::uint32_t pixel) {
  const bool is_split = seen_[job.first_pixel + pixel].is_split;
  const std::size_t own = plane_index(pixel);
  joint_bilateral_weights(*taps_, center_at(job, pixel, is_split ? FilterLobe::Specular : FilterLobe::All), weights_);
  if (is_split) joint_bilateral_weights(*taps_, center_at(job, pixel, FilterLobe::Diffuse), matte_weights_);
  each_sum([&](std::size_t i) {
    glm::dvec3& sum = filtered_.at(i)[pixel];
    sum = filtered_mean(weights_, lent_[i]);
    if (is_split) sum += filtered_mean(matte_weights_, matte_[i]) - filtered_mean(weights_, matte_[i]);
    if (keeps(context, i)) sum += kept_[i].at(own) - filtered_mean(weights_, kept_[i]);
  });
}

void Denoiser::resolve(const LightContext& context, const TileJob& job, const TileParts& again, PixelSums& sums) {
  for (int y = 0; y < job.place.height(); ++y) {
    for (int x = 0; x < job.place.width(); ++x) {
      const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
      if (!job.wants(pixel)) continue;
      const std::uint32_t own = job.first_pixel + pixel;
      if (sums.wants_cost) sums.cost[own] += std::exchange(sums.cost[spare_ + pixel], 0.0F);
      const bool is_crossed = again.crossed[pixel] != 0 && states_[own] != State::Apart;
      if (is_crossed) {
        each_sum([&](std::size_t i) { filtered_.at(i)[pixel] += sum_of(sums, i)[spare_ + pixel]; });
      } else if (states_[own] == State::Lends) {
        share(context, job, pixel);
      } else {
        each_sum([&](std::size_t i) { filtered_.at(i)[pixel] = sum_of(sums, i)[own]; });
      }
    }
  }
  each_sum([&](std::size_t i) { std::ranges::copy(filtered_.at(i), sum_of(sums, i).begin() + job.first_pixel); });
}

}  // namespace hpr
