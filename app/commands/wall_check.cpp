#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "app/command.h"
#include "app/commands/wall_run.h"
#include "app/results.h"
#include "core/bytes.h"
#include "core/json.h"
#include "core/log.h"
#include "core/text.h"
#include "image/key.h"
#include "walls/config/wall_file.h"
#include "walls/drawing/plan.h"
#include "walls/geometry/curved.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// What `hpr wall check` reports about a wall.
struct WallCheck {
  std::string spec;  ///< as the user named it
  WallReading reading;
};

/// What one wants to know about a sound wall.
struct Figures {
  std::size_t hosts = 0;
  std::size_t visible_pixels = 0;
  bool flat = true;
  double width_px = 0.0;  ///< of a flat wall, gaps included, at its finest pixels
  double height_px = 0.0;
  double gap_percent = 0.0;  ///< percent of the picture behind gaps
  WallSeams seams;
};

Figures figures_of(const Wall& wall) {
  Figures figures;
  std::set<std::string> hosts;
  for (const WallNode& node : wall.nodes) hosts.insert(node.host);
  figures.hosts = std::max<std::size_t>(hosts.size(), 1);
  std::map<Eye, double> areas;
  for (const WallScreen& screen : wall.screens) {
    figures.visible_pixels += screen.pixels.area();
    areas[screen.eye] += screen_width(screen) * screen_height(screen);
  }
  // Two eyes' screens lie in one place.
  const double lit = areas[Eye::Both] + std::max(areas[Eye::Left], areas[Eye::Right]);
  const WallExtent extent = wall_extent(wall);
  figures.flat = extent.flat;
  figures.width_px = extent.width / finest_pitch(wall);
  figures.height_px = extent.height / finest_pitch(wall);
  figures.gap_percent = std::max(0.0, 100.0 * (1.0 - lit / (extent.width * extent.height)));
  figures.seams = wall_seams(wall);
  return figures;
}

std::string plural(std::size_t count, std::string_view what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// What a rank's screens take of its memory; the scene comes on top.
struct RankNeed {
  std::string owner;  ///< "n0 (wall01), rank 0", "any rank"
  int rank = -1;      ///< -1: whichever
  std::string node;
  std::size_t screens = 0;
  std::uint64_t bytes = 0;
};

/// Of each picture that is drawn: its keys, its radiance, the display colours that travel, and the screen's picture.
constexpr std::uint64_t kBytesPerPixel = sizeof(Key) + sizeof(Rgb) + 2 * sizeof(Rgba8);

/// The memory of each rank that screens name, and of each node or the whole wall for the screens that name none. Curved
/// screens count by their own pixels, which rays draw; what OpenGL would need for them stands with their figures.
std::vector<RankNeed> needs_of(const Wall& wall) {
  std::vector<RankNeed> needs;
  std::size_t last = wall.screens.size();
  for (const ScreenEye& picture : screen_eyes(wall)) {
    const WallScreen& screen = wall.screens[picture.screen];
    const std::string owner = owner_of(wall, screen);
    auto need = std::ranges::find(needs, owner, &RankNeed::owner);
    if (need == needs.end()) need = needs.insert(needs.end(), {owner, screen.rank, screen.node, 0, 0});
    need->bytes += kBytesPerPixel * picture.pixels.area();
    if (picture.screen != last) ++need->screens;
    last = picture.screen;
  }
  return needs;
}

std::uint64_t sum_of(const std::vector<RankNeed>& needs) {
  return std::accumulate(needs.begin(), needs.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const RankNeed& need) { return sum + need.bytes; });
}

std::string mebibytes(std::uint64_t bytes) {
  return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / (1 << 20));
}

std::string describe_memory(const Wall& wall) {
  const std::vector<RankNeed> needs = needs_of(wall);
  const RankNeed& most = *std::ranges::max_element(needs, {}, &RankNeed::bytes);
  const std::string all = mebibytes(sum_of(needs));
  if (needs.size() == 1) return fmt::format("memory: {} for the pictures of a frame, and the scene\n", all);
  return fmt::format("memory: {} for the pictures of a frame, {} of it for {}; and the scene on every rank\n", all,
                     mebibytes(most.bytes), most.owner);
}

std::string describe_first_viewer(const Wall& wall, bool flat) {
  const WallViewer& viewer = wall.viewers.front();
  const glm::dvec3 at = viewer.position;
  if (viewer.has_position) {
    return fmt::format("viewer: at {:g}, {:g}, {:g} m; the wall is a window into the scene\n", at.x, at.y, at.z);
  }
  if (flat) return "viewer: none given; the wall shows what the camera sees\n";
  return fmt::format("viewer: none given; taken at {:g}, {:g}, {:g} m\n", at.x, at.y, at.z);
}

