#include "rt/reference/path_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/timing.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/medium.h"
#include "rt/photons/photon_query.h"
#include "rt/ray_counts.h"
#include "rt/scratch_pool.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

/// What all paths share.
struct PathScene {
  const Scene& scene;
  const CoverageTraversal& rays;
  const LightSampler& lights;
  RaySpace space;
  Surfaces surfaces;
  PathSettings settings;
  bool has_single_sided = false;  ///< some material shows its front alone
};

/// A path on its way from the eye: the ray it goes next, and what must be known of the place it comes from.
struct Path {
  glm::dvec3 origin{0.0};  ///< world
  glm::dvec3 direction{0.0, 0.0, -1.0};
  glm::dvec3 throughput{1.0};  ///< what of the radiance met reaches the pixel
  glm::dvec3 followed{1.0};    ///< the part of throughput that came by lobes the passes follow
  glm::dvec3 from{0.0};        ///< where it was scattered last, and the normal (light_normal) lights were chosen by
  glm::dvec3 from_normal{0.0};
  double pdf = 0.0;             ///< of the direction it was sent in, per solid angle; 0: the only one
  double radiance_scale = 1.0;  ///< the part of throughput that is radiance squeezed by refraction, not energy lost
  double travelled = 0.0;       ///< metres before its origin: from the eye to the near plane
  double reach = 0.0;           ///< metres
  Media media;                  ///< that the ray goes through
  Sampler sampler;
  std::uint32_t pixel = 0;
  int segments = 1;   ///< including the one ahead
  bool looks = true;  ///< from the eye by followed lobes alone: it meets what is seen, not what light meets
  Faces faces = Faces::Front;
};

/// Light on its way to a path's surface, if nothing stands between.
struct ShadowRay {
  glm::dvec3 origin{0.0};  ///< world
  glm::dvec3 direction{0.0};
  double reach = 0.0;        ///< metres
  glm::dvec3 radiance{0.0};  ///< what reaches the pixel
  std::uint32_t pixel = 0;
};

/// The paths of some pixels, all in step: each step traces the rays of every path sorted by the lobe that sent them,
/// adds the light found, and leaves one ray or none for each path. So there are never more rays in flight than pixels.
class PathWavefront {
 public:
  explicit PathWavefront(const PathScene& shared) : shared_(shared) {}

  /// Starts with black pixels and no paths.
  void start(const View& view, std::size_t pixels);
  void add(const Path& path);
  /// Until every path has ended.
  void run();

  [[nodiscard]] const glm::dvec3& radiance(std::size_t pixel) const { return radiance_[pixel]; }
  /// Whether a path met a surface.
  [[nodiscard]] bool is_covered(std::size_t pixel) const { return covered_[pixel] != 0; }
  [[nodiscard]] PathCounts& counts() { return counts_; }

 private:
  /// In this order rays are traced: neighbours in a packet go about the same way. Those of the eye go first.
  static constexpr std::size_t kKinds = 1 + kLobes.size();
  static std::size_t kind_of(Lobe lobe) { return 1 + static_cast<std::size_t>(lobe); }

  void trace_paths();
  void arrive(Path& path, std::uint32_t surface);
  void miss(const Path& path);
  void add_emission(const Path& path, const SurfacePoint& point, std::uint32_t surface, const glm::dvec3& emission);
  void scatter(Path& path, const SurfacePoint& point, const MaterialPoint& material);
  void sample_light(Path& path, const SurfacePoint& point, const MaterialPoint& material, const Bsdf& bsdf,
                    const std::array<double, kLobes.size()>& chances);
  bool survives_roulette(Path& path);
  void trace_shadows();

  const PathScene& shared_;
  const View* view_ = nullptr;
  std::array<std::vector<Path>, kKinds> paths_;
  std::array<std::vector<Path>, kKinds> next_;
  std::vector<ShadowRay> shadows_;
  std::vector<glm::dvec3> radiance_;
  std::vector<std::uint8_t> covered_;
  PathCounts counts_;
  std::vector<RayRequest> requests_;
  std::vector<std::uint32_t> hits_;
  std::vector<float> passed_;  ///< per shadow ray: the share of its light that gets through
  TraversalScratch scratch_;
  std::uint16_t generation_ = 0;  ///< of the rays under way
  WorldTriangle triangle_;
};

