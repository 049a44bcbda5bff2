#include "engine/plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "cluster/transport/collectives.h"
#include "compositing/compositor.h"
#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "engine/balance/distribution_choice.h"
#include "engine/balance/load_balance.h"
#include "engine/binning/chunk_binning.h"
#include "engine/display/background.h"
#include "engine/session.h"
#include "gpu/light/gpu_photon_tracer.h"
#include "rt/passes/pass_list.h"
#include "rt/sampling/sampler.h"
#include "rt/sampling/sampling.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/pages/part_pages.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

std::string explain_depth(const FramePlan& plan) {
  const char* why = "keys of {} bytes instead of 8 where they are sent, drawn so by OpenGL";
  if (plan.mine.group.size() == 1 && !plan.by_view) {
    why = "as asked; gains nothing, as nothing is composited";
  } else if (plan.strategy == "mpi-reduce") {
    why = "as asked; gains nothing, as MPI's reduction moves whole keys";
  } else if (!plan.by_view && (plan.strategy == "shared-memory" || plan.strategy == "auto")) {
    why = "keys of {} bytes instead of 8 between hosts; gains nothing inside one, where they are merged in place";
  }
  return fmt::format("depth: {} bits ({})", kDepthFormatNames.at(static_cast<std::size_t>(plan.depth_format)),
                     fmt::format(fmt::runtime(why), sent_bytes(plan.depth_format)));
}

std::string explain(const RayBuild& build) {
  return fmt::format("embree: {} build quality, {}", kBuildQualityNames.at(static_cast<std::size_t>(build.quality)),
                     build.same_instructions
                         ? "AVX2 on every rank"
                         : "each rank's widest instructions (last bits may differ between machines)");
}

/// A map finer than the pixels that look at it is wasted work: progressive samples add up to the same.
std::uint32_t photons_for(std::uint32_t most, std::span<const View> views) {
  constexpr std::size_t kMinPhotons = 1000;
  std::size_t pixels = 0;
  for (const View& view : views) pixels += view.size().area();
  return static_cast<std::uint32_t>(std::min<std::size_t>(most, std::max(pixels, kMinPhotons)));
}

/// One rank composites nothing.
void check_fits(const std::string& strategy, int ranks) {
  if (ranks <= 1 || make_compositor(strategy)->fits(ranks)) return;
  throw Error(ExitCode::Usage, fmt::format("strategy {} cannot run on {} ranks", strategy, ranks),
              "choose other factors or another strategy, or another number of ranks (--ranks, --groups)");
}

/// Throws Error (Usage), on all ranks alike, for what ranks cannot do that hold parts.
void check_parts(const FrameSettings& settings, const FramePlan& plan, const Scene& scene, int ranks) {
  if (!scene.parts.empty() && settings.verify_percent > 0.0) {
    throw Error(ExitCode::Usage, "--verify has a tile drawn whole by another rank, and ranks hold parts of the scene",
                "leave it out, or load the scene with --data replicated");
  }
  if (settings.in_parts() && plan.distribution == Distribution::Hybrid && ranks % plan.groups != 0) {
    throw Error(ExitCode::Usage, fmt::format("{} ranks make no {} groups of one size", ranks, plan.groups),
                "each group holds all of the scene: choose another number of groups or of ranks");
  }
}

/// Whether groups of the ranks follow the view. Strategies composite groups whose tiles are cut beforehand; so whoever
/// names one, or says how many groups there are to be, gets those. Rays find a surface among many as fast as among few,
/// and would need an Embree scene anew for other objects.
bool groups_follow_view(const FramePlan& plan, const FrameSettings& settings, const Scene& scene, int ranks) {
  return plan.distribution == Distribution::Hybrid && ranks > 1 && settings.groups == 0 && settings.strategy.empty() &&
         plan.primary == Primary::Raster && !settings.in_parts() && scene.parts.empty();
}

