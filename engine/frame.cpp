#include "engine/frame.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "cluster/transport/collectives.h"
#include "compositing/compositor.h"
#include "compositing/tile_gather.h"
#include "core/interrupt.h"
#include "core/timing.h"
#include "engine/balance/load_balance.h"
#include "engine/binning/chunk_binning.h"
#include "engine/session.h"
#include "engine/tile_ownership.h"
#include "engine/verification.h"
#include "gpu/gpu_primary_rays.h"
#include "raster/rasterizer.h"
#include "rt/deferred_shader.h"
#include "rt/show/show.h"
#include "rt/trace/primary_rays.h"

// The frame loop: the place to start reading. A frame flows one way,
//
//     scene ──> cluster ──> raster ──> compositing ──> rt ──> walls
//
// and each step below is one of its arrows. What the scene is and who does what stand in the Session and the FramePlan
// (engine/plan.cpp); the last arrow, tiles to screens, is taken by whoever shows the frame (engine/output.cpp).
namespace hpr {

namespace {

bool spends_light(const FramePlan& plan) {
  return plan.lit || plan.shading == Shading::Local;
}

/// Which of its objects this rank draws on a screen; null: all.
const std::vector<SurfaceRange>* surfaces_of(const FramePlan& plan, std::size_t screen) {
  return plan.by_view ? &plan.by_view->surfaces(screen) : nullptr;
}

}  // namespace

void prepare(Session& session, const FramePlan& plan) {
  if (!plan.mine.area.empty() || bins_chunks(session, plan)) {
    if (session.scene().part_pages) {
      session.partition_rays(plan.rays);  // pages come as they are drawn
    } else if (plan.primary == Primary::Rays) {
      if (plan.keys_on_device) {
        (void)session.gpu_primary_rays(plan.mine.objects);
      } else {
        (void)session.primary_rays(plan.mine.objects, plan.rays);
      }
    } else {
      (void)session.rasterizer(plan.mine.objects);
    }
  }
  if (spends_light(plan)) (void)session.shader(plan.rays);
  if (plan.mine.group.size() > 1) (void)session.group(plan.mine.group);
}

namespace {

/// raster, of some of this rank's objects.
void rasterize_objects(Session& session, const FramePlan& plan, std::span<const SurfaceRange> objects,
                       std::span<const View> views, TileLayer<Key>& keys, FrameTimes& spent) {
  Rasterizer& own = session.rasterizer(objects);
  const trace::Span span("raster");
  const bool bins = bins_chunks(session, plan);
  Rasterizer& rasterizer = bins && plan.rays.part ? receive_triangles(session, plan, own, views, spent) : own;
  std::optional<ScreenChunks> chunks;
  if (bins && !plan.rays.part) chunks = find_chunks(session, plan, own, views, spent);
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    const std::vector<Rect> parts = parts_of(plan.mine.area, screen);
    if (parts.empty()) continue;
    if (chunks) {
      rasterizer.draw(views[screen], screen, parts, (*chunks)[screen], keys);
    } else {
      rasterizer.draw(views[screen], screen, parts, keys, surfaces_of(plan, screen));
    }
    spent.raster += rasterizer.stats();
  }
}

/// trace_primary(), on a device.
void trace_on_device(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                     std::span<TileLayer<Key>* const> keys, FrameWork& work) {
  GpuPrimaryRays& device = session.gpu_primary_rays(plan.mine.objects);
  const trace::Span span("primary rays, on the device");
  const Stopwatch watch;
  for (std::size_t screen = 0; screen < plan.layout.screens(); ++screen) {
    const std::vector<Rect> parts = parts_of(plan.mine.area, screen);
    for (std::size_t i = 0; i < jittered.size(); ++i) device.draw(jittered[i].views[screen], screen, parts, *keys[i]);
  }
  const double ms = watch.ms() * session.threads();  // what each tile took of it is not known
  session.balance().add_keys(plan.layout, plan.tiles, ms);
  work.keys_ms += ms;
}

/// trace_primary(), through some of this rank's objects.
PrimaryRayStats trace_objects(Session& session, const FramePlan& plan, std::span<const SurfaceRange> objects,
                              std::span<const JitteredViews> jittered, std::span<TileLayer<Key>* const> keys,
                              FrameWork& work) {
  PrimaryRays& rays = session.primary_rays(objects, plan.rays);
  const trace::Span span("primary rays");
  PrimaryRayStats stats;
  // Ranks that draw for others do not know what those want.
  const bool draws_own = session.comm().size() == 1 || draws_alone(plan.distribution);
  for (std::size_t screen = 0; screen < plan.layout.screens(); ++screen) {
    const std::vector<Rect> parts = parts_of(plan.mine.area, screen);
    if (parts.empty()) continue;
    std::vector<View> views;
    views.reserve(jittered.size());
    for (const JitteredViews& each : jittered) views.push_back(each.views[screen]);
    rays.draw(views, screen, parts, keys, draws_own ? jittered.front().sample.wanted : nullptr);
    stats += rays.stats();
    session.balance().add_keys(plan.layout, rays.costs());
    for (const TileCost& cost : rays.costs()) work.keys_ms += cost.ms;
  }
  return stats;
}

}  // namespace