/// The power heuristic with exponent 2: the weight of a direction found with density `own` where another technique has
/// `other`. As a ratio, so that large densities do not overflow.
double power_heuristic(double own, double other) {
  const double ratio = other / own;
  return 1.0 / (1.0 + ratio * ratio);
}

double sum_of(const glm::dvec3& v) {
  return v.x + v.y + v.z;
}

double largest(const glm::dvec3& v) {
  return std::max({v.x, v.y, v.z});
}

/// By how much radiance is squeezed (or, on its way out, stretched) where it is refracted.
double radiance_scale_of(const MaterialPoint& material, const SurfacePoint& point) {
  if (!material.solid || !(material.ior > 0.0)) return 1.0;
  const double squared = material.ior * material.ior;
  return point.inside ? squared : 1.0 / squared;
}

/// How likely each lobe is chosen: as much of the path's light as it scatters, by energy: so that clear glass changes
/// the weight of a path by nothing but the radiance_scale. False when no lobe is there.
bool choose_chances(const Bsdf& bsdf, const glm::dvec3& throughput, double radiance_scale,
                    std::array<double, kLobes.size()>& chances) {
  double sum = 0.0;
  for (std::size_t i = 0; i < bsdf.lobes().size(); ++i) {
    const glm::dvec3 part = throughput * bsdf.weight(kLobes[i]);
    chances[i] = part.x + part.y + part.z;
    if (kLobes[i] == Lobe::Transmission && bsdf.is_delta(kLobes[i])) chances[i] /= radiance_scale;
    sum += chances[i];
  }
  if (!(sum > 0.0) || !std::isfinite(sum)) return false;
  for (double& chance : chances) chance /= sum;
  return true;
}

struct Scattered {
  Scattering lobes;
  glm::dvec3 value{0.0};  ///< f, of all lobes with more than one direction
  double pdf = 0.0;       ///< of choosing such a lobe, and in it this direction
};

Scattered evaluate(const Bsdf& bsdf, const std::array<double, kLobes.size()>& chances, const glm::dvec3& direction) {
  Scattered scattered{.lobes = bsdf.scattering(direction)};
  for (std::size_t i = 0; i < bsdf.lobes().size(); ++i) {
    if (!(chances[i] > 0.0)) continue;
    scattered.value += scattered.lobes.value[i];
    scattered.pdf += chances[i] * scattered.lobes.pdf[i];
  }
  return scattered;
}

/// What share of the scattered light comes by lobes that the passes follow.
glm::dvec3 followed_share(const Bsdf& bsdf, const std::array<double, kLobes.size()>& chances,
                          const Scattered& scattered, double glossy_cutoff) {
  glm::dvec3 followed(0.0);
  for (std::size_t i = 0; i < bsdf.lobes().size(); ++i) {
    if (chances[i] > 0.0 && is_followed(bsdf, kLobes[i], glossy_cutoff)) followed += scattered.lobes.value[i];
  }
  glm::dvec3 fraction(0.0);
  for (int c = 0; c < 3; ++c) fraction[c] = scattered.value[c] > 0.0 ? followed[c] / scattered.value[c] : 0.0;
  return fraction;
}

/// Splits what a path carries on by chance: into what comes by lobes the passes follow, the share `followed` of it, and
/// the rest, which meet other faces. Returns whether it is the former, and weights the path's throughput by it.
bool looks_on(Path& path, const glm::dvec3& followed) {
  const double all = sum_of(path.throughput);
  const double looking = all > 0.0 ? std::clamp(sum_of(path.throughput * followed) / all, 0.0, 1.0) : 0.0;
  if (looking == 0.0 || looking == 1.0) return looking == 1.0;
  const bool looks = path.sampler.one() < looking;
  path.throughput *= looks ? followed / looking : (1.0 - followed) / (1.0 - looking);
  return looks;
}

std::size_t choose_lobe(const std::array<double, kLobes.size()>& chances, double u) {
  std::size_t last = 0;
  for (std::size_t i = 0; i < chances.size(); ++i) {
    if (!(chances[i] > 0.0)) continue;
    last = i;
    if (u < chances[i]) break;
    u -= chances[i];
  }
  return last;
}

void PathWavefront::start(const View& view, std::size_t pixels) {
  view_ = &view;
  radiance_.assign(pixels, glm::dvec3(0.0));
  covered_.assign(pixels, 0);
  for (auto& paths : paths_) paths.clear();
}

