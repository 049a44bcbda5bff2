#include "walls/drawing/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "core/bytes.h"
#include "core/error.h"
#include "core/json.h"
#include "core/text.h"
#include "walls/drawing/canvas.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// What a manifest has of one screen, summed over all frames.
struct Sums {
  std::size_t frames = 0;
  std::size_t stale = 0;
  std::size_t lost = 0;
  std::vector<double> ms{};  ///< of the frames that have it
  double bytes = 0.0;        ///< of the frames in `ms`
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

std::optional<double> percent_of_frames(std::size_t count, const Sums& sums) {
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
    Measure{"stale", "share of frames shown too late", " %",
            [](const Sums& sums) { return percent_of_frames(sums.stale, sums); }},
    Measure{"lost", "share of frames without a display", " %",
            [](const Sums& sums) { return percent_of_frames(sums.lost, sums); }},
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
    notes.push_back(fmt::format("stale {:.1f} %, lost {:.1f} %", *percent_of_frames(sums.stale, sums),
                                *percent_of_frames(sums.lost, sums)));
  }
  if (sums.ranks.size() == 1) notes.push_back(fmt::format("by rank {}", *sums.ranks.begin()));
  if (sums.ranks.size() > 1) notes.push_back(fmt::format("by {} ranks in turn", sums.ranks.size()));
  return notes;
}

constexpr int kWidth = 1280;
constexpr int kMargin = 40;
constexpr int kHead = 90;   ///< room for the title
constexpr int kScale = 56;  ///< room for the scale of colours, where there is one
constexpr int kTopViewHeight = 260;
constexpr int kCaption = 34;  ///< between the two drawings
constexpr Rgba8 kPaper{255, 255, 255, 255};
constexpr Rgba8 kInk{28, 30, 36, 255};
constexpr Rgba8 kFaint{150, 154, 164, 255};
constexpr Rgba8 kGap{226, 228, 232, 255};
constexpr Rgba8 kViewer{200, 40, 40, 255};
/// Light enough for dark text; one per owner, then from the start.
constexpr std::array<Rgba8, 8> kOwners{{{176, 206, 240, 255},
                                        {250, 214, 165, 255},
                                        {188, 226, 184, 255},
                                        {240, 190, 196, 255},
                                        {212, 196, 234, 255},
                                        {246, 238, 170, 255},
                                        {176, 226, 226, 255},
                                        {222, 208, 190, 255}}};

/// Colours from little to much, light enough for dark text; between them colours are mixed.
constexpr std::array<Rgba8, 4> kHeat{
    {{236, 244, 232, 255}, {253, 230, 138, 255}, {251, 170, 90, 255}, {240, 110, 90, 255}}};
constexpr Rgba8 kNotMeasured{255, 255, 255, 255};

/// `fraction`: from 0 to 1.
Rgba8 heat_color(double fraction) {
  const double at = std::clamp(fraction, 0.0, 1.0) * (kHeat.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(at), kHeat.size() - 2);
  const double part = at - static_cast<double>(below);
  const auto mix = [&](std::uint8_t a, std::uint8_t b) {
    return static_cast<std::uint8_t>(std::lround((1.0 - part) * a + part * b));
  };
  const Rgba8& a = kHeat.at(below);
  const Rgba8& b = kHeat.at(below + 1);
  return {mix(a.r, b.r), mix(a.g, b.g), mix(a.b, b.b), 255};
}

glm::dvec2 corner(const Rect& r) {
  return {r.x0, r.y0};
}
glm::dvec2 extent(const Rect& r) {
  return {r.width(), r.height()};
}

std::string millimeters(double meters) {
  return fmt::format("{:g}", std::round(meters * 1e4) / 10.0);
}

/// Everything that is drawn, laid out on one sheet.
struct Plan {
  const Wall& wall;
  const WallHeat* heat;  ///< none: coloured by owner
  WallPicture picture;
  glm::dvec2 origin;  ///< of the picture on the sheet
  Size sheet;
  std::vector<Rgba8> colors;  ///< per screen, by owner
};

