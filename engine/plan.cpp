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
#include "engine/display/background.h"
#include "engine/session.h"
#include "rt/passes/pass_list.h"
#include "rt/sampling/sampler.h"
#include "rt/sampling/sampling.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

/// Past this many triangles a rank's share of the scene matters more than the pixels it composites.
constexpr std::uint32_t kManyTriangles = 4'000'000;

struct Choice {
  Distribution distribution;
  std::string why;
};

Choice choose_distribution(const FrameSettings& settings, const Scene& scene, int ranks) {
  if (settings.distribution) return {*settings.distribution, "as asked"};
  if (ranks == 1) return {Distribution::SortFirst, "one rank draws everything"};
  if (settings.partitioned)
    return {Distribution::SortLast, "each rank has its own objects, as the data is partitioned"};
  if (scene.triangles <= kManyTriangles) {
    return {
        Distribution::SortFirst,
        fmt::format("{} triangles are few enough to cull on every rank, and nothing is composited", scene.triangles)};
  }
  return {Distribution::Hybrid,
          fmt::format("{} triangles are shared inside groups, pixels between them", scene.triangles)};
}

std::vector<std::size_t> tiles_in(const FrameLayout& layout, const std::vector<ScreenRect>& area) {
  std::vector<std::size_t> tiles;
  for (const ScreenRect& rect : area) {
    for (int y = rect.pixels.y0; y < rect.pixels.y1; y += kTileSide) {
      for (int x = rect.pixels.x0; x < rect.pixels.x1; x += kTileSide)
        tiles.push_back(layout.tile_at(rect.screen, x, y));
    }
  }
  std::ranges::sort(tiles);
  return tiles;
}

