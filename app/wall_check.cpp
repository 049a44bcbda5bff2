#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "app/report_error.h"
#include "app/wall_command.h"
#include "core/hash.h"
#include "core/log.h"
#include "walls/geometry.h"

namespace hpr {
namespace {

/// What one wants to know about a sound wall.
struct Figures {
  std::size_t hosts = 0;
  std::size_t visible_pixels = 0;
  bool flat = true;
  double width_px = 0.0;  ///< of a flat wall, gaps included, at its finest pixels
  double height_px = 0.0;
  double gap_percent = 0.0;  ///< of that, behind gaps
  WallSeams seams;
};

Figures figures_of(const Wall& wall) {
  Figures figures;
  std::set<std::string> hosts;
  for (const WallNode& node : wall.nodes) hosts.insert(node.host);
  figures.hosts = std::max<std::size_t>(hosts.size(), 1);
  double lit = 0.0;
  for (const WallScreen& screen : wall.screens) {
    figures.visible_pixels += screen.pixels.area();
    lit += screen_width(screen) * screen_height(screen);
  }
  const WallExtent extent = wall_extent(wall);
  figures.flat = extent.flat;
  figures.width_px = extent.width / finest_pitch(wall);
  figures.height_px = extent.height / finest_pitch(wall);
  figures.gap_percent = std::max(0.0, 100.0 * (1.0 - lit / (extent.width * extent.height)));
  figures.seams = wall_seams(wall);
  return figures;
}

double tenths(double value) {
  return std::round(10.0 * value) / 10.0;
}

std::string plural(std::size_t count, std::string_view what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

}  // namespace

void report_findings(const WallCheck& check) {
  for (const WallFinding& finding : check.reading.findings) {
    if (finding.error) {
      print_error({ExitCode::BadInput, finding.what, finding.hint, finding.line});
    } else {
      log::warning("{} ({})", finding.what, finding.hint);
    }
  }
}

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
  text += wall.viewer_given ? fmt::format("viewer: at {:g}, {:g}, {:g} m; the wall is a window into the scene\n",
                                          wall.viewer.x, wall.viewer.y, wall.viewer.z)
          : figures.flat    ? std::string("viewer: none given; the wall shows what the camera sees\n")
                            : fmt::format("viewer: none given; taken at {:g}, {:g}, {:g} m\n", wall.viewer.x,
                                          wall.viewer.y, wall.viewer.z);
  return text;
}

std::string check_json(const WallCheck& check) {
  using Json = nlohmann::ordered_json;
  Json findings = Json::array();
  for (const WallFinding& finding : check.reading.findings) {
    findings.push_back(Json{{"severity", finding.error ? "error" : "warning"},
                            {"line", finding.place.line},
                            {"column", finding.place.column},
                            {"what", finding.what},
                            {"text", finding.line},
                            {"hint", finding.hint}});
  }
  Json document{{"schema", "hpr.wall-check/1"},
                {"wall", check.spec},
                {"ok", check.reading.ok()},
                {"findings", std::move(findings)}};
  if (check.reading.ok()) {
    const Wall& wall = check.reading.wall;
    const Figures figures = figures_of(wall);
    document["name"] = wall.name;
    document["wall_hash"] = hex16(wall.hash);
    document["screens"] = wall.screens.size();
    document["hosts"] = figures.hosts;
    document["visible_pixels"] = figures.visible_pixels;
    document["flat"] = figures.flat;
    document["extent_px"] = figures.flat ? Json{figures.width_px, figures.height_px} : Json(nullptr);
    document["gap_percent"] = figures.flat ? Json(figures.gap_percent) : Json(nullptr);
    document["seams"] = Json{{"count", figures.seams.count},
                             {"whole_pixel_error_px", figures.seams.largest_error_px},
                             {"accumulated_error_px", figures.seams.accumulated_error_px}};
    document["viewer_given"] = wall.viewer_given;
  }
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace hpr