std::string describe_warp(const Wall& wall, const WarpFigures& figures) {
  const WallScreen& screen = wall.screens[figures.screen];
  std::string text = fmt::format("warp of \"{}\": ", screen.id);
  if (figures.curve) {
    text += fmt::format("{} points, {:.1f} x {:.1f} degrees for the viewer, {}x{} px as OpenGL draws it flat, ",
                        figures.mesh_size, figures.curve->width_degrees, figures.curve->height_degrees,
                        figures.curve->flat_pixels.width, figures.curve->flat_pixels.height);
  } else if (figures.mesh_size > 0) {
    text += fmt::format("{} triangles, ", figures.mesh_size);
  }
  text += fmt::format("{:.2f} % of its pixels lit", 100.0 * figures.lit);
  if (screen.warp.light) text += ", blended";
  if (screen.warp.floor) text += ", with a floor of black";
  return text + "\n";
}

/// One line each for further viewers, trackers, stereo and monitors.
std::string describe_more(const Wall& wall) {
  std::string text;
  for (std::size_t i = 1; i < wall.viewers.size(); ++i) {
    const WallViewer& viewer = wall.viewers[i];
    text += fmt::format("viewer \"{}\": at {:g}, {:g}, {:g} m\n", viewer.id, viewer.position.x, viewer.position.y,
                        viewer.position.z);
  }
  for (const WallViewer& viewer : wall.viewers) {
    const std::string who = viewer.id.empty() ? "the viewer" : fmt::format("viewer \"{}\"", viewer.id);
    const WallTracker& tracker = viewer.tracker;
    if (tracker.kind == WallTracker::Kind::File) {
      text += fmt::format("tracker: {} moves as recorded in {}\n", who, printable(tracker.path));
    } else if (tracker.kind == WallTracker::Kind::Udp) {
      text += fmt::format("tracker: {} moves as told at UDP port {} of {}\n", who, tracker.port,
                          printable(tracker.address));
    }
  }
  if (wall.stereo != StereoMode::None) {
    text += fmt::format("stereo: {}, {} pictures for {}\n", stereo_names().at(static_cast<std::size_t>(wall.stereo)),
                        screen_eyes(wall).size(), plural(wall.screens.size(), "screen"));
  }
  for (const WarpFigures& figures : warp_figures(wall)) text += describe_warp(wall, figures);
  for (const WallMonitor& monitor : wall.monitors) {
    text += fmt::format("monitor \"{}\": {} on {}x{} px\n", monitor.id, monitor.surface, monitor.pixels.width,
                        monitor.pixels.height);
  }
  return text;
}

Json memory_json(const Wall& wall) {
  const std::vector<RankNeed> needs = needs_of(wall);
  Json ranks = Json::array();
  for (const RankNeed& need : needs) {
    ranks.push_back({{"rank", need.rank >= 0 ? Json(need.rank) : Json()},
                     {"node", need.node.empty() ? Json() : Json(need.node)},
                     {"screens", need.screens},
                     {"bytes", need.bytes}});
  }
  return {{"bytes_per_pixel", kBytesPerPixel}, {"bytes", sum_of(needs)}, {"ranks", ranks}};
}

