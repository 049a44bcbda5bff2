#include "app/options/render_options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>
#include <iterator>

#include "app/options/words.h"
#include "compositing/compositor.h"
#include "core/names.h"
#include "engine/output.h"
#include "engine/quality.h"
#include "scene/environment.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

constexpr double kDefaultFovDegrees = 45.0;
constexpr int kReferenceDepth = 64;

glm::dvec3 to_point(const std::vector<double>& values) {
  return {values[0], values[1], values[2]};
}

Shading parse_shading(const std::string& name) {
  if (name == "deferred") return Shading::Deferred;
  if (name == "local") return Shading::Local;
  const std::vector<std::string> choices{"deferred", "local"};
  throw Error(ExitCode::Usage, fmt::format("unknown shading '{}'", name), unknown_name_hint(name, choices));
}

/// Whether the ranks share the scene out.
bool parse_data(const std::string& name) {
  if (name == "replicated" || name == "partitioned") return name == "partitioned";
  const std::vector<std::string> choices{"replicated", "partitioned"};
  throw Error(ExitCode::Usage, fmt::format("scene data is never '{}'", printable(name)),
              unknown_name_hint(name, choices));
}

Primary parse_primary(const std::string& name) {
  if (name == "raster") return Primary::Raster;
  if (name == "rays") return Primary::Rays;
  if (name == "auto") return Primary::Auto;
  const std::vector<std::string> choices{"raster", "rays", "auto"};
  throw Error(ExitCode::Usage, fmt::format("nothing called '{}' makes keys", printable(name)),
              unknown_name_hint(name, choices));
}

/// The first camera of that name, else the one at that index.
const Camera& find_camera(const Scene& scene, const std::string& wanted) {
  const auto named = std::ranges::find(scene.cameras, wanted, &Camera::name);
  if (named != scene.cameras.end()) return *named;
  std::size_t index = 0;
  const char* const last = wanted.data() + wanted.size();
  if (std::from_chars(wanted.data(), last, index).ptr == last && index < scene.cameras.size()) {
    return scene.cameras[index];
  }
  std::vector<std::string> names;
  names.reserve(scene.cameras.size());
  for (const Camera& camera : scene.cameras) names.push_back(printable(camera.name));
  throw Error(ExitCode::Usage, fmt::format("the scene has no camera '{}'", printable(wanted)),
              names.empty() ? "it has none at all: use --eye and --at" : unknown_name_hint(wanted, names));
}

/// Adds what the scene's environment had replaced to the scene's own warnings.
void note_not_finite(const std::string& name, Scene& scene) {
  const Environment& environment = *scene.environment;
  if (environment.not_finite == 0) return;
  const auto width = static_cast<std::size_t>(environment.image.width());
  scene.not_finite += environment.not_finite;
  scene.warnings.push_back(fmt::format("{}: {} values are no finite numbers, the first in pixel {},{}; replaced", name,
                                       environment.not_finite, environment.first_not_finite % width,
                                       environment.first_not_finite / width));
}

/// Throws Error (Usage) for what is no list of passes.
void choose_passes(const std::string& passes, RaySettings& rays) {
  const std::vector<std::string> named = split_words(passes);
  if (named.empty()) {
    throw Error(ExitCode::Usage, "--passes names none", "write auto, all, none, or a list such as shadow,reflection");
  }
  const std::vector<std::string> words{"auto", "all", "none"};
  const bool one_word = named.size() == 1 && std::ranges::find(words, named.front()) != words.end();
  rays.auto_passes = one_word && named.front() == "auto";
  rays.all_passes = one_word && named.front() == "all";
  if (one_word) return;
  std::vector<std::string> choices = words;
  std::ranges::copy(all_pass_names(), std::back_inserter(choices));
  for (const std::string& name : named) {
    if (std::ranges::find(words, name) != words.end()) {
      throw Error(ExitCode::Usage, fmt::format("--passes: '{}' goes with no other word", name),
                  "leave it or the others out");
    }
    if (std::ranges::find(choices, name) != choices.end()) continue;
    throw Error(ExitCode::Usage, fmt::format("no ray pass is called '{}'", printable(name)),
                unknown_name_hint(name, choices));
  }
  rays.passes = named;
}

}  // namespace

