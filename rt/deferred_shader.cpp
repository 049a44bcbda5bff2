#include "rt/deferred_shader.h"

#include <algorithm>
#include <iterator>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "core/error.h"
#include "core/job_board.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "rt/deferred_state.h"
#include "rt/denoise/denoiser.h"
#include "rt/lights/direct_light.h"
#include "rt/passes/half_resolution.h"
#include "rt/passes/pixel_sums.h"
#include "rt/passes/tile_margin.h"
#include "rt/show/show_pixels.h"
#include "rt/tile_shader.h"

namespace hpr {
namespace {

void check_sizes(std::span<const ShadedSample> samples) {
  const FrameLayout& layout = samples.front().keys->layout();
  for (const ShadedSample& sample : samples) {
    HPR_CHECK(sample.keys->layout() == layout && sample.views.size() == layout.screens());
    for (std::size_t i = 0; i < sample.views.size(); ++i) HPR_CHECK(sample.views[i].size() == layout.size(i));
  }
}

bool gathers_all_lobes(std::span<const PassPlan> plan) {
  return runs_pass(plan, [](const PassInfo& pass) { return pass.gathers_all_lobes; });
}

bool needs_photons(std::span<const PassPlan> plan) {
  return runs_pass(plan, [](const PassInfo& pass) { return pass.needs_photons; });
}

/// Rays find an even sky by themselves, unless photons bring what mirrors and glass make of it.
ConstantEnvironment constant_environment_of(std::span<const PassPlan> plan) {
  return gathers_all_lobes(plan) && !needs_photons(plan) ? ConstantEnvironment::LeftToRays
                                                         : ConstantEnvironment::Sampled;
}

}  // namespace

DeferredShader::State::State(const Scene& lit, RaySettings chosen, const Requirements& requirements,
                             const RaySource& source, RayForwarding* others, const MakeTileShader& make_device)
    : scene(lit),
      settings(std::move(chosen)),
      plan(plan_passes(requirements, settings)),
      space(lit),
      surfaces(lit, space, settings.show == Show::Ao || lifts_origins(plan, settings), others),
      lights(lit, constant_environment_of(plan)),
      media(lit),
      shared(shared_components(settings)),
      gathers(gathers_all_lobes(plan)),
      forwarding(others) {
  for (const PassPlan& planned : plan) {
    if (!planned.runs) continue;
    const PassInfo& info = info_of(planned.pass);
    if (info.lobe) {
      followed_lobes.at(static_cast<std::size_t>(*info.lobe)) = true;
      followed_lobes.at(static_cast<std::size_t>(extension_of(*info.lobe))) = true;
    }
    passes.push_back({info, info.make()});
  }
  if (!passes.empty() || settings.reference || settings.denoise || traces_own_rays(settings.show) ||
      !covering_surfaces(lit, true).empty()) {
    build_rays(source);
  }
  if (needs_photons(plan)) build_photons();
  if (settings.reference) build_reference();
  if (make_device) device = make_device({scene, surfaces, lights, settings, plan, followed_lobes});
  if (device && photons) photons->trace_on(device->photon_device());
}

/// Builds the ray scene of this rank's part of `objects`.
const RayScene& DeferredShader::State::build(std::optional<RayScene>& made, std::vector<SurfaceRange> objects) {
  made.emplace(scene, space, settings.threads, surfaces_at_home(scene, settings.part, objects), settings.build);
  if (forwarding != nullptr) made->share(*forwarding, std::move(objects), settings.build);
  return *made;
}

void DeferredShader::State::for_each(std::size_t count, const std::function<void(std::size_t)>& body) const {
  if (forwarding == nullptr) return parallel_for(settings.threads, count, body);
  const CallMemory memory = needs_light(settings.show) ? CallMemory::Large : CallMemory::Small;
  forwarding->for_each(settings.threads, count, body, memory);
}

void DeferredShader::State::build_rays(const RaySource& source) {
  opaque = source ? &source() : &build(own_opaque, covering_surfaces(scene, false));
  std::uint64_t skipped = opaque->skipped_triangles();
  if (const auto with_alpha = covering_surfaces(scene, true); !with_alpha.empty()) {
    (void)build(alpha_tested, with_alpha);
    skipped += alpha_tested->skipped_triangles();
  }
  rays.emplace(scene, surfaces, space, *opaque, alpha_tested ? &*alpha_tested : nullptr);
  if (skipped > 0) log::warning("{} triangles lie beyond what rays can reach; no ray meets them", skipped);
}

void DeferredShader::State::build_photons() {
  if (settings.photons == 0) settings.photons = kPhotons;
  photons.emplace(scene, surfaces, space, whole_scene(), lights, settings,
                  gathers ? PhotonUse::Gathered : PhotonUse::Direct);
}

void DeferredShader::State::build_reference() {
  PathSettings own;
  own.seed = settings.seed;
  own.max_depth = settings.max_depth;
  own.glossy_cutoff = settings.glossy_cutoff;
  own.background = settings.background;
  own.terminator_fix = settings.terminator_fix;
  own.spread_in_pixel = false;  // views are jittered
  own.threads = settings.threads;
  reference.emplace(scene, *rays, lights, own, forwarding);
}

const RayScene& DeferredShader::State::whole_scene() {
  if (!alpha_tested) return *opaque;
  return whole ? *whole : build(whole, {SurfaceRange{0, scene.triangles}});
}

void DeferredShader::State::trace_reference(const ShadedSample& sample, std::span<const std::size_t> tiles) {
  const Stopwatch watch;
  reference->trace(sample.views, tiles, sample.number, {sample.output.radiance, sample.output.coverage}, sample.wanted);
  const PathCounts& traced = reference->counts();
  counts = {};
  counts.primary = traced.primary;
  counts[PassId::Shadow] = traced.shadow;
  counts[PassId::Reflection] = traced.diffuse + traced.reflection;
  counts[PassId::Refraction] = traced.transmission;
  counts.invalid = traced.invalid;
  counts.cut = traced.cut;
  counts.not_finite = traced.not_finite;
  counts.first_not_finite = traced.first_not_finite;
  times = {{"reference", watch.ms() * settings.threads}};
}

const PhotonMaps* DeferredShader::State::photon_maps(const SampleNumber& number) {
  if (!photons) return nullptr;
  const Stopwatch watch;
  const PhotonMaps& maps = photons->build(number, nullptr);
  photon_ms += watch.ms();
  return &maps;
}

void DeferredShader::State::warn_of_cut_rays() {
  if (counts.cut == 0 || std::exchange(has_warned, true)) return;
  log::warning("{} rays of a sample or a few passed {} surfaces that cover in part; what is behind is not all seen",
               counts.cut, kMaxPassed);
}

void DeferredShader::State::shade_wavefront(const LightContext& context, WaveScratch& memory, PixelSums& sums) const {
  RayBuffers& buffers = memory.buffers;
  Wavefront& wave = memory.wave;
  Stopwatch watch;
  const auto charge = [&](std::size_t step) {
    memory.ms[step] += watch.ms();
    watch.restart();
  };
  const auto for_each_pass = [&](const auto& body) {
    for (std::size_t i = 0; i < passes.size(); ++i) {
      body(passes[i]);
      charge(kFirstPassStep + i);
    }
  };
  add_emission(context, wave, sums);
  charge(kDirectStep);
  const std::size_t depth = wave.vertices.front().depth + 1U;
  if (memory.waiting.size() <= depth) memory.waiting.resize(depth + 1);
  LobeRays followed(context, wave, buffers, sums);
  for_each_pass([&](const RunningPass& running) { followed.add(running.info, running.pass->lobes()); });
  followed.trace();
  for (std::size_t i = 0; i < passes.size(); ++i) memory.ms[kFirstPassStep + i] += watch.ms() * followed.fraction(i);
  watch.restart();
  for_each_pass([&](const RunningPass& running) {
    followed.finish(running.info, memory.waiting[depth]);
    running.pass->scatter(context, wave, buffers, sums, memory.waiting[depth]);
  });
  for (DirectLight light(context, wave); light.sample_next();) {
    charge(kDirectStep);
    for_each_pass([&](const RunningPass& running) { running.pass->trace_shadows(context, buffers, sums, wave); });
    add_samples(wave, sums);
    charge(kDirectStep);
  }
}

/// Later generations first, so that few points wait: never more than a wave per depth, times what one splits into.
void DeferredShader::State::shade_waiting(const LightContext& context, WaveScratch& memory, PixelSums& sums) const {
  while (true) {
    const auto deepest = std::ranges::find_if(memory.waiting.rbegin(), memory.waiting.rend(),
                                              [](const auto& points) { return !points.empty(); });
    if (deepest == memory.waiting.rend()) return;
    if (deepest->size() <= kWavefrontVertices) {
      memory.wave.vertices.clear();
      std::swap(memory.wave.vertices, *deepest);
    } else {
      const auto first = deepest->end() - static_cast<std::ptrdiff_t>(kWavefrontVertices);
      memory.wave.vertices.assign(first, deepest->end());
      deepest->erase(first, deepest->end());
    }
    shade_wavefront(context, memory, sums);
  }
}

/// The strips that filters of a tile read beyond its edges.
std::size_t DeferredShader::State::count_margins(const LightContext& context, const TileJob& job, bool denoises) const {
  return (denoises || shared != 0) && context.rays != nullptr ? TileMargin::count(job, settings.filter_across_tiles)
                                                              : 0;
}

void DeferredShader::State::start_filters(const LightContext& context, TileScratch& scratch, const TilePart& part,
                                          std::size_t margins, const UsePoints& use) {
  if (part.denoises) {
    const auto& layers = part.samples.front().output.components;
    const bool filters_components = std::ranges::any_of(layers, [](const auto* layer) { return layer != nullptr; });
    scratch.denoiser.start(part.jobs.size(), margins, filters_components);
  }
  if (shared != 0) scratch.shared.start(shared, context, part.jobs.front());
  scratch.margins.clear();
  if (margins > 0) find_margins(context, scratch, part, use);
}

/// What lies in those strips.
void DeferredShader::State::find_margins(const LightContext& context, TileScratch& scratch, const TilePart& part,
                                         const UsePoints& use) {
  const std::span<const TileJob> jobs = part.jobs;
  std::size_t first_tile = jobs.size() + (part.denoises ? 1 : 0);
  scratch.margins.resize(jobs.size());
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const Stopwatch watch;
    TileMargin& margin = scratch.margins[i];
    margin.find(context, jobs[i], part.denoises ? Denoiser::reach(jobs[i].number.sample) : HalfResShading::kReach,
                static_cast<std::uint32_t>(first_tile * kTilePixels), scratch.own.buffers);
    first_tile += margin.strips().size();
    fetch_triangles(context, margin.strips());
    std::vector<PathVertex> points;
    std::vector<PathVertex> found;
    for (const TileJob& strip : margin.strips()) {
      found.clear();
      find_primary_vertices(context, strip, {0, strip.rect.height()}, scratch.own.buffers, scratch.sums, found);
      if (shared != 0) scratch.shared.add_margin(strip, found);
      if (part.denoises) scratch.denoiser.add_vertices(context, found);
      std::ranges::move(found, std::back_inserter(points));
    }
    scratch.own.ms[kSurfaceStep] += watch.ms();
    use(std::move(points));
  }
}