/// Who draws what, and how it comes together.
std::vector<std::string> explain_distribution(const FramePlan& plan, const FrameSettings& settings,
                                              const DistributionChoice& choice, int ranks) {
  std::vector<std::string> lines{fmt::format("distribute: {} over {} rank{} ({})", name_of(plan.distribution), ranks,
                                             ranks == 1 ? "" : "s", choice.why)};
  if (!choice.speeds.empty()) lines.push_back(fmt::format("speeds: {}", choice.speeds));
  if (plan.by_view) {
    lines.push_back(fmt::format("groups: by view ({})", describe(*plan.by_view)));
    lines.emplace_back("composite: each tile among the ranks that draw into it (they are known beforehand)");
  } else {
    const char* const why =
        settings.strategy.empty() ? "shared memory on one host, else what is predicted to take least" : "as asked";
    lines.push_back(plan.mine.group.size() > 1
                        ? fmt::format("composite: {} among {} ranks ({})", plan.strategy, plan.mine.group.size(), why)
                        : fmt::format("composite: off (one rank covers each tile)"));
  }
  if (plan.depth_format != DepthFormat::Float32) lines.push_back(explain_depth(plan));
  return lines;
}

std::string counted(std::size_t count, std::string_view what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// What the scene has of each kind of light: "1 point light", "2 triangles that emit", "the environment studio".
std::vector<std::string> describe_lights(const Scene& scene) {
  constexpr std::array<std::string_view, 4> kLightNames{"point light", "directional light", "spotlight", "headlight"};
  std::array<std::size_t, kLightNames.size()> lights{};
  for (const Light& light : scene.lights) ++lights.at(static_cast<std::size_t>(light.type));
  std::vector<std::string> parts;
  for (std::size_t type = 0; type < lights.size(); ++type) {
    if (lights[type] > 0) parts.push_back(counted(lights[type], kLightNames[type]));
  }
  std::vector<bool> emitting;
  for (const Material& material : scene.materials) emitting.push_back(emits(scene, material));
  std::size_t triangles = 0;
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    if (emitting[mesh.material]) triangles += mesh.triangle_count();
  }
  if (triangles > 0) parts.push_back(counted(triangles, "triangle") + (triangles == 1 ? " that emits" : " that emit"));
  if (!scene.environment_note.empty()) {
    parts.push_back(scene.environment_note);
  } else if (scene.environment) {
    parts.emplace_back("the scene's environment");
  }
  return parts;
}

/// What this rank holds of the scene; empty: all of it, as nothing else was asked for.
std::string explain_data(const Session& session, const FrameSettings& settings, const FramePlan& plan) {
  if (!plan.rays.part) return settings.in_parts() ? "data: whole (one rank has all of it)" : "";
  const PartPages* const pages = session.scene().part_pages.get();
  const char* const why = settings.in_parts() ? "as asked" : "ranks hold parts of the scene";
  if (pages == nullptr) {
    return fmt::format("data: partitioned ({}: rays travel to the ranks whose objects they may meet)", why);
  }
  return fmt::format(
      "data: paged ({}: rays wait for the pages they may meet; {} of {} pages of this rank are in memory at a time, "
      "the "
      "largest of {})",
      why, pages->max_resident(), pages->size(), format_bytes(pages->bytes_of_largest()));
}

