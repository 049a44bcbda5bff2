#include "rt/denoise/denoiser.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "rt/passes/pixel_sums.h"
#include "scene/points_lines.h"

namespace hpr {
namespace {

/// Branches of a pixel's sampler.
constexpr std::uint32_t kSubpixelBranch = 0x4C4F4F4BU;

/// Distance of unit normals at which the weight falls to 0, in a frame's first sample.
constexpr float kNormalWidth = 0.9F;
/// On surfaces smoother than this roughness normals must be closer and neighbours count less, in proportion down to a
/// tenth: what mirrors show changes quickly with their normal and with the place.
constexpr float kSmooth = 0.5F;
constexpr float kMinWidth = 0.1F;
/// Subpixel samples of a fragment that shows one surface, and of one that shows many.
constexpr std::uint32_t kSurfaceSamples = 2;
constexpr std::uint32_t kMixedSamples = 4;
/// Samples after which neighbours count less.
constexpr float kNeighbourSamples = 16.0F;
/// What is so many times as bright as all pixels about is rare light that few samples have found yet: filtered like
/// the rest it would make blotches, left alone salt.
constexpr double kFarBrighter = 3.0;
/// Of what is beyond, pixels about share this multiple of the rest; more would show, and is left out.
constexpr double kShared = 2.0;
/// A lobe whose alpha is so many times the angle of a pixel blurs what it shows over the pixels about: it is four times
/// as wide.
constexpr double kBlurringAngles = 1.0;
/// Below it a lobe shows points and lines.
constexpr float kMinBlur = 0.25F;
/// In place of the brightness of a pixel that the tile does not know.
constexpr double kUnknown = -1.0;
/// Bound of the ratio of scattered fractions, either way.
constexpr float kMaxRatio = 4.0F;
/// One for each FilterLobe.
constexpr std::size_t kLobePlanes = 3;
constexpr auto kDirect = static_cast<std::size_t>(Component::Direct);
constexpr auto kShadow = static_cast<std::size_t>(Component::Shadow);

float square(float value) {
  return value * value;
}

/// FilterCenter::sharpness for so narrow a width, relative to kNormalWidth.
float sharpness_of(float width) {
  return 1.0F / square(kNormalWidth * width);
}

std::size_t index_of(int column, int row) {
  return static_cast<std::size_t>(row) * kTileSide + static_cast<std::size_t>(column);
}

std::size_t plane_index(std::uint32_t pixel) {
  return TapPlanes::index(static_cast<int>(pixel) % kTileSide, static_cast<int>(pixel) / kTileSide);
}

bool is_in_tile(const TileJob& job, const glm::ivec2& pixel) {
  return std::min(pixel.x, pixel.y) >= 0 && pixel.x < job.rect.width() && pixel.y < job.rect.height();
}

bool is_on_screen(const TileJob& job, std::size_t at) {
  const glm::ivec2 pixel = job.origin() + TapPlanes::pixel_at(at);
  const Size& screen = job.view->screen;
  return std::min(pixel.x, pixel.y) >= 0 && pixel.x < screen.width && pixel.y < screen.height;
}

/// Whether a surface is so flat that what a lobe of that alpha shows beside it is the same, but for the blur.
bool is_flat(const NeighborFeatures<float>& taps, std::size_t at, float alpha) {
  for (const std::size_t step : {std::size_t{1}, std::size_t{TapPlanes::kStride}}) {
    bool has_neighbor = false;
    for (const std::size_t about : {at - step, at + step}) {
      if (taps.kinds.at(about) != taps.kinds.at(at)) continue;
      has_neighbor = true;
      const glm::vec3 turned = taps.shading_normal.at(about) - taps.shading_normal.at(at);
      if (glm::dot(turned, turned) > square(alpha)) return false;
    }
    if (!has_neighbor) return false;
  }
  return true;
}

/// Calls `body` with the 8 pixels about one, indices of planes.
template <typename Body>
void each_about(std::size_t at, const Body& body) {
  for (const std::size_t row : {at - TapPlanes::kStride, at, at + TapPlanes::kStride}) {
    for (const std::size_t about : {row - 1, row, row + 1}) {
      if (about != at) body(about);
    }
  }
}

/// The least of a tap and of those about it that show the like.
float least_about(const NeighborFeatures<float>& taps, const std::array<float, TapPlanes::kSize>& values,
                  std::size_t at) {
  float least = values.at(at);
  each_about(at, [&](std::size_t about) {
    if (taps.kinds.at(about) == taps.kinds.at(at)) least = std::min(least, values.at(about));
  });
  return least;
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

int Denoiser::reach(std::uint32_t sample) {
  return sample == 0 ? TapPlanes::kMaxRadius + 1 : TapPlanes::kMaxRadius;
}

void Denoiser::start(std::size_t samples, std::size_t margins, bool with_components) {
  sums_ = with_components ? 1 + kComponents : 1;
  spare_ = static_cast<std::uint32_t>(samples * kTilePixels);
  states_.assign((samples + (margins > 0 ? 1 : 0) + margins) * kTilePixels, State::Unlit);
  pixel_features_.resize(states_.size());
  some_separate_ = false;
  if (!taps_) {
    taps_ = std::make_unique<NeighborFeatures<float>>();
    taps_->scattering.resize(kLobePlanes);
  }
}

/// Sampled lights bring light by all lobes together: where it does not stay with its pixel, the diffuse part is not
/// known.
bool Denoiser::knows_diffuse(const LightContext& context) {
  return keeps_direct(context.scene) || (context.lights.enumerated() == 0 && !context.lights.has_tree());
}

void Denoiser::add_vertices(const LightContext& context, std::span<const PathVertex> points) {
  for (const PathVertex& point : points) {
    State& state = states_[point.pixel];
    const bool is_tap = state == State::Unlit && point.throughput == glm::dvec3(1.0) && point.coverage == 1.0 &&
                        point.material.emission == glm::dvec3(0.0);
    PixelFeature& seen = pixel_features_[point.pixel];
    if (state == State::Unlit) seen.feature = feature_at(point.surface, context.view->eye);
    state = is_tap ? State::Tap : State::Alone;
    if (!is_tap) continue;
    seen.shading_normal = point.material.normal;
    double roughness = point.material.roughness;
    if (point.bsdf.present(Lobe::Coat)) roughness = std::min(roughness, point.bsdf.roughness(Lobe::Coat));
    seen.width = std::clamp(static_cast<float>(roughness) / kSmooth, kMinWidth, 1.0F);
    seen.alpha = roughness < Bsdf::kDeltaRoughness ? 0.0F : static_cast<float>(roughness * roughness);
    seen.blur = 0.0F;
    seen.diffuse = glm::vec3(point.bsdf.weight(Lobe::Diffuse));
    seen.specular = glm::vec3(0.0F);
    seen.separate_diffuse = seen.width < 1.0F && seen.diffuse != glm::vec3(0.0F) && knows_diffuse(context);
    for (const Lobe lobe : point.bsdf.lobes().subspan(1)) {
      seen.specular += glm::vec3(point.bsdf.weight(lobe));
      if (point.bsdf.present(lobe) && !context.follows_for_itself(point.bsdf, lobe)) seen.separate_diffuse = false;
    }
    some_separate_ |= seen.separate_diffuse;
  }
}

FilterCenter<float> Denoiser::center_of(const View& view, const SurfaceFeature& feature, std::uint32_t pixel) {
  FilterCenter<float> center;
  center.material = feature.material;
  center.position = feature.position;
  center.max_distance2 = max_distance2(view, feature.position);
  center.max_bend2 = square(kMaxBend);
  center.max_ratio = kMaxRatio;
  center.min_ratio = 1.0F / kMaxRatio;
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

glm::dvec3 Denoiser::kept_light(const PixelSums& sums, std::size_t sum, std::uint32_t pixel) {
  const auto kept = [&](std::size_t component) {
    return sums.components.at(component)[pixel] - sums.diffuse_components.at(component)[pixel];
  };
  return sum == 0 ? kept(kDirect) + kept(kShadow) : kept(sum - 1);
}

template <typename Body>
void Denoiser::each_pixel(const TileJob& job, std::span<const TileJob> margin, const Body& body) {
  for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) body(job.first_pixel + pixel, plane_index(pixel));
  for (const TileJob& strip : margin) {
    for (int y = 0; y < strip.rect.height(); ++y) {
      for (int x = 0; x < strip.rect.width(); ++x) {
        body(strip.first_pixel + static_cast<std::uint32_t>(index_of(x, y)),
             TapPlanes::index(strip.rect.x0 - job.rect.x0 + x, strip.rect.y0 - job.rect.y0 + y));
      }
    }
  }
}

void Denoiser::set_taps(const TileJob& job, std::span<const TileJob> margin) {
  NeighborFeatures<float>& taps = *taps_;
  taps.kinds.fill(NeighborFeatures<float>::kNoTap);
  each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
    if (states_[own] != State::Tap) return;
    const PixelFeature& seen = pixel_features_[own];
    taps.kinds.at(at) = tap_kind(seen.feature.material, seen.separate_diffuse);
    taps.position.set(at, seen.feature.position);
    taps.normal.set(at, seen.feature.normal);
    taps.shading_normal.set(at, seen.shading_normal);
    for (const FilterLobe lobe : {FilterLobe::All, FilterLobe::Specular, FilterLobe::Diffuse}) {
      taps.scattering[static_cast<std::size_t>(lobe)].set(at, scattering_of(seen, lobe));
    }
    taps.sharpness.at(at) = 1.0F / square(seen.width);
  });
}

void Denoiser::set_blur(const LightContext& context, const TileJob& job, std::span<const TileJob> margin,
                        const PixelSums& sums) {
  const PixelFootprint footprint = footprint_of(*context.view);
  each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
    if (states_[own] == State::Tap) distance_.at(at) = sums.distance[own];
  });
  each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
    PixelFeature& seen = pixel_features_[own];
    if (states_[own] != State::Tap || seen.alpha == 0.0F || seen.width == 1.0F || !is_flat(*taps_, at, seen.alpha))
      return;
    // The angle that a pixel of what the surface shows takes of the lobe.
    const auto distance = static_cast<double>(least_about(*taps_, distance_, at));
    const auto to_eye = static_cast<double>(glm::length(seen.feature.position));
    const double angle = footprint.metres * (footprint.orthographic ? 1.0 / distance : 1.0 + to_eye / distance);
    seen.blur = static_cast<float>(std::min(1.0, static_cast<double>(seen.alpha) / (kBlurringAngles * angle)));
  });
}