/// Clears the sums of a tile and starts its filters.
void DeferredShader::State::start_tile(const LightContext& context, TileScratch& scratch, const TilePart& part,
                                       const UsePoints& use) {
  const std::size_t margins = part.jobs.size() * count_margins(context, part.jobs.front(), part.denoises);
  scratch.sums.clear(part.jobs.front(), part.index, part.samples,
                     {.all_components = shared != 0 || (part.denoises && Denoiser::keeps_direct(scene)),
                      .diffuse = part.denoises,
                      .cost = settings.show == Show::Cost,
                      .margins = margins});
  start_filters(context, scratch, part, margins, use);
}

/// Shades scratch.points: wavefronts of whole pixels, from the last one on.
void DeferredShader::State::shade_points(const LightContext& context, TileScratch& scratch) {
  std::vector<std::span<PathVertex>> waves;
  for (std::span<PathVertex> left = scratch.points; !left.empty();) {
    waves.push_back(last_wavefront(left));
    left = left.first(left.size() - waves.back().size());
  }
  shade_waves(waves.size(), scratch, [&](std::size_t i, WaveScratch& memory) {
    std::ranges::move(waves[i], std::back_inserter(memory.waiting[0]));
    shade_waiting(context, memory, scratch.sums);
  });
  scratch.points.clear();
}