void rasterize(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys,
               FrameTimes& spent) {
  HPR_CHECK(!plan.by_view || plan.by_view->fits(views));
  session.draw_pages(plan.mine.objects, [&](std::span<const SurfaceRange> objects) {
    rasterize_objects(session, plan, objects, views, keys, spent);
  });
}

PrimaryRayStats trace_primary(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                              std::span<TileLayer<Key>* const> keys, FrameWork& work) {
  session.partition_rays(plan.rays);
  PrimaryRayStats stats;
  if (plan.keys_on_device && jittered.front().sample.wanted == nullptr) {  // devices leave out no pixels
    trace_on_device(session, plan, jittered, keys, work);
    return stats;
  }
  session.draw_pages(plan.mine.objects, [&](std::span<const SurfaceRange> objects) {
    stats += trace_objects(session, plan, objects, jittered, keys, work);
  });
  return stats;
}

namespace {

/// raster: the keys of each sample, before any rank exchanges them.
FrameTimes draw_keys(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                     std::span<TileLayer<Key>* const> keys) {
  FrameTimes spent;
  const Stopwatch watch;
  if (plan.primary == Primary::Rays) {
    spent.primary = trace_primary(session, plan, jittered, keys, spent.work);
  } else {
    for (std::size_t i = 0; i < jittered.size(); ++i) rasterize(session, plan, jittered[i].views, *keys[i], spent);
    spent.work.keys_ms =
        (watch.ms() - spent.chunk_exchange_ms) * session.threads();  // what each tile took of it is not known
    session.balance().add_keys(plan.layout, plan.tiles, spent.work.keys_ms);
  }
  spent.primary_ms = watch.ms() - spent.chunk_exchange_ms;
  return spent;
}

/// compositing: merges the layers of a group, or of the ranks that meet in a tile; returns the tiles that this rank
/// owns after it.
std::vector<std::size_t> composite(Session& session, const FramePlan& plan, TileLayer<Key>& keys) {
  if (plan.mine.group.size() == 1 && !plan.by_view) return plan.tiles;
  const trace::Span span("composite");
  if (plan.by_view) {
    const ViewGroups& groups = plan.by_view->groups();
    return session.tile_gather().composite(session.comm(), keys, groups.tiles, groups.owners);
  }
  Compositor& compositor = session.compositor(plan.strategy, plan.mine.group);
  return compositor.composite(session.group(plan.mine.group), keys, plan.tiles).tiles;
}

/// The colours of keys that already carry them, which cover their pixels; none where there is no key.
void unpack_colors(const TileLayer<Key>& keys, std::span<const std::size_t> tiles, TileLayer<Rgb>& radiance,
                   TileLayer<float>* coverage) {
  for (const std::size_t tile : tiles) {
    const auto from = keys.tile(tile);
    const auto to = radiance.tile(tile);
    for (std::size_t i = 0; i < from.size(); ++i) {
      const Rgba8 color = from_word(key_rgba(from[i]));
      if (from[i] != kNoKey) to[i] = {srgb_to_linear(color.r), srgb_to_linear(color.g), srgb_to_linear(color.b)};
    }
    radiance.set_active(tile);
    if (coverage == nullptr) continue;
    std::ranges::transform(from, coverage->tile(tile).begin(), [](Key key) { return key != kNoKey ? 1.0F : 0.0F; });
    coverage->set_active(tile);
  }
}

/// Adds times, costs and ray counts of the shader's last call.
void add_light(Session& session, const FramePlan& plan, const DeferredShader& shader, FrameTimes& spent) {
  FrameTimes light;
  light.passes = shader.times();
  light.rays = shader.counts();
  for (const TileCost& cost : shader.costs()) light.work.light_ms += cost.ms;
  session.balance().add_light(plan.layout, shader.costs());
  spent += light;
}

/// Whether what is composited goes on to whoever has time to light it.
bool balances_light(const Session& session, const FramePlan& plan) {
  return plan.balance != Balance::Static && !draws_alone(plan.distribution) && plan.lit &&
         plan.shading == Shading::Deferred && session.ranks() > 1;
}

/// Moves keys to the ranks that own their tiles; the first sample decides which those are.
void move_to_owners(Session& session, const FramePlan& plan, std::optional<TileOwnership>& ownership, Frame& frame) {
  if (!ownership && balances_light(session, plan)) {
    ownership.emplace(session.balance().owners_of_light(session.comm(), *frame.keys, frame.owned), session.rank());
  } else if (!ownership) {
    ownership.emplace(session.comm(), plan.layout, frame.owned);
  }
  if (draws_alone(plan.distribution)) return;
  ownership->move_to_owners(session.comm(), *frame.keys, frame.owned);
  frame.owned = ownership->mine();
}

void mark_rank(const Session& session, std::span<const LentRows> lent, Frame& frame) {
  const auto layer = frame.aovs.single.find(Aov::Rank);
  if (layer == frame.aovs.single.end()) return;
  for (const std::size_t tile : frame.owned) {
    std::ranges::fill(layer->second.tile(tile), static_cast<float>(session.rank()));
    layer->second.set_active(tile);
  }
  for (const LentRows& rows : lent) {
    std::ranges::fill(layer->second.tile(rows.tile).subspan(rows.first_pixel(), rows.pixels()),
                      static_cast<float>(rows.lit_by));
  }
}

/// Shades the tiles of `frame`, a few at a time, between which all ranks agree on whether the sample has been
/// overtaken. The frame says so.
void shade_while_wanted(Session& session, const FramePlan& plan, DeferredShader& shader, const ShadedSample& lit,
                        Interrupt& interrupt, Frame& frame, FrameTimes& spent) {
  struct Progress {
    bool overtaken = false;
    bool done = false;
  };
  constexpr double kBetween_ms = 100.0;  // agreements: what other ranks shade in vain at most
  const std::span<const std::size_t> tiles = frame.owned;
  const std::size_t least = 4 * static_cast<std::size_t>(session.threads());
  // One rank has nobody to agree with.
  std::size_t count = session.comm().size() == 1 ? tiles.size() : least;
  for (std::size_t first = 0;;) {
    count = std::min(count, tiles.size() - first);
    const Stopwatch watch;
    shader.shade(std::span(&lit, 1), tiles.subspan(first, count), [&] { return interrupt.is_raised(); });
    add_light(session, plan, shader, spent);
    const Progress mine{interrupt.is_raised(), first + count == tiles.size()};
    const std::vector<Progress> all = all_gather_value(session.comm(), mine);
    frame.overtaken = std::ranges::any_of(all, &Progress::overtaken);
    if (frame.overtaken || std::ranges::all_of(all, &Progress::done)) return;
    first += count;
    if (count > 0)
      count = std::clamp(static_cast<std::size_t>(static_cast<double>(count) * kBetween_ms / std::max(watch.ms(), 1.0)),
                         least, 4 * count + least);
  }
}

/// Collective, before a frame begins: whether ranks light parts of others' tiles in it, of so many samples together.
bool start_lending(Session& session, const FramePlan& plan, std::size_t samples) {
  return lends_light(session, plan) &&
         session.balance().lending().start(session.comm(), {plan.layout.tiles(), samples});
}

/// Shades the owned tiles of some samples, of which `frame` is the first; `lends`: whoever has time does.
void shade_tiles(Session& session, const FramePlan& plan, std::span<const ShadedSample> samples, bool lends,
                 Interrupt* interrupt, Frame& frame, FrameTimes& spent) {
  DeferredShader& shader = session.shader(plan.rays);
  LightLending& lending = session.balance().lending();
  if (lends && (interrupt == nullptr || lending.sees_all(session.comm()))) {
    const LightLending::Work work{samples, frame.owned, session.balance().light_costs(plan.layout), session.threads(),
                                  interrupt};
    const Stopwatch watch;
    frame.overtaken = !lending.shade(session.comm(), shader, work);
    spent.light_ms += watch.ms() - lending.return_ms();
    spent.return_ms += lending.return_ms();
    add_light(session, plan, shader, spent);
    spent.work.lent += lending.lent().size();
    return;
  }
  const Stopwatch watch;
  if (interrupt != nullptr) {
    shade_while_wanted(session, plan, shader, samples.front(), *interrupt, frame, spent);
  } else {
    shader.shade(samples, frame.owned);
    add_light(session, plan, shader, spent);
  }
  spent.light_ms += watch.ms();
}

/// rt: gives the owned tiles of `frame` their radiance, from keys or from colors that keys carry.
void shade(Session& session, const FramePlan& plan, std::span<const View> views, const FrameSample& sample, bool lends,
           Frame& frame, FrameTimes& spent) {
  if (plan.shading == Shading::Local) {
    const trace::Span light("light");
    DeferredShader& shader = session.shader(plan.rays);
    const LightOutput output = frame.aovs.output(frame.radiance);
    const Stopwatch watch;
    unpack_colors(*frame.keys, frame.owned, frame.radiance, output.coverage);
    shade_empty(shader, views, *frame.keys, frame.owned, output, sample.number);
    add_light(session, plan, shader, spent);
    spent.light_ms += watch.ms();
  } else if (plan.lit) {
    const trace::Span light("light");
    const ShadedSample lit{views, frame.keys, frame.aovs.output(frame.radiance), sample.number, sample.wanted};
    shade_tiles(session, plan, std::span(&lit, 1), lends, sample.interrupt, frame, spent);
    if (frame.overtaken) return;
    mark_rank(session, lends ? session.balance().lending().lent() : std::span<const LentRows>(), frame);
  }
}

/// What Show::Rank stands for; the shader does not know it.
void show_ranks(const Session& session, const FramePlan& plan, Frame& frame) {
  if (!plan.drawn_by || !plan.lit) return;
  for (const std::size_t tile : frame.owned) {
    const std::span<const Key> keys = std::as_const(*frame.keys).tile(tile);
    const std::span<Rgb> colors = frame.radiance.tile(tile);
    for (std::size_t i = 0; i < keys.size(); ++i) {
      const int rank = keys[i] == kNoKey ? session.rank() : plan.drawn_by->rank_of(tile, key_surface(keys[i]));
      colors[i] = distinct_color(static_cast<std::uint32_t>(rank));
    }
  }
}

}  // namespace