/// What lights the pixels, and how many of them.
void explain_light(Session& session, const FrameSettings& settings, FramePlan& plan) {
  auto& lines = plan.explained;
  if (plan.rays.build != RayBuild{}) lines.push_back(explain(plan.rays.build));
  if (const std::string data = explain_data(session, settings, plan); !data.empty()) lines.push_back(data);
  lines.push_back(fmt::format("shading: {} ({})", plan.shading == Shading::Deferred ? "deferred" : "local",
                              plan.shading == Shading::Deferred ? "each visible pixel is lit once, after compositing"
                                                                : "each rank lights all it drew, before compositing"));
  if (settings.resolution_scale != 1.0) {
    lines.push_back(
        fmt::format("resolution: {} of the pixels a side (as asked), enlarged by a filter", settings.resolution_scale));
  }
  if (plan.rays.show != Show::Shaded) {
    lines.push_back(fmt::format("show: {} (as asked, in place of light)", name_of(plan.rays.show)));
  }
  if (!needs_light(plan.rays.show)) return;
  const std::vector<std::string> lights = describe_lights(session.scene());
  if (!lights.empty()) lines.push_back(fmt::format("light: {}", fmt::join(lights, ", ")));
  if (plan.rays.background.kind != Background::Kind::Environment) {
    lines.push_back(fmt::format("background: {} (as asked{})", to_text(plan.rays.background),
                                plan.is_transparent() ? ": alpha is what surfaces cover" : ""));
  }
  if (!gives_light(session.scene())) {
    lines.emplace_back("light: a headlight at the eye (the scene has no lights)");
  } else if (session.scene().triangles > 0 && !session.requirements().indirect.needed &&
             !session.requirements().shadow.needed) {
    lines.emplace_back("light: none (what the scene has of lights is black)");
  }
  if (!plan.rays.half_resolution.empty()) {
    lines.push_back(
        fmt::format("half resolution: {} (as asked)", fmt::join(names_of(plan.rays.half_resolution), ", ")));
  }
  if (plan.rays.denoise) {
    lines.push_back(fmt::format("denoiser: in the first {} samples (as asked)", kDenoisedSamples));
  }
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rays through a grid of points of every view.
std::vector<Ray> camera_rays(std::span<const View> views) {
  constexpr double kRays = 1024.0;
  const int side = std::max(4, static_cast<int>(std::sqrt(kRays / static_cast<double>(views.size()))));
  std::vector<Ray> rays_from_eye;
  for (const View& view : views) {
    for (int i = 0; i < side * side; ++i) {
      const int column = i % side;
      const int row = i / side;
      const double x = (column + 0.5) * view.size().width / side;
      const double y = (row + 0.5) * view.size().height / side;
      Ray ray = view_ray(view, x, y);
      ray.origin += ray.direction * view.near_distance;
      ray.direction = glm::normalize(ray.direction);
      rays_from_eye.push_back(ray);
    }
  }
  return rays_from_eye;
}

/// What one of the camera rays meets.
struct SeenPoint {
  std::size_t ray = 0;
  SurfacePoint surface;
};

/// Where the camera rays of some views end, of those that meet something. The same on all ranks, however the scene is
/// shared out. Inside RayScene::for_each.
std::vector<SeenPoint> find_seen(const RayScene& scene, const Surfaces& surfaces, std::span<const Ray> camera_rays) {
  RayBatch rays;
  for (const Ray& ray : camera_rays) {
    rays.push(scene.space().from_world(ray.origin), ray.direction, kInfinity, Faces::Front);
  }
  std::vector<std::uint32_t> hits(camera_rays.size());
  (void)scene.closest(rays, hits);
  surfaces.prefetch(hits);
  std::vector<SeenPoint> seen;
  WorldTriangle triangle;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (hits[i] == kNoSurface) continue;
    surfaces.load(hits[i], triangle);
    seen.push_back({i, surfaces.meet(triangle, camera_rays[i].origin, camera_rays[i].direction)});
  }
  return seen;
}

/// Collective. How much of the sky's light reaches the surfaces that some views see, as about a thousand rays find out:
/// of what would without anything in its way. None where the views see no surface.
std::optional<double> open_sky(Session& session, const RaySettings& settings, std::span<const View> views) {
  session.partition_rays(settings);
  const RayScene& scene = session.ray_scene(settings.build);
  const Surfaces surfaces(session.scene(), scene.space(), true, session.forwarding());
  const std::vector<Ray> rays_from_eye = camera_rays(views);
  std::vector<std::uint8_t> blocked;
  scene.for_each(1, 1, [&](std::size_t) {
    RayBatch rays;
    for (const SeenPoint& point : find_seen(scene, surfaces, rays_from_eye)) {
      Sampler sampler(photon_stream({settings.seed, 0}), static_cast<std::uint32_t>(point.ray));
      const glm::dvec3 up = warp::cosine_lobe(point.surface.geometric_normal, sampler.two());
      rays.push(scene.space().from_world(ray_origin(point.surface, up)), up, kInfinity);
    }
    blocked.resize(rays.size());
    (void)scene.occluded(rays, blocked);
  });
  if (blocked.empty()) return std::nullopt;
  return static_cast<double>(std::ranges::count(blocked, 0)) / static_cast<double>(blocked.size());
}