/// Light of neighbours in place of a sample's own, once that is known.
void DeferredShader::State::denoise(const LightContext& context, TileScratch& scratch, std::span<const TileJob> jobs,
                                    std::size_t index) {
  const Stopwatch watch;
  const double before = scratch.own.spent_ms();
  const TileFragments& tile_fragments =
      fragments.of_tile(context, scratch.own.buffers, jobs.front(), index, scratch.finder);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const TileJob& job = jobs[i];
    if (job.number.sample >= kDenoisedSamples) break;
    scratch.denoiser.resample_edges(context, job, margin_of(scratch, i), tile_fragments, scratch.own.buffers,
                                    scratch.sums, scratch.points);
    shade_points(context, scratch);
    scratch.denoiser.resolve(context, job, tile_fragments, scratch.sums);
  }
  scratch.own.ms.back() += watch.ms() - (scratch.own.spent_ms() - before);
}

/// Shows something in place of light.
void DeferredShader::State::show_tile(const LightContext& context, TileScratch& scratch, std::span<const TileJob> jobs,
                                      std::size_t index, std::span<const ShadedSample> samples) const {
  const trace::Span span("show tile", "tile", index);
  const DenormalsAsZero mode;
  const Stopwatch watch;
  scratch.sums.clear(jobs.front(), index, samples, {});
  const int end = jobs.front().end_row();
  for (RowRange rows{jobs.front().rows.first, 0}; rows.first < end; rows.first = rows.end) {
    rows.end = end_of_wavefront(jobs.front(), rows.first);
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      std::vector<PathVertex>& points = scratch.own.waiting[0];
      find_primary_vertices(context, jobs[i], rows, scratch.own.buffers, scratch.sums, points);
      add_first_surfaces(points, index, samples[i].output);
      show_pixels(context, jobs[i], rows, scratch.own.buffers, scratch.sums, points);
      points.clear();
    }
  }
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    scratch.sums.store(jobs[i], index, samples[i].output, scratch.own.buffers.counts);
  }
  scratch.own.ms[kSurfaceStep] += watch.ms();
}

