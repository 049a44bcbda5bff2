#include "app/stats_file.h"

#include <algorithm>

#include "core/file.h"
#include "core/json.h"
#include "engine/wall/wall_status.h"
#include "walls/manifest/manifest.h"

namespace hpr {
namespace {

Json not_finite_json(const RayCounts& rays) {
  Json first;
  if (rays.not_finite > 0) {
    const ScreenPixel& pixel = rays.first_not_finite;
    first = {{"screen", pixel.screen}, {"x", pixel.x}, {"y", pixel.y}};
  }
  return {{"pixels", rays.not_finite}, {"first", first}};
}

}  // namespace

void write_stats(const std::filesystem::path& path, const RunStats& stats) {
  Json passes = Json::array();
  for (const PassTime& time : stats.times) {
    const auto plan = std::ranges::find(stats.passes, time.pass, &PassPlan::pass);
    passes.push_back(
        {{"name", time.name}, {"ms", time.ms}, {"why", plan == stats.passes.end() ? "every frame" : plan->why}});
  }
  Json rays{{"primary", stats.rays.primary}};
  for (const PassInfo& pass : all_passes()) rays[pass.name] = stats.rays[pass.id];
  Json json{{"schema", "hpr.stats/1"},
            {"ms", stats.ms},
            {"samples", stats.samples},
            {"samples_in_all", stats.samples_in_all},
            {"ms_per_sample", stats.samples > 0 ? Json(stats.ms / stats.samples) : Json()},
            {"estimated_relmse", stats.relmse},
            {"plan", stats.plan},
            {"passes", passes},
            {"rays", rays},
            {"rays_cut", stats.rays.cut},
            {"rays_invalid", stats.rays.invalid},
            {"not_finite", not_finite_json(stats.rays)},
            {"bytes_sent", stats.bytes_sent},
            {"memory_peak_bytes_per_rank", stats.memory_peak_bytes},
            {"ranks", stats.ranks}};
  if (stats.budget) json["budget"] = budget_json(to_record(*stats.budget));
  write_file_atomically(path, json.dump(2) + "\n");
}

}  // namespace hpr
