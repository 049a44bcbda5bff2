#include "tools/compare/distributions/frame_prediction.h"

#include <algorithm>
#include <numeric>
#include <thread>

#include "cluster/transport/collectives.h"
#include "engine/balance/frame_model.h"
#include "engine/balance/load_balance.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "scene/partial_mesh.h"
#include "scene/view.h"

namespace hpr {
namespace {

constexpr double kNsPerMs = 1e6;

double sum_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

std::optional<double> predict_frame_ms(Session& session, const FramePlan& plan, std::span<const View> views,
                                       int samples) {
  const std::span<const double> light = session.balance().light_costs(plan.layout);
  const bool has_model = plan.shading == Shading::Deferred && !plan.rays.part && !is_shared_out(session.scene());
  if (!has_model || light.empty()) return std::nullopt;  // on all ranks alike
  MachineSpeeds speeds;
  const double threads = session.threads();
  const double cores = std::max(1U, std::thread::hardware_concurrency());
  speeds.host_ranks = session.ranks();
  speeds.crowding = std::max(1.0, threads * session.ranks() / cores);
  // What was measured is processor time, of which a rank gets less where ranks crowd the cores.
  const double ns_per_ms = kNsPerMs * speeds.crowding / threads;
  FrameLoad load = load_of(session, views);
  for (const double ms : light) load.light_ns.push_back(ns_per_ms * ms);
  load.by_rays = plan.primary == Primary::Rays;
  if (load.by_rays) {
    const double keys = sum_of(session.balance().costs(plan.layout)) - sum_of(light);
    double pixels = 0.0;
    for (const View& view : views) pixels += static_cast<double>(view.size().area());
    speeds.ray = ns_per_ms * keys / std::max(pixels, 1.0);
  } else {
    speeds.raster = session.measure_raster();
  }
  const int groups = plan.by_view ? 0 : plan.groups;
  const FramePrediction prediction = predict_frame(plan.distribution, load, speeds, session.ranks(), groups);
  return all_gather_value(session.comm(), samples * prediction.total_ms()).front();
}

}  // namespace hpr