Plan lay_out(const Wall& wall, const WallHeat* heat) {
  constexpr int kTallest = 700;
  WallPicture picture = wall_picture(wall, kWidth - 2 * kMargin);
  if (picture.size.height > kTallest) picture = wall_picture(wall, kTallest);
  const int top = kHead + (heat != nullptr ? kScale : 0);
  const glm::dvec2 origin{0.5 * (kWidth - picture.size.width), top};
  const Size sheet{kWidth, top + picture.size.height + kCaption + kTopViewHeight + kMargin};
  Plan plan{wall, heat, std::move(picture), origin, sheet, {}};
  if (heat != nullptr) {
    const double most = heat->largest();
    for (const auto& value : heat->values) {
      plan.colors.push_back(!value ? kNotMeasured : heat_color(most > 0.0 ? *value / most : 0.0));
    }
    return plan;
  }
  std::vector<std::string> owners;
  for (const WallScreen& screen : wall.screens) {
    const std::string owner = owner_of(wall, screen);
    const auto found = std::ranges::find(owners, owner);
    plan.colors.push_back(kOwners.at(static_cast<std::size_t>(found - owners.begin()) % kOwners.size()));
    if (found == owners.end()) owners.push_back(owner);
  }
  return plan;
}

void draw_head(Canvas& canvas, const Plan& plan) {
  std::size_t pixels = 0;
  for (const WallScreen& screen : plan.wall.screens) pixels += screen.pixels.area();
  const WallExtent whole = wall_extent(plan.wall);
  const WallSeams seams = wall_seams(plan.wall);
  std::string facts = fmt::format("{} screen{}, {:.2f} Mpx", plan.wall.screens.size(),
                                  plan.wall.screens.size() == 1 ? "" : "s", static_cast<double>(pixels) * 1e-6);
  if (whole.flat) facts += fmt::format(", {} x {} mm", millimeters(whole.width), millimeters(whole.height));
  if (seams.count > 0) {
    facts += seams.widest_m - seams.narrowest_m < 1e-6
                 ? fmt::format(", gaps of {} mm", millimeters(seams.widest_m))
                 : fmt::format(", gaps of {} to {} mm", millimeters(seams.narrowest_m), millimeters(seams.widest_m));
  }
  canvas.text({0.5 * kWidth, 34.0}, plan.wall.name, 24.0, kInk);
  canvas.text({0.5 * kWidth, 64.0}, facts, 14.0, kInk);
}

/// The scale of colours, and what they mean.
void draw_scale(Canvas& canvas, const WallHeat& heat) {
  constexpr int kSteps = 32;
  constexpr double kStep = 10.0;
  constexpr double kHeight = 14.0;
  const double left = 0.5 * (kWidth - kSteps * kStep);
  for (int i = 0; i < kSteps; ++i) {
    canvas.fill({left + i * kStep, kHead}, {kStep, kHeight}, heat_color((i + 0.5) / kSteps));
  }
  canvas.frame({left, kHead}, {kSteps * kStep, kHeight}, kInk, 1.0);
  const double most = heat.largest();
  const double center_y = kHead + 0.5 * kHeight;
  canvas.text({left - 30.0, center_y}, "0" + heat.unit, 13.0, kInk);
  canvas.text({left + kSteps * kStep + 50.0, center_y}, fmt::format("{:.3g}{}", most, heat.unit), 13.0, kInk);
  canvas.text({0.5 * kWidth, kHead + kHeight + 18.0}, heat.title, 13.0, kInk);
}

