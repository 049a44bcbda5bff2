#include "engine/session.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "cluster/distribution/scene_distribution.h"
#include "cluster/transport/collectives.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "compositing/tile_gather.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/balance/load_balance.h"
#include "engine/device/device_choice.h"
#include "gpu/device/gpu_device.h"
#include "gpu/gpu_primary_rays.h"
#include "gpu/light/gpu_tile_shader.h"
#include "raster/chunk_bounds.h"
#include "raster/gl_context.h"
#include "raster/keys/key_readback.h"
#include "raster/raster_speed.h"
#include "raster/rasterizer.h"
#include "rt/deferred_shader.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/ray_forwarding.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/refined_triangles.h"
#include "scene/pages/part_pages.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// Collective. Finds what all of a scene tells that is shared out: which instances are refined, and a camera that sees
/// all of it.
void find_whole(Communicator& comm, Scene& scene) {
  if (scene.parts.empty()) return;
  SceneFraming framing(scene.bounds);
  std::vector<RefinementCount> mine;  // of one of those who hold the part
  const auto add = [&](std::span<const SurfaceRange> surfaces) {
    for (const Instance& instance : scene.instances) framing.add(instance, scene.mesh_of(instance));
    if (static_cast<std::size_t>(comm.rank()) >= scene.parts.size()) return;
    const std::vector<RefinementCount> counts = count_refined_parts(scene, RaySpace(scene), surfaces);
    mine.insert(mine.end(), counts.begin(), counts.end());
  };
  agree_on_failure(comm, [&] {
    if (!scene.part_pages) add(scene.parts.at(static_cast<std::size_t>(comm.rank()) % scene.parts.size()));
    for (std::size_t page = 0; scene.part_pages && page < scene.part_pages->size(); ++page) {
      const PageInUse use(scene, page);
      add(surfaces_of_page(scene, page));
    }
  });
  for (const SceneFraming::Extremes& of_rank : all_gather_value(comm, framing.extremes())) framing.add(of_rank);
  scene.framing = framing.camera();
  std::vector<RefinementCount> all;
  for (const auto& of_rank : all_gather_lists(comm, std::span(std::as_const(mine)))) {
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  }
  scene.refined = refined_by_counts(scene, all);
}

Scene load_scene_of_all(Communicator& comm, const std::function<LoadedScene()>& load) {
  const trace::Span span("load scene");
  Scene scene = distribute_scene(comm, load);
  find_whole(comm, scene);
  return scene;
}

}  // namespace

Session::Session(Communicator& comm, const SessionSettings& settings, const std::function<LoadedScene()>& load)
    : comm_(comm),
      settings_(settings),
      host_(find_host_resources(comm, settings.threads)),
      scene_(load_scene_of_all(comm_, load)),
      requirements_(requirements_of(scene_)),
      assembler_(std::make_unique<Assembler>()),
      tile_gather_(std::make_unique<TileGather>()),
      balance_(std::make_unique<LoadBalance>()) {
  warn_of_scene();
  limit_software_gl(host_.threads);
  if (settings_.backend == kVulkan) {
    start_vulkan();
  } else if (settings_.backend != "auto" || settings_.device >= 0) {
    start_gl();
  } else {
    find_device();
  }
}

Session::~Session() = default;

void Session::start_vulkan() {
  agree_on_failure(comm_, [&] {
    const trace::Span span("start Vulkan");
    // Who names Vulkan is content with a device on the CPU.
    gpu_ = std::make_unique<GpuDevice>(
        GpuOptions{.device = settings_.device, .local_rank = host_.local_rank, .software = true});
    gpu_primary_rays_ = std::make_unique<GpuPrimaryRays>(*gpu_, host_.threads);
  });
  compare_devices();
}

void Session::find_device() {
  const bool may_have_one = has_gpu_device();
  if (std::ranges::count(all_gather_value(comm_, may_have_one ? 1 : 0), 1) == 0) return;  // Vulkan is not even opened
  DeviceOffer mine{.host = host_.host, .problem = "no device of one"};
  if (may_have_one) {
    const trace::Span span("start Vulkan");
    mine = start_offered(host_.host, host_.local_rank, [this](const GpuDevice::Choose& choose) {
      gpu_ = std::make_unique<GpuDevice>(GpuOptions{}, choose);
      gpu_primary_rays_ = std::make_unique<GpuPrimaryRays>(*gpu_, host_.threads);
    });
  }
  const auto states = all_gather_value(comm_, mine.state);
  const std::vector<std::string> hosts = all_gather_texts(comm_, mine.host);
  const std::vector<std::string> problems = all_gather_texts(comm_, mine.problem);
  std::vector<DeviceOffer> offers;
  for (std::size_t rank = 0; rank < states.size(); ++rank)
    offers.push_back({states[rank], hosts[rank], problems[rank]});
  const DeviceChoice choice = choose_devices(offers);
  if (choice.uses) return compare_devices();
  gpu_primary_rays_.reset();
  gpu_.reset();
  no_device_ = choice.why;
  if (choice.is_warning && comm_.rank() == 0) log::warning("{}: keys and light are made without Vulkan", choice.why);
}