/// Finds what some rows of a tile show in one sample, which its filters learn too; `points` has none yet.
void DeferredShader::State::find_rows(const LightContext& context, TileScratch& scratch, WaveScratch& memory,
                                      const TilePart& part, std::size_t sample, const RowRange& rows,
                                      std::vector<PathVertex>& points) const {
  const Stopwatch watch;
  find_primary_vertices(context, part.jobs[sample], rows, memory.buffers, scratch.sums, points);
  add_first_surfaces(points, part.index, part.samples[sample].output);
  if (shared != 0 || part.denoises) {
    const std::lock_guard lock(scratch.mutex);
    if (shared != 0) scratch.shared.choose(points, rows.first);
    if (part.denoises) scratch.denoiser.add_vertices(context, points);
  }
  memory.ms[kSurfaceStep] += watch.ms();
}

/// Shades some rows of one sample after those of another: what one sample has read the next one finds in the cache.
void DeferredShader::State::shade_rows(const LightContext& context, TileScratch& scratch, WaveScratch& memory,
                                       const TilePart& part, const RowRange& rows) const {
  for (std::size_t i = 0; i < part.jobs.size(); ++i) {
    find_rows(context, scratch, memory, part, i, rows, memory.waiting[0]);
    shade_waiting(context, memory, scratch.sums);
  }
}