std::string explain_depth(const FramePlan& plan) {
  const char* why = "keys of {} bytes instead of 8 where they are sent, drawn so by OpenGL";
  if (plan.mine.group.size() == 1) {
    why = "as asked; gains nothing, as nothing is composited";
  } else if (plan.strategy == "mpi-reduce") {
    why = "as asked; gains nothing, as MPI's reduction moves whole keys";
  } else if (plan.strategy == "shared-memory" || plan.strategy == "auto") {
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

/// Who draws what, and how it comes together.
void explain_distribution(FramePlan& plan, const FrameSettings& settings, const Choice& choice, int ranks) {
  auto& lines = plan.explained;
  lines.push_back(fmt::format("distribute: {} over {} rank{} ({})", name_of(plan.distribution), ranks,
                              ranks == 1 ? "" : "s", choice.why));
  const char* const why =
      settings.strategy.empty() ? "shared memory on one host, else what is predicted to take least" : "as asked";
  lines.push_back(plan.mine.group.size() > 1
                      ? fmt::format("composite: {} among {} ranks ({})", plan.strategy, plan.mine.group.size(), why)
                      : fmt::format("composite: off (one rank covers each tile)"));
  if (plan.depth_format != DepthFormat::Float32) lines.push_back(explain_depth(plan));
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
    if (emitting[mesh.material]) triangles += mesh.triangles.size();
  }
  if (triangles > 0) parts.push_back(counted(triangles, "triangle") + (triangles == 1 ? " that emits" : " that emit"));
  if (!scene.environment_note.empty()) {
    parts.push_back(scene.environment_note);
  } else if (scene.environment) {
    parts.emplace_back("the scene's environment");
  }
  return parts;
}

/// What lights the pixels, and how many of them.
void explain_light(Session& session, const FrameSettings& settings, FramePlan& plan) {
  auto& lines = plan.explained;
  if (plan.rays.build != RayBuild{}) lines.push_back(explain(plan.rays.build));
  if (plan.rays.part) {
    lines.emplace_back("data: partitioned (as asked: rays travel to the ranks whose objects they may meet)");
  } else if (settings.partitioned) {
    lines.emplace_back("data: whole (one rank has all of it)");
  }
  lines.push_back(fmt::format("shading: {} ({})", plan.shading == Shading::Deferred ? "deferred" : "local",
                              plan.shading == Shading::Deferred ? "each visible pixel is lit once, after compositing"
                                                                : "each rank lights all it drew, before compositing"));
  if (settings.resolution_scale != 1.0) {
    lines.push_back(
        fmt::format("resolution: {} of the pixels a side (as asked), enlarged by a filter", settings.resolution_scale));
  }
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

/// Collective. How much of the sky's light reaches the surfaces that some views see, as about a thousand rays find out:
/// of what would without anything in its way. None where the views see no surface. The same on all ranks, however the
/// scene is shared out.
std::optional<double> open_sky(Session& session, const RaySettings& settings, std::span<const View> views) {
  session.partition_rays(settings);
  const RayScene& scene = session.ray_scene(settings.build);
  const RaySpace& space = scene.space();
  const Surfaces surfaces(session.scene(), space);
  const std::vector<Ray> rays_from_eye = camera_rays(views);
  RayBatch rays;
  for (const Ray& ray : rays_from_eye) rays.push(space.from_world(ray.origin), ray.direction, kInfinity, Faces::Front);
  std::vector<std::uint32_t> seen(rays_from_eye.size());
  std::vector<std::uint8_t> blocked;
  scene.for_each(1, 1, [&](std::size_t) {
    (void)scene.closest(rays, seen);
    rays.clear();
    WorldTriangle triangle;
    for (std::size_t i = 0; i < rays_from_eye.size(); ++i) {
      if (seen[i] == kNoSurface) continue;
      surfaces.load(seen[i], triangle);
      const SurfacePoint point = surfaces.meet(triangle, rays_from_eye[i].origin, rays_from_eye[i].direction);
      Sampler sampler(photon_stream({settings.seed, 0}), static_cast<std::uint32_t>(i));
      const glm::dvec3 up = warp::cosine_lobe(point.geometric_normal, sampler.two());
      rays.push(space.from_world(ray_origin(point, up)), up, kInfinity);
    }
    blocked.resize(rays.size());
    (void)scene.occluded(rays, blocked);
  });
  if (blocked.empty()) return std::nullopt;
  return static_cast<double>(std::ranges::count(blocked, 0)) / static_cast<double>(blocked.size());
}

// Processor time in ns on an Intel Xeon, as bench/primary_bench.cpp measures it. Only their ratios decide.
constexpr double kTriangleCost = 100.0;  ///< OpenGL's, beyond what its pixels take
constexpr double kPixelCost = 100.0;     ///< of rays
constexpr double kBuildCost = 350.0;     ///< of a triangle in Embree's scene
constexpr double kStartCost = 52e6;      ///< of OpenGL, with its first shaders

/// What is done once is shared out among so many frames, unless it is known to be for one.
constexpr double kFrames = 8.0;

/// Collective where the choice is left open: who makes the keys, and why.
PrimaryChoice primary_of_frame(Session& session, const FrameSettings& settings, const FramePlan& plan,
                               std::span<const View> views) {
  if (settings.primary != Primary::Auto) return {settings.primary, "as asked"};
  KeyWork work{.triangles = session.scene().triangles, .single_picture = settings.single_picture};
  for (const Mesh& mesh : session.scene().meshes) work.own_triangles += mesh.triangles.size();
  for (const View& view : views) work.pixels += view.size().area();
  work.rounds_depth = settings.depth_format != DepthFormat::Float32;
  work.software_gl = work.rounds_depth || session.draws_by_software();
  work.ray_scene_is_for_keys = std::ranges::none_of(plan_passes(session.requirements(), plan.rays),
                                                    [](const PassPlan& pass) { return pass.runs; });
  return choose_primary(work);
}

/// Whether rays or photons are to bring indirect light, where the scene leaves the choice.
void choose_indirect(Session& session, const FrameSettings& settings, FramePlan& plan, std::span<const View> views) {
  if (settings.indirect_is_chosen || !plan.rays.passes.empty()) return;
  RaySettings wanted = plan.rays;
  wanted.gather = true;
  if (wanted.reference || !session.requirements().indirect.needed || !gathers_by_rays(session.requirements(), wanted)) {
    return;
  }
  // Processors that round otherwise may count otherwise.
  const std::optional<double> open = all_gather_value(session.comm(), open_sky(session, plan.rays, views)).front();
  if (!open) return;
  plan.rays.gather = *open >= kOpenSky;
  plan.explained.push_back(fmt::format("indirect light: by {} ({:.0f} % of what is seen lies open to the even sky)",
                                       plan.rays.gather ? "rays" : "photons", 100.0 * *open));
}

void explain_pass(const PassPlan& pass, const FrameSettings& settings, FramePlan& plan) {
  auto& lines = plan.explained;
  lines.push_back(fmt::format("pass {}: {} ({})", name_of(pass.pass), pass.runs ? "on" : "off", pass.why));
  if (!pass.runs || !info_of(pass.pass).needs_photons) return;
  lines.push_back(
      fmt::format("photons: {} a sample ({})", plan.rays.photons > 0 ? plan.rays.photons : kPhotons,
                  settings.photons_fit_frame ? "of the quality, but no more than pixels, past 1000" : "as asked"));
  if (plan.rays.photon_radius > 0.0) {
    lines.push_back(fmt::format("photon radius: {} m at first (as asked)", plan.rays.photon_radius));
  }
}

}  // namespace

PrimaryChoice choose_primary(const KeyWork& work) {
  if (work.rounds_depth) return {Primary::Raster, "OpenGL alone rounds depths"};
  if (!work.software_gl) return {Primary::Raster, "by a GPU"};
  const double build_ns = work.ray_scene_is_for_keys ? kBuildCost * static_cast<double>(work.own_triangles) : 0.0;
  const double trace_ns = kPixelCost * static_cast<double>(work.pixels);
  const double rays_ns = trace_ns + build_ns / (work.single_picture ? 1.0 : kFrames);
  const double start_ns = kStartCost / kFrames;
  const double raster_ns = kTriangleCost * static_cast<double>(work.triangles) + start_ns;
  if (rays_ns > raster_ns) {
    return {Primary::Raster, fmt::format("{} pixels are many beside {} triangles{}", work.pixels, work.triangles,
                                         build_ns > 0.0 ? ", as nothing else needs Embree's scene" : "")};
  }
  return {Primary::Rays, trace_ns <= start_ns
                             ? fmt::format("{} pixels are too few to start OpenGL on a CPU for", work.pixels)
                             : fmt::format("{} pixels are few beside {} triangles that a CPU would rasterise",
                                           work.pixels, work.triangles)};
}

FramePlan plan_frame(Session& session, const FrameSettings& settings, std::span<const View> views) {
  const int ranks = session.comm().size();
  FramePlan plan;
  std::vector<Size> sizes;
  sizes.reserve(views.size());
  for (const View& view : views) sizes.push_back(view.size());
  plan.layout = FrameLayout(sizes);

  const Choice choice = choose_distribution(settings, session.scene(), ranks);
  plan.distribution = choice.distribution;
  plan.groups = std::min(settings.groups > 0 ? settings.groups : default_groups(ranks), ranks);
  plan.strategy = !settings.strategy.empty() ? settings.strategy : "auto";
  plan.depth_format = settings.depth_format;
  plan.shading = settings.shading;
  plan.rays = settings.rays;
  if (settings.photons_fit_frame) plan.rays.photons = photons_for(plan.rays.photons, views);
  plan.aovs = settings.aovs;
  plan.layers = settings.aovs;
  if (plan.is_transparent() && std::ranges::find(plan.layers, Aov::Coverage) == plan.layers.end()) {
    plan.layers.push_back(Aov::Coverage);
  }
  plan.verify_percent = settings.verify_percent;
  plan.mine = std::move(assign(plan.distribution, session.scene(), plan.layout, ranks,
                               plan.groups)[static_cast<std::size_t>(session.comm().rank())]);
  if (settings.partitioned && ranks > 1) plan.rays.part = plan.mine.objects;
  // Surfaces of partial coverage have no keys: light finds them before what the keys name.
  if (!covering_surfaces(session.scene(), true).empty()) {
    plan.mine.objects = common_ranges(merged_ranges(plan.mine.objects, session.scene().triangles),
                                      covering_surfaces(session.scene(), false));
  }
  plan.tiles = tiles_in(plan.layout, plan.mine.area);

  if (!settings.strategy.empty()) {
    agree_on_failure(session.comm(), [&] { check_fits(plan.strategy, static_cast<int>(plan.mine.group.size())); });
  }

  explain_distribution(plan, settings, choice, ranks);
  const PrimaryChoice primary = primary_of_frame(session, settings, plan, views);
  plan.primary = primary.primary;
  plan.explained.push_back(
      fmt::format("primary: {} ({})", plan.primary == Primary::Rays ? "rays" : "raster", primary.why));
  if (plan.primary == Primary::Raster) session.start_gl();
  explain_light(session, settings, plan);
  choose_indirect(session, settings, plan, views);
  for (const PassPlan& pass : plan_passes(session.requirements(), plan.rays)) explain_pass(pass, settings, plan);
  if (plan.verify_percent > 0.0) {
    plan.explained.push_back(fmt::format("verify: {} % of the tiles, drawn again by {} (as asked)", plan.verify_percent,
                                         ranks > 1 ? "another rank" : "the same rank, as there is one"));
  }
  return plan;
}

}  // namespace hpr
