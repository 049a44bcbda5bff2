#include "app/stats_file.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "engine/wall/wall_status.h"
#include "walls/manifest/budget_json.h"

namespace hpr {
namespace {

nlohmann::ordered_json not_finite_json(const RayCounts& rays) {
  nlohmann::ordered_json first = nullptr;
  if (rays.not_finite > 0) {
    const ScreenPixel& pixel = rays.first_not_finite;
    first = {{"screen", pixel.screen}, {"x", pixel.x}, {"y", pixel.y}};
  }
  return {{"pixels", rays.not_finite}, {"first", first}};
}

}  // namespace

void write_stats(const std::filesystem::path& path, const RunStats& stats) {
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  for (const PassTime& time : stats.times) {
    const auto plan = std::ranges::find(stats.passes, time.pass, &PassPlan::pass);
    passes.push_back(
        {{"name", time.name}, {"ms", time.ms}, {"why", plan == stats.passes.end() ? "every frame" : plan->why}});
  }
  nlohmann::ordered_json rays{{"primary", stats.rays.primary}};
  for (const PassInfo& pass : all_passes()) rays[pass.name] = stats.rays[pass.id];
  nlohmann::ordered_json json{
      {"schema", "hpr.stats/1"},
      {"ms", stats.ms},
      {"samples", stats.samples},
      {"samples_in_all", stats.samples_in_all},
      {"ms_per_sample", stats.samples > 0 ? nlohmann::ordered_json(stats.ms / stats.samples) : nullptr},
      {"estimated_relmse", stats.relmse ? nlohmann::ordered_json(*stats.relmse) : nlohmann::ordered_json(nullptr)},
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
