#include "rt/lighter.h"

#include <xmmintrin.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <mutex>
#include <optional>
#include <utility>

#include "core/check.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "rt/direct_light.h"
#include "rt/pass.h"

namespace hpr {
namespace {

/// Denormal numbers read and written as zero while it lives, as Embree advises; the thread's own mode returns after.
class FlushDenormals {
 public:
  FlushDenormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040U); }
  ~FlushDenormals() { _mm_setcsr(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned int before_;
};

/// The memory one thread needs for a tile. Kept from tile to tile: fresh pages would cost a tenth of the time.
struct Scratch {
  explicit Scratch(TileWork tile_work, std::size_t times) : work(std::move(tile_work)), ms(times, 0.0) {}
  TileWork work;
  Wave wave;
  Wave next;
  std::vector<double> ms;
};

// Where each step's time stands.
constexpr std::size_t kSurfaceStep = 0;
constexpr std::size_t kDirectStep = 1;
constexpr std::size_t kFirstPassStep = 2;

glm::dvec3 to_vector(const Rgb& color) {
  return {color.r, color.g, color.b};
}

/// The first generation: the surfaces the keys of a tile name.
void resolve(TileWork& tile, const Rect& place, std::span<const Key> keys, Wave& wave) {
  const glm::dvec3 background = to_vector(tile.scene.background);
  WorldTriangle triangle;
  for (int y = 0; y < place.height(); ++y) {
    for (int x = 0; x < place.width(); ++x) {
      const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
      if (keys[pixel] == kNoKey) {
        tile.radiance[pixel] = background;
        continue;
      }
      tile.surfaces.load(key_surface(keys[pixel]), triangle);
      const Ray ray = view_ray(*tile.view, place.x0 + x + 0.5, place.y0 + y + 0.5);
      PathPoint& point = wave.points.emplace_back();
      point.surface = tile.surfaces.meet(triangle, ray.origin, ray.direction);
      point.material = evaluate_material(tile.scene, tile.scene.materials[point.surface.material], point.surface.uv);
      point.pixel = pixel;
    }
  }
}

void store(const TileWork& tile, const Rect& place, std::span<Rgb> pixels, RayCounts& counts) {
  std::ranges::fill(pixels, Rgb{});
  for (int y = 0; y < place.height(); ++y) {
    for (int x = 0; x < place.width(); ++x) {
      const auto i = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
      const glm::dvec3& sum = tile.radiance[i];
      const Rgb color{static_cast<float>(sum.r), static_cast<float>(sum.g), static_cast<float>(sum.b)};
      if (std::isfinite(color.r) && std::isfinite(color.g) && std::isfinite(color.b)) {
        pixels[i] = color;
      } else {
        ++counts.not_finite;
      }
    }
  }
}

}  // namespace

RayCounts& RayCounts::operator+=(const RayCounts& other) {
  primary += other.primary;
  shadow += other.shadow;
  reflection += other.reflection;
  refraction += other.refraction;
  ambient_occlusion += other.ambient_occlusion;
  photon += other.photon;
  invalid += other.invalid;
  not_finite += other.not_finite;
  return *this;
}

struct Lighter::State {
  const Scene& scene;
  RaySettings settings;
  RaySpace space;
  Surfaces surfaces;
  std::vector<Light> lights;
  std::vector<std::unique_ptr<Pass>> passes;  ///< those that run
  std::optional<RayScene> rays;
  std::vector<std::unique_ptr<Scratch>> idle;
  std::mutex mutex;
  RayCounts counts;
  std::vector<PassTime> times;

  State(const Scene& lit, RaySettings chosen, const Requirements& requirements);
  std::unique_ptr<Scratch> take_scratch();
  void light_tile(Scratch& scratch, const Rect& place, std::span<const Key> keys, std::span<Rgb> radiance) const;
};

Lighter::State::State(const Scene& lit, RaySettings chosen, const Requirements& requirements)
    : scene(lit),
      settings(std::move(chosen)),
      space(lit.bounds),
      surfaces(lit, space),
      lights(lights_or_headlight(lit)) {
  const std::vector<PassPlan> plan = plan_passes(requirements, settings);
  std::vector<std::unique_ptr<Pass>> all = make_all_passes();
  bool needs_rays = false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!plan[i].runs) continue;
    needs_rays = needs_rays || all[i]->needs_rays();
    passes.push_back(std::move(all[i]));
  }
  if (needs_rays) {
    rays.emplace(scene, space, settings.threads);
    if (rays->skipped_triangles() > 0) {
      log::warning("{} triangles lie beyond what rays can reach; no ray meets them", rays->skipped_triangles());
    }
  }
  if (scene.lights.empty()) log::info("the scene has no lights; it is lit by a headlight");
}