VerifyCounts& VerifyCounts::operator+=(const VerifyCounts& other) {
  tiles += other.tiles;
  mismatches += other.mismatches;
  unmended += other.unmended;
  return *this;
}

FrameWork& FrameWork::operator+=(const FrameWork& other) {
  keys_ms += other.keys_ms;
  light_ms += other.light_ms;
  lent += other.lent;
  return *this;
}

FrameTimes& FrameTimes::operator+=(const FrameTimes& other) {
  primary_ms += other.primary_ms;
  primary += other.primary;
  raster += other.raster;
  chunk_exchange_ms += other.chunk_exchange_ms;
  composite_ms += other.composite_ms;
  move_ms += other.move_ms;
  return_ms += other.return_ms;
  light_ms += other.light_ms;
  if (passes.empty()) {
    passes = other.passes;
  } else {
    for (std::size_t i = 0; i < other.passes.size(); ++i) passes.at(i).ms += other.passes[i].ms;
  }
  rays += other.rays;
  work += other.work;
  verified += other.verified;
  samples += other.samples;
  return *this;
}

DrawnLayer draw_layer(Session& session, const FramePlan& plan, std::span<const View> views, TileLayer<Key>& keys,
                      const FrameSample& sample) {
  const JitteredViews jittered{{views.begin(), views.end()}, sample};
  TileLayer<Key>* const layer = &keys;
  DrawnLayer drawn{draw_keys(session, plan, std::span(&jittered, 1), std::span(&layer, 1))};

  const Stopwatch light;
  if (spends_light(plan)) {
    const trace::Span photons("photons");
    std::function<bool()> is_overtaken;
    if (sample.interrupt != nullptr) is_overtaken = [&] { return sample.interrupt->is_raised(); };
    drawn.overtaken = !session.shader(plan.rays).trace_photons(session.comm(), sample.number, is_overtaken);
  }
  if (plan.shading == Shading::Local && !drawn.overtaken) {
    const trace::Span shading("light");
    shade_local(session.shader(plan.rays), views, keys, plan.tiles, sample.number);
    add_light(session, plan, session.shader(plan.rays), drawn.spent);
  }
  drawn.spent.light_ms = light.ms();
  return drawn;
}