void PathWavefront::add(const Path& path) {
  paths_[0].push_back(path);
  ++counts_.paths;
}

void PathWavefront::run() {
  const auto some_left = [&] { return std::ranges::any_of(paths_, [](const auto& paths) { return !paths.empty(); }); };
  for (generation_ = 0; some_left(); ++generation_) {
    for (auto& paths : next_) paths.clear();
    shadows_.clear();
    trace_paths();
    trace_shadows();
    std::swap(paths_, next_);
  }
  counts_.cut += std::exchange(scratch_.cut, 0);
}

void PathWavefront::trace_paths() {
  requests_.clear();
  for (auto& paths : paths_) {
    for (Path& path : paths) {
      requests_.push_back({path.origin, path.direction, path.reach, &path.sampler, path.pixel, path.faces});
    }
  }
  hits_.resize(requests_.size());
  scratch_.batch.purpose = {generation_ == 0 ? RayKind::Primary : RayKind::Bounce, generation_};
  counts_.invalid += shared_.rays.closest(requests_, hits_, scratch_);
  counts_.primary += paths_[0].size();
  counts_.diffuse += paths_[kind_of(Lobe::Diffuse)].size();
  counts_.reflection += paths_[kind_of(Lobe::Reflection)].size() + paths_[kind_of(Lobe::Coat)].size();
  counts_.transmission +=
      paths_[kind_of(Lobe::Transmission)].size() + paths_[kind_of(Lobe::DiffuseTransmission)].size();
  std::size_t ray = 0;
  for (auto& paths : paths_) {
    for (Path& path : paths) {
      const std::uint32_t surface = hits_[ray++];
      if (surface == kNoSurface) {
        miss(path);
      } else {
        arrive(path, surface);
      }
    }
  }
}

void PathWavefront::miss(const Path& path) {
  const Background& background = shared_.settings.background;
  if (path.segments == 1 && background.kind != Background::Kind::Environment) {
    const bool shows = background.kind == Background::Kind::Color;
    if (shows) radiance_[path.pixel] += glm::dvec3(background.color.r, background.color.g, background.color.b);
    return;
  }
  // A background is a backdrop, to be looked at as unlit surfaces are: no light.
  const glm::dvec3 light = shared_.lights.environment(path.direction);
  if (!shared_.scene.environment) {
    radiance_[path.pixel] += path.throughput * path.followed * light;
    return;
  }
  double weight = 1.0;
  if (path.pdf > 0.0 && shared_.settings.technique != Technique::Surfaces) {
    const double by_light = shared_.lights.environment_pdf_any(path.from, path.from_normal, path.direction);
    if (by_light > 0.0) {
      weight = shared_.settings.technique == Technique::Lights ? 0.0 : power_heuristic(path.pdf, by_light);
    }
  }
  radiance_[path.pixel] += path.throughput * light * weight;
}

void PathWavefront::arrive(Path& path, std::uint32_t surface) {
  covered_[path.pixel] = 1;
  shared_.surfaces.load(surface, triangle_);
  const SurfacePoint point = shared_.surfaces.meet(triangle_, path.origin, path.direction);
  MaterialPoint material = evaluate_material(shared_.scene, point);
  const double metres = path.travelled + glm::distance(path.origin, point.position);
  path.throughput *= path.segments == 1 ? transmittance(path.media.here, metres)
                                        : transmittance_to(path.media, point, material, metres);
  if (material.unlit) {
    // A colour to be looked at, not light: seen, mirrored and seen through glass, as the passes show it.
    radiance_[path.pixel] += path.throughput * path.followed * material.emission;
    return;
  }
  if (material.emission != glm::dvec3(0.0)) add_emission(path, point, surface, material.emission);
  if (path.segments >= shared_.settings.max_depth) {
    ++counts_.too_long;
    return;
  }
  if (disperses(material) && !(Bsdf::shares_directions(material) && carries_channels(path.throughput))) {
    choose_channel(material, path.throughput, path.sampler.one());
  }
  scatter(path, point, material);
}

void PathWavefront::add_emission(const Path& path, const SurfacePoint& point, std::uint32_t surface,
                                 const glm::dvec3& emission) {
  double weight = 1.0;
  if (path.pdf > 0.0 && shared_.settings.technique != Technique::Surfaces) {
    const double by_light = shared_.lights.surface_pdf_any(path.from, path.from_normal, surface, point);
    if (by_light > 0.0) {
      weight = shared_.settings.technique == Technique::Lights ? 0.0 : power_heuristic(path.pdf, by_light);
    }
  }
  radiance_[path.pixel] += path.throughput * emission * weight;
}