std::unique_ptr<Scratch> Lighter::State::take_scratch() {
  {
    const std::lock_guard lock(mutex);
    if (!idle.empty()) {
      std::unique_ptr<Scratch> scratch = std::move(idle.back());
      idle.pop_back();
      return scratch;
    }
  }
  return std::make_unique<Scratch>(TileWork{.scene = scene,
                                            .surfaces = surfaces,
                                            .space = space,
                                            .rays = rays ? &*rays : nullptr,
                                            .lights = lights,
                                            .max_depth = settings.max_depth,
                                            .radiance = {},
                                            .counts = {},
                                            .batch = {},
                                            .blocked = {},
                                            .hits = {}},
                                   kFirstPassStep + passes.size());
}

void Lighter::State::light_tile(Scratch& scratch, const Rect& place, std::span<const Key> keys,
                                std::span<Rgb> radiance) const {
  const FlushDenormals mode;
  TileWork& tile = scratch.work;
  Stopwatch watch;
  const auto charge = [&](std::size_t step) {
    scratch.ms[step] += watch.ms();
    watch.restart();
  };
  tile.radiance.assign(kTilePixels, glm::dvec3(0.0));
  scratch.wave.depth = 0;
  scratch.wave.points.clear();
  resolve(tile, place, keys, scratch.wave);
  charge(kSurfaceStep);
  while (!scratch.wave.points.empty()) {
    scratch.next.depth = scratch.wave.depth + 1;
    scratch.next.points.clear();
    add_emission(tile, scratch.wave);
    charge(kDirectStep);
    for (std::size_t i = 0; i < passes.size(); ++i) {
      passes[i]->spread(tile, scratch.wave, scratch.next);
      charge(kFirstPassStep + i);
    }
    for (std::size_t light = 0; light < lights.size(); light += kLightsAtOnce) {
      sample_lights(tile, light, scratch.wave);
      charge(kDirectStep);
      for (std::size_t i = 0; i < passes.size(); ++i) {
        passes[i]->hide(tile, scratch.wave);
        charge(kFirstPassStep + i);
      }
      add_samples(tile, scratch.wave);
      charge(kDirectStep);
    }
    std::swap(scratch.wave, scratch.next);
  }
  store(tile, place, radiance, tile.counts);
}

Lighter::Lighter(const Scene& scene, RaySettings settings, const Requirements& requirements)
    : state_(std::make_unique<State>(scene, std::move(settings), requirements)) {}
Lighter::~Lighter() = default;
Lighter::Lighter(Lighter&&) noexcept = default;
Lighter& Lighter::operator=(Lighter&&) noexcept = default;

const RayCounts& Lighter::counts() const {
  return state_->counts;
}
const std::vector<PassTime>& Lighter::times() const {
  return state_->times;
}

void Lighter::light(std::span<const View> views, const TileLayer<Key>& keys, std::span<const std::size_t> tiles,
                    TileLayer<Rgb>& radiance) {
  const FrameLayout& layout = keys.layout();
  HPR_CHECK(radiance.layout() == layout);
  HPR_CHECK(views.size() == layout.screens());
  for (std::size_t i = 0; i < views.size(); ++i) HPR_CHECK(views[i].size() == layout.size(i));

  State& state = *state_;
  parallel_for(state.settings.threads, tiles.size(), [&](std::size_t i) {
    const std::size_t tile = tiles[i];
    const TilePlace place = layout.place(tile);
    radiance.set_active(tile);
    std::unique_ptr<Scratch> scratch = state.take_scratch();
    scratch->work.view = &views[place.screen];
    state.light_tile(*scratch, place.pixels, keys.tile(tile), radiance.tile(tile));
    const std::lock_guard lock(state.mutex);
    state.idle.push_back(std::move(scratch));
  });

  state.counts = {};
  std::vector<double> ms(kFirstPassStep + state.passes.size(), 0.0);
  for (const auto& scratch : state.idle) {
    state.counts += scratch->work.counts;
    for (std::size_t i = 0; i < ms.size(); ++i) ms[i] += scratch->ms[i];
  }
  state.idle.clear();
  state.times = {{"surface", ms[kSurfaceStep]}, {"direct", ms[kDirectStep]}};
  for (std::size_t i = 0; i < state.passes.size(); ++i) {
    state.times.push_back({std::string(state.passes[i]->name()), ms[kFirstPassStep + i]});
  }
}

void shade_local(Lighter& lighter, std::span<const View> views, TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles) {
  TileLayer<Rgb> radiance(keys.layout());
  lighter.light(views, keys, tiles, radiance);
  for (const std::size_t tile : tiles) {
    const std::span<const Rgb> colors = radiance.tile(tile);
    const std::span<Key> words = keys.tile(tile);
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] != kNoKey) words[i] = make_color_key(key_depth(words[i]), to_word(to_srgb(colors[i])));
    }
  }
}

}  // namespace hpr