/// Metres, rounded so that no processor's last bits count, and views that are almost the same have one.
double rounded_footprint(double metres) {
  constexpr double kStepsPerDoubling = 4.0;
  return std::exp2(std::round(kStepsPerDoubling * std::log2(metres)) / kStepsPerDoubling);
}

/// Collective. Metres across that a pixel covers of what some views see, in the median over camera rays; 0 where they
/// see no surface.
double pixel_footprint(Session& session, const RaySettings& settings, std::span<const View> views) {
  session.partition_rays(settings);
  const RayScene& scene = session.ray_scene(settings.build);
  const Surfaces surfaces(session.scene(), scene.space(), true, session.forwarding());
  const std::vector<Ray> rays_from_eye = camera_rays(views);
  const std::size_t rays_of_view = rays_from_eye.size() / views.size();
  std::vector<double> footprints;
  scene.for_each(1, 1, [&](std::size_t) {
    for (const SeenPoint& point : find_seen(scene, surfaces, rays_from_eye)) {
      const View& view = views[point.ray / rays_of_view];
      const glm::dvec2 center(0.5 * view.size().width, 0.5 * view.size().height);
      const Ray one = view_ray(view, center.x, center.y);
      const Ray beside = view_ray(view, center.x + 1.0, center.y);
      const double apart = glm::distance(glm::normalize(one.direction), glm::normalize(beside.direction));
      footprints.push_back(glm::distance(one.origin, beside.origin) +
                           apart * glm::distance(view.eye, point.surface.position));
    }
  });
  if (footprints.empty()) return 0.0;
  const auto median = footprints.begin() + static_cast<std::ptrdiff_t>(footprints.size() / 2);
  std::ranges::nth_element(footprints, median);
  return *median > 0.0 ? rounded_footprint(*median) : 0.0;
}

/// How many photons are sent, and how far they are gathered from, where the settings leave that to what is seen.
void fit_photons(Session& session, const FrameSettings& settings, FramePlan& plan, std::span<const View> views) {
  const bool sends = runs_pass(plan_passes(session.requirements(), plan.rays), PassId::Photon);
  if (sends && plan.rays.global_photons && plan.rays.photon_footprint == 0.0) {
    plan.rays.photon_footprint = all_gather_value(session.comm(), pixel_footprint(session, plan.rays, views)).front();
  }
  if (!settings.photons_fit_frame) return;
  if (plan.rays.photon_footprint > 0.0) {
    plan.rays.fits_photons = true;
    // Rays bring all but caustics, of which a small picture shows little.
    constexpr std::uint32_t kPerPixel = 4;
    if (final_gathers(session.requirements(), plan.rays)) {
      plan.rays.photons = photons_for(plan.rays.photons / kPerPixel, views) * kPerPixel;
    }
  } else {
    plan.rays.photons = photons_for(plan.rays.photons, views);
  }
}

/// Processor time of OpenGL's start in ns, with its first shaders, on an Intel Xeon, as bench/primary_bench.cpp
/// measures it. What else keys take is as documented in MachineSpeeds: only ratios decide.
constexpr double kStartCost = 52e6;

/// What is done once is shared out among so many frames, unless it is known to be for one.
constexpr double kFrames = 8.0;

/// Leaves this rank its part of the scene's objects: those it draws, or under sort-middle, where it draws what others
/// send as well, those it culls.
void partition(const Session& session, FramePlan& plan) {
  if (plan.distribution == Distribution::SortMiddle) {
    plan.mine.objects = partition_objects(session.scene(), session.ranks())[static_cast<std::size_t>(session.rank())];
  }
  plan.rays.part = plan.mine.objects;
  if (plan.distribution != Distribution::SortMiddle) plan.rays.holders = plan.mine.group;
}