/// What there is to say of the ranks' devices, and how much memory they have for each rank.
void Session::compare_devices() {
  const GpuInfo& device = gpu_->info();
  log::debug("Vulkan: {}, {}", device.name, device.driver);
  std::vector<DeviceOfRank> used;
  const std::vector<std::string> hosts = all_gather_texts(comm_, host_.host);
  const auto uuids = all_gather_value(comm_, device.uuid);
  const auto by_cpu = all_gather_value(comm_, device.software ? 1 : 0);
  const std::vector<std::string> devices = all_gather_texts(comm_, device.name + ", " + device.driver);
  for (std::size_t rank = 0; rank < hosts.size(); ++rank) used.push_back({hosts[rank], uuids[rank], by_cpu[rank] != 0});
  const auto self = static_cast<std::size_t>(comm_.rank());
  const auto together = std::ranges::count_if(
      used, [&](const DeviceOfRank& each) { return each.host == used[self].host && each.uuid == used[self].uuid; });
  device_bytes_ = std::ranges::min(all_gather_value(comm_, device.memory / static_cast<std::uint64_t>(together)));
  if (comm_.rank() != 0) return;
  if (const std::string crowding = describe_crowding(used); !crowding.empty()) log::warning("{}", crowding);
  const auto other = std::ranges::find_if(devices, [&](const std::string& each) { return each != devices.front(); });
  if (other != devices.end()) {
    log::warning("rank {} has another device than rank 0 ({}; {}): pictures may differ in last bits, and at edges",
                 other - devices.begin(), *other, devices.front());
  }
  std::vector<std::size_t> ranks;
  for (std::size_t rank = 0; rank < by_cpu.size(); ++rank) {
    if (by_cpu[rank] != 0) ranks.push_back(rank);
  }
  if (!ranks.empty()) {
    log::warning("Vulkan has no GPU for {} {}: the CPU does its work, slowly", ranks.size() == 1 ? "rank" : "ranks",
                 fmt::join(ranks, ", "));
  }
  if (!fits_on_gpu(scene_) && settings_.backend == kVulkan)
    log::warning("Embree makes the keys: no device takes parts of scenes");
}

GpuPrimaryRays& Session::gpu_primary_rays(std::span<const SurfaceRange> objects) {
  HPR_CHECK(gpu_primary_rays_ && fits_on_gpu(scene_));
  const trace::Span span("scene to device");
  gpu_primary_rays_->hold(scene_, objects);
  return *gpu_primary_rays_;
}

/// Why the device takes nothing of this scene; empty: it does. Whoever names Vulkan gets an error where its memory
/// ends.
std::string Session::refusal_of_scene() const {
  if (!fits_on_gpu(scene_)) return "no device takes parts of scenes";
  if (settings_.backend == kVulkan) return {};
  const std::uint64_t bytes = device_bytes_of(scene_);
  if (bytes <= device_bytes_ / 2) return {};  // the rest is for pixels, photons and other programs
  return fmt::format("the scene may take {} of the {} that a rank has there", format_bytes(bytes),
                     format_bytes(device_bytes_));
}

bool Session::has_gpu_of_keys() const {
  return gpu_ && refusal_of_scene().empty();
}

std::string Session::refusal_of_light(const RaySettings& settings) const {
  if (!gpu_) return "no device was asked for";
  if (std::string refusal = refusal_of_scene(); !refusal.empty()) return refusal;
  return hpr::refusal_of_light(scene_, settings);
}

std::string Session::device_and_driver() const {
  return gpu_ ? fmt::format("{}, driver {}", gpu_->info().name, gpu_->info().driver) : "";
}

std::string Session::device_description() const {
  if (!gpu_) return no_device_.empty() ? "" : fmt::format("none ({})", no_device_);
  return fmt::format("{} ({})", device_and_driver(),
                     settings_.backend == kVulkan ? "as asked by --backend vulkan" : "a GPU that Vulkan has");
}