/// What is written on a screen.
std::vector<std::string> lines_of(const Plan& plan, std::size_t index) {
  const WallScreen& screen = plan.wall.screens[index];
  if (plan.heat != nullptr) {
    std::vector<std::string> lines{screen.id};
    const auto& value = plan.heat->values[index];
    if (!value) lines.emplace_back("not measured");
    const auto& notes = plan.heat->notes[index];
    lines.insert(lines.end(), notes.begin(), notes.end());
    if (!screen.node.empty()) lines.push_back(owner_of(plan.wall, screen));
    return lines;
  }
  std::vector<std::string> lines{
      screen.id, fmt::format("{} x {} px", screen.pixels.width, screen.pixels.height),
      fmt::format("{} x {} mm", millimeters(screen_width(screen)), millimeters(screen_height(screen))),
      owner_of(plan.wall, screen)};
  if (!screen.window.empty()) lines.push_back("window " + screen.window);
  if (screen.rotate != 0) lines.push_back(fmt::format("turned {} degrees", screen.rotate));
  if (screen.mirror != Mirror::None) lines.emplace_back("mirrored");
  if (screen.eye != Eye::Both) lines.emplace_back(screen.eye == Eye::Left ? "left eye" : "right eye");
  return lines;
}

void draw_screen(Canvas& canvas, const Plan& plan, std::size_t index) {
  const Rect& rect = plan.picture.screens[index];
  const glm::dvec2 at = plan.origin + corner(rect);
  canvas.fill(at, extent(rect), plan.colors[index]);
  canvas.frame(at, extent(rect), kInk, 1.0);

  std::vector<std::string> lines = lines_of(plan, index);
  std::size_t longest = 0;
  for (const std::string& line : lines) longest = std::max(longest, line.size());
  // A letter is about 0.6 of the font's height wide.
  const double height = std::min({16.0, 0.92 * rect.width() / (0.6 * static_cast<double>(longest)),
                                  0.9 * rect.height() / (1.4 * static_cast<double>(lines.size()))});
  constexpr double kMinLegible = 5.0;
  if (height < kMinLegible) lines.resize(1);
  const double used = height < kMinLegible ? std::min(height * 2.0, 0.5 * rect.height()) : height;
  const glm::dvec2 center = at + 0.5 * extent(rect);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double y = (static_cast<double>(i) - 0.5 * static_cast<double>(lines.size() - 1)) * 1.4 * used;
    canvas.text(center + glm::dvec2(0.0, y), lines[i], used, kInk);
  }
}

/// Where the viewer looks straight at a flat wall.
void draw_foot_point(Canvas& canvas, const Plan& plan) {
  const WallExtent whole = wall_extent(plan.wall);
  if (!plan.wall.viewers.front().has_position || !whole.flat) return;
  const glm::dvec3 inside = glm::transpose(whole.axes) * (plan.wall.viewers.front().position - whole.center);
  const double per_meter = plan.picture.size.width / whole.width;
  const glm::dvec2 size(plan.picture.size.width, plan.picture.size.height);
  const glm::dvec2 at = plan.origin + 0.5 * size + glm::dvec2(inside.x, -inside.y) * per_meter;
  const glm::dvec2 low = plan.origin - 20.0;
  const glm::dvec2 high = plan.origin + size + 20.0;
  if (at.x < low.x || at.y < low.y || at.x > high.x || at.y > high.y) return;
  canvas.line(at - glm::dvec2(9.0, 0.0), at + glm::dvec2(9.0, 0.0), kViewer, 2.0);
  canvas.line(at - glm::dvec2(0.0, 9.0), at + glm::dvec2(0.0, 9.0), kViewer, 2.0);
}

