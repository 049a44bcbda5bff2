#include "engine/balance/distribution_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <memory>

#include "cluster/transport/collectives.h"
#include "compositing/compositor.h"
#include "core/error.h"
#include "engine/balance/load_balance.h"
#include "engine/frame_settings.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "rt/passes/pass_list.h"
#include "scene/partial_mesh.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

/// Throws Error (Usage) where ranks hold parts of the scene and settings ask for more.
DistributionChoice distribution_of_parts(const FrameSettings& settings, const Scene& scene, int ranks) {
  const bool in_islands = static_cast<int>(scene.parts.size()) < ranks;
  if (!in_islands && scene.pages.empty() && settings.distribution == Distribution::SortMiddle &&
      settings.primary == Primary::Raster) {
    return {Distribution::SortMiddle, "as asked"};
  }
  const bool in_groups = in_islands || settings.distribution == Distribution::Hybrid;  // of all ranks, it may be
  const Distribution fits = in_groups ? Distribution::Hybrid : Distribution::SortLast;
  if (settings.distribution.value_or(fits) != fits) {
    throw Error(ExitCode::Usage,
                fmt::format("ranks hold parts of the scene, which --distribute {} needs whole",
                            name_of(*settings.distribution)),
                fmt::format("use --distribute {}, or load the scene again", name_of(fits)));
  }
  return {fits, in_islands ? fmt::format("{} groups of {} ranks that hold a part of the scene each",
                                         ranks / static_cast<int>(scene.parts.size()), scene.parts.size())
                           : "each rank holds a part of the scene"};
}

/// Whether Embree's scene serves keys alone, so that ranks that draw fewer objects build less of it.
bool builds_for_keys(Session& session, const FramePlan& plan) {
  return plan.primary == Primary::Rays && !traces_rays_beside_keys(session.requirements(), plan.rays);
}

/// Whether a tenth of a frame could be gained if one rank drew all triangles that others need not draw then; by speeds
/// as they are documented, so that small frames do not wait for measurements.
bool drawing_matters(const FrameSettings& settings, const FramePlan& plan, const Scene& scene, double ranks) {
  const MachineSpeeds typical;
  constexpr double kMeasuringNs = 1e8;  // about, with shaders to be compiled
  const bool by_raster = plan.primary == Primary::Raster;
  const double draw = by_raster ? static_cast<double>(scene.triangles) * typical.raster.triangle
                                : static_cast<double>(mesh_triangles(scene)) * typical.build;
  double pixels = 0.0;
  for (std::size_t screen = 0; screen < plan.layout.screens(); ++screen) {
    pixels += static_cast<double>(plan.layout.size(screen).area());
  }
  const double light = needs_light(plan.rays.show) ? pixels * typical.light : pixels * typical.raster.pixel;
  const bool pays = draw > (settings.single_picture ? 1.0 : 0.2) * kMeasuringNs;
  return pays && draw > kMinDistributionGain * (light + draw) / ranks;
}

std::string describe(const PredictedChoice& choice) {
  std::vector<FramePrediction> sorted = choice.predictions;
  std::ranges::stable_sort(sorted, {}, &FramePrediction::total_ms);
  std::vector<std::string> texts;
  texts.reserve(sorted.size());
  for (const FramePrediction& prediction : sorted) {
    texts.push_back(fmt::format("{} {:.3g}", name_of(prediction.distribution), prediction.total_ms()));
  }
  return fmt::format("predicted ms of a sample: {}", fmt::join(texts, ", "));
}

std::string describe(const MachineSpeeds& speeds, bool by_raster) {
  std::string raster;
  if (by_raster) {
    raster = fmt::format("a triangle {:.3g} ns, a pixel {:.2g} ns, ", speeds.raster.triangle,
                         speeds.raster.pixel + speeds.raster.read);
  }
  return fmt::format("measured: {}a pixel merged {:.2g} ns in place and {:.2g} ns sent, a message {:.2g} us{}", raster,
                     speeds.merge_in_place, speeds.merge, 1e-3 * speeds.message,
                     speeds.noise.empty() ? "" : "; the machine is too noisy to predict well: " + speeds.noise);
}

/// Those under which a strategy that is asked for by name can composite its groups, if there are any.
std::vector<Distribution> candidates_for(const std::string& strategy, int ranks, int groups) {
  std::vector<Distribution> candidates;
  for (const Distribution distribution : kDistributions) {
    bool fits = true;
    if (!strategy.empty() && !draws_alone(distribution)) {
      const std::unique_ptr<Compositor> compositor = make_compositor(strategy);
      fits = std::ranges::all_of(make_groups(ranks, distribution == Distribution::SortLast ? 1 : groups),
                                 [&](const std::vector<int>& group) {
                                   return group.size() == 1 || compositor->fits(static_cast<int>(group.size()));
                                 });
    }
    if (fits) candidates.push_back(distribution);
  }
  return candidates;
}

}  // namespace

