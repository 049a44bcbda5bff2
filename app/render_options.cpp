#include "app/render_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>

#include "compositing/compositor.h"
#include "core/names.h"

namespace hpr {
namespace {

constexpr double kDefaultFovDegrees = 45.0;

glm::dvec3 to_point(const std::vector<double>& values) {
  return {values[0], values[1], values[2]};
}

std::vector<std::string> split_list(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t start = 0; start <= text.size();) {
    const std::size_t end = std::min(text.find(',', start), text.size());
    if (end > start) words.push_back(text.substr(start, end - start));
    start = end + 1;
  }
  return words;
}

Shading parse_shading(const std::string& name) {
  if (name == "deferred") return Shading::Deferred;
  if (name == "local") return Shading::Local;
  const std::vector<std::string> choices{"deferred", "local"};
  throw Error(ExitCode::Usage, fmt::format("unknown shading '{}'", name), unknown_name_hint(name, choices));
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

}  // namespace

void RenderOptions::declare(CLI::App& app) {
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
  app.add_option("--passes", passes, "auto, none, or a list of ray passes")->capture_default_str();
  app.add_option("--max-depth", max_depth, "reflections of reflections")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--distribute", distribute, "sort-first, sort-last, hybrid or auto")->capture_default_str();
  app.add_option("--groups", groups, "groups of ranks for hybrid (default: about the square root of the ranks)")
      ->check(CLI::PositiveNumber);
  app.add_option("--strategy", strategy, "how layers are composited: a strategy's name or auto")->capture_default_str();
  app.add_option("--shading", shading, "deferred: light once after compositing; local: each rank before it")
      ->capture_default_str();
  app.add_option("--exposure", exposure,
                 "brightens (or darkens) display colours by so many stops; EXR files stay as lit")
      ->check(CLI::Range(-30.0, 30.0))
      ->capture_default_str();
  app.add_flag("--explain", explain, "print the plan of the frame and why");
  app.add_option("--stats", stats, "write what the frame took as JSON")->type_name("FILE.json");
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

FrameSettings RenderOptions::settings() const {
  FrameSettings settings;
  if (!std::isfinite(fov_degrees) || !std::isfinite(exposure)) {
    throw Error(ExitCode::Usage, "--fov and --exposure take finite numbers", "write e.g. --fov 45");
  }
  if (distribute != "auto") settings.distribution = parse_distribution(distribute);
  settings.groups = groups;
  if (strategy != "auto") settings.strategy = make_compositor(strategy)->name();
  settings.shading = parse_shading(shading);
  settings.rays.auto_passes = passes == "auto";
  if (passes != "auto" && passes != "none") settings.rays.passes = split_list(passes);
  settings.rays.max_depth = max_depth;
  (void)plan_passes({}, settings.rays);  // unknown pass names are found before the scene is loaded
  return settings;
}

}  // namespace hpr