Frame make_frame(Session& session, const FramePlan& plan, std::span<const View> views, FrameTimes* times,
                 const FrameSample& sample) {
  const trace::Span span("sample", "number", sample.number.sample);
  TileLayer<Key>& keys = session.keys(plan.layout, plan.strategy, plan.mine.group);
  keys.set_depth_format(plan.depth_format);
  const bool lends = start_lending(session, plan, 1);
  const DrawnLayer layer = draw_layer(session, plan, views, keys, sample);
  FrameTimes spent = layer.spent;

  const Stopwatch watch;
  Frame frame{&keys, TileLayer<Rgb>(plan.layout), composite(session, plan, keys), AovLayers(plan.layout, plan.layers),
              plan.is_transparent()};
  spent.composite_ms = watch.ms();
  std::optional<TileOwnership> of_frame;
  if (sample.ownership != nullptr) {
    move_to_owners(session, plan, *sample.ownership, frame);
  } else if (balances_light(session, plan)) {
    move_to_owners(session, plan, of_frame, frame);
  }
  if (sample.before_shading != nullptr) (*sample.before_shading)();
  spent.move_ms = watch.ms() - spent.composite_ms;

  frame.overtaken = layer.overtaken;
  if (!frame.overtaken) shade(session, plan, views, sample, lends, frame, spent);
  if (frame.overtaken) return frame;
  if (plan.verify_percent > 0.0) {
    const JitteredViews drawn{{views.begin(), views.end()}, sample};
    spent.verified = verify(session, plan, std::span(&drawn, 1), std::span(&frame, 1));
  }
  show_ranks(session, plan, frame);
  spent.samples = 1;
  if (times != nullptr) *times = spent;
  return frame;
}

