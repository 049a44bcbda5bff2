#include "walls/drawing/heat.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "core/bytes.h"
#include "core/error.h"
#include "core/json.h"
#include "core/text.h"

namespace hpr {
namespace {

/// Of one screen, over all frames.
struct Sums {
  std::size_t frames = 0;
  std::size_t stale = 0;
  std::size_t lost = 0;
  std::vector<double> ms{};  ///< of the frames that tell it
  double bytes = 0.0;        ///< of those
  std::set<std::uint64_t> ranks{};
};

/// Not the mean: the first picture pays for what is loaded to write it.
std::optional<double> median_ms(const Sums& sums) {
  if (sums.ms.empty()) return std::nullopt;
  std::vector<double> sorted = sums.ms;
  std::ranges::sort(sorted);
  return sorted[(sorted.size() - 1) / 2];
}

std::optional<double> mean_kib(const Sums& sums) {
  return sums.ms.empty() ? std::nullopt : std::optional(sums.bytes / 1024.0 / static_cast<double>(sums.ms.size()));
}

std::optional<double> share(std::size_t count, const Sums& sums) {
  if (sums.frames == 0) return std::nullopt;
  return 100.0 * static_cast<double>(count) / static_cast<double>(sums.frames);
}

struct Measure {
  std::string_view name;
  std::string_view title;
  std::string_view unit;
  std::optional<double> (*value)(const Sums& sums);
};

constexpr std::array kMeasures{
    Measure{"ms", "median time to hand a picture over", " ms", median_ms},
    Measure{"bytes", "mean size of a picture as it was handed over", " KiB", mean_kib},
    Measure{"stale", "share of frames shown too late", " %", [](const Sums& sums) { return share(sums.stale, sums); }},
    Measure{"lost", "share of frames without a display", " %", [](const Sums& sums) { return share(sums.lost, sums); }},
};

const Measure& find_measure(std::string_view name) {
  const auto found = std::ranges::find(kMeasures, name, &Measure::name);
  if (found != kMeasures.end()) return *found;
  throw Error(ExitCode::Usage, fmt::format("a plan cannot be coloured by '{}'", printable(name)),
              unknown_name_hint(name, heat_names()));
}

void add_state(const Json& screen, Sums& sums) {
  const Json& state = screen["state"];
  ++sums.frames;
  sums.stale += state == "stale" ? 1U : 0U;
  sums.lost += state == "lost" ? 1U : 0U;
}

void add_cost(const Json& cost, Sums& sums) {
  if (cost["rank"].is_unsigned()) sums.ranks.insert(cost["rank"].get<std::uint64_t>());
  if (!cost["ms"].is_number() || !cost["bytes"].is_number()) return;
  const auto ms = cost["ms"].get<double>();
  const auto bytes = cost["bytes"].get<double>();
  if (ms < 0.0 || bytes < 0.0) return;
  sums.ms.push_back(ms);
  sums.bytes += bytes;
}

std::map<std::string, Sums> sums_of(const ManifestFile& manifest) {
  std::map<std::string, Sums> sums;
  for (const std::string& record : manifest.frames) {
    const Json frame = Json::parse(record);
    for (const auto& [key, add] : {std::pair("screens", &add_state), std::pair("costs", &add_cost)}) {
      if (!frame[key].is_array()) continue;
      for (const Json& entry : frame[key].elements()) {
        if (entry["id"].is_string()) add(entry, sums[entry["id"].string()]);
      }
    }
  }
  return sums;
}

std::vector<std::string> notes_of(const Sums& sums) {
  std::vector<std::string> notes;
  if (!sums.ms.empty()) notes.push_back(fmt::format("{:.1f} ms, {:.1f} KiB", *median_ms(sums), *mean_kib(sums)));
  if (sums.frames > 0) {
    notes.push_back(fmt::format("stale {:.1f} %, lost {:.1f} %", *share(sums.stale, sums), *share(sums.lost, sums)));
  }
  if (sums.ranks.size() == 1) notes.push_back(fmt::format("by rank {}", *sums.ranks.begin()));
  if (sums.ranks.size() > 1) notes.push_back(fmt::format("by {} ranks in turn", sums.ranks.size()));
  return notes;
}

}  // namespace

double WallHeat::largest() const {
  double most = 0.0;
  for (const auto& value : values) most = std::max(most, value.value_or(0.0));
  return most;
}

const std::vector<std::string>& heat_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    all.reserve(std::size(kMeasures));
    for (const Measure& measure : kMeasures) all.emplace_back(measure.name);
    return all;
  }();
  return names;
}

WallHeat wall_heat(const Wall& wall, const ManifestFile& manifest, const std::string& path, std::string_view by) {
  const Measure& measure = find_measure(by);
  if (manifest.wall_hash != wall.hash) {
    throw Error(ExitCode::BadInput,
                fmt::format("'{}' is of another wall: its hash is {}, this one's {}", printable(path, 200),
                            hex16(manifest.wall_hash), hex16(wall.hash)),
                "name the wall file that was run, with the same --set");
  }
  const std::map<std::string, Sums> sums = sums_of(manifest);
  WallHeat heat;
  heat.unit = measure.unit;
  heat.title =
      fmt::format("{}, {} frame{}", measure.title, manifest.frames.size(), manifest.frames.size() == 1 ? "" : "s");
  for (const WallScreen& screen : wall.screens) {
    const auto found = sums.find(screen.id);
    const Sums of = found == sums.end() ? Sums{} : found->second;
    heat.values.push_back(measure.value(of));
    heat.notes.push_back(notes_of(of));
  }
  if (std::ranges::any_of(heat.values, [](const auto& value) { return value.has_value(); })) return heat;
  throw Error(ExitCode::BadInput, fmt::format("'{}' does not tell the {} of its screens", printable(path, 200), by),
              by == "ms" || by == "bytes" ? "run the wall with --display file or remote, or use --by stale or lost"
                                          : "it has no frames");
}

}  // namespace hpr