/// Calls body(i, memory) for i in [0, count); where rays travel, many at once, as each wait is for all ranks.
void DeferredShader::State::shade_waves(std::size_t count, TileScratch& scratch,
                                        const std::function<void(std::size_t, WaveScratch&)>& body) {
  if (forwarding == nullptr) {
    for (std::size_t i = 0; i < count; ++i) body(i, scratch.own);
    return;
  }
  const std::thread::id owner = std::this_thread::get_id();
  forwarding->for_each_within(count, [&](std::size_t i) {
    const DenormalsAsZero mode;
    const CpuStopwatch watch;
    std::unique_ptr<WaveScratch> memory = wave_memory.take(steps());
    body(i, *memory);
    wave_memory.put_back(std::move(memory));
    if (std::this_thread::get_id() == owner) return;
    const std::lock_guard lock(scratch.mutex);
    scratch.helpers_ms += watch.ms();
  });
}

/// The margins that are left, and all rows of a tile.
void DeferredShader::State::shade_all_rows(const LightContext& context, TileScratch& scratch, const TilePart& part) {
  std::vector<RowRange> rows;
  const TileJob& job = part.jobs.front();
  for (int row = job.rows.first; row < job.end_row(); row = rows.back().end) {
    rows.push_back({row, end_of_wavefront(job, row)});
  }
  const std::size_t margins = scratch.margin_points.size();
  shade_waves(margins + rows.size(), scratch, [&](std::size_t i, WaveScratch& memory) {
    if (i >= margins) return shade_rows(context, scratch, memory, part, rows[i - margins]);
    std::swap(memory.waiting[0], scratch.margin_points[i]);
    shade_waiting(context, memory, scratch.sums);
  });
  scratch.margin_points.clear();
}

void DeferredShader::State::shade_tile(const LightContext& context, TileScratch& scratch, std::span<const TileJob> jobs,
                                       std::size_t index, std::span<const ShadedSample> samples) {
  const trace::Span span("light tile", "tile", index);
  const DenormalsAsZero mode;
  PixelSums& sums = scratch.sums;
  const TilePart part{jobs, samples, index, denoises(samples.front().number)};
  start_tile(context, scratch, part, [&](std::vector<PathVertex>&& points) {
    if (forwarding != nullptr) {
      scratch.margin_points.push_back(std::move(points));
      return;
    }
    std::swap(scratch.own.waiting[0], points);
    shade_waiting(context, scratch.own, scratch.sums);
  });
  shade_all_rows(context, scratch, part);
  if (shared != 0) scratch.shared.upsample(sums);
  if (part.denoises) denoise(context, scratch, jobs, index);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (settings.show == Show::Cost) show_cost(jobs[i], sums);
    sums.store(jobs[i], index, samples[i].output, scratch.own.buffers.counts);
  }
}

/// Counts and times of what was lit, gathered from the threads' memory.
void DeferredShader::State::gather_counts(double spent_ms) {
  counts = {};
  std::vector<double> ms(steps(), 0.0);
  for (const auto& scratch : tile_memory.all()) scratch->own.gather(counts, ms);
  for (const auto& memory : wave_memory.all()) memory->gather(counts, ms);
  if (forwarding != nullptr) share_out(spent_ms, ms);
  if (photons) {
    const PhotonCounts traced = photons->take_counts();
    for (const RunningPass& running : passes) {
      if (running.info.needs_photons) counts[running.info.id] = traced.rays;
    }
    counts.invalid += traced.invalid;
    counts.cut += traced.cut;
  }
  times = {{"surface", ms[kSurfaceStep]}, {"direct", ms[kDirectStep]}};
  for (std::size_t i = 0; i < passes.size(); ++i) {
    double& spent = ms[kFirstPassStep + i];
    // Threads send together what they gather one by one: times are summed over threads.
    const PassInfo& info = passes[i].info;
    if (info.needs_photons) spent += std::exchange(photon_ms, 0.0) * settings.threads;
    times.push_back({std::string(info.name), spent, info.id});
    if (info.needs_photons && device) add_photon_times(*device, settings.threads, times);
  }
  if (settings.denoise) times.push_back({"denoise", ms.back()});
}

DeferredShader::DeferredShader(const Scene& scene, RaySettings settings, const Requirements& requirements,
                               const RaySource& rays, RayForwarding* forwarding, const MakeTileShader& make_device)
    : state_(std::make_unique<State>(scene, std::move(settings), requirements, rays, forwarding, make_device)) {}