void PathWavefront::scatter(Path& path, const SurfacePoint& point, const MaterialPoint& material) {
  const Bsdf bsdf(material, point);
  std::array<double, kLobes.size()> chances{};
  const double radiance_scale = radiance_scale_of(material, point);
  if (!choose_chances(bsdf, path.throughput, radiance_scale, chances)) return;
  sample_light(path, point, material, bsdf, chances);

  const std::size_t chosen = choose_lobe(chances, path.sampler.one());
  const Lobe lobe = kLobes[chosen];
  const auto sample = bsdf.sample(lobe, next_two(path.sampler, path.segments - 1));
  if (!sample) return;
  if (bsdf.is_delta(lobe)) {
    path.throughput *= sample->weight / chances[chosen];
    path.pdf = 0.0;
  } else {
    const Scattered scattered = evaluate(bsdf, chances, sample->direction);
    if (!(scattered.pdf > 0.0)) return;
    const double cosine = std::abs(glm::dot(material.normal, sample->direction));
    path.throughput *= scattered.value * (cosine / scattered.pdf);
    glm::dvec3 followed = followed_share(bsdf, chances, scattered, shared_.settings.glossy_cutoff);
    if (path.looks && shared_.has_single_sided) {
      path.looks = looks_on(path, followed);
      followed = glm::dvec3(path.looks ? 1.0 : 0.0);
    }
    path.followed *= followed;
    path.pdf = scattered.pdf;
  }
  if (lobe == Lobe::Transmission) path.radiance_scale *= radiance_scale;
  if (!survives_roulette(path)) return;
  path.media = media_towards(path.media, point, material, sample->direction);
  path.faces = path.looks && !leads_into_solid(point, material, sample->direction) ? Faces::Front : Faces::Both;
  path.origin = ray_origin(point, sample->direction);
  path.direction = sample->direction;
  path.reach = std::numeric_limits<double>::infinity();
  path.from = point.position;
  path.from_normal = bsdf.light_normal();
  path.travelled = 0.0;
  ++path.segments;
  next_[kind_of(lobe)].push_back(path);
}

void PathWavefront::sample_light(Path& path, const SurfacePoint& point, const MaterialPoint& material, const Bsdf& bsdf,
                                 const std::array<double, kLobes.size()>& chances) {
  const double u_choice = path.sampler.one();
  const glm::dvec2 u = next_two(path.sampler, path.segments - 1);
  const auto light = shared_.lights.sample_any(point.position, bsdf.light_normal(), *view_, u_choice, u);
  if (!light || light->weight == glm::dvec3(0.0)) return;
  const Technique technique = shared_.settings.technique;
  if (technique == Technique::Surfaces && light->pdf > 0.0) return;
  const Scattered scattered = evaluate(bsdf, chances, light->to_light);
  if (scattered.value == glm::dvec3(0.0)) return;
  double weight = std::abs(glm::dot(material.normal, light->to_light));
  if (technique == Technique::Both && light->pdf > 0.0) weight *= power_heuristic(light->pdf, scattered.pdf);
  glm::dvec3 radiance = path.throughput * scattered.value * light->weight * weight;
  if (!light->casts_shadows) {
    // The headlight shows what is looked at, as the passes have it: seen, mirrored and seen through glass.
    radiance_[path.pixel] += path.followed * radiance;
    return;
  }
  radiance *= transmittance_to_light(path.media, point, material, light->to_light, light->distance);

  ShadowRay& ray = shadows_.emplace_back();
  ray.pixel = path.pixel;
  ray.radiance = radiance;
  ray.origin = ray_origin(point, light->to_light);
  const bool viewers_side = glm::dot(light->to_light, point.geometric_normal) > 0.0;
  if (shared_.settings.terminator_fix && viewers_side) ray.origin += point.lift;
  ray.direction = light->to_light;
  ray.reach = light->distance;
  if (!std::isfinite(light->distance)) return;
  // Aimed from the moved origin, and stopped short of the light by what rounding may add, so that a light that lies on
  // a surface is not hidden by it.
  const glm::dvec3 to_goal = light->goal - ray.origin;
  const double distance = glm::length(to_goal);
  if (distance > 0.0) ray.direction = to_goal / distance;
  const double before =
      kOriginSteps * kFloatStep * distance + std::max(light->offset, shared_.space.rounding_at(light->goal));
  ray.reach = std::max(distance - before, 0.0);
}