/// Collective where the choice is left open: who makes the keys, and why.
PrimaryChoice primary_of_frame(Session& session, const FrameSettings& settings, const FramePlan& plan,
                               std::span<const View> views) {
  const bool rounds_depth = settings.depth_format != DepthFormat::Float32;
  const bool has_points = std::ranges::any_of(views, [](const View& view) { return view.points.has_value(); });
  const bool by_device = settings.keys_by_device && !rounds_depth && !has_points && session.has_gpu_of_keys();
  if (by_device && settings.primary != Primary::Raster) return {Primary::Rays, "by the device", true};
  if (settings.primary != Primary::Auto) return {settings.primary, "as asked"};
  KeyWork work{.triangles = session.scene().triangles,
               .own_triangles = mesh_triangles(session.scene()),
               .single_picture = settings.single_picture};
  for (const View& view : views) work.pixels += view.size().area();
  work.rounds_depth = rounds_depth;
  work.software_gl = work.rounds_depth || session.draws_by_software();
  work.ray_scene_is_for_keys = !traces_rays_beside_keys(session.requirements(), plan.rays);
  return choose_primary(work);
}

/// Whether rays or photons are to bring indirect light, where the scene leaves the choice.
void choose_indirect(Session& session, const FrameSettings& settings, FramePlan& plan, std::span<const View> views) {
  if (settings.indirect_is_chosen || !plan.rays.passes.empty()) return;
  RaySettings wanted = plan.rays;
  wanted.gather = true;
  if (wanted.reference || !needs_light(wanted.show) || !session.requirements().indirect.needed ||
      !gathers_by_rays(session.requirements(), wanted)) {
    return;
  }
  // Processors that round otherwise may count otherwise.
  const std::optional<double> open = all_gather_value(session.comm(), open_sky(session, plan.rays, views)).front();
  if (!open) return;
  plan.rays.gather = *open >= kOpenSky;
  plan.explained.push_back(fmt::format("indirect light: by {} ({:.0f} % of what is seen lies open to the even sky)",
                                       plan.rays.gather ? "rays" : "photons", 100.0 * *open));
}

/// Why no device lights these views; empty: one does.
std::string refusal_of_light(const Session& session, const FramePlan& plan, std::span<const View> views) {
  if (std::ranges::any_of(views, [](const View& view) { return view.points.has_value(); })) {
    return "pixels that look through points are the CPU's";
  }
  if (!plan.aovs.empty()) return "further layers (--aov) are the CPU's";
  return session.refusal_of_light(plan.rays);
}

/// Whether a device lights, where one was asked for, and why not.
void choose_light(const Session& session, const FrameSettings& settings, FramePlan& plan, std::span<const View> views) {
  if (!session.has_device() || !needs_light(plan.rays.show)) return;
  const std::string refusal =
      settings.light_by_device ? refusal_of_light(session, plan, views) : "as what was lit before";
  plan.rays.on_device = refusal.empty();
  plan.explained.push_back(refusal.empty() ? "light: on the device" : fmt::format("light: by the CPU ({})", refusal));
  if (!refusal.empty() || !runs_pass(plan_passes(session.requirements(), plan.rays), PassId::Photon)) return;
  const std::string untraced = refusal_of_photons(session.scene());
  plan.explained.push_back(untraced.empty() ? "photons: traced on the device"
                                            : fmt::format("photons: traced by the CPU ({})", untraced));
}

void explain_pass(const PassPlan& pass, const FrameSettings& settings, FramePlan& plan) {
  auto& lines = plan.explained;
  lines.push_back(fmt::format("pass {}: {} ({})", name_of(pass.pass), pass.runs ? "on" : "off", pass.why));
  if (!pass.runs || !info_of(pass.pass).needs_photons) return;
  const std::uint32_t photons = plan.rays.photons > 0 ? plan.rays.photons : kPhotons;
  if (plan.rays.fits_photons) {
    lines.push_back(fmt::format("photons: up to {} a sample (as many as fill what they are gathered from)", photons));
  } else {
    lines.push_back(
        fmt::format("photons: {} a sample ({})", photons,
                    settings.photons_fit_frame ? "of the quality, but no more than pixels, past 1000" : "as asked"));
  }
  if (plan.rays.photon_radius > 0.0) {
    lines.push_back(fmt::format("photon radius: {} m at first (as asked)", plan.rays.photon_radius));
  } else if (plan.rays.photon_footprint > 0.0) {
    lines.push_back(fmt::format(
        "photon radius: two pixels at first, of {:.3g} m (the median of what is seen), or more where photons are few",
        plan.rays.photon_footprint));
  }
}

}  // namespace

