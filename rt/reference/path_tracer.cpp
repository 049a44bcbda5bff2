#include "rt/reference/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/timing.h"
#include "rt/passes/path_wave.h"
#include "rt/trace/denormals.h"

namespace hpr {
namespace {

/// Paths that go together. Enough to fill packets for some bounces, few enough to stay in the second-level cache.
constexpr int kRowsAtOnce = 16;

/// The path of one pixel, at the eye, which lies in `media`. The near plane cuts as it does in rasterised pictures.
Path path_from_eye(const View& view, const Media& media, const PathSettings& settings, int x, int y,
                   const SampleNumber& number) {
  Path path;
  path.sampler =
      Sampler(pixel_stream({settings.seed, number.frame}, view.screen_number, view.block.x0 + x, view.block.y0 + y),
              number.sample);
  const glm::dvec2 place = settings.spread_in_pixel ? path.sampler.two_of_pixel() : glm::dvec2(0.5);
  const Ray ray = view_ray(view, x + place.x, y + place.y);
  path.origin = ray.origin + view.near_distance * ray.direction;
  path.direction = glm::normalize(ray.direction);
  path.media = media;
  path.travelled = glm::distance(ray.origin, path.origin);
  path.reach = view.orthographic ? view.far_distance - view.near_distance : std::numeric_limits<double>::infinity();
  return path;
}

Rgb to_pixel(const glm::dvec3& radiance, const ScreenPixel& pixel, PathCounts& counts) {
  const Rgb color{static_cast<float>(radiance.r), static_cast<float>(radiance.g), static_cast<float>(radiance.b)};
  if (std::isfinite(color.r) && std::isfinite(color.g) && std::isfinite(color.b)) return color;
  ++counts.not_finite;
  counts.first_not_finite = std::min(counts.first_not_finite, pixel);
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
  std::vector<std::unique_ptr<PathWave>> idle;  ///< kept from tile to tile: fresh pages cost time
  std::mutex mutex;
  PathCounts counts;

  std::unique_ptr<PathWave> take_wave();
  void trace_tile(PathWave& wave, const View& view, const Media& eye, const TilePlace& place,
                  const SampleNumber& number, std::span<const std::uint8_t> wanted, std::span<Rgb> pixels) const;
};

std::unique_ptr<PathWave> PathTracer::State::take_wave() {
  {
    const std::lock_guard lock(mutex);
    if (!idle.empty()) {
      std::unique_ptr<PathWave> wave = std::move(idle.back());
      idle.pop_back();
      return wave;
    }
  }
  return std::make_unique<PathWave>(shared);
}

void PathTracer::State::trace_tile(PathWave& wave, const View& view, const Media& eye, const TilePlace& place,
                                   const SampleNumber& number, std::span<const std::uint8_t> wanted,
                                   std::span<Rgb> pixels) const {
  const DenormalsAsZero mode;
  std::ranges::fill(pixels, Rgb{});
  const Rect& rect = place.pixels;
  for (int top = rect.y0; top < rect.y1; top += kRowsAtOnce) {
    const int bottom = std::min(top + kRowsAtOnce, rect.y1);
    wave.start(view, static_cast<std::size_t>(bottom - top) * kTileSide);
    for (int y = top; y < bottom; ++y) {
      for (int x = rect.x0; x < rect.x1; ++x) {
        const auto pixel = static_cast<std::size_t>(y - rect.y0) * kTileSide + static_cast<std::size_t>(x - rect.x0);
        if (!wanted.empty() && wanted[pixel] == 0) continue;
        Path path = path_from_eye(view, eye, shared.settings, x, y, number);
        path.pixel = static_cast<std::uint32_t>((y - top) * kTileSide + x - rect.x0);
        wave.add(path);
      }
    }
    wave.run();
    for (int y = top; y < bottom; ++y) {
      for (int x = 0; x < rect.width(); ++x) {
        const auto from = static_cast<std::size_t>(y - top) * kTileSide + static_cast<std::size_t>(x);
        const auto to = static_cast<std::size_t>(y - rect.y0) * kTileSide + static_cast<std::size_t>(x);
        const ScreenPixel pixel{view.screen_number, view.block.y0 + y, view.block.x0 + rect.x0 + x};
        pixels[to] = to_pixel(wave.radiance(from), pixel, wave.counts());
      }
    }
  }
}

PathTracer::PathTracer(const Scene& scene, const RayScene& rays, const LightSet& lights, PathSettings settings)
    : state_(std::make_unique<State>(PathScene{.scene = scene,
                                               .rays = rays,
                                               .lights = lights,
                                               .space = RaySpace(scene.bounds),
                                               .surfaces = Surfaces(scene, RaySpace(scene.bounds)),
                                               .settings = settings,
                                               .has_coverage = has_coverage(scene)})) {}
PathTracer::~PathTracer() = default;
PathTracer::PathTracer(PathTracer&&) noexcept = default;
PathTracer& PathTracer::operator=(PathTracer&&) noexcept = default;

const PathCounts& PathTracer::counts() const {
  return state_->counts;
}

void PathTracer::trace(std::span<const View> views, std::span<const std::size_t> tiles, const SampleNumber& number,
                       TileLayer<Rgb>& radiance, const PixelMask* wanted) {
  const FrameLayout& layout = radiance.layout();
  HPR_CHECK(views.size() == layout.screens());
  for (std::size_t i = 0; i < views.size(); ++i) HPR_CHECK(views[i].size() == layout.size(i));

  State& state = *state_;
  const std::vector<Media> eyes = state.media.of_eyes(views);
  state.shared.rays.for_each(state.shared.settings.threads, tiles.size(), [&](std::size_t i) {
    const std::size_t tile = tiles[i];
    const trace::Span span("path trace tile", "tile", tile);
    const TilePlace place = layout.place(tile);
    radiance.set_active(tile);
    std::unique_ptr<PathWave> wave = state.take_wave();
    state.trace_tile(*wave, views[place.screen], eyes[place.screen], place, number, mask_of(wanted, tile),
                     radiance.tile(tile));
    const std::lock_guard lock(state.mutex);
    state.idle.push_back(std::move(wave));
  });
  state.counts = {};
  for (const auto& wave : state.idle) {
    state.counts += wave->counts();
    wave->counts() = {};
  }
}

}  // namespace hpr