void Denoiser::set_light(const LightContext& context, const TileJob& job, std::span<const TileJob> margin,
                         const PixelSums& sums) {
  const auto set = [&](TapVectors<double>& lent, const auto& light_of) {
    each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
      lent.set(at, states_[own] == State::Tap ? light_of(own) : glm::dvec3(0.0));
    });
  };
  light_.resize(sums_);
  if (some_separate_) diffuse_light_.resize(sums_);
  if (keeps_direct(context.scene)) kept_light_.resize(sums_);
  each_sum([&](std::size_t i) {
    set(light_[i], [&](std::uint32_t pixel) { return sum_of(sums, i)[pixel]; });
    if (some_separate_) set(diffuse_light_[i], [&](std::uint32_t pixel) { return diffuse_of(sums, i)[pixel]; });
    if (!keeps(context, i)) return;
    set(kept_light_[i], [&](std::uint32_t pixel) { return kept_light(sums, i, pixel); });
  });
}

void Denoiser::add_background(const LightContext& context, const SubpixelSample& sample, const glm::dvec3& direction) {
  const glm::dvec3 light = sample.fraction * context.background(direction);
  if (!uncovered_.empty()) uncovered_[sample.pixel] += sample.fraction;
  filtered_[0][sample.pixel] += light;
  if (sums_ > 1) filtered_[1 + static_cast<std::size_t>(Component::Direct)][sample.pixel] += light;
}