MachineSpeeds speeds_of_frame(Session& session, const FramePlan& plan) {
  MachineSpeeds speeds = session.balance().speeds(session, plan.primary == Primary::Raster);
  const std::span<const double> all = session.balance().costs(plan.layout);
  if (plan.primary != Primary::Rays || all.empty()) return speeds;
  double keys_ms = 0.0;
  double pixels = 0.0;
  for (std::size_t tile = 0; tile < all.size(); ++tile) {
    keys_ms += all[tile] - session.balance().light_costs(plan.layout)[tile];
    pixels += static_cast<double>(plan.layout.place(tile).pixels.area());
  }
  speeds.ray = 1e6 * speeds.crowding / session.threads() * keys_ms / std::max(pixels, 1.0);
  return speeds;
}

FrameLoad load_of_frame(Session& session, const FramePlan& plan, const MachineSpeeds& speeds,
                        std::span<const View> views) {
  FrameLoad load = load_of(session, views);
  // What was measured is processor time, of which a rank gets less where ranks crowd the cores.
  const double ns_per_ms = 1e6 * speeds.crowding / session.threads();
  for (const double ms : session.balance().light_costs(plan.layout)) load.light_ns.push_back(ns_per_ms * ms);
  if (!needs_light(plan.rays.show)) load.light_ns.assign(plan.layout.tiles(), 0.0);
  load.by_rays = plan.primary == Primary::Rays;
  if (builds_for_keys(session, plan)) load.built_triangles = mesh_triangles(session.scene());
  return load;
}

PredictedChoice choose_by_model(const FrameLoad& load, const MachineSpeeds& speeds, int ranks, int groups,
                                std::optional<Distribution> current, std::span<const Distribution> candidates) {
  HPR_CHECK(!candidates.empty());
  PredictedChoice choice;
  MachineSpeeds at_work = speeds;
  at_work.build = 0.0;  // it is done
  for (const Distribution distribution : candidates) {
    const MachineSpeeds& its_speeds = distribution == current ? at_work : speeds;
    choice.predictions.push_back(predict_frame(distribution, load, its_speeds, ranks, groups));
  }
  const double least = std::ranges::min(choice.predictions, {}, &FramePrediction::total_ms).total_ms();
  const auto takes_about_least = [&](const FramePrediction& prediction) {
    return prediction.total_ms() * (1.0 - kMinDistributionGain) <= least;
  };
  choice.distribution = std::ranges::find_if(choice.predictions, takes_about_least)->distribution;
  if (!current) return choice;
  const auto kept = std::ranges::find(choice.predictions, *current, &FramePrediction::distribution);
  if (kept != choice.predictions.end() && takes_about_least(*kept)) choice.distribution = *current;
  return choice;
}

DistributionChoice choose_distribution(Session& session, const FrameSettings& settings, const FramePlan& plan,
                                       std::span<const View> views, std::optional<Distribution> current) {
  const Scene& scene = session.scene();
  const int ranks = session.ranks();
  if (!scene.parts.empty()) return distribution_of_parts(settings, scene, ranks);
  if (settings.distribution) return {*settings.distribution, "as asked"};
  if (ranks == 1) return {Distribution::SortFirst, "one rank draws everything"};
  if (settings.in_parts()) {
    return {Distribution::SortLast, "each rank has its own objects, as the data is partitioned"};
  }
  if (plan.shading == Shading::Local) {
    return {Distribution::SortFirst, "coplanar surfaces show who drew them, so that no clock may decide who does"};
  }
  const bool by_raster = plan.primary == Primary::Raster;
  if (!by_raster && !builds_for_keys(session, plan)) {
    return {Distribution::SortFirst, "rays find a surface among many as fast as among few, and nothing is composited"};
  }
  if (!drawing_matters(settings, plan, scene, ranks)) {
    return {Distribution::SortFirst, fmt::format("{} triangles are few enough to cull on every rank, and nothing is "
                                                 "composited",
                                                 scene.triangles)};
  }
  if (by_raster) session.start_gl();
  MachineSpeeds speeds = speeds_of_frame(session, plan);
  speeds.finish = speeds.collect = 0.0;  // the same, and once for all samples
  FrameLoad load = load_of_frame(session, plan, speeds, views);
  if (settings.single_picture) load.frames = 1.0;
  const bool by_view = by_raster && settings.groups == 0 && settings.strategy.empty();
  const int groups = std::min(settings.groups > 0 ? settings.groups : default_groups(ranks), ranks);
  const PredictedChoice predicted = choose_by_model(load, speeds, ranks, by_view ? 0 : groups, current,
                                                    candidates_for(settings.strategy, ranks, groups));
  // Ranks time alike but not to the bit, and must decide alike.
  const int chosen = all_gather_value(session.comm(), static_cast<int>(predicted.distribution)).front();
  return {static_cast<Distribution>(chosen), describe(predicted), true, describe(speeds, by_raster)};
}

}  // namespace hpr