Json warps_json(const Wall& wall) {
  Json warps = Json::array();
  for (const WarpFigures& figures : warp_figures(wall)) {
    const WallScreen& screen = wall.screens[figures.screen];
    const char* const kind = figures.curve ? "positions" : "mesh";
    Json warp{{"screen", screen.id},
              {"mesh", figures.mesh_size > 0 ? Json(kind) : Json()},
              {"mesh_size", figures.mesh_size},
              {"lit_percent", std::round(10'000.0 * figures.lit) / 100.0},
              {"blend", screen.warp.light != nullptr},
              {"black", screen.warp.floor != nullptr}};
    if (figures.curve) {
      warp["degrees"] = Json::array({figures.curve->width_degrees, figures.curve->height_degrees});
      warp["flat_pixels"] = Json::array({figures.curve->flat_pixels.width, figures.curve->flat_pixels.height});
    }
    warps.push_back(std::move(warp));
  }
  return warps;
}

double tenths(double value) {
  return std::round(10.0 * value) / 10.0;
}

/// Every finding on stderr: errors in their three lines, warnings in one.
void report_findings(const WallCheck& check) {
  for (const WallFinding& finding : check.reading.findings) {
    if (finding.error) {
      print_error({ExitCode::BadInput, finding.what, finding.hint, finding.line});
    } else {
      log::warning("{} ({})", finding.what, finding.hint);
    }
  }
}

/// A sound wall's figures in words: pixels, hosts, gaps, seams, viewer.
std::string describe_wall(const Wall& wall) {
  const Figures figures = figures_of(wall);
  std::string text = fmt::format("ok: {}, {}, ", plural(wall.screens.size(), "screen"), plural(figures.hosts, "host"));
  if (figures.flat) {
    text += fmt::format("{:g}x{:g} px of which {:.1f} % lie behind gaps, ", tenths(figures.width_px),
                        tenths(figures.height_px), figures.gap_percent);
  }
  text += fmt::format("{:.1f} Mpx visible\n", static_cast<double>(figures.visible_pixels) * 1e-6);
  if (figures.seams.count > 0) {
    text +=
        fmt::format("seams: {}; bezels in whole pixels would be off by {:.2f} px at one, {:.2f} px across the wall\n",
                    figures.seams.count, figures.seams.largest_error_px, figures.seams.accumulated_error_px);
  }
  return text + describe_first_viewer(wall, figures.flat) + describe_more(wall) + describe_memory(wall);
}

/// Findings and figures as JSON, schema hpr.wall-check/1.
std::string check_json(const WallCheck& check) {
  Json findings = Json::array();
  for (const WallFinding& finding : check.reading.findings) {
    findings.push_back({{"severity", finding.error ? "error" : "warning"},
                        {"line", finding.position.line},
                        {"column", finding.position.column},
                        {"what", finding.what},
                        {"text", finding.line},
                        {"hint", finding.hint}});
  }
  Json document{
      {"schema", "hpr.wall-check/1"}, {"wall", check.spec}, {"ok", check.reading.ok()}, {"findings", findings}};
  if (check.reading.ok()) {
    const Wall& wall = check.reading.wall;
    const Figures figures = figures_of(wall);
    document["name"] = wall.name;
    document["wall_hash"] = hex16(wall.hash);
    document["screens"] = wall.screens.size();
    document["hosts"] = figures.hosts;
    document["visible_pixels"] = figures.visible_pixels;
    document["flat"] = figures.flat;
    document["extent_px"] = figures.flat ? Json::array({figures.width_px, figures.height_px}) : Json();
    document["gap_percent"] = figures.flat ? Json(figures.gap_percent) : Json();
    document["seams"] = {{"count", figures.seams.count},
                         {"whole_pixel_error_px", figures.seams.largest_error_px},
                         {"accumulated_error_px", figures.seams.accumulated_error_px}};
    document["viewer_given"] = wall.viewers.front().has_position;
    document["viewers"] = wall.viewers.size();
    document["stereo"] = stereo_names().at(static_cast<std::size_t>(wall.stereo));
    document["pictures"] = screen_eyes(wall).size();
    document["warps"] = warps_json(wall);
    document["memory"] = memory_json(wall);
  }
  return document.dump(2) + "\n";
}

/// `hpr wall check WALL`.
class WallCheckCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "check"; }
  [[nodiscard]] std::string_view summary() const override { return "every error and oddity in a wall file"; }

  void declare(const OptionSet& options) override {
    declare_wall(options, wall_);
    options.flag("--json", json_, "print one JSON document (hpr.wall-check/1)");
    declare_overrides(options, overrides_);
  }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    const WallCheck check{wall_, read()};
    if (json_) {
      fmt::print("{}", check_json(check));
    } else {
      report_findings(check);
      if (check.reading.ok()) fmt::print("{}", describe_wall(check.reading.wall));
    }
    return check.reading.ok() ? ExitCode::Done : ExitCode::BadInput;
  }

 private:
  /// With --json, what cannot be read at all is a finding too.
  [[nodiscard]] WallReading read() const {
    try {
      return read_wall(wall_, overrides_);
    } catch (const Error& error) {
      WallFinding finding;
      finding.what = error.what();
      finding.line = error.line();
      finding.hint = error.hint();
      if (json_) fmt::print("{}", check_json({wall_, {{}, {finding}}}));
      throw;
    }
  }

  std::string wall_;
  std::vector<std::string> overrides_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> make_wall_check_command() {
  return std::make_unique<WallCheckCommand>();
}

}  // namespace hpr