void RenderOptions::declare(CLI::App& app) {
  declare_frame(app);
  app.add_flag("--reference", reference, "path tracing in place of the passes: slow, and the ground truth");
  app.add_option("--aov", aov,
                 "layers of the .exr, of FILE.aov.exr beside a .png, or of a wall (SCREEN.aov.exr): a list of depth, "
                 "id, normal, albedo, direct, "
                 "shadow, reflection, refraction, ambient-occlusion, photon, rank, cost")
      ->type_name("LIST");
  app.add_flag("--explain", explain, "print the plan of the frame and why");
  app.add_option("--stats", stats, "write what the frame took as JSON")->type_name("FILE.json");
}

void RenderOptions::declare_frame(CLI::App& app) {
  const auto point = [&](const char* name, std::vector<double>& value, const char* text) {
    return app.add_option(name, value, text)->delimiter(',')->expected(3)->type_name("X,Y,Z");
  };
  CLI::Option* const by_name = app.add_option("--camera", camera, "name or index of a camera of the scene");
  CLI::Option* const by_eye = point("--eye", eye, "where the eye is");
  CLI::Option* const by_at = point("--at", at, "what it looks at");
  by_eye->needs(by_at)->excludes(by_name);
  by_at->needs(by_eye);
  point("--up", up, "which way is up")->needs(by_eye);
  app.add_option("--fov", fov_degrees, "vertical angle in degrees")->check(CLI::Range(0.001, 179.0));
  app.add_option("--primary", primary, "what finds the visible surfaces: raster, rays, or auto, which measures both")
      ->capture_default_str();
  declare_light(app);
  declare_economies(app);
  ray_build.declare(app);
  wire.declare(app);
  app.add_option("--distribute", distribute, "sort-first, sort-last, hybrid or auto")->capture_default_str();
  app.add_option("--groups", groups, "groups of ranks for hybrid (default: about the square root of the ranks)")
      ->check(CLI::Range(1, 1 << 20));
  app.add_option("--strategy", strategy, "how layers are composited: a strategy's name or auto")->capture_default_str();
  app.add_option("--data", data,
                 "what rays meet on a rank: replicated, all of the scene, or partitioned, what the rank draws itself, "
                 "while the rays of the others come to it")
      ->capture_default_str();
  app.add_option("--shading", shading, "deferred: light once after compositing; local: each rank before it")
      ->capture_default_str();
  app.add_option("--exposure", exposure,
                 "brightens (or darkens) display colours by so many stops; EXR files stay as lit")
      ->check(CLI::Range(-30.0, 30.0))
      ->capture_default_str();
  app.add_flag(
      "--strict", strict,
      "values that are no finite numbers are errors, not replaced: of files (exit code 3), of the picture (1)");
}