PrimaryChoice choose_primary(const KeyWork& work) {
  if (work.rounds_depth) return {Primary::Raster, "OpenGL alone rounds depths"};
  if (!work.software_gl) return {Primary::Raster, "by a GPU"};
  const MachineSpeeds typical;
  const double build_ns = work.ray_scene_is_for_keys ? typical.build * static_cast<double>(work.own_triangles) : 0.0;
  const double trace_ns = typical.ray * static_cast<double>(work.pixels);
  const double rays_ns = trace_ns + build_ns / (work.single_picture ? 1.0 : kFrames);
  const double start_ns = kStartCost / kFrames;
  const double raster_ns = typical.raster.triangle * static_cast<double>(work.triangles) + start_ns;
  if (rays_ns > raster_ns) {
    return {Primary::Raster, fmt::format("{} pixels are many beside {} triangles{}", work.pixels, work.triangles,
                                         build_ns > 0.0 ? ", as nothing else needs Embree's scene" : "")};
  }
  return {Primary::Rays, trace_ns <= start_ns
                             ? fmt::format("{} pixels are too few to start OpenGL on a CPU for", work.pixels)
                             : fmt::format("{} pixels are few beside {} triangles that a CPU would rasterise",
                                           work.pixels, work.triangles)};
}

FrameLayout layout_of(std::span<const View> views) {
  std::vector<Size> sizes;
  sizes.reserve(views.size());
  for (const View& view : views) sizes.push_back(view.size());
  return FrameLayout(std::move(sizes));
}

namespace {

/// What the settings say, whoever does it.
FramePlan plan_of(const FrameSettings& settings, std::span<const View> views) {
  FramePlan plan;
  plan.layout = layout_of(views);
  plan.strategy = !settings.strategy.empty() ? settings.strategy : "auto";
  plan.depth_format = settings.depth_format;
  plan.shading = settings.shading;
  plan.rays = settings.rays;
  plan.aovs = settings.aovs;
  plan.layers = settings.aovs;
  if (plan.is_transparent() && std::ranges::find(plan.layers, Aov::Coverage) == plan.layers.end()) {
    plan.layers.push_back(Aov::Coverage);
  }
  plan.verify_percent = settings.verify_percent;
  plan.balance = settings.balance;
  return plan;
}

int groups_of(const FrameSettings& settings, const Scene& scene, int ranks) {
  if (!scene.parts.empty()) return ranks / static_cast<int>(scene.parts.size());
  return std::min(settings.groups > 0 ? settings.groups : default_groups(ranks), ranks);
}

/// Collective where groups follow the view. Who draws what, of a plan that knows its distribution and its primary.
void assign_ranks(Session& session, const FrameSettings& settings, std::span<const View> views, FramePlan& plan) {
  const Scene& scene = session.scene();
  const int ranks = session.ranks();
  const bool by_view = groups_follow_view(plan, settings, scene, ranks);
  std::vector<Assignment> assigned =
      assign(by_view ? Distribution::SortFirst : plan.distribution, scene, plan.layout, ranks, plan.groups);
  if (plan.rays.show == Show::Rank) plan.drawn_by.emplace(assigned, plan.layout);
  for (std::size_t rank = 0; rank < assigned.size(); ++rank) {
    if (assigned[rank].group.front() == static_cast<int>(rank)) plan.areas.push_back(assigned[rank].area);
  }
  plan.mine = std::move(assigned[static_cast<std::size_t>(session.rank())]);
  const bool in_groups = plan.mine.group.size() > 1 || plan.distribution == Distribution::SortMiddle;
  if ((settings.in_parts() && ranks > 1 && in_groups) || !scene.parts.empty()) partition(session, plan);
  // Surfaces of partial coverage have no keys: light finds them before what the keys name.
  if (!covering_surfaces(scene, true).empty()) {
    plan.mine.objects =
        common_ranges(merged_ranges(plan.mine.objects, scene.triangles), covering_surfaces(scene, false));
  }
  plan.tiles = tiles_of(plan.layout, plan.mine.area);
  if (by_view) {
    plan.areas.clear();
    group_by_view(session, plan, views);
  }
}

}  // namespace