bool Denoiser::add_filtered(const LightContext& context, const TileJob& job, const SubpixelSample& sample,
                            const SurfaceFeature& seen) {
  const Material& material = context.scene.materials[seen.material];
  if (material.unlit || material.emissive != glm::vec3(0.0F)) return false;  // surfaces that emit are no taps
  const int radius = job.number.sample == 0 ? 2 : 1;
  FilterCenter<float> center = center_of(*job.view, seen, sample.pixel);
  center.normal = seen.normal;
  center.sharpness = sharpness_of(narrowed_);
  center.offset = sample.position - glm::vec2(job.view->jitter);  // from what the pixel's own sample sees
  center.window = window_about(center.pixel, center.offset, radius);
  center.reach = static_cast<float>(radius) + 1.0F;
  center.is_pixel = false;
  joint_bilateral_weights(*taps_, center, weights_);
  if (weights_.sum == 0.0F) return false;
  each_sum(
      [&](std::size_t i) { filtered_.at(i)[sample.pixel] += sample.fraction * filtered_mean(weights_, light_[i]); });
  return true;
}

/// Adds the subpixel sample that a ray was traced for.
void Denoiser::add_sample(const LightContext& context, const TileJob& job, RayBuffers& buffers,
                          const SubpixelSample& sample, std::size_t ray, std::vector<PathVertex>& unfiltered) {
  const RayRequest& request = buffers.requests[ray];
  if (buffers.hits[ray] == kNoSurface) return add_background(context, sample, request.direction);
  const WorldTriangle& triangle = buffers.triangles.load(context.surfaces, buffers.hits[ray]);
  const SurfacePoint surface = context.surfaces.meet(triangle, request.origin, request.direction);
  if (add_filtered(context, job, sample, feature_at(surface, job.view->eye))) return;
  PathVertex& point = unfiltered.emplace_back(surface);
  start_vertex(context, job, static_cast<int>(sample.pixel) % kTileSide, static_cast<int>(sample.pixel) / kTileSide,
               sample.fraction, point);
  point.sampler = point.sampler.branch(kSubpixelBranch + sample.number);
  point.pixel = spare_ + sample.pixel;
}