void Session::start_gl() {
  if (gl_) return;
  std::unique_ptr<GlContext> context;
  const bool by_vulkan = settings_.backend == kVulkan;
  agree_on_failure(comm_, [&] {
    const trace::Span span("start OpenGL");
    context = make_gl_context({.backend = by_vulkan ? "auto" : settings_.backend,
                               .device = by_vulkan ? -1 : settings_.device,
                               .local_rank = host_.local_rank,
                               .threads = host_.threads});
  });
  gl_ = std::move(context);
  log::debug("OpenGL: {}", gl_->description());
  compare_rasterizers();
}

bool Session::draws_by_software() {
  const auto of_any = [this](bool mine) { return std::ranges::count(all_gather_value(comm_, mine ? 1 : 0), 1) > 0; };
  if (of_any(!has_gpu_device())) return true;
  start_gl();
  return of_any(gl_->software());
}

RasterSpeed Session::measure_raster() {
  HPR_CHECK(gl_);
  return measure_raster_speed(*gl_);
}

std::string Session::gl_description() const {
  return gl_ ? gl_->description() : "not started, as nothing was drawn by it";
}

std::string_view Session::key_route() const {
  HPR_CHECK(gl_);
  return route_name(fastest_route(*gl_));
}

std::string Session::gpu() const {
  if (gpu_ && !gpu_->info().software) {
    return host_.host + ": " + gpu_->info().name;
  }
  return gl_ && !gl_->software() ? host_.host + ": " + gl_->description() : "";
}

Session::HostResources Session::find_host_resources(Communicator& comm, int threads) {
  HostResources host;
  host.host = host_name();
  host.ranks = 0;
  const std::vector<std::string> hosts = all_gather_texts(comm, host.host);
  for (int rank = 0; rank < comm.size(); ++rank) {
    if (hosts[static_cast<std::size_t>(rank)] != host.host) continue;
    if (rank < comm.rank()) ++host.local_rank;
    ++host.ranks;
  }
  // A launcher may already have given this rank cores of its own; else the ranks of a host share all of them.
  const int online = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  host.threads = threads > 0 ? threads : std::clamp(online / host.ranks, 1, usable_cores());
  return host;
}

void Session::load(const std::function<LoadedScene()>& load) {
  Scene scene = load_scene_of_all(comm_, load);
  release_scene();
  scene_ = std::move(scene);
  balance_->forget();
  requirements_ = requirements_of(scene_);
  warn_of_scene();
}

void Session::change_scene(const std::function<void(Scene&)>& change) {
  release_scene();
  change(scene_);
  find_whole(comm_, scene_);
  requirements_ = requirements_of(scene_);
}

void Session::warn_of_scene() const {
  if (comm_.rank() != 0) return;
  for (const std::string& warning : scene_.warnings)
    log::warning("{}: {}", printable(scene_.name), printable(warning, 400));
}

void Session::release_scene() {
  release_rays();
  if (gpu_primary_rays_) gpu_primary_rays_->release();
  part_.reset();
  forwarding_.reset();
  traced_objects_.clear();
  rasterizer_.reset();
  whole_rasterizer_.reset();
  receiving_rasterizer_.reset();
  objects_.clear();
  scene_chunks_.reset();
}

const SceneChunks& Session::scene_chunks() {
  if (!scene_chunks_) {
    const trace::Span span("cut chunks");
    scene_chunks_ = std::make_unique<SceneChunks>(make_scene_chunks(scene_, threads()));
  }
  return *scene_chunks_;
}

void Session::compare_rasterizers() {
  if (comm_.size() == 1) return;
  const auto prints = all_gather_value(comm_, raster_fingerprint(*gl_));
  std::vector<std::size_t> others;
  for (std::size_t rank = 0; rank < prints.size(); ++rank) {
    if (prints[rank] != prints[0]) others.push_back(rank);
  }
  if (!others.empty() && comm_.rank() == 0) {
    log::warning("ranks {} rasterise differently from rank 0 (another GL driver or CPU): pictures may differ at edges",
                 fmt::join(others, ", "));
  }
}

Rasterizer& Session::rasterizer(std::span<const SurfaceRange> objects) {
  HPR_CHECK(gl_);
  if (!rasterizer_ || !std::ranges::equal(objects, objects_)) {
    const trace::Span span("upload geometry");
    rasterizer_.reset();  // frees its GPU memory before the next one takes some
    objects_.assign(objects.begin(), objects.end());
    rasterizer_ = std::make_unique<Rasterizer>(*gl_, scene_, objects_, host_.threads);
  }
  return *rasterizer_;
}

Rasterizer& Session::receiving_rasterizer() {
  HPR_CHECK(gl_);
  if (!receiving_rasterizer_) {
    receiving_rasterizer_ = std::make_unique<Rasterizer>(*gl_, scene_, std::span<const SurfaceRange>(), host_.threads);
  }
  return *receiving_rasterizer_;
}

