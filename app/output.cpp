#include "app/output.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "cluster/collectives.h"
#include "core/error.h"
#include "core/file.h"
#include "core/log.h"
#include "core/names.h"
#include "core/parallel.h"
#include "scene/scene_files.h"
#include "walls/budget_json.h"

namespace hpr {
namespace {

std::uint64_t peak_memory_bytes() {
  struct rusage usage {};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// The slowest rank's time.
double slowest(Communicator& comm, double ms) {
  return std::ranges::max(all_gather_value(comm, ms));
}

}  // namespace

Blocks cut_blocks(std::span<const View> screens) {
  Blocks blocks;
  for (std::size_t screen = 0; screen < screens.size(); ++screen) {
    for (const View& block : split_into_blocks(screens[screen], kRasterLimit)) {
      blocks.views.push_back(block);
      blocks.screen_of.push_back(screen);
    }
  }
  return blocks;
}

std::vector<int> block_owners(const Blocks& blocks, std::span<const int> shown_by) {
  std::vector<int> owners;
  for (const std::size_t screen : blocks.screen_of) owners.push_back(shown_by[screen]);
  return owners;
}

ImageLimits picture_limits(const Globals& globals) {
  if (!globals.limit_image.empty()) return globals.scene_limits().image;
  return {.side = 1 << 20, .pixels = std::uint64_t{1} << 31U};
}

void check_size(Size size, const Globals& globals) {
  const ImageLimits limits = picture_limits(globals);
  if (size.width > limits.side || size.height > limits.side || size.area() > limits.pixels) {
    throw Error(ExitCode::Limit,
                fmt::format("a picture of {}x{} pixels is beyond the limit of {} a side and {} in all", size.width,
                            size.height, limits.side, limits.pixels),
                "draw a smaller one, or raise --limit-image");
  }
}

namespace {

void to_display(std::span<const Rgb> radiance, std::span<Rgba8> display, double exposure_stops) {
  const auto gain = static_cast<float>(std::exp2(exposure_stops));
  std::ranges::transform(radiance, display.begin(), [gain](const Rgb& color) {
    return to_srgb({color.r * gain, color.g * gain, color.b * gain});
  });
}

}  // namespace

Image<Rgba8> to_display(const Image<Rgb>& radiance, int threads, double exposure_stops) {
  Image<Rgba8> display(radiance.size());
  parallel_for(threads, static_cast<std::size_t>(radiance.height()), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    to_display(radiance.row(y), display.row(y), exposure_stops);
  });
  return display;
}

TileLayer<Rgba8> to_display(const Frame& frame, int threads, double exposure_stops) {
  TileLayer<Rgba8> display(frame.radiance.layout());
  for (const std::size_t tile : frame.owned) display.set_active(tile);
  parallel_for(threads, frame.owned.size(), [&](std::size_t i) {
    to_display(frame.radiance.tile(frame.owned[i]), display.tile(frame.owned[i]), exposure_stops);
  });
  return display;
}

RunStats gather_stats(Session& session, const FramePlan& plan, const FrameTimes& times, const FrameCost& cost) {
  CountingCommunicator& comm = session.comm();
  RunStats stats;
  stats.ranks = comm.size();
  stats.plan = plan.explained;
  stats.passes = plan_passes(session.requirements(), plan.rays);
  stats.ms = slowest(comm, cost.ms);
  stats.times.push_back({plan.primary == Primary::Rays ? "primary-rays" : "raster", slowest(comm, times.primary_ms)});
  for (const PrimaryRayStats& traced : all_gather_value(comm, times.primary)) {
    stats.rays.primary += traced.rays;
    stats.rays.invalid += traced.invalid;
  }
  stats.times.push_back({"composite", slowest(comm, times.composite_ms)});
  // The lighter adds up what its threads took; a frame waits for them side by side.
  for (const PassTime& pass : times.passes) {
    stats.times.push_back({pass.name, slowest(comm, pass.ms / session.threads())});
  }
  for (const RayCounts& counts : all_gather_value(comm, times.rays)) stats.rays += counts;
  if (stats.rays.not_finite > 0 && comm.rank() == 0) {
    const ScreenPixel& first = stats.rays.first_not_finite;
    log::warning("{} samples of pixels had no finite radiance and are black, the first in pixel {},{} of screen {}",
                 stats.rays.not_finite, first.x, first.y, first.screen);
  }
  stats.samples = times.samples;
  stats.samples_in_all = times.samples;
  for (const std::size_t sent : all_gather_value(comm, cost.bytes_sent)) stats.bytes_sent += sent;
  stats.memory_peak_bytes = all_gather_value(comm, peak_memory_bytes());
  return stats;
}

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

void write_or_print(std::string_view text, const std::string& path, bool overwrite) {
  if (path.empty()) {
    fmt::print("{}", text);
    return;
  }
  check_writable(path, overwrite);
  write_file_atomically(path, text);
}

void write_stats(const std::filesystem::path& path, const RunStats& stats) {
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  for (const PassTime& time : stats.times) {
    const auto plan = std::ranges::find(stats.passes, time.name, &PassPlan::name);
    passes.push_back(
        {{"name", time.name}, {"ms", time.ms}, {"why", plan == stats.passes.end() ? "every frame" : plan->why}});
  }
  nlohmann::ordered_json json{
      {"schema", "hpr.stats/1"},
      {"ms", stats.ms},
      {"samples", stats.samples},
      {"samples_in_all", stats.samples_in_all},
      {"ms_per_sample", stats.samples > 0 ? nlohmann::ordered_json(stats.ms / stats.samples) : nullptr},
      {"estimated_relmse", stats.relmse ? nlohmann::ordered_json(*stats.relmse) : nlohmann::ordered_json(nullptr)},
      {"plan", stats.plan},
      {"passes", passes},
      {"rays",
       {{"primary", stats.rays.primary},
        {"shadow", stats.rays.shadow},
        {"reflection", stats.rays.reflection},
        {"refraction", stats.rays.refraction},
        {"ambient-occlusion", stats.rays.ambient_occlusion},
        {"photon", stats.rays.photon},
        {"gather", stats.rays.gather}}},
      {"rays_cut", stats.rays.cut},
      {"rays_invalid", stats.rays.invalid},
      {"not_finite", not_finite_json(stats.rays)},
      {"bytes_sent", stats.bytes_sent},
      {"memory_peak_bytes_per_rank", stats.memory_peak_bytes},
      {"ranks", stats.ranks}};
  if (stats.budget) json["budget"] = budget_json(*stats.budget);
  write_file_atomically(path, json.dump(2) + "\n");
}

void check_distinct(std::span<const std::string> paths, const std::string& trace) {
  std::set<std::filesystem::path> named;
  std::vector<std::string> all(paths.begin(), paths.end());
  all.push_back(trace);
  for (const std::string& path : all) {
    std::error_code error;
    const std::filesystem::path plain = std::filesystem::absolute(path, error);
    const std::filesystem::path place = std::filesystem::weakly_canonical(plain, error);
    if (path.empty() || named.insert(error ? plain : place).second) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is named for two results", printable(path)),
                "give each its own name");
  }
}

void check_spared(const std::string& scene, const SceneLimits& limits, std::span<const std::string> inputs,
                  std::span<const std::string> results) {
  const auto identity = [](const std::filesystem::path& path) -> std::optional<std::pair<dev_t, ino_t>> {
    struct stat info {};
    if (path.empty() || ::stat(path.c_str(), &info) != 0) return std::nullopt;
    return std::pair(info.st_dev, info.st_ino);
  };
  std::map<std::pair<dev_t, ino_t>, std::string> replaced;
  for (const std::string& result : results) {
    if (const auto file = identity(result)) replaced.emplace(*file, result);
  }
  if (replaced.empty()) return;  // spares reading the scene twice
  std::vector<std::filesystem::path> files = files_of_scene(scene, limits);
  files.insert(files.end(), inputs.begin(), inputs.end());
  for (const std::filesystem::path& path : files) {
    const auto file = identity(path);
    const auto result = file ? replaced.find(*file) : replaced.end();
    if (result == replaced.end()) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is read, and would be replaced", printable(result->second)),
                "give the result another name");
  }
}

}  // namespace hpr