FramePlan plan_frame(Session& session, const FrameSettings& settings, std::span<const View> views) {
  const int ranks = session.comm().size();
  FramePlan plan = plan_of(settings, views);
  const PrimaryChoice primary = primary_of_frame(session, settings, plan, views);
  plan.primary = primary.primary;
  plan.keys_on_device = primary.on_device;
  plan.groups = groups_of(settings, session.scene(), ranks);
  const DistributionChoice choice = choose_distribution(session, settings, plan, views);
  plan.distribution = choice.distribution;
  plan.distribution_is_predicted = choice.is_predicted;
  check_parts(settings, plan, session.scene(), ranks);
  assign_ranks(session, settings, views, plan);

  if (!settings.strategy.empty()) {
    agree_on_failure(session.comm(), [&] { check_fits(plan.strategy, static_cast<int>(plan.mine.group.size())); });
  }

  plan.explained = explain_distribution(plan, settings, choice, ranks);
  plan.explained_distribution = plan.explained.size();
  if (ranks > 1) plan.explained.push_back(explain_balance(plan));
  if (const std::string device = session.device_description(); !device.empty())
    plan.explained.push_back(fmt::format("device: {}", device));
  plan.explained.push_back(
      fmt::format("primary: {} ({})", plan.primary == Primary::Rays ? "rays" : "raster", primary.why));
  if (plan.distribution == Distribution::SortMiddle) plan.explained.push_back(explain_binning(plan, ranks));
  if (!session.scene().shapes_note.empty()) plan.explained.push_back("shapes: " + session.scene().shapes_note);
  if (plan.primary == Primary::Raster) {
    session.start_gl();
    plan.explained.push_back(fmt::format("keys: read by {}", session.key_route()));
  }
  explain_light(session, settings, plan);
  choose_indirect(session, settings, plan, views);
  fit_photons(session, settings, plan, views);
  choose_light(session, settings, plan, views);
  plan_areas(session, plan, views);
  for (const PassPlan& pass : plan_passes(session.requirements(), plan.rays)) explain_pass(pass, settings, plan);
  if (plan.verify_percent > 0.0) {
    plan.explained.push_back(fmt::format("verify: {} % of the tiles, drawn again by {} (as asked)", plan.verify_percent,
                                         ranks > 1 ? "another rank" : "the same rank, as there is one"));
  }
  return plan;
}

void choose_again(Session& session, const FrameSettings& settings, std::span<const View> views, FramePlan& plan) {
  const DistributionChoice choice = choose_distribution(session, settings, plan, views, plan.distribution);
  if (choice.distribution == plan.distribution) return;
  log::debug("distribute: {} in place of {}", name_of(choice.distribution), name_of(plan.distribution));
  FramePlan changed = plan;
  changed.distribution = choice.distribution;
  changed.areas.clear();
  changed.by_view.reset();
  changed.drawn_by.reset();
  assign_ranks(session, settings, views, changed);
  plan_areas(session, changed, views);
  const auto old_lines = static_cast<std::ptrdiff_t>(plan.explained_distribution);
  std::vector<std::string> lines = explain_distribution(changed, settings, choice, session.ranks());
  changed.explained_distribution = lines.size();
  lines.insert(lines.end(), plan.explained.begin() + old_lines, plan.explained.end());
  changed.explained = std::move(lines);
  plan = std::move(changed);
}

}  // namespace hpr