void Session::release_rays() {
  shader_.reset();
  ray_settings_.reset();
  primary_rays_.reset();
  whole_primary_rays_.reset();
  traced_part_.reset();
  ray_scene_.reset();
}

void Session::build_rays_by(const RayBuild& build) {
  if (build == ray_build_) return;
  release_rays();
  ray_build_ = build;
}

void Session::partition_rays(const RaySettings& settings) {
  build_rays_by(settings.build);
  Communicator& holders = settings.part && !settings.holders.empty() ? group(settings.holders) : comm_;
  if (settings.part == part_ && settings.holders == holders_) return;
  release_rays();
  forwarding_.reset();
  part_.reset();  // where what follows fails, it is tried again
  holders_ = settings.holders;
  if (!settings.part) return;
  forwarding_ = scene_.part_pages ? std::make_unique<RayForwarding>(holders, scene_, RaySpace(scene_))
                                  : std::make_unique<RayForwarding>(holders, scene_, RaySpace(scene_), *settings.part);
  part_ = settings.part;
}

std::unique_ptr<RayScene> Session::build_ray_scene(std::span<const SurfaceRange> objects) const {
  const trace::Span span("build ray scene");
  return std::make_unique<RayScene>(scene_, RaySpace(scene_), host_.threads, objects, ray_build_);
}

void Session::draw_pages(std::span<const SurfaceRange> objects,
                         const std::function<void(std::span<const SurfaceRange>)>& draw) {
  if (!scene_.part_pages) return draw(objects);
  const auto forget_page = [this] {  // its memory goes before the next frame
    page_.reset();
    rasterizer_.reset();
    primary_rays_.reset();
  };
  forget_page();  // of a frame that failed
  for (const std::size_t page : scene_.part_pages->nearest_first()) {
    const PageInUse use(scene_, page);
    page_ = page;
    const std::span<const SurfaceRange> surfaces = surfaces_of_page(scene_, page);
    draw(common_ranges(merged_ranges({objects.begin(), objects.end()}, scene_.triangles),
                       merged_ranges({surfaces.begin(), surfaces.end()}, scene_.triangles)));
  }
  forget_page();
}

/// The primary rays through what a page has of the scene that light meets.
PrimaryRays& Session::primary_rays_of_page() {
  HPR_CHECK(page_);
  primary_rays_ =
      std::make_unique<PrimaryRays>(scene_, ray_scene(ray_build_).of_page(*page_, host_.threads), host_.threads);
  return *primary_rays_;
}

PrimaryRays& Session::primary_rays(std::span<const SurfaceRange> objects, const RaySettings& settings) {
  partition_rays(settings);
  if (scene_.part_pages) return primary_rays_of_page();
  if (!primary_rays_ || !std::ranges::equal(objects, traced_objects_)) {
    primary_rays_.reset();
    traced_part_.reset();  // frees its memory before the next one takes some
    traced_objects_.assign(objects.begin(), objects.end());
    const bool everything = merged_ranges(traced_objects_, scene_.triangles) == covering_part();
    if (!everything) traced_part_ = build_ray_scene(traced_objects_);
    primary_rays_ =
        std::make_unique<PrimaryRays>(scene_, everything ? ray_scene(ray_build_) : *traced_part_, host_.threads);
  }
  return *primary_rays_;
}

Rasterizer& Session::whole_rasterizer() {
  HPR_CHECK(gl_);
  const std::vector<SurfaceRange> everything = covering_part();
  if (rasterizer_ && merged_ranges(objects_, scene_.triangles) == everything) return *rasterizer_;
  if (!whole_rasterizer_) {
    const trace::Span span("upload geometry");
    whole_rasterizer_ = std::make_unique<Rasterizer>(*gl_, scene_, everything, host_.threads);
  }
  return *whole_rasterizer_;
}

PrimaryRays& Session::whole_primary_rays(const RaySettings& settings) {
  HPR_CHECK(!settings.part);
  partition_rays(settings);
  if (primary_rays_ && !traced_part_) return *primary_rays_;
  if (!whole_primary_rays_) {
    whole_primary_rays_ = std::make_unique<PrimaryRays>(scene_, ray_scene(ray_build_), host_.threads);
  }
  return *whole_primary_rays_;
}

/// Of the surfaces that cover what is behind them, those that rays meet at home.
std::vector<SurfaceRange> Session::covering_part() const {
  return surfaces_at_home(scene_, part_, covering_surfaces(scene_, false));
}