/// About the most that a surface scatters of the sky: a sample that sees it where its neighbors do not is no brighter.
double Denoiser::sky_light(const LightContext& context, const PixelFeature& seen) {
  const glm::dvec3 scattering(scattering_of(seen, FilterLobe::All));
  return brightness(scattering) * context.lights.environment_irradiance(glm::dvec3(seen.shading_normal)) *
         std::numbers::inv_pi;
}

Denoiser::Surroundings Denoiser::surroundings_of(const TileJob& job, std::size_t at) const {
  const NeighborFeatures<float>& taps = *taps_;
  const TapVectors<float>& scattering = taps.scattering[static_cast<std::size_t>(FilterLobe::All)];
  Surroundings found;
  each_about(at, [&](std::size_t about) {
    const double light = brightness_.at(about);
    if (light == kUnknown) {
      found.is_known = found.is_known && !is_in_tile(job, TapPlanes::pixel_at(about));
      return;
    }
    found.brightest = std::max(found.brightest, light);
    const double scattered = brightness(glm::dvec3(scattering.at(about)));
    if (taps.kinds.at(about) == taps.kinds.at(at) && scattered > 0.0)
      found.irradiance = std::max(found.irradiance, light / scattered);
  });
  return found;
}

void Denoiser::set_apart(const LightContext& context, const PixelSums& sums, const TileJob& job,
                         std::span<const TileJob> margin) {
  excess_.clear();
  brightness_.fill(kUnknown);
  each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
    const bool is_lit = own >= spare_ || (is_in_tile(job, TapPlanes::pixel_at(at)) && job.wants(own - job.first_pixel));
    if (is_lit) brightness_.at(at) = brightness(sums.radiance[own]);
  });
  each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
    if (states_[own] == State::Unlit) return;
    const glm::dvec3& light = sums.radiance[own];
    if (!fits_floats(light)) states_[own] = State::Apart;
    if (states_[own] != State::Tap) return;
    const PixelFeature& seen = pixel_features_[own];
    const double sky = sky_light(context, seen);
    const Surroundings about = surroundings_of(job, at);
    if (!(brightness(light) > std::max(kFarBrighter * about.brightest, sky))) return;
    // What it shows may have lines and points, or nothing says how bright it should be.
    const bool shows_detail = seen.width < 1.0F && seen.blur < kMinBlur;
    if (shows_detail || !about.is_known || about.irradiance == 0.0) {
      states_[own] = State::Apart;
      return;
    }
    const double scattered = brightness(glm::dvec3(scattering_of(seen, FilterLobe::All)));
    const double expected = std::max(kFarBrighter * about.irradiance * scattered, sky);
    const double filtered = brightness(keeps(context, 0) ? light - kept_light(sums, 0, own) : light);
    if (!(filtered > expected)) return;
    const double beyond = 1.0 - expected / filtered;
    excess_.push_back({own, at, beyond, std::min(beyond, kShared * expected / filtered)});
  });
  std::ranges::sort(excess_, {}, &Excess::at);  // row by row, wherever tiles end
}

