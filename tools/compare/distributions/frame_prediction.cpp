#include "tools/compare/distributions/frame_prediction.h"

#include <algorithm>

#include "cluster/transport/collectives.h"
#include "engine/balance/distribution_choice.h"
#include "engine/balance/load_balance.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "scene/partial_mesh.h"
#include "scene/view.h"

namespace hpr {
std::optional<double> predict_frame_ms(Session& session, const FramePlan& plan, std::span<const View> views,
                                       int samples, double rest_ms) {
  const std::span<const double> light = session.balance().light_costs(plan.layout);
  const bool has_model = plan.shading == Shading::Deferred && !plan.rays.part && !is_shared_out(session.scene());
  if (!has_model || light.empty()) return std::nullopt;  // on all ranks alike
  MachineSpeeds speeds = speeds_of_frame(session, plan);
  speeds.finish = speeds.collect = 0.0;  // in `rest_ms`
  FrameLoad load = load_of_frame(session, plan, speeds, views);
  load.built_triangles = 0;  // in frames before
  const int groups = plan.by_view ? 0 : plan.groups;
  const FramePrediction prediction = predict_frame(plan.distribution, load, speeds, session.ranks(), groups);
  const double rest = std::ranges::min(all_gather_value(session.comm(), rest_ms));
  return all_gather_value(session.comm(), samples * prediction.total_ms() + rest).front();
}

}  // namespace hpr
