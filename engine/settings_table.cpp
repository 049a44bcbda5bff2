#include "engine/settings_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "compositing/compositor.h"
#include "core/error.h"
#include "core/text.h"
#include "engine/aov.h"
#include "engine/display/background.h"
#include "engine/settings/setting_values.h"
#include "image/filter.h"
#include "rt/passes/pass_list.h"
#include "rt/show/show.h"

namespace hpr {
namespace {

using setting::choice;
using setting::flag;
using setting::number;
using setting::off_flag;
using setting::parse_number;
using setting::plain_text;
using setting::Settings;
using setting::text;

/// "X,Y,Z", finite numbers whose squares are finite too.
std::optional<glm::dvec3> parse_point(const std::string& written) {
  const std::vector<std::string> parts = split_commas(written);
  glm::dvec3 point(0.0);
  bool good = parts.size() == 3;
  for (std::size_t i = 0; good && i < 3; ++i) {
    const auto parsed = parse_number<double>(parts[i]);
    good = parsed && std::abs(*parsed) <= 1e18;
    if (good) point[static_cast<int>(i)] = *parsed;
  }
  if (good) return point;
  throw Error(ExitCode::Usage, fmt::format("'{}' is no point: three finite numbers up to 1e18", printable(written)),
              "write e.g. 0,1.7,5");
}

SettingValue point(std::optional<glm::dvec3> CameraChoice::*which) {
  return text(
      "X,Y,Z", "three numbers",
      [which](Settings& settings) -> std::optional<glm::dvec3>& { return settings.camera.*which; }, parse_point,
      [](const std::optional<glm::dvec3>& value) {
        return value ? fmt::format("{},{},{}", value->x, value->y, value->z) : std::string();
      });
}

constexpr std::array<std::string_view, 2> kOffOn{"off", "on"};

/// Throws Error (Usage) for what is no list of passes.
void parse_passes(Settings& settings, const std::string& list) {
  RaySettings& rays = settings.frame.rays;
  const std::vector<std::string> named = split_words(list);
  if (named.empty()) {
    throw Error(ExitCode::Usage, "names no pass", "write auto, all, none, or a list such as shadow,reflection");
  }
  const std::vector<std::string> keywords{"auto", "all", "none"};
  const bool is_keyword = named.size() == 1 && std::ranges::find(keywords, named.front()) != keywords.end();
  std::vector<PassId> passes;
  for (const std::string& name : named) {
    if (!is_keyword && std::ranges::find(keywords, name) != keywords.end()) {
      throw Error(ExitCode::Usage, fmt::format("'{}' goes with no other word", name), "leave it or the others out");
    }
    if (!is_keyword) passes.push_back(parse_pass(name, keywords));
  }
  rays.auto_passes = is_keyword && named.front() == "auto";
  rays.all_passes = is_keyword && named.front() == "all";
  rays.passes = std::move(passes);
}

SettingValue passes() {
  std::vector<std::string_view> names;
  for (const PassInfo& pass : all_passes()) names.push_back(pass.name);
  return {.type = "LIST",
          .takes = fmt::format("auto, all, none, or a list of {}", fmt::join(names, ", ")),
          .parse = parse_passes,
          .write =
              [](const Settings& settings) {
                const RaySettings& rays = settings.frame.rays;
                if (!rays.passes.empty()) return fmt::format("{}", fmt::join(names_of(rays.passes), ","));
                return std::string(rays.auto_passes ? "auto" : rays.all_passes ? "all" : "none");
              },
          .copy =
              [](const Settings& from, Settings& to) {
                to.frame.rays.auto_passes = from.frame.rays.auto_passes;
                to.frame.rays.all_passes = from.frame.rays.all_passes;
                to.frame.rays.passes = from.frame.rays.passes;
              }};
}

SettingValue drawn_width(DrawnWidth PointLineWidths::*which) {
  return text(
      "N|Npx|Nm", "pixels or metres: 2, 2px, 0.01m",
      [which](Settings& settings) -> DrawnWidth& { return settings.widths.*which; }, parse_drawn_width,
      [](const DrawnWidth& width) { return to_text(width); });
}

std::vector<PassId> parse_half_resolution(const std::string& list) {
  std::vector<PassId> passes;
  if (list == "none") return passes;
  for (const std::string& name : split_words(list)) passes.push_back(parse_half_resolution_pass(name));
  return passes;
}

std::optional<Distribution> parse_distribution_or_auto(const std::string& name) {
  const std::string automatic = "auto";
  if (name == automatic) return std::nullopt;
  return parse_distribution(name, std::span(&automatic, 1));
}

std::string write_samples(const SampleGoal& goal) {
  if (goal.relmse) return fmt::format("until:relmse={}", *goal.relmse);
  if (goal.seconds) return fmt::format("until:{}s", *goal.seconds);
  return fmt::format("{}", goal.samples.value_or(0));
}

int parse_codec_error(std::string levels) {
  if (levels.ends_with("/255")) levels.resize(levels.size() - 4);
  const auto parsed = parse_number<int>(levels);
  if (parsed && *parsed >= 0 && *parsed <= 255) return *parsed;
  throw Error(ExitCode::Usage, fmt::format("'{}' is no number of levels", printable(levels)), "write e.g. 3/255, or 3");
}

SettingValue exposure() {
  constexpr double kMaxStops = 30.0;
  return text(
      "auto|STOPS", fmt::format("auto, or {:g} to {:g} stops", -kMaxStops, kMaxStops),
      [](Settings& s) -> std::optional<double>& { return s.display.exposure_stops; },
      [=](const std::string& written) -> std::optional<double> {
        if (written == "auto") return std::nullopt;
        const auto parsed = parse_number<double>(written);
        if (parsed && std::abs(*parsed) <= kMaxStops) return parsed;
        throw Error(ExitCode::Usage, fmt::format("'{}' is no exposure", printable(written)),
                    fmt::format("write auto, or a number of stops from {:g} to {:g}", -kMaxStops, kMaxStops));
      },
      [](const std::optional<double>& stops) { return stops ? fmt::format("{}", *stops) : std::string("auto"); });
}

bool sends_photons(const Settings& settings) {
  const RaySettings& rays = settings.frame.rays;
  const bool named = std::ranges::any_of(rays.passes, [](PassId pass) { return info_of(pass).needs_photons; });
  return named || (rays.passes.empty() && (rays.auto_passes || rays.all_passes));
}

bool traces_passes(const Settings& settings) {
  return !settings.frame.rays.reference;
}

bool shows_light(const Settings& settings) {
  return settings.frame.rays.show == Show::Shaded;
}

/// Whether the passes and what they are set to matter.
bool computes_light(const Settings& settings) {
  return needs_light(settings.frame.rays.show);
}

bool forms_groups(const Settings& settings) {
  return settings.frame.distribution.value_or(Distribution::Hybrid) == Distribution::Hybrid;
}

std::vector<Setting> make_table() {
  std::vector<std::string_view> filters;
  for (const PixelFilter filter : all_pixel_filters()) filters.push_back(name_of(filter));
  const std::vector<Dependency> on_photons{
      {"show", computes_light}, {"reference", traces_passes}, {"passes", sends_photons}};
  return {
      // What is seen.
      {.name = "scene",
       .help = "name or index of one of the file's scenes (default: the one that the file names, else the first)",
       .value = plain_text("NAME|INDEX", "a scene", [](Settings& s) -> std::string& { return s.scene.scene; }),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "variant",
       .help = "name of one of the file's variants of materials (default: the materials without any)",
       .value = plain_text("NAME", "a variant", [](Settings& s) -> std::string& { return s.scene.variant; }),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "camera",
       .help = "name or index of a camera of the scene",
       .value = plain_text("NAME|INDEX", "a camera", [](Settings& s) -> std::string& { return s.camera.name; }),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "eye",
       .help = "where the eye is, in place of a camera of the scene; with --at",
       .value = point(&CameraChoice::eye),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "at",
       .help = "what the eye looks at",
       .value = point(&CameraChoice::at),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "up",
       .help = "which way is up for the eye (default: 0,1,0)",
       .value = point(&CameraChoice::up),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "fov",
       .help = "vertical angle of view in degrees",
       .value = number(0.001, 179.0, [](Settings& s) -> double& { return s.camera.fov_degrees; }),
       .decides_bits = false},
      {.name = "environment",
       .help = "light from all around, in place of the scene's own: a latitude-longitude picture, one radiance R,G,B, "
               "or studio, a neutral one; none: what the scene brings alone (default: that, and studio where it is too "
               "little)",
       .value = plain_text("studio|none|FILE|R,G,B", "studio, none, a picture or a radiance",
                           [](Settings& s) -> std::string& { return s.environment; }),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "background",
       .help = "what is seen past all surfaces, while mirrors and glass see the environment: the environment too, one "
               "radiance R,G,B, or transparent, nothing: the picture's alpha is what surfaces cover",
       .value = text(
           "R,G,B|environment|transparent", "environment, transparent or a radiance",
           [](Settings& s) -> Background& { return s.frame.rays.background; }, parse_background,
           [](const Background& value) { return to_text(value); }),
       .initial = "environment"},
      {.name = "cull",
       .help = "gltf: who looks at a single-sided material from behind looks through; none: all have two sides",
       .value = choice(kCullNames, [](Settings& s) -> Cull& { return s.cull; }),
       .initial = "gltf",
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "point-size",
       .help = "diameter of the scene's points: pixels where they stand in the first frame, or metres; 0: none",
       .value = drawn_width(&PointLineWidths::points),
       .initial = "3px",
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "line-width",
       .help = "width of the scene's lines, as of --point-size",
       .value = drawn_width(&PointLineWidths::lines),
       .initial = "2px",
       .decides_bits = false,
       .fixed_in_session = true},

      // How light is computed, the settings that move most first.
      {.name = "quality",
       .help = "what the settings of light are that are not given",
       .value = choice(kQualityNames, [](Settings& s) -> Quality& { return s.quality; }),
       .initial = "good",
       .costs = "all of the below that are not given",
       .loses = "all of the below that are not given",
       .decides_bits = false,
       .limits_reference = true},
      {.name = "spp",
       .help = "samples of a pixel: a number, until:60s or until:relmse=1e-3",
       .value = text(
           "N", "1, 2, 3 ...; until:60s; until:relmse=1e-3", [](Settings& s) -> SampleGoal& { return s.sampling.goal; },
           parse_sample_goal, write_samples),
       .by_quality = {"1", "1", "64"},
       .finished = "8",
       .costs = "time in proportion",
       .loses = "noise: its squared error falls as 1 / spp, faster where it is only edges",
       .decides_bits = false,
       .limits_reference = true},
      {.name = "adaptive",
       .help = "more samples for pixels whose samples differ more, --spp of them on average",
       .value = flag([](Settings& s) -> bool& { return s.sampling.adaptive; }),
       .costs = "a tenth of the time for as many samples, in more rounds of fewer pixels",
       .loses = "false: noise of the pixels whose samples differ most; true: a little of the mean, as pixels that look "
                "calm by chance get fewer samples",
       .limits_reference = true},
      {.name = "denoise",
       .help = "pixels that see similar surfaces share light, and pixels on edges are resampled, in the first samples",
       .value = flag([](Settings& s) -> bool& { return s.frame.rays.denoise; }),
       .finished = "true",
       .costs = "a sixth to one and a quarter times as much again of a frame's first 16 samples",
       .loses = "false: noise, and steps at edges; true: detail of light finer than a pixel or two, less with more "
                "samples",
       .limits_reference = true,
       .used_with = {{"show", computes_light}}},
      {.name = "passes",
       .help = "ray passes: auto, what the scene requires; all, those it does not too; none; or a list",
       .value = passes(),
       .initial = "auto",
       .costs = "the rays of each pass",
       .loses = "the light a pass carries is missing, or there where it is blocked",
       .decides_bits = false,
       .limits_reference = true,
       .used_with = {{"show", computes_light}, {"reference", traces_passes}}},
      {.name = "indirect",
       .help = "all indirect light, not caustics alone: by photons, or under an even sky by rays (default: with "
               "--quality best, or where --passes names photon)",
       .value = flag([](Settings& s) -> bool& { return s.frame.rays.global_photons; }),
       .by_quality = {"false", "false", "true"},
       .finished = "true",
       .costs =
           "photons wherever light meets rough surfaces, and a gather at every point; in the open under an even sky "
           "a ray at every point instead",
       .loses = "false: light that rough surfaces scatter on to others: a quarter of what a closed room shows",
       .limits_reference = true,
       .negated = "no-indirect",
       .used_with = on_photons},
      {.name = "final-gather",
       .help = "rays bring indirect light to what the eye sees, and photons to what those rays reach: no dark rims in "
               "creases (default: with --quality best from 32 samples on)",
       .value = flag([](Settings& s) -> bool& { return s.frame.rays.final_gather; }),
       .by_quality = {"false", "false", "true"},
       .costs = "a ray at every point, and the light of what it meets",
       .loses = "false: light in creases and at the feet of things, as far as photons blur; true: smoothness, where "
                "samples are few",
       .limits_reference = true,
       .negated = "no-final-gather",
       .used_with = on_photons},
      {.name = "photons",
       .help = "sent per sample, where the scene requires any",
       .value = number(
           std::uint32_t{0}, std::uint32_t{1'000'000'000},
           [](Settings& s) -> std::uint32_t& { return s.frame.rays.photons; }, "0 to 1000000000 a sample"),
       .by_quality = {"0", "100000", "200000"},
       .costs = "time in proportion; left to the quality, no more are sent than the frame's pixels show",
       .loses = "fewer photons are noise, and in large scenes gather from further away: caustics and indirect light "
                "blur; 0 leaves them out",
       .limits_reference = true,
       .used_with = on_photons},
      {.name = "photon-radius",
       .help = "metres about a point in which photons count, in a frame's first sample (default: with --indirect "
               "two pixels where photons lie dense enough, else from their density)",
       .value = number(
           0.0, 1e30, [](Settings& s) -> double& { return s.frame.rays.photon_radius; },
           "0 (from pixels and density) or metres"),
       .costs = "nothing, but for gathers that meet more photons",
       .loses = "wide: caustics blur, corners darken; narrow: noise. It shrinks from sample to sample",
       .limits_reference = true,
       .used_with = on_photons},
      {.name = "resolution-scale",
       .help = "the frame is made of so many of the pixels a side, and shown at full size by a filter",
       .value = number(0.1, 1.0, [](Settings& s) -> double& { return s.frame.resolution_scale; }),
       .initial = "1",
       .costs = "time in proportion to its square, but for what triangles take",
       .loses = "detail smaller than the pixels that are left, edges first",
       .decides_bits = false,
       .limits_reference = true},
      {.name = "half-resolution",
       .help = "passes whose light is computed for one pixel in four where its neighbors see similar surfaces",
       .value = text(
           "LIST", fmt::format("none, or a list of {}", fmt::join(names_of(half_resolution_passes()), ", ")),
           [](Settings& s) -> std::vector<PassId>& { return s.frame.rays.half_resolution; }, parse_half_resolution,
           [](const std::vector<PassId>& passes) { return fmt::format("{}", fmt::join(names_of(passes), ",")); }),
       .costs = "four times the points of those passes",
       .loses = "detail of that light where neighbors see similar surfaces",
       .limits_reference = true,
       .used_with = {{"show", computes_light}}},
      {.name = "max-depth",
       .help = "reflections and refractions in a row; of the reference: segments of a path, the first from the eye",
       .value = number(1, 64, [](Settings& s) -> int& { return s.frame.rays.max_depth; }),
       .by_quality = {"2", "8", "16"},
       .costs = "rays between mirrors and through glass",
       .loses = "what is seen by more bounces is black",
       .limits_reference = true},
      {.name = "glossy-cutoff",
       .help = "specular surfaces at least this rough are not followed by rays",
       .value = number(
           0.0, 1.0, [](Settings& s) -> double& { return s.frame.rays.glossy_cutoff; }, "0 to 1: a roughness"),
       .by_quality = {"0.1", "0.3", "1"},
       .costs = "a ray for every smoother surface in view, and what it meets",
       .loses = "rougher surfaces reflect lights only, not the scene",
       .limits_reference = true},
      {.name = "light-samples",
       .help = "rays to surfaces that emit and the environment, per point",
       .value = number(
           1, 4096, [](Settings& s) -> int& { return s.frame.rays.light_samples; }, "1 to 4096 a point"),
       .by_quality = {"1", "1", "2"},
       .costs = "shadow rays in proportion",
       .loses = "noise in soft shadows",
       .limits_reference = true,
       .used_with = {{"show", computes_light}, {"reference", traces_passes}}},
      {.name = "depth-format",
       .help = "bits of a depth where layers are composited",
       .value = choice(kDepthFormatNames, [](Settings& s) -> DepthFormat& { return s.frame.depth_format; }),
       .initial = "32f",
       .costs = "8, 7 or 6 bytes of a key sent between ranks",
       .loses = "order of surfaces closer than a step of depth; then the lower surface is seen",
       .limits_reference = true},
      {.name = "color-format",
       .help = "how the colors of an .exr are sent to rank 0",
       .value = choice(kColorFormatNames, [](Settings& s) -> ColorFormat& { return s.color_format; }),
       .initial = "32f",
       .costs = "12, 6 or 4 bytes of a color sent to where an .exr is written",
       .loses = "16f: 11 bits of a color; 8: what a display shows",
       .decides_bits = false,
       .limits_reference = true},
      {.name = "embree-quality",
       .help = "what Embree spends on building its trees",
       .value = choice(kBuildQualityNames, [](Settings& s) -> BuildQuality& { return s.frame.rays.build.quality; }),
       .initial = "medium",
       .costs = "time to build the ray scene, at the start",
       .loses = "low: rays take longer; no bit of a picture",
       .decides_bits = false},
      {.name = "deterministic",
       .help = "on: rays have the same bits on every machine; off: each rank traces by its widest instructions",
       .value = choice(kOffOn, [](Settings& s) -> bool& { return s.frame.rays.build.same_instructions; }),
       .initial = "on",
       .costs = "10 to 56 % of the rays a second where a processor has wider instructions than AVX2",
       .loses = "off: the same bits on machines of different instruction sets"},
      {.name = "filter",
       .help = "how samples make up a pixel (default: the center for one sample, box for more)",
       .value = text(
           fmt::format("{}", fmt::join(filters, "|")), fmt::format("{}", fmt::join(filters, ", ")),
           [](Settings& s) -> std::optional<PixelFilter>& { return s.sampling.filter; },
           [](const std::string& name) { return std::optional(parse_pixel_filter(name)); },
           [](const auto& filter) { return std::string(name_of(filter.value_or(PixelFilter::Box))); }),
       .costs = "nothing",
       .loses = "sharpness for smoothness, and the noise of wide filters"},
      {.name = "primary",
       .help = "what finds the visible surfaces; auto: a GPU; without one, rays where triangles are many or pixels few",
       .value = choice(kPrimaryNames, [](Settings& s) -> Primary& { return s.frame.primary; }),
       .initial = "auto",
       .costs = "rasterising many triangles, or rays through many pixels",
       .loses = "at edges, 0.0025 to 0.045 % of pixels see another surface",
       .decides_bits = false},
      {.name = "shading",
       .help = "deferred: light once after compositing; local: each rank before it",
       .value = choice(kShadingNames, [](Settings& s) -> Shading& { return s.frame.shading; }),
       .initial = "deferred",
       .costs = "rays for what later turns out to be hidden",
       .loses =
           "local: colors of 8 bits are composited, and coplanar surfaces of different ranks show the brighter one",
       .limits_reference = true,
       .used_with = {{"show", shows_light}}},
      {.name = "data",
       .help = "what a rank holds of the scene: replicated, all of it, or partitioned, what the rank draws itself, "
               "while the rays of the others come to it, or paged, the same with what --limit-mem has no room for on "
               "the disk",
       .value = choice(kDataNames, [](Settings& s) -> SceneData& { return s.frame.data; }),
       .initial = "replicated",
       .costs = "partitioned: time and messages, as rays travel; paged: time, as pages come and go; replicated: the "
                "memory of "
                "a whole scene on each rank",
       .loses = "nothing: no bit of a picture",
       .decides_bits = false},
      {.name = "no-terminator-fix",
       .help = "shadow rays leave from the triangles, not the smooth surface they stand for",
       .value = off_flag([](Settings& s) -> bool& { return s.frame.rays.terminator_fix; }),
       .costs = "nothing",
       .loses = "true: smooth surfaces of few triangles show their triangles where light grazes them"},
      {.name = "reference",
       .help = "path tracing in place of the passes: slow, and the ground truth",
       .value = flag([](Settings& s) -> bool& { return s.frame.rays.reference; }),
       .costs = "path tracing in place of the passes: many more samples for the same noise",
       .loses = "false: what the passes leave out, caught by photons of some width",
       .limits_reference = true,
       .scope = SettingScope::Single,
       .used_with = {{"show", shows_light}}},

      // Who does what.
      {.name = "distribute",
       .help = fmt::format("how the work is shared: {} or auto", distribution_names()),
       .value = text(
           "NAME", distribution_names() + ", auto",
           [](Settings& s) -> std::optional<Distribution>& { return s.frame.distribution; }, parse_distribution_or_auto,
           [](const std::optional<Distribution>& value) { return std::string(value ? name_of(*value) : "auto"); }),
       .initial = "auto",
       .decides_bits = false},
      {.name = "groups",
       .help = "groups of ranks for hybrid, whose tiles are cut beforehand (default: groups follow the view; by rays, "
               "about the square root of the ranks)",
       .value = number(1, 1 << 20, [](Settings& s) -> int& { return s.frame.groups; }),
       .decides_bits = false,
       .used_with = {{"distribute", forms_groups}}},
      {.name = "balance",
       .help = "tiles by what they took before (measured), rows of them to who is done too (demand), or by count",
       .value = choice(kBalanceNames, [](Settings& s) -> Balance& { return s.frame.balance; }),
       .initial = "demand",
       .decides_bits = false},
      {.name = "strategy",
       .help = "how layers are composited: a strategy's name or auto",
       .value = text(
           "NAME", "a strategy, auto", [](Settings& s) -> std::string& { return s.frame.strategy; },
           [](const std::string& name) { return std::string(name == "auto" ? "" : make_compositor(name)->name()); },
           [](const std::string& name) { return name.empty() ? std::string("auto") : name; }),
       .initial = "auto",
       .decides_bits = false},
      {.name = "verify",
       .help = "percent of a frame's tiles that are drawn again, by another rank, and compared bit for bit",
       .value = number(
           0.0, 100.0, [](Settings& s) -> double& { return s.frame.verify_percent; }, "0 to 100 percent"),
       .initial = "0",
       .decides_bits = false,
       .scope = SettingScope::Single},

      // What is made of the picture.
      {.name = "show",
       .help = "in place of light: shading normals, texture coordinates, edges of triangles, a color for each object "
               "(ids) or rank, rays a pixel (cost), surfaces behind each other (overdraw), ambient occlusion (ao)",
       .value = choice(kShowNames, [](Settings& s) -> Show& { return s.frame.rays.show; }),
       .initial = "shaded"},
      {.name = "tone",
       .help = "how bright light fits a display: neutral keeps the colors of lit surfaces, aces and filmic have more "
               "contrast, agx less, none clips; EXR files stay as lit",
       .value = choice(kToneNames, [](Settings& s) -> Tone& { return s.display.tone; }),
       .initial = "neutral",
       .decides_bits = false,
       .used_with = {{"show", shows_light}}},
      {.name = "exposure",
       .help = "brightens (or darkens) display colors by so many stops; auto: as the light of all that is seen asks "
               "for, alike on all screens; EXR files stay as lit",
       .value = exposure(),
       .initial = "auto",
       .decides_bits = false,
       .used_with = {{"show", shows_light}}},
      {.name = "aov",
       .help =
           fmt::format("layers of the .exr, of FILE.aov.exr beside a .png, or of a wall (SCREEN.aov.exr): a list of {}",
                       fmt::join(aov_names(), ", ")),
       .value = text(
           "LIST", "layers", [](Settings& s) -> std::vector<Aov>& { return s.frame.aovs; }, parse_aovs,
           [](const std::vector<Aov>& aovs) {
             std::vector<std::string_view> names(aovs.size());
             std::ranges::transform(aovs, names.begin(), [](Aov aov) { return name_of(aov); });
             return fmt::format("{}", fmt::join(names, ","));
           }),
       .scope = SettingScope::Single},
      {.name = "strict",
       .help = "values that are not finite are errors, not replaced: of files (exit code 3), of the picture (1)",
       .value = flag([](Settings& s) -> bool& { return s.strict; }),
       .decides_bits = false,
       .fixed_in_session = true},
      {.name = "codec",
       .help = "of pictures on their way to displays: auto, or one of hpr bench codec",
       .value =
           plain_text("NAME", "raw, lz4, zstd, jpeg, auto", [](Settings& s) -> std::string& { return s.codec.name; }),
       .initial = "auto",
       .costs = "time to encode and decode, against time on the link",
       .loses = "jpeg: see --codec-quality; the others only what --codec-error allows",
       .decides_bits = false,
       .fixed_in_session = true,
       .scope = SettingScope::Wall},
      {.name = "codec-quality",
       .help = "of jpeg",
       .value = number(1, 100, [](Settings& s) -> int& { return s.codec.quality; }),
       .initial = "90",
       .costs = "bytes",
       .loses = "low: blocks and ringing at edges, colors first",
       .decides_bits = false,
       .fixed_in_session = true,
       .scope = SettingScope::Wall},
      {.name = "codec-error",
       .help = "levels of 255 that a shown color may be off, e.g. 3/255",
       .value = text(
           "N", "0 to 255 levels of 255, written 3 or 3/255", [](Settings& s) -> int& { return s.codec.error; },
           parse_codec_error, [](int levels) { return fmt::format("{}/255", levels); }),
       .initial = "0",
       .costs = "0: up to twice the bytes of an error of 2",
       .loses = "so many levels at most, in every pixel and channel, whatever the codec",
       .decides_bits = false,
       .fixed_in_session = true,
       .scope = SettingScope::Wall},
  };
}

}  // namespace

std::span<const Setting> all_settings() {
  static const std::vector<Setting> table = make_table();
  return table;
}

const Setting* find_setting(std::string_view name) {
  const auto settings = all_settings();
  const auto found = std::ranges::find(settings, name, &Setting::name);
  return found == settings.end() ? nullptr : &*found;
}

void set_setting(RenderSettings& settings, std::string_view name, const std::string& value) {
  const Setting* const setting = find_setting(name);
  if (setting == nullptr) {
    std::vector<std::string> names;
    for (const Setting& one : all_settings()) names.emplace_back(one.name);
    throw Error(ExitCode::Usage, fmt::format("there is no setting '{}'", printable(name)),
                unknown_name_hint(name, names));
  }
  try {
    setting->value.parse(settings, value);
  } catch (const Error& error) {
    const std::string what = error.what();
    throw Error(error.code(), what.starts_with("--") ? what : fmt::format("--{}: {}", name, what), error.hint());
  }
  settings.specified.insert(setting->name);
}

void reset_setting(RenderSettings& settings, std::string_view name) {
  const Setting* const setting = find_setting(name);
  HPR_CHECK(setting != nullptr);
  setting->value.copy(RenderSettings(), settings);
  settings.specified.erase(setting->name);
}

const Setting& find_tradeoff_setting(const std::string& name) {
  const Setting* const setting = find_setting(name);
  const bool is_tradeoff = setting != nullptr && setting->is_tradeoff();
  if (is_tradeoff && setting->scope != SettingScope::Wall) return *setting;
  if (is_tradeoff) {
    throw Error(ExitCode::Usage, fmt::format("'{}' changes no picture before it is sent", name),
                "hpr bench codec SCENE measures what it costs and loses");
  }
  std::vector<std::string> choices;
  for (const Setting& other : all_settings()) {
    if (other.is_tradeoff() && other.scope != SettingScope::Wall) choices.emplace_back(other.name);
  }
  throw Error(ExitCode::Usage, fmt::format("there is no knob '{}'", printable(name)), unknown_name_hint(name, choices));
}

}  // namespace hpr