void RenderOptions::declare_light(CLI::App& app) {
  app.add_option("--quality", quality, "draft, good or best: what the options of light are that are not given")
      ->capture_default_str();
  app.add_option("--spp", spp, "samples of a pixel: a number, until:60s or until:relmse=1e-3")->type_name("N");
  app.add_flag("--adaptive", adaptive, "more samples for pixels whose samples differ more, --spp of them on average");
  app.add_flag(
      "--denoise", denoise,
      "neighbours that see the like share light, and outlines are looked at more closely, in the first samples");
  app.add_option("--filter", filter,
                 "how samples make up a pixel: box, triangle, gaussian, b-spline or mitchell (default: the centre for "
                 "one sample, box for more)");
  app.add_option("--passes", passes, "auto: what the scene requires; all: those it does not too; none; or a list")
      ->capture_default_str();
  app.add_option("--max-depth", max_depth,
                 "reflections and refractions in a row; of the reference: segments of a path, the first from the eye")
      ->check(CLI::Range(1, 64));
  app.add_option("--environment", environment,
                 "light from all around: a latitude-longitude picture, or one radiance R,G,B; replaces the scene's own")
      ->type_name("FILE|R,G,B");
  app.add_option("--light-samples", light_samples, "rays to surfaces that emit and the environment, per point")
      ->check(CLI::Range(1, 4096));
  app.add_option("--glossy-cutoff", glossy_cutoff, "specular surfaces at least this rough are not followed by rays")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--photons", photons, "sent per sample, where the scene requires any")
      ->check(CLI::Range(std::uint32_t{0}, std::uint32_t{1'000'000'000}));
  app.add_flag_function(
         "--indirect,!--no-indirect", [this](std::int64_t count) { indirect = count > 0; },
         "all indirect light, not caustics alone: by photons, or under an even sky by rays (default: with --quality "
         "best, or where --passes names photon)")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  app.add_flag("--no-terminator-fix", no_terminator_fix,
               "shadow rays leave from the triangles, not the smooth surface they stand for");
}

Camera RenderOptions::choose_camera(const Scene& scene) const {
  if (!eye.empty()) {
    return look_at(to_point(eye), to_point(at), to_point(up),
                   glm::radians(fov_degrees > 0.0 ? fov_degrees : kDefaultFovDegrees));
  }
  Camera chosen;
  if (!camera.empty()) {
    chosen = find_camera(scene, camera);
  } else {
    chosen = scene.cameras.empty() ? framing_camera(scene.bounds) : scene.cameras.front();
  }
  auto* const lens = std::get_if<PerspectiveLens>(&chosen.lens);
  if (fov_degrees > 0.0 && lens != nullptr) lens->vertical_fov_radians = glm::radians(fov_degrees);
  return chosen;
}

Scene RenderOptions::load(const std::string& source, const Globals& globals) const {
  Scene scene = load_scene(source, globals.scene_limits());
  if (!environment.empty()) {
    scene.environment = load_environment(environment, globals.picture_limits());
    note_not_finite(printable(environment), scene);
  }
  if (strict && scene.not_finite > 0) {
    const auto named = std::ranges::find_if(
        scene.warnings, [](const std::string& text) { return text.find("no finite numbers") != std::string::npos; });
    throw Error(
        ExitCode::BadInput,
        fmt::format("{}: {}", printable(source),
                    named != scene.warnings.end() ? printable(*named, 400)
                                                  : fmt::format("{} values are no finite numbers", scene.not_finite)),
        "repair the file, or draw without --strict: they are replaced");
  }
  return scene;
}

Sampling RenderOptions::sampling() const {
  Sampling sampling;
  sampling.goal = spp ? parse_sample_goal(*spp) : parse_sample_goal(std::to_string(find_quality(quality).samples));
  if (!filter.empty()) sampling.filter = parse_pixel_filter(filter);
  sampling.adaptive = adaptive;
  check_sampling(sampling);
  return sampling;
}

std::vector<std::string> RenderOptions::without_use() const {
  std::vector<std::string> names;
  if (!reference) {
    const std::vector<std::string> named = split_words(passes);
    const bool may_send = passes == "auto" || passes == "all" || std::ranges::find(named, "photon") != named.end();
    if (!may_send && photons.value_or(0) > 0) names.emplace_back("--photons");
    if (!may_send && photon_radius > 0.0) names.emplace_back("--photon-radius");
    if (!may_send && indirect.value_or(false)) names.emplace_back("--indirect");
    return names;
  }
  if (passes != "auto") names.emplace_back("--passes");
  if (photons) names.emplace_back("--photons");
  if (photon_radius > 0.0) names.emplace_back("--photon-radius");
  if (indirect) names.emplace_back("--indirect");
  if (light_samples) names.emplace_back("--light-samples");
  return names;
}

/// No infinities, no points beyond what squares in double precision.
void RenderOptions::check_numbers() const {
  if (!std::isfinite(fov_degrees) || !std::isfinite(exposure) || !std::isfinite(glossy_cutoff.value_or(0.0))) {
    throw Error(ExitCode::Usage, "--fov, --exposure and --glossy-cutoff take finite numbers", "write e.g. --fov 45");
  }
  for (const auto* const point : {&eye, &at, &up}) {
    if (std::ranges::all_of(*point, [](double value) { return std::abs(value) <= 1e18; })) continue;
    throw Error(ExitCode::Usage, "--eye, --at and --up take finite numbers up to 1e18", "write e.g. --eye 0,1.7,5");
  }
}

void RenderOptions::settle_photons(const Quality& defaults, RaySettings& rays) const {
  const bool names_photons = std::ranges::find(rays.passes, "photon") != rays.passes.end();
  rays.global_photons = indirect.value_or(defaults.global_photons || names_photons);
  const bool asks_for_photons = names_photons || indirect.value_or(false);
  if (photons == std::uint32_t{0} && asks_for_photons) {
    throw Error(ExitCode::Usage,
                fmt::format("{}, and --photons 0 sends none",
                            names_photons ? "--passes names photon" : "--indirect is the light of photons"),
                "leave one of them out, or send some");
  }
  // A quality without photons sends those of the next if it must.
  const bool must_send = asks_for_photons || rays.all_passes;
  const std::uint32_t usual = defaults.photons == 0 && must_send ? find_quality("good").photons : defaults.photons;
  rays.photons = photons.value_or(usual);
}

/// What of `settings` goes together.
void RenderOptions::check_combination(const FrameSettings& settings) const {
  if (settings.depth_format != DepthFormat::Float32 && settings.primary != Primary::Raster) {
    throw Error(ExitCode::Usage, "--depth-format rounds depths before OpenGL compares them; rays compare their own",
                "use it with --primary raster");
  }
  if (settings.partitioned && settings.distribution.value_or(Distribution::SortLast) != Distribution::SortLast) {
    throw Error(ExitCode::Usage,
                fmt::format("--data partitioned gives each rank its own objects, of which --distribute {} draws others",
                            distribute),
                "use --distribute sort-last, or leave it out");
  }
  const bool splits = std::ranges::any_of(
      settings.aovs, [](Aov layer) { return layer != Aov::Depth && layer != Aov::Id && layer != Aov::Rank; });
  if (reference && (splits || settings.shading == Shading::Local)) {
    throw Error(ExitCode::Usage, "--reference has no light of its own passes to show or to composite",
                "with it, use --shading deferred and of --aov only depth, id and rank");
  }
  const bool shares_light = !half_resolution.empty() && half_resolution != "none";
  if (adaptive && (settings.shading == Shading::Local || shares_light)) {
    throw Error(ExitCode::Usage, "--adaptive lights pixels one by one, as --shading local and --half-resolution do not",
                "use it without them");
  }
  if (!settings.aovs.empty() && settings.shading == Shading::Local) {
    throw Error(ExitCode::Usage, "--aov needs surfaces, which --shading local replaces by colours",
                "use --shading deferred");
  }
}

FrameSettings RenderOptions::settings(std::uint64_t seed) const {
  check_numbers();
  FrameSettings settings;
  const std::string unsaid = "auto";
  if (distribute != unsaid) settings.distribution = parse_distribution(distribute, std::span(&unsaid, 1));
  settings.groups = groups;
  if (strategy != "auto") settings.strategy = make_compositor(strategy)->name();
  settings.primary = parse_primary(primary);
  settings.shading = parse_shading(shading);
  settings.partitioned = parse_data(data);
  choose_passes(passes, settings.rays);
  const Quality& defaults = find_quality(quality);
  settings.rays.seed = seed;
  settings.rays.max_depth = max_depth.value_or(reference ? kReferenceDepth : defaults.max_depth);
  settings.rays.light_samples = light_samples.value_or(defaults.light_samples);
  settings.rays.glossy_cutoff = glossy_cutoff.value_or(defaults.glossy_cutoff);
  settle_photons(defaults, settings.rays);
  settings.photons_fit_frame = !photons;
  settings.rays.reference = reference;
  settings.rays.build = ray_build.build();
  settings.depth_format = wire.depths();
  settings.rays.terminator_fix = !no_terminator_fix;
  settings.aovs = parse_aovs(aov);
  check_combination(settings);
  settle_economies(settings);
  return settings;
}

void check_raw(const RenderOptions& options) {
  if (options.shading == "local") {
    throw Error(ExitCode::Usage, "--raw writes surfaces, which --shading local replaces by colours",
                "use --shading deferred");
  }
  if (options.resolution_scale != 1.0) {
    throw Error(ExitCode::Usage, "--raw has a key for every pixel, of which --resolution-scale makes fewer",
                "draw a smaller picture with --size");
  }
}

std::vector<std::string> option_names() {
  CLI::App app;
  app.set_help_flag();
  RenderOptions options;
  options.declare(app);
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  }
  return names;
}

void set_option(RenderOptions& options, const std::string& name, const std::string& value) {
  CLI::App app;
  options.declare(app);
  std::vector<std::string> words{fmt::format("--{}={}", name, value)};
  app.parse(words);
}

}  // namespace hpr