void Denoiser::take_excess(const LightContext& context) {
  for (const Excess& excess : excess_) {
    if (states_[excess.pixel] != State::Tap) continue;
    const auto scale = [&](TapVectors<double>& light, const glm::dvec3& kept) {
      const glm::dvec3 all = light.at(excess.at);
      light.set(excess.at, all - excess.fraction * (all - kept));
    };
    each_sum([&](std::size_t i) {
      scale(light_[i], keeps(context, i) ? kept_light_[i].at(excess.at) : glm::dvec3(0.0));
      if (some_separate_) scale(diffuse_light_[i], glm::dvec3(0.0));
    });
  }
}

double Denoiser::window_sum(const TileJob& job, std::size_t at, int radius) const {
  const bool is_own = is_in_tile(job, TapPlanes::pixel_at(at));
  double sum = 0.0;
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      const std::size_t about = at + static_cast<std::size_t>(y * TapPlanes::kStride + x);
      if (is_own ? brightness_.at(about) == kUnknown : !is_on_screen(job, about)) continue;
      sum += std::max(0.0, 1.0 - static_cast<double>(x * x + y * y) / square(static_cast<float>(radius + 1)));
    }
  }
  return sum;
}

/// By how much more of the light a tap scatters than the center of the term.
glm::dvec3 Denoiser::scattering_ratio(std::size_t tap, const ScatteringTerm<float>& term) const {
  const glm::dvec3 theirs(taps_->scattering[term.plane].at(tap));
  const glm::dvec3 own(term.own);
  glm::dvec3 ratio(1.0);
  for (int i = 0; i < 3; ++i) {
    if (own[i] != theirs[i]) ratio[i] = theirs[i] / own[i];
  }
  return ratio;
}

void Denoiser::add_share(const LightContext& context, const TileJob& job, const PixelSums& sums, const Excess& excess,
                         const glm::ivec2& to, const glm::dvec3& fraction) {
  if (!is_in_tile(job, to)) return;
  const auto pixel = static_cast<std::uint32_t>(index_of(to.x, to.y));
  if (!job.wants(pixel)) return;
  each_sum([&](std::size_t i) {
    glm::dvec3 light = sum_of(sums, i)[excess.pixel];
    if (keeps(context, i)) light -= kept_light(sums, i, excess.pixel);
    filtered_.at(i)[pixel] += excess.shared * fraction * light;
  });
}

void Denoiser::share_excess(const LightContext& context, const TileJob& job, const PixelSums& sums) {
  const int radius = reach(job.number.sample) - 1;
  for (const Excess& excess : excess_) {
    if (states_[excess.pixel] != State::Tap) continue;
    const PixelFeature& seen = pixel_features_[excess.pixel];
    FilterCenter<float> center = center_of(*job.view, seen.feature, 0);
    center.pixel = TapPlanes::pixel_at(excess.at);
    center.separate_diffuse = seen.separate_diffuse;
    center.normal = seen.shading_normal;
    center.sharpness = sharpness_of(narrowed_ * seen.width);
    center.terms[0] = {static_cast<std::size_t>(FilterLobe::All), scattering_of(seen, FilterLobe::All)};
    center.term_count = 1;
    center.window = window_about(center.pixel, center.offset, radius);
    center.reach = static_cast<float>(radius) + 1.0F;
    joint_bilateral_weights(*taps_, center, weights_);
    const double whole = window_sum(job, excess.at, radius);
    double left = 1.0;
    for (int y = 0; y < static_cast<int>(weights_.rows); ++y) {
      for (int x = 0; x < static_cast<int>(weights_.columns); ++x) {
        const float weight = weights_.terms[0].red.at(static_cast<std::size_t>(y) * TapWeights<float>::kPlaces +
                                                      static_cast<std::size_t>(x));
        if (weight == 0.0F) continue;
        const glm::ivec2 to = center.window.first + glm::ivec2(x, y);
        const glm::dvec3 tint = scattering_ratio(TapPlanes::index(to.x, to.y), center.terms[0]);
        const double fraction = static_cast<double>(weight) * tint.x / whole;  // the filter lends the other way round
        left -= fraction;
        add_share(context, job, sums, excess, to, fraction * tint);
      }
    }
    add_share(context, job, sums, excess, center.pixel, glm::dvec3(left));  // with what no pixel about takes
  }
}