const RayScene& Session::ray_scene(const RayBuild& build) {
  build_rays_by(build);
  if (!ray_scene_) {
    ray_scene_ = build_ray_scene(covering_part());
    if (forwarding_) ray_scene_->share(*forwarding_, covering_surfaces(scene_, false), ray_build_);
  }
  return *ray_scene_;
}

DeferredShader& Session::shader(const RaySettings& settings) {
  partition_rays(settings);
  if (!shader_ || ray_settings_ != settings) {
    const trace::Span span("prepare light");
    shader_.reset();  // its parts of the scene leave before others come
    RaySettings own = settings;
    own.threads = host_.threads;
    own.host_ranks = host_.ranks;
    MakeTileShader make_device;
    if (own.on_device) {
      HPR_CHECK(gpu_ && refusal_of_light(own).empty());
      make_device = [this](const ShadingInputs& inputs) {
        return std::make_unique<GpuTileShader>(*gpu_, inputs, host_.threads);
      };
    }
    shader_ = std::make_unique<DeferredShader>(
        scene_, own, requirements_, [this]() -> const RayScene& { return ray_scene(ray_build_); }, forwarding_.get(),
        make_device);
    ray_settings_ = settings;
  }
  return *shader_;
}

void Session::leave_other_group(std::span<const int> members) {
  if (!group_.comm || std::ranges::equal(members, group_.members)) return;
  compositor_.reset();  // these may hold on to the old group
  keys_ = {};
  release_rays();
  forwarding_.reset();
  part_.reset();
  group_ = {};
}

Communicator& Session::group(std::span<const int> members) {
  leave_other_group(members);
  if (static_cast<int>(members.size()) == comm_.size()) return comm_;
  if (!group_.comm) {
    group_.comm = comm_.subset(members);
    group_.members.assign(members.begin(), members.end());
  }
  return *group_.comm;
}

Compositor& Session::compositor(const std::string& strategy, std::span<const int> members) {
  (void)group(members);  // a new group ends the old one's strategy
  if (!compositor_ || strategy_ != strategy) {
    compositor_ = make_compositor(strategy);
    strategy_ = strategy;
  }
  return *compositor_;
}

TileLayer<Key>& Session::keys(const FrameLayout& layout, const std::string& strategy, std::span<const int> members) {
  leave_other_group(members);  // also who is alone now: the others wait for that, where memory was shared
  const bool shared = members.size() > 1 && compositor(strategy, members).merges_in_place();
  bool fits = keys_.layout() == layout && keys_shared_ == shared && std::ranges::equal(members, keys_members_);
  // Other ranks may have new groups where this one's stays: then all take memory, as all agree on whether there is
  // some.
  if (static_cast<int>(members.size()) < comm_.size()) {
    fits = std::ranges::all_of(all_gather_value(comm_, fits ? 1 : 0), [](int of_rank) { return of_rank == 1; });
  }
  if (fits && layout.tiles() > 0) {
    parallel_for(threads(), keys_.tiles(), [&](std::size_t tile) { keys_.clear(tile); });
    return keys_;
  }
  keys_ = {};  // before as much is taken again
  agree_on_failure(comm_, [&] { keys_ = shared ? shared_layer(layout, strategy, members) : TileLayer<Key>(layout); });
  keys_shared_ = shared;
  keys_members_.assign(members.begin(), members.end());
  return keys_;
}

std::span<TileLayer<Key>> Session::round_keys(const FrameLayout& layout, std::size_t count) {
  if (!round_keys_.empty() && round_keys_.front().layout() != layout) round_keys_.clear();
  while (round_keys_.size() < count) round_keys_.emplace_back(layout);
  while (round_keys_.size() > std::max<std::size_t>(count, 2)) round_keys_.pop_back();
  const std::span<TileLayer<Key>> layers = std::span(round_keys_).first(count);
  parallel_for(threads(), layers.size() * layout.tiles(),
               [&](std::size_t i) { layers[i / layout.tiles()].clear(i % layout.tiles()); });
  return layers;
}

TileLayer<Key> Session::shared_layer(const FrameLayout& layout, const std::string& strategy,
                                     std::span<const int> members) {
  try {
    return {layout, group(members).share(TileLayer<Key>::bytes_for(layout))};
  } catch (const Error& error) {
    // All ranks of the group failed alike. Whoever leaves the choice of strategy to us gets another one.
    if (error.code() != ExitCode::Limit || strategy != "auto") throw;
    if (comm_.rank() == 0) log::warning("{}; compositing by messages", error.what());
    return TileLayer<Key>(layout);
  }
}

}  // namespace hpr