std::size_t max_round_size(Session& session, const FramePlan& plan) {
  if (session.comm().size() > 1 && !draws_alone(plan.distribution)) return 1;
  if (plan.shading != Shading::Deferred || !plan.lit || !plan.aovs.empty() || plan.rays.part) return 1;
  if (session.shader(plan.rays).shades_one_by_one()) return 1;
  // Keys and colours of a round are in memory together.
  constexpr std::size_t kPixels = std::size_t{1} << 23U;
  const std::size_t fit = kPixels / std::max<std::size_t>(plan.layout.pixels(), 1);
  return std::clamp(fit, std::size_t{1}, PrimaryRays::kMaxViews);
}

std::vector<Frame> make_round(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                              FrameTimes& times) {
  const trace::Span span("round", "samples", jittered.size());
  const std::span<TileLayer<Key>> keys = session.round_keys(plan.layout, jittered.size());
  std::vector<TileLayer<Key>*> layers;
  for (TileLayer<Key>& layer : keys) {
    layer.set_depth_format(plan.depth_format);
    layers.push_back(&layer);
  }
  const bool lends = start_lending(session, plan, jittered.size());
  times = draw_keys(session, plan, jittered, layers);
  std::vector<Frame> frames;
  std::vector<ShadedSample> samples;
  for (std::size_t i = 0; i < jittered.size(); ++i) {
    frames.push_back({&keys[i], TileLayer<Rgb>(plan.layout), plan.tiles, AovLayers(plan.layout, plan.layers),
                      plan.is_transparent()});
    if (jittered[i].sample.ownership != nullptr)
      move_to_owners(session, plan, *jittered[i].sample.ownership, frames.back());
  }
  if (jittered.front().sample.before_shading != nullptr) (*jittered.front().sample.before_shading)();
  for (std::size_t i = 0; i < jittered.size(); ++i) {
    const FrameSample& sample = jittered[i].sample;
    samples.push_back(
        {jittered[i].views, &keys[i], frames[i].aovs.output(frames[i].radiance), sample.number, sample.wanted});
  }
  const trace::Span light("light");
  shade_tiles(session, plan, samples, lends, nullptr, frames.front(), times);
  if (plan.verify_percent > 0.0) times.verified = verify(session, plan, jittered, frames);
  for (Frame& frame : frames) show_ranks(session, plan, frame);
  times.samples = static_cast<int>(jittered.size());
  return frames;
}

}  // namespace hpr