void Denoiser::set_unexpected_apart(const TileJob& job, std::span<const CoverageFragment> fragments) {
  const glm::vec2 position(job.view->jitter);
  for (auto fragment = fragments.begin(); fragment != fragments.end();) {
    const std::uint32_t pixel = fragment->pixel;
    const auto next =
        std::find_if(fragment, fragments.end(), [&](const CoverageFragment& each) { return each.pixel != pixel; });
    const std::uint32_t own = job.first_pixel + pixel;
    const SurfaceFeature seen = states_[own] == State::Unlit ? SurfaceFeature{} : pixel_features_[own].feature;
    const bool is_expected = std::any_of(
        fragment, next, [&](const CoverageFragment& each) { return each.matches(*job.view, seen, position); });
    if (job.wants(pixel) && !is_expected) states_[own] = State::Apart;
    fragment = next;
  }
}

void Denoiser::resample_edges(const LightContext& context, const TileJob& job, std::span<const TileJob> margin,
                              const TileFragments& fragments, RayBuffers& buffers, PixelSums& sums,
                              std::vector<PathVertex>& unfiltered) {
  set_taps(job, margin);
  set_blur(context, job, margin, sums);
  set_apart(context, sums, job, margin);
  each_sum([&](std::size_t i) {
    filtered_.at(i).assign(kTilePixels, glm::dvec3(0.0));
    std::fill_n(sum_of(sums, i).begin() + spare_, kTilePixels, glm::dvec3(0.0));
  });
  uncovered_.assign(sums.wants_coverage ? kTilePixels : 0, 0.0);
  narrowed_ = 1.0F / std::sqrt(std::sqrt(1.0F + static_cast<float>(job.number.sample)));
  set_unexpected_apart(job, fragments.fragments);
  each_pixel(job, margin, [&](std::uint32_t own, std::size_t at) {
    if (states_[own] == State::Apart) taps_->kinds.at(at) = NeighborFeatures<float>::kNoTap;
  });
  set_light(context, job, margin, sums);
  take_excess(context);
  View view = unjittered(job);
  buffers.requests.clear();
  samples_.clear();
  for (const CoverageFragment& fragment : fragments.fragments) {
    if (!job.wants(fragment.pixel) || states_[job.first_pixel + fragment.pixel] == State::Apart) continue;
    sample_fragment(context, job, buffers, sums, view, fragment, *fragments.positions);
  }
  trace_primary_rays(context, buffers);
  for (std::size_t i = 0; i < samples_.size(); ++i) add_sample(context, job, buffers, samples_[i], i, unfiltered);
  for (PathVertex& point : unfiltered) finish_vertex(context, point);
}

/// Requests a ray where no tap has a weight.
void Denoiser::sample_fragment(const LightContext& context, const TileJob& job, RayBuffers& buffers, PixelSums& sums,
                               View& view, const CoverageFragment& fragment, const SubpixelOffsets& positions) {
  if (fragment.shows == CoverageFragment::Shows::Background) {
    const SubpixelSample sample{fragment.pixel, 0, fragment.position_at(positions, job.number.sample),
                                fragment.fraction};
    return add_background(context, sample, ray_through(view, job, sample.pixel, sample.position).direction);
  }
  const bool is_surface = fragment.shows == CoverageFragment::Shows::Surface;
  const std::uint32_t count = is_surface ? std::clamp(fragment.count(), 1U, kSurfaceSamples) : kMixedSamples;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t number =
        samples_.empty() || samples_.back().pixel != fragment.pixel ? 0 : samples_.back().number + 1;
    const glm::vec2 position = fragment.position_at(positions, job.number.sample * count + i);
    const SubpixelSample sample{fragment.pixel, number, position, fragment.fraction / static_cast<float>(count)};
    if (is_surface && add_filtered(context, job, sample, fragment.patch.at(position))) continue;
    samples_.push_back(sample);
    buffers.requests.push_back(ray_through(view, job, sample.pixel, position));
    sums.count_ray(job.first_pixel + sample.pixel);
  }
}