/// The wall seen from above, with the viewer and what they see it under.
void draw_top_view(Canvas& canvas, const Plan& plan) {
  const Wall& wall = plan.wall;
  glm::dvec2 low(wall.viewers.front().position.x, wall.viewers.front().position.z);
  glm::dvec2 high = low;
  const auto seen_from_above = [](const glm::dvec3& p) { return glm::dvec2(p.x, p.z); };
  for (const WallScreen& screen : wall.screens) {
    for (const glm::dvec3& p : {screen.lower_left, screen.lower_right, screen.upper_left,
                                screen.lower_right + screen.upper_left - screen.lower_left}) {
      low = glm::min(low, seen_from_above(p));
      high = glm::max(high, seen_from_above(p));
    }
  }
  const double top = plan.origin.y + plan.picture.size.height + kCaption;
  const glm::dvec2 span = high - low;
  const double per_meter =
      std::min((kWidth - 6.0 * kMargin) / std::max(span.x, 1e-6), (kTopViewHeight - 50.0) / std::max(span.y, 1e-6));
  const glm::dvec2 center(0.5 * kWidth, top + 30.0 + 0.5 * (kTopViewHeight - 50.0));
  const auto to_plan = [&](const glm::dvec3& p) {
    return center + (seen_from_above(p) - 0.5 * (low + high)) * per_meter;
  };
  canvas.text({0.5 * kWidth, top + 8.0}, "seen from above", 13.0, kFaint);
  const glm::dvec2 eye = to_plan(wall.viewers.front().position);
  // Floors and ceilings first: the rest stands on them.
  for (const bool lying : {true, false}) {
    for (std::size_t i = 0; i < wall.screens.size(); ++i) {
      const WallScreen& screen = wall.screens[i];
      const bool lies = std::abs(screen_axes(screen)[2].y) > 0.7;
      if (lies != lying) continue;
      const std::array<glm::dvec2, 5> outline{to_plan(screen.lower_left), to_plan(screen.lower_right),
                                              to_plan(screen.lower_right + screen.upper_left - screen.lower_left),
                                              to_plan(screen.upper_left), to_plan(screen.lower_left)};
      if (lies) {
        canvas.polyline(outline, plan.colors[i], 3.0);
        continue;
      }
      canvas.line(eye, outline[0], kGap, 1.0);
      canvas.line(eye, outline[1], kGap, 1.0);
      canvas.polyline(outline, kInk, 5.0);
      canvas.polyline(outline, plan.colors[i], 3.0);
    }
  }
  canvas.disc(eye, 6.0, kViewer);
  const std::string_view label = wall.viewers.front().has_position ? "viewer" : "viewer (placed by the camera)";
  canvas.text(eye + glm::dvec2(0.0, 18.0), label, 13.0, kViewer);
}

void draw_plan(Canvas& canvas, const Plan& plan) {
  canvas.fill({0.0, 0.0}, {plan.sheet.width, plan.sheet.height}, kPaper);
  draw_head(canvas, plan);
  if (plan.heat != nullptr) draw_scale(canvas, *plan.heat);
  for (const Rect& plane : plan.picture.planes) {
    canvas.fill(plan.origin + corner(plane), extent(plane), kGap);
    canvas.hatch(plan.origin + corner(plane), extent(plane), kFaint, 6.0, 1.0);
  }
  // Of two eyes' screens in one place the left one's is seen, as in the assembled wall.
  for (const bool right_eye : {true, false}) {
    for (std::size_t i = 0; i < plan.wall.screens.size(); ++i) {
      if ((plan.wall.screens[i].eye == Eye::Right) == right_eye) draw_screen(canvas, plan, i);
    }
  }
  draw_foot_point(canvas, plan);
  draw_top_view(canvas, plan);
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

std::string owner_of(const Wall& wall, const WallScreen& screen) {
  std::string owner;
  const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
  if (node != wall.nodes.end()) {
    owner = node->host == node->id ? node->id : fmt::format("{} ({})", node->id, node->host);
  }
  const std::string rank = screen.rank >= 0 ? fmt::format("rank {}", screen.rank) : "any rank";
  return owner.empty() ? rank : fmt::format("{}, {}", owner, rank);
}

std::string wall_plan_svg(const Wall& wall, const WallHeat* heat) {
  const Plan plan = lay_out(wall, heat);
  SvgCanvas canvas(plan.sheet, wall.name);
  draw_plan(canvas, plan);
  return canvas.document();
}

Image<Rgba8> wall_plan_image(const Wall& wall, const WallHeat* heat) {
  const Plan plan = lay_out(wall, heat);
  PixelCanvas canvas(plan.sheet);
  draw_plan(canvas, plan);
  return canvas.image();
}

}  // namespace hpr