DeferredShader::~DeferredShader() = default;
DeferredShader::DeferredShader(DeferredShader&&) noexcept = default;
DeferredShader& DeferredShader::operator=(DeferredShader&&) noexcept = default;

const RayCounts& DeferredShader::counts() const {
  return state_->counts;
}
const std::vector<PassTime>& DeferredShader::times() const {
  return state_->times;
}

bool DeferredShader::shades_one_by_one() const {
  return state_->reference || state_->photons || state_->shared != 0;
}

void DeferredShader::shade(std::span<const View> views, const TileLayer<Key>& keys, std::span<const std::size_t> tiles,
                           const LightOutput& output, const SampleNumber& number) {
  const ShadedSample only{views, &keys, output, number};
  shade(std::span(&only, 1), tiles);
}

DeferredShader::State::Call DeferredShader::State::start_call(std::span<const ShadedSample> samples,
                                                              const std::function<bool()>& is_overtaken) {
  const ShadedSample& first = samples.front();
  costs.clear();
  Call call{samples, photon_maps(first.number), media.of_eyes(first.views), is_overtaken};
  if (settings.denoise) fragments.prepare(first.keys->layout(), first.views, settings);
  return call;
}

/// A tile's part in each sample.
std::vector<TileJob> DeferredShader::State::jobs_of(const Call& call, const ShadedPart& part) const {
  const ShadedSample& first = call.samples.front();
  const TilePlace location = first.keys->layout().place(part.tile);
  const std::span<const std::uint8_t> wanted = part.keys != nullptr ? part.wanted : mask_of(first.wanted, part.tile);
  std::vector<TileJob> jobs;
  for (const ShadedSample& sample : call.samples) {
    const auto keys = part.keys != nullptr ? std::span(part.keys + jobs.size() * kTilePixels, kTilePixels)
                                           : sample.keys->tile(part.tile);
    jobs.push_back({location.pixels,
                    sample.number,
                    keys,
                    &sample.views[location.screen],
                    static_cast<std::uint32_t>(jobs.size() * kTilePixels),
                    wanted,
                    {part.first_row, part.end_row}});
  }
  return jobs;
}

LightContext DeferredShader::State::context_of(const Call& call, std::size_t screen) const {
  return {.scene = scene,
          .surfaces = surfaces,
          .rays = rays ? &*rays : nullptr,
          .lights = lights,
          .settings = settings,
          .followed_lobes = followed_lobes,
          .gathers = gathers,
          .photons = call.photons,
          .view = &call.samples.front().views[screen],
          .eye_media = call.eyes[screen]};
}

void DeferredShader::State::shade_part(const Call& call, const ShadedPart& part) {
  const std::vector<TileJob> jobs = jobs_of(call, part);
  if (!wants_any(jobs.front().wanted)) return;
  const CpuStopwatch watch;
  std::unique_ptr<TileScratch> scratch = tile_memory.take(steps());
  const LightContext context = context_of(call, call.samples.front().keys->layout().place(part.tile).screen);
  if (needs_light(settings.show)) {
    shade_tile(context, *scratch, jobs, part.tile, call.samples);
  } else {
    show_tile(context, *scratch, jobs, part.tile, call.samples);
  }
  const double ms = watch.ms() + std::exchange(scratch->helpers_ms, 0.0);
  tile_memory.put_back(std::move(scratch));
  const std::lock_guard lock(mutex);
  costs.push_back({part.tile, ms});
}

void DeferredShader::shade(std::span<const ShadedSample> samples, std::span<const std::size_t> tiles,
                           const std::function<bool()>& is_overtaken) {
  HPR_CHECK(samples.size() == 1 || (!samples.empty() && !shades_one_by_one()));
  check_sizes(samples);
  const ShadedSample& first = samples.front();
  State& state = *state_;
  if (state.reference) {
    state.costs.clear();
    state.trace_reference(first, tiles);
    state.warn_of_cut_rays();
    return;
  }
  const State::Call call = state.start_call(samples, is_overtaken);
  const Stopwatch watch;
  State::DeviceWork done;
  const std::vector<std::size_t> left = state.light_by_device(call, tiles, done);
  const double before_ms = watch.ms() * state.settings.threads;
  const std::vector<std::size_t> order = fullest_first(left, *first.keys, state.settings.threads);
  state.for_each(order.size(), [&](std::size_t i) {
    if (call.overtaken()) return;
    if (!wants_any(mask_of(first.wanted, order[i]))) return;
    for (const ShadedSample& sample : samples) set_active(sample.output, order[i]);
    state.shade_part(call, {.tile = order[i]});
  });
  state.gather_counts(watch.ms() * state.settings.threads);
  if (state.device) {
    state.counts += done.traced;
    add_times(*state.device, done.ms * state.settings.threads, state.settings.threads, state.times);
    for (const std::size_t tile : tiles) state.costs.push_back({tile, before_ms / static_cast<double>(tiles.size())});
  }
  state.warn_of_cut_rays();
}

