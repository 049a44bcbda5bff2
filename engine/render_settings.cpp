#include "engine/render_settings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <glm/trigonometric.hpp>
#include <optional>
#include <variant>

#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "engine/settings_table.h"
#include "image/filter.h"
#include "rt/passes/pass_list.h"
#include "rt/show/show.h"
#include "scene/load_scene.h"
#include "scene/studio.h"
#include "scene/view.h"

namespace hpr {
namespace {

constexpr int kReferenceDepth = 64;

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

/// Gives a scene the environment that was asked for.
void set_environment(const std::string& wanted, const ImageLimits& pictures, Scene& scene) {
  if (wanted == kNoEnvironment) return;
  if (wanted.empty()) {
    if (!needs_studio(scene)) return;
    scene.environment = make_studio();
    scene.environment_note = "the environment studio (the scene brings too little light; --environment none: no other)";
    return;
  }
  scene.environment = load_environment(wanted, pictures);
  scene.environment_note = fmt::format("the environment {} (as asked)", printable(wanted));
  note_not_finite(printable(wanted), scene);
}

/// The pass that needs photons, if it is named.
std::optional<PassId> named_photon_pass(const RaySettings& rays) {
  const auto found = std::ranges::find_if(rays.passes, [](PassId pass) { return info_of(pass).needs_photons; });
  return found == rays.passes.end() ? std::nullopt : std::optional(*found);
}

/// Whether a finished picture takes its value of a setting, which excludes some of what users may have asked for.
bool can_finish(const Setting& setting, const RenderSettings& settings) {
  const FrameSettings& frame = settings.frame;
  if (setting.finished.empty() || settings.is_given(setting.name)) return false;
  if (setting.name == "denoise") {
    const bool weighs_negatively = settings.sampling.filter && min_samples(*settings.sampling.filter) > 1;
    return frame.shading == Shading::Deferred && frame.rays.half_resolution.empty() && !weighs_negatively;
  }
  if (setting.name == "indirect") {
    return !settings.is_given("passes") && !(settings.is_given("photons") && frame.rays.photons == 0);
  }
  return true;
}

constexpr std::uint32_t kManySamples = 64;
/// With fewer, what photons blur is less than the noise of rays that gather.
constexpr std::uint32_t kGatheredSamples = 32;

/// With fewer, noise hides the seams between tiles, and not a seventh of the time is to spare.
constexpr std::uint32_t kSeamlessSamples = 4;

/// In one of so many samples: all of them together are to gather enough. With fewer than four in one they show one by
/// one; denoised pictures of few samples, whose filter takes each photon's disc for light of its own, need more.
double photons_to_gather(bool denoise, std::uint32_t samples) {
  return denoise ? std::clamp(800.0 / samples, 4.0, 200.0) : std::clamp(256.0 / samples, 4.0, 50.0);
}

std::uint32_t samples_of(const RenderSettings& settings) {
  return settings.sampling.goal.samples.value_or(kManySamples);
}

/// What of the settings of photons depends on others.
void resolve_photons(RenderSettings& settings) {
  RaySettings& rays = settings.frame.rays;
  const bool asks_for_indirect = settings.is_given("indirect") && rays.global_photons;
  const std::optional<PassId> named = named_photon_pass(rays);
  const bool asks_for_photons = named || asks_for_indirect;
  if (!settings.is_given("indirect")) rays.global_photons = rays.global_photons || named;
  if (settings.is_given("photons") && rays.photons == 0 && asks_for_photons) {
    throw Error(ExitCode::Usage,
                fmt::format("{}, and --photons 0 sends none", named ? fmt::format("--passes names {}", name_of(*named))
                                                                    : "--indirect is the light of photons"),
                "leave one of them out, or send some");
  }
  // A quality without photons sends those of the next where it must send some.
  if (!settings.is_given("photons") && rays.photons == 0 && (asks_for_photons || rays.all_passes)) {
    const Setting& photons = *find_setting("photons");
    photons.value.parse(settings, std::string(photons.by_quality.at(static_cast<std::size_t>(Quality::Good))));
  }
  settings.frame.photons_fit_frame = !settings.is_given("photons");
  const std::uint32_t samples = samples_of(settings);
  rays.photons_gathered = photons_to_gather(rays.denoise, samples);
  if (samples < kGatheredSamples && !settings.is_given("final-gather")) rays.final_gather = false;
}

void check_camera(const CameraChoice& camera) {
  if (camera.eye && !camera.name.empty()) throw Error(ExitCode::Usage, "--eye excludes --camera", "use one of them");
  if (camera.eye && !camera.at) throw Error(ExitCode::Usage, "--eye requires --at", "name what the eye looks at");
  if (camera.at && !camera.eye) throw Error(ExitCode::Usage, "--at requires --eye", "name where the eye is");
  if (camera.up && !camera.eye) throw Error(ExitCode::Usage, "--up requires --eye", "cameras of scenes have their own");
}

void check_verify(const FrameSettings& frame) {
  if (frame.verify_percent == 0.0) return;
  if (frame.shading == Shading::Local || frame.in_parts()) {
    throw Error(ExitCode::Usage,
                "--verify has a tile drawn whole by another rank, which --shading local and --data partitioned or "
                "paged leave to many",
                "use it with --shading deferred and --data replicated");
  }
  if (!frame.rays.build.same_instructions) {
    throw Error(ExitCode::Usage, "--verify compares bits, which --deterministic off lets differ between machines",
                "use one of them");
  }
}

/// What stands in the place of all shaders is no light that settings could be about.
void resolve_show(RenderSettings& settings) {
  RaySettings& rays = settings.frame.rays;
  if (rays.show == Show::Shaded) return;
  rays.reference = false;
  settings.frame.shading = Shading::Deferred;
  settings.display = {.exposure_stops = 0.0, .tone = Tone::None, .shows = name_of(rays.show)};
  if (needs_light(rays.show)) return;
  rays.denoise = false;
  rays.half_resolution.clear();
  if (std::ranges::none_of(settings.frame.aovs, is_part)) return;
  throw Error(ExitCode::Usage,
              fmt::format("--show {} leaves no light of which --aov could show parts", name_of(rays.show)),
              "with it, use of --aov only depth, id, normal, albedo, rank and cost");
}

/// Whether ranks draw no objects but those of a part of the scene that each holds.
bool may_be_in_parts(const FrameSettings& frame) {
  return frame.distribution != Distribution::SortFirst;
}

/// What ranks cannot do that hold parts.
void check_data(const FrameSettings& frame) {
  if (frame.in_parts() && !may_be_in_parts(frame)) {
    throw Error(ExitCode::Usage,
                fmt::format("--data {} gives each rank its own objects, of which --distribute {} draws others",
                            kDataNames.at(static_cast<std::size_t>(frame.data)), name_of(*frame.distribution)),
                frame.data == SceneData::Paged ? "use --distribute sort-last or hybrid, or leave it out"
                                               : "use --distribute sort-last, sort-middle or hybrid, or leave it out");
  }
  if (frame.data == SceneData::Paged && frame.distribution == Distribution::SortMiddle) {
    throw Error(ExitCode::Usage,
                "--data paged draws page by page, and --distribute sort-middle sends triangles of all of them",
                "use --distribute sort-last or hybrid, or leave it out");
  }
  if (frame.in_parts() && frame.distribution == Distribution::SortMiddle && frame.primary != Primary::Raster) {
    throw Error(
        ExitCode::Usage,
        "--data partitioned --distribute sort-middle sends triangles for OpenGL to draw, and rays would meet none",
        "use --primary raster, or --distribute sort-last");
  }
}

/// What of the settings excludes each other.
void check_combination(const RenderSettings& settings) {
  const FrameSettings& frame = settings.frame;
  const bool is_local = frame.shading == Shading::Local;
  const bool shares_light = !frame.rays.half_resolution.empty();
  const auto refuse = [](const std::string& what, const std::string& hint) {
    throw Error(ExitCode::Usage, what, hint);
  };
  if (frame.depth_format != DepthFormat::Float32 && frame.primary == Primary::Rays) {
    refuse("--depth-format rounds depths before OpenGL compares them; rays compare their own",
           "use it with --primary raster");
  }
  check_data(frame);
  const bool splits = std::ranges::any_of(
      frame.aovs, [](Aov layer) { return layer != Aov::Depth && layer != Aov::Id && layer != Aov::Rank; });
  if (frame.rays.reference && (splits || is_local)) {
    refuse("--reference has no light of its own passes to show or to composite",
           "with it, use --shading deferred and of --aov only depth, id and rank");
  }
  if (settings.sampling.adaptive && (is_local || shares_light)) {
    refuse("--adaptive lights pixels one by one, as --shading local and --half-resolution do not",
           "use it without them");
  }
  if (!frame.aovs.empty() && is_local) {
    refuse("--aov needs surfaces, which --shading local replaces by colours", "use --shading deferred");
  }
  if (frame.resolution_scale != 1.0 && !frame.aovs.empty()) {
    refuse("--aov has a value for every pixel, of which --resolution-scale makes fewer",
           "draw a smaller picture with --size");
  }
  if (shares_light && (frame.rays.reference || is_local)) {
    refuse("--half-resolution is about passes over what is seen in the end",
           "use it without --reference and with --shading deferred");
  }
}

void check_denoise(const RenderSettings& settings) {
  const FrameSettings& frame = settings.frame;
  if (!frame.rays.denoise) return;
  if (frame.rays.reference || frame.shading == Shading::Local || !frame.rays.half_resolution.empty()) {
    throw Error(ExitCode::Usage, "--denoise is about the light of passes at all that is seen in the end",
                "use it without --reference and --half-resolution, and with --shading deferred");
  }
  if (settings.sampling.filter && min_samples(*settings.sampling.filter) > 1) {
    throw Error(ExitCode::Usage,
                fmt::format("--denoise looks at more places, whose weights --filter {} makes negative",
                            name_of(*settings.sampling.filter)),
                "use another filter, e.g. b-spline");
  }
}

}  // namespace

RenderSettings resolve(RenderSettings settings, std::uint64_t seed) {
  for (const Setting& setting : all_settings()) {
    const std::string_view value = setting.by_quality.at(static_cast<std::size_t>(settings.quality));
    if (!value.empty() && !settings.is_given(setting.name)) setting.value.parse(settings, std::string(value));
  }
  if (settings.finishes && settings.quality == Quality::Good && !settings.is_given("spp") &&
      !settings.frame.rays.reference) {
    for (const Setting& setting : all_settings()) {
      if (can_finish(setting, settings)) setting.value.parse(settings, std::string(setting.finished));
    }
    Sampling& sampling = settings.sampling;
    if (sampling.filter) sampling.goal.samples = std::max(*sampling.goal.samples, min_samples(sampling));
  }
  RaySettings& rays = settings.frame.rays;
  rays.seed = seed;
  resolve_show(settings);
  if (rays.reference && !settings.is_given("max-depth")) rays.max_depth = kReferenceDepth;
  resolve_photons(settings);
  rays.filter_across_tiles =
      (rays.denoise || !rays.half_resolution.empty()) && samples_of(settings) >= kSeamlessSamples;
  if (rays.denoise && settings.sampling.filter) rays.filter = *settings.sampling.filter;
  check_camera(settings.camera);
  check_combination(settings);
  check_denoise(settings);
  check_verify(settings.frame);
  check_sampling(settings.sampling);
  return settings;
}

Camera choose_camera(const CameraChoice& choice, const Scene& scene) {
  if (choice.eye) {
    return look_at(*choice.eye, choice.at.value_or(glm::dvec3(0.0)), choice.up.value_or(glm::dvec3(0.0, 1.0, 0.0)),
                   glm::radians(choice.fov_degrees > 0.0 ? choice.fov_degrees : kDefaultFovDegrees));
  }
  Camera chosen;
  if (!choice.name.empty()) {
    chosen = find_camera(scene, choice.name);
  } else {
    chosen = scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front();
  }
  auto* const lens = std::get_if<PerspectiveLens>(&chosen.lens);
  if (choice.fov_degrees > 0.0 && lens != nullptr) lens->vertical_fov_radians = glm::radians(choice.fov_degrees);
  return chosen;
}

FirstViews first_view(const RenderSettings& settings, Size size) {
  return [camera = settings.camera, size](const Scene& scene) {
    return std::vector{make_view(choose_camera(camera, scene), size, scene.bounds)};
  };
}

namespace {

/// Reads a scene whole, or in parts where that is asked for, or it is too large and nothing says otherwise.
LoadedScene load_as_fits(const std::string& source, const RenderSettings& settings, const SceneLimits& limits) {
  const FrameSettings& frame = settings.frame;
  const auto in_parts = [&] {
    LoadedScene loaded = load_unshaped_scene(source, limits, settings.scene, true);
    loaded.in_pages = frame.data == SceneData::Paged;
    if (frame.distribution == Distribution::Hybrid) loaded.islands = frame.groups;
    return loaded;
  };
  if (frame.in_parts()) return in_parts();
  try {
    return load_unshaped_scene(source, limits, settings.scene);
  } catch (const Error& error) {
    const bool has_a_choice = !settings.is_given("data") && may_be_in_parts(frame) && frame.verify_percent == 0.0;
    if (error.code() != ExitCode::Limit || !has_a_choice || source.starts_with("gen:")) throw;
    log::info("{}; reading it in parts, one for each rank", error.what());
    return in_parts();
  }
}

/// The framing_camera of a scene of which meshes have no triangles here.
Camera framing_of(const LoadedScene& loaded) {
  constexpr std::uint32_t kPiece = 1U << 16U;
  SceneFraming framing(loaded.scene.bounds);
  const auto add = [&](std::uint32_t mesh, const Mesh& vertices) {
    for (const Instance& instance : loaded.scene.instances) {
      if (instance.mesh == mesh) framing.add(instance, vertices);
    }
  };
  for (std::uint32_t mesh = 0; mesh < loaded.scene.meshes.size(); ++mesh) {
    if (!loaded.scene.meshes[mesh].partial) {
      add(mesh, loaded.scene.meshes[mesh]);
      continue;
    }
    const std::unique_ptr<MeshReader> read = loaded.read_mesh(mesh);
    std::vector<float> values;
    for (std::uint32_t first = 0; first < read->vertices(); first += std::min(kPiece, read->vertices() - first)) {
      Mesh piece;
      read->read(VertexArray::Positions, first, first + std::min(kPiece, read->vertices() - first), values);
      append_values(piece, VertexArray::Positions, values);
      add(mesh, piece);
    }
  }
  return framing.camera();
}

}  // namespace

LoadedScene load_scene(const std::string& source, const RenderSettings& settings, const SceneLimits& limits,
                       const ImageLimits& pictures, const FirstViews& views) {
  LoadedScene loaded = load_as_fits(source, settings, limits);
  Scene& scene = loaded.scene;
  if (has_points_or_lines(scene)) {
    if (loaded.read_mesh && scene.cameras.empty()) scene.framing = framing_of(loaded);
    shape_points_and_lines(scene, settings.widths, views(scene), limits.memory_bytes);
    scene.framing.reset();  // it may be another one now
  }
  set_environment(settings.environment, pictures, scene);
  if (settings.cull == Cull::None) {
    for (Material& material : scene.materials) material.double_sided = true;
  }
  if (settings.strict && scene.not_finite > 0) {
    const auto named = std::ranges::find_if(
        scene.warnings, [](const std::string& text) { return text.find("no finite numbers") != std::string::npos; });
    throw Error(
        ExitCode::BadInput,
        fmt::format("{}: {}", printable(source),
                    named != scene.warnings.end() ? printable(*named, 400)
                                                  : fmt::format("{} values are no finite numbers", scene.not_finite)),
        "repair the file, or draw without --strict: they are replaced");
  }
  return loaded;
}

void check_raw(const RenderSettings& settings) {
  if (settings.frame.shading == Shading::Local) {
    throw Error(ExitCode::Usage, "--raw writes surfaces, which --shading local replaces by colours",
                "use --shading deferred");
  }
  if (settings.frame.resolution_scale != 1.0) {
    throw Error(ExitCode::Usage, "--raw has a key for every pixel, of which --resolution-scale makes fewer",
                "draw a smaller picture with --size");
  }
}

std::string what_is_left_out(const RenderSettings& settings) {
  const FrameSettings& frame = settings.frame;
  if (frame.rays.reference) return {};
  std::vector<std::string_view> parts;
  const auto note = [&](bool is_left_out, std::string_view setting, std::string_view part) {
    if (is_left_out && !settings.is_given(setting)) parts.push_back(part);
  };
  note(!settings.sampling.sums(), "spp", "antialiasing (--spp 8)");
  if (!settings.is_given("passes")) {
    note(!frame.rays.global_photons, "indirect", "indirect light (--indirect)");
    note(frame.rays.photons == 0, "photons", "caustics (--photons 100000)");
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

void note_what_is_left_out(const RenderSettings& settings) {
  const std::string parts = what_is_left_out(settings);
  if (!parts.empty()) log::info("left out: {}", parts);
}

std::vector<std::string> unused_settings(const RenderSettings& settings) {
  std::vector<std::string> sentences;
  for (const Setting& setting : all_settings()) {
    if (!settings.is_given(setting.name)) continue;
    for (const Dependency& dependency : setting.used_with) {
      if (dependency.is_met(settings)) continue;
      const SettingValue& other = find_setting(dependency.on)->value;
      sentences.push_back(fmt::format("--{}{} has no use for --{}", dependency.on,
                                      other.is_flag ? "" : " " + other.write(settings), setting.name));
      break;
    }
  }
  return sentences;
}

}  // namespace hpr