bool PathWavefront::survives_roulette(Path& path) {
  if (!(largest(path.throughput) > 0.0)) return false;
  if (path.segments < shared_.settings.roulette_from) return true;
  const double chance = largest(path.throughput) / path.radiance_scale;
  if (chance >= 1.0) return true;
  if (path.sampler.one() >= chance) return false;
  path.throughput /= chance;
  return true;
}

void PathWavefront::trace_shadows() {
  requests_.clear();
  for (const ShadowRay& ray : shadows_) requests_.push_back({ray.origin, ray.direction, ray.reach, nullptr, ray.pixel});
  counts_.shadow += shadows_.size();
  passed_.resize(requests_.size());
  scratch_.batch.purpose = {RayKind::Shadow, static_cast<std::uint16_t>(generation_ + 1)};
  counts_.invalid += shared_.rays.passed(requests_, passed_, scratch_);
  for (std::size_t i = 0; i < shadows_.size(); ++i) {
    if (passed_[i] > 0.0F) radiance_[shadows_[i].pixel] += static_cast<double>(passed_[i]) * shadows_[i].radiance;
  }
}

/// Paths that go together. Enough to fill packets for some bounces, few enough to stay in the second-level cache.
constexpr int kRowsAtOnce = 16;

/// The path of one pixel, at the eye, which lies in `media`. The near plane cuts as it does in rasterised pictures.
Path path_from_eye(const View& view, const Media& media, const PathSettings& settings, int x, int y,
                   const SampleNumber& number) {
  Path path;
  path.sampler =
      Sampler(pixel_stream({settings.seed, number.frame}, view.screen_number, view.block.x0 + x, view.block.y0 + y),
              number.sample);
  const glm::dvec2 position = settings.spread_in_pixel ? path.sampler.two_of_pixel() : glm::dvec2(0.5);
  const Ray ray = view_ray(view, x + position.x, y + position.y);
  path.origin = ray.origin + view.near_distance * ray.direction;
  path.direction = glm::normalize(ray.direction);
  path.media = media;
  path.travelled = glm::distance(ray.origin, path.origin);
  path.reach = view.orthographic ? view.far_distance - view.near_distance : std::numeric_limits<double>::infinity();
  return path;
}

/// `pixel`: none where a neighbor that the screen is joined to counts it.
Rgb to_pixel(const glm::dvec3& radiance, const std::optional<ScreenPixel>& pixel, PathCounts& counts) {
  const Rgb color{static_cast<float>(radiance.r), static_cast<float>(radiance.g), static_cast<float>(radiance.b)};
  if (std::isfinite(color.r) && std::isfinite(color.g) && std::isfinite(color.b)) return color;
  if (pixel) {
    ++counts.not_finite;
    counts.first_not_finite = std::min(counts.first_not_finite, *pixel);
  }
  return {};
}

}  // namespace

PathCounts& PathCounts::operator+=(const PathCounts& other) {
  paths += other.paths;
  primary += other.primary;
  diffuse += other.diffuse;
  reflection += other.reflection;
  transmission += other.transmission;
  shadow += other.shadow;
  invalid += other.invalid;
  cut += other.cut;
  too_long += other.too_long;
  not_finite += other.not_finite;
  first_not_finite = std::min(first_not_finite, other.first_not_finite);
  return *this;
}

struct PathTracer::State {
  explicit State(PathScene scene) : shared(std::move(scene)), media(shared.scene) {}

  PathScene shared;
  MediumFinder media;
  ScratchPool<PathWavefront> waves;
  PathCounts counts;

  void add_paths(PathWavefront& wave, const View& view, const Media& eye, const Rect& tile, const Rect& rows,
                 const SampleNumber& number, std::span<const std::uint8_t> wanted) const;
  void trace_tile(PathWavefront& wave, const View& view, const Media& eye, const TilePlace& location,
                  const SampleNumber& number, std::span<const std::uint8_t> wanted, std::span<Rgb> pixels,
                  std::span<float> coverage) const;
};