void DeferredShader::shade(std::span<const ShadedSample> samples, const NextPart& next) {
  HPR_CHECK(!is_whole() && (samples.size() == 1 || (!samples.empty() && !shades_one_by_one())));
  check_sizes(samples);
  State& state = *state_;
  const std::function<bool()> never;
  const State::Call call = state.start_call(samples, never);
  const Stopwatch watch;
  const auto threads = static_cast<std::size_t>(std::max(state.settings.threads, 1));
  parallel_for(state.settings.threads, threads, [&](std::size_t) {
    while (const std::optional<ShadedPart> part = next()) {
      state.shade_part(call, *part);
      report_step();
    }
  });
  state.gather_counts(watch.ms() * state.settings.threads);
  state.warn_of_cut_rays();
}

bool DeferredShader::is_whole() const {
  return state_->reference || state_->forwarding != nullptr;
}

bool DeferredShader::shades_whole_tiles() const {
  return state_->settings.denoise || state_->shared != 0;
}

std::span<const TileCost> DeferredShader::costs() const {
  return state_->costs;
}

bool DeferredShader::trace_photons(Communicator& comm, const SampleNumber& number,
                                   const std::function<bool()>& is_overtaken) {
  if (!state_->photons) return true;
  const Stopwatch watch;
  const bool is_wanted = state_->photons->build_while_wanted(number, comm, is_overtaken);
  if (is_wanted) state_->photon_ms += watch.ms();
  return is_wanted;
}

void DeferredShader::discard_photons() {
  if (state_->photons) state_->photons->discard();
}

void shade_local(DeferredShader& shader, std::span<const View> views, TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles, const SampleNumber& number) {
  TileLayer<Rgb> radiance(keys.layout());
  shader.shade(views, keys, tiles, {.radiance = &radiance}, number);
  for (const std::size_t tile : tiles) {
    const std::span<const Rgb> colors = radiance.tile(tile);
    const std::span<Key> words = keys.tile(tile);
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] != kNoKey) words[i] = make_color_key(key_depth(words[i]), to_word(to_srgb(colors[i])));
    }
  }
}

void shade_empty(DeferredShader& shader, std::span<const View> views, const TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles, const LightOutput& output, const SampleNumber& number) {
  std::vector<std::size_t> open;
  std::ranges::copy_if(tiles, std::back_inserter(open),
                       [&](std::size_t tile) { return std::ranges::count(keys.tile(tile), kNoKey) > 0; });
  // Keys that carry colours name no surfaces: pixels that have one are lit as if they were empty, and left out.
  const TileLayer<Key> empty(keys.layout());
  TileLayer<Rgb> behind(keys.layout());
  TileLayer<float> covered(output.coverage != nullptr ? keys.layout() : FrameLayout());
  shader.shade(views, empty, open, {.radiance = &behind, .coverage = output.coverage != nullptr ? &covered : nullptr},
               number);
  for (const std::size_t tile : open) {
    const std::span<const Key> words = keys.tile(tile);
    const auto fill = [&](const auto& from, auto& to) {
      for (std::size_t i = 0; i < words.size(); ++i) {
        if (words[i] == kNoKey) to.tile(tile)[i] = from.tile(tile)[i];
      }
    };
    fill(std::as_const(behind), *output.radiance);
    if (output.coverage != nullptr) fill(std::as_const(covered), *output.coverage);
  }
}

}  // namespace hpr