glm::vec3 Denoiser::scattering_of(const PixelFeature& seen, FilterLobe lobe) {
  if (lobe == FilterLobe::All) return seen.specular + seen.diffuse;
  return lobe == FilterLobe::Diffuse ? seen.diffuse : seen.specular;
}

FilterCenter<float> Denoiser::center_at(const TileJob& job, std::uint32_t pixel, FilterLobe lobe) const {
  const PixelFeature& seen = pixel_features_[job.first_pixel + pixel];
  const float width = lobe == FilterLobe::Diffuse ? 1.0F : std::max(seen.width, seen.blur);
  const int radius = (width < 1.0F ? 1 : 2) + (job.number.sample == 0 ? 1 : 0);
  FilterCenter<float> center = center_of(*job.view, seen.feature, pixel);
  center.separate_diffuse = seen.separate_diffuse;
  center.normal = seen.shading_normal;
  center.sharpness = sharpness_of(narrowed_ * (lobe == FilterLobe::Diffuse ? 1.0F : seen.width));
  center.neighbor_weight = width / (1.0F + static_cast<float>(job.number.sample) / kNeighbourSamples);
  center.terms[0] = {static_cast<std::size_t>(lobe), scattering_of(seen, lobe)};
  center.term_count = 1;
  center.window = window_about(center.pixel, center.offset, radius);
  center.reach = static_cast<float>(radius) + 1.0F;
  return center;
}

void Denoiser::filter(const LightContext& context, const TileJob& job, std::uint32_t pixel) {
  const bool separate_diffuse = pixel_features_[job.first_pixel + pixel].separate_diffuse;
  const std::size_t own = plane_index(pixel);
  joint_bilateral_weights(*taps_, center_at(job, pixel, separate_diffuse ? FilterLobe::Specular : FilterLobe::All),
                          weights_);
  if (separate_diffuse) joint_bilateral_weights(*taps_, center_at(job, pixel, FilterLobe::Diffuse), diffuse_weights_);
  each_sum([&](std::size_t i) {
    glm::dvec3& sum = filtered_.at(i)[pixel];
    sum = filtered_mean(weights_, light_[i]);
    if (separate_diffuse)
      sum += filtered_mean(diffuse_weights_, diffuse_light_[i]) - filtered_mean(weights_, diffuse_light_[i]);
    if (keeps(context, i)) sum += kept_light_[i].at(own) - filtered_mean(weights_, kept_light_[i]);
  });
}

void Denoiser::resolve(const LightContext& context, const TileJob& job, const TileFragments& fragments,
                       PixelSums& sums) {
  for (int y = 0; y < job.rect.height(); ++y) {
    for (int x = 0; x < job.rect.width(); ++x) {
      const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
      if (!job.wants(pixel)) continue;
      const std::uint32_t own = job.first_pixel + pixel;
      if (sums.wants_cost) sums.cost[own] += std::exchange(sums.cost[spare_ + pixel], 0.0F);
      const bool is_crossed = fragments.crossed[pixel] != 0 && states_[own] != State::Apart;
      if (is_crossed) {
        each_sum([&](std::size_t i) { filtered_.at(i)[pixel] += sum_of(sums, i)[spare_ + pixel]; });
        if (sums.wants_coverage) sums.uncovered[own] = uncovered_[pixel];
      } else if (states_[own] == State::Tap) {
        filter(context, job, pixel);
      } else {
        each_sum([&](std::size_t i) { filtered_.at(i)[pixel] = sum_of(sums, i)[own]; });
      }
    }
  }
  share_excess(context, job, sums);
  each_sum([&](std::size_t i) { std::ranges::copy(filtered_.at(i), sum_of(sums, i).begin() + job.first_pixel); });
}

}  // namespace hpr