/// Starts the paths of some rows of a tile, of pixels that are wanted.
void PathTracer::State::add_paths(PathWavefront& wave, const View& view, const Media& eye, const Rect& tile,
                                  const Rect& rows, const SampleNumber& number,
                                  std::span<const std::uint8_t> wanted) const {
  wave.start(view, static_cast<std::size_t>(rows.height()) * kTileSide);
  for (int y = rows.y0; y < rows.y1; ++y) {
    for (int x = rows.x0; x < rows.x1; ++x) {
      const auto pixel = static_cast<std::size_t>(y - tile.y0) * kTileSide + static_cast<std::size_t>(x - tile.x0);
      if (!wanted.empty() && wanted[pixel] == 0) continue;
      Path path = path_from_eye(view, eye, shared.settings, x, y, number);
      path.pixel = static_cast<std::uint32_t>((y - rows.y0) * kTileSide + x - tile.x0);
      wave.add(path);
    }
  }
}

void PathTracer::State::trace_tile(PathWavefront& wave, const View& view, const Media& eye, const TilePlace& location,
                                   const SampleNumber& number, std::span<const std::uint8_t> wanted,
                                   std::span<Rgb> pixels, std::span<float> coverage) const {
  const DenormalsAsZero mode;
  std::ranges::fill(pixels, Rgb{});
  std::ranges::fill(coverage, 0.0F);
  const Rect& rect = location.pixels;
  for (int top = rect.y0; top < rect.y1; top += kRowsAtOnce) {
    const int bottom = std::min(top + kRowsAtOnce, rect.y1);
    add_paths(wave, view, eye, rect, {rect.x0, top, rect.x1, bottom}, number, wanted);
    wave.run();
    for (int y = top; y < bottom; ++y) {
      for (int x = 0; x < rect.width(); ++x) {
        const auto from = static_cast<std::size_t>(y - top) * kTileSide + static_cast<std::size_t>(x);
        const auto to = static_cast<std::size_t>(y - rect.y0) * kTileSide + static_cast<std::size_t>(x);
        pixels[to] = to_pixel(wave.radiance(from), own_pixel(view, rect.x0 + x, y), wave.counts());
        if (!coverage.empty() && wave.is_covered(from)) coverage[to] = 1.0F;
      }
    }
  }
}

PathTracer::PathTracer(const Scene& scene, const CoverageTraversal& rays, const LightSampler& lights,
                       PathSettings settings, RayForwarding* others)
    : state_(std::make_unique<State>(
          PathScene{.scene = scene,
                    .rays = rays,
                    .lights = lights,
                    .space = RaySpace(scene),
                    .surfaces = Surfaces(scene, RaySpace(scene), true, others),
                    .settings = settings,
                    .has_single_sided = !std::ranges::all_of(scene.materials, shows_both_sides)})) {}
PathTracer::~PathTracer() = default;
PathTracer::PathTracer(PathTracer&&) noexcept = default;
PathTracer& PathTracer::operator=(PathTracer&&) noexcept = default;

const PathCounts& PathTracer::counts() const {
  return state_->counts;
}

void PathTracer::trace(std::span<const View> views, std::span<const std::size_t> tiles, const SampleNumber& number,
                       const PathOutput& output, const PixelMask* wanted) {
  const FrameLayout& layout = output.radiance->layout();
  HPR_CHECK(views.size() == layout.screens());
  for (std::size_t i = 0; i < views.size(); ++i) HPR_CHECK(views[i].size() == layout.size(i));

  State& state = *state_;
  const std::vector<Media> eyes = state.media.of_eyes(views);
  const auto trace_one = [&](std::size_t i) {
    const std::size_t tile = tiles[i];
    const trace::Span span("path trace tile", "tile", tile);
    const TilePlace location = layout.place(tile);
    output.radiance->set_active(tile);
    if (output.coverage != nullptr) output.coverage->set_active(tile);
    std::unique_ptr<PathWavefront> wave = state.waves.take(state.shared);
    state.trace_tile(*wave, views[location.screen], eyes[location.screen], location, number, mask_of(wanted, tile),
                     output.radiance->tile(tile),
                     output.coverage != nullptr ? output.coverage->tile(tile) : std::span<float>());
    state.waves.put_back(std::move(wave));
  };
  state.shared.rays.opaque().for_each(state.shared.settings.threads, tiles.size(), trace_one, CallMemory::Small);
  state.counts = {};
  for (const auto& wave : state.waves.all()) {
    state.counts += wave->counts();
    wave->counts() = {};
  }
}

}  // namespace hpr
