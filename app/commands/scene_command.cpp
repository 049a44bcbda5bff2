#include <fmt/format.h>

#include <algorithm>

#include "app/command.h"
#include "app/options/render_options.h"
#include "core/file.h"
#include "core/json.h"
#include "core/log.h"
#include "core/text.h"
#include "rt/passes/pass_list.h"
#include "scene/flatten.h"
#include "scene/generators/generators.h"
#include "scene/gltf/gltf.h"
#include "scene/load_scene.h"
#include "scene/requirements.h"

namespace hpr {
namespace {

Json corner(const glm::dvec3& p) {
  return Json::array({p.x, p.y, p.z});
}

Json requirement_json(const Requirement& requirement) {
  return {{"needed", requirement.needed}, {"why", requirement.why}};
}

Json info_json(const Scene& scene) {
  const Requirements required = requirements_of(scene);
  Json needed;
  for (const PassInfo& pass : all_passes()) {
    if (pass.required_by != nullptr) needed[pass.name] = requirement_json(required.*pass.required_by);
  }
  Json cameras = Json::array();
  for (const Camera& camera : scene.cameras) cameras.push_back(camera.name);
  return {{"schema", "hpr.scene-info/1"},
          {"triangles", scene.triangles},
          {"meshes", scene.meshes.size()},
          {"instances", scene.instances.size()},
          {"materials", scene.materials.size()},
          {"textures", scene.textures.size()},
          {"lights", scene.lights.size()},
          {"cameras", cameras},
          {"scenes", scene.scenes},
          {"variants", scene.variants},
          {"bounds", Json::array({corner(scene.bounds.low), corner(scene.bounds.high)})},
          {"requires", needed},
          {"warnings", scene.warnings}};
}

void print_info(const Scene& scene) {
  const glm::dvec3& low = scene.bounds.low;
  const glm::dvec3& high = scene.bounds.high;
  fmt::print("{}\n", printable(scene.name));
  fmt::print("  triangles  {}\n  meshes     {}\n  instances  {}\n", scene.triangles, scene.meshes.size(),
             scene.instances.size());
  fmt::print("  materials  {}\n  textures   {}\n  lights     {}\n", scene.materials.size(), scene.textures.size(),
             scene.lights.size());
  fmt::print("  bounds     {:g} {:g} {:g} to {:g} {:g} {:g} m\n", low.x, low.y, low.z, high.x, high.y, high.z);
  for (const Camera& camera : scene.cameras) fmt::print("  camera     {}\n", printable(camera.name));
  for (const std::string& name : scene.scenes) fmt::print("  scene      {}\n", printable(name));
  for (const std::string& name : scene.variants) fmt::print("  variant    {}\n", printable(name));
  const Requirements required = requirements_of(scene);
  for (const PassInfo& pass : all_passes()) {
    if (pass.required_by == nullptr) continue;
    const Requirement& requirement = required.*pass.required_by;
    fmt::print("  {:<10} {}: {}\n", pass.name, requirement.needed ? "needed" : "not needed", requirement.why);
  }
}

/// Declares the options that choose among what a file holds.
void declare_choice(const OptionSet& options, RenderSettings& settings) {
  for (const char* const name : {"scene", "variant"}) (void)declare_setting(options, settings, *find_setting(name));
}

void log_warnings(const Scene& scene) {
  for (const std::string& warning : scene.warnings) log::warning("{}", printable(warning, 400));
}

class SceneInfoCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "info"; }
  [[nodiscard]] std::string_view summary() const override { return "counts, bounds and the passes the scene requires"; }

  void declare(const OptionSet& options) override {
    options.option("SCENE", source_, "a .gltf or .glb file, or gen:NAME?key=value").required();
    declare_choice(options, settings_);
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const Scene scene = load_scene(source_, globals.scene_limits(), settings_.scene);
    if (json_) {
      fmt::print("{}\n", info_json(scene).dump(2));
    } else {
      print_info(scene);
      log_warnings(scene);
    }
    return ExitCode::Done;
  }

 private:
  std::string source_;
  RenderSettings settings_;
  bool json_ = false;
};

class SceneValidateCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "validate"; }
  [[nodiscard]] std::string_view summary() const override {
    return "findings; exit code 0 when the scene can be drawn";
  }

  void declare(const OptionSet& options) override {
    options.option("SCENE", source_, "a .gltf or .glb file, or gen:NAME?key=value").required();
    declare_choice(options, settings_);
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    Json json{{"schema", "hpr.scene-validate/1"}, {"scene", source_}};
    try {
      const Scene scene = load_scene(source_, globals.scene_limits(), settings_.scene);
      log_warnings(scene);
      if (json_) {
        json["verdict"] = scene.warnings.empty() ? "ok" : "warn";
        json["warnings"] = scene.warnings;
        fmt::print("{}\n", json.dump(2));
      } else {
        fmt::print("{}: can be drawn: {} triangles, {} warnings\n", printable(source_, 300), scene.triangles,
                   scene.warnings.size());
      }
      return ExitCode::Done;
    } catch (const Error& error) {
      if (json_) {
        json["verdict"] = "error";
        json["error"] = error.what();
        json["exit_code"] = static_cast<int>(error.code());
        fmt::print("{}\n", json.dump(2));
      }
      throw;
    }
  }

 private:
  std::string source_;
  RenderSettings settings_;
  bool json_ = false;
};

class SceneMakeCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "make"; }
  [[nodiscard]] std::string_view summary() const override { return "writes a generated scene as binary glTF"; }

  void declare(const OptionSet& options) override {
    options.option("NAME", source_, "one of `hpr scene list`, also as NAME?key=value").required();
    options.option("--triangles", triangles_, "about this many, the nearest size the generator has")
        .range(std::uint64_t{1}, std::uint64_t{4'294'967'294});
    options.flag("--flatten", flatten_, "a mesh of its own for every instance, in world coordinates");
    options.option("-o", output_, "the .glb file").required();
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    constexpr std::string_view kPrefix = "gen:";  // as `list` names them
    std::string text = source_.starts_with(kPrefix) ? source_.substr(kPrefix.size()) : source_;
    const Generator& generator = find_generator(text.substr(0, text.find('?')));
    if (!output_.ends_with(".glb")) {
      throw Error(ExitCode::Usage,
                  fmt::format("cannot write '{}': scenes are written as binary glTF", printable(output_)),
                  "name a .glb file");
    }
    const auto add = [&](const std::string& key, const std::string& value) {
      text += fmt::format("{}{}={}", text.find('?') == std::string::npos ? '?' : '&', key, value);
    };
    if (triangles_ > 0) {
      const GeneratorOptions options = options_for_triangles(generator, triangles_);
      if (options.empty()) log::warning("{} has only one size; --triangles changes nothing", generator.name);
      for (const auto& [key, value] : options) add(key, value);
    }
    constexpr std::uint64_t kDefaultSeed = 1;
    if (generator.options.contains("seed")) {
      if (text.find("seed=") == std::string::npos) add("seed", std::to_string(globals.seed));
    } else if (globals.seed != kDefaultSeed) {
      log::warning("{} has nothing random; --seed changes nothing", generator.name);
    }
    check_writable(output_, globals.force);
    Scene scene = generate_scene(text);
    if (flatten_) scene = flattened(scene);
    if (scene.background != Rgb{}) log::warning("glTF has no backgrounds; that of gen:{} is left out", text);
    const std::vector<std::byte> file = encode_glb(scene);
    write_file_atomically(output_, file);
    log::info("{}: gen:{}, {} triangles, {} bytes", output_, text, scene.triangles, file.size());
    return ExitCode::Done;
  }

 private:
  std::string source_;
  std::string output_;
  std::uint64_t triangles_ = 0;
  bool flatten_ = false;
};

class SceneListCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "list"; }
  [[nodiscard]] std::string_view summary() const override { return "the scenes HPR generates and their options"; }

  [[nodiscard]] ExitCode run(const Globals& /*globals*/) override {
    for (const Generator& generator : all_generators()) {
      fmt::print("gen:{}  {}\n", generator.name, generator.summary);
      for (const auto& [key, meaning] : generator.options) fmt::print("    {:<10} {}\n", key, meaning);
    }
    return ExitCode::Done;
  }
};

/// Looks at scenes and makes them: what is in one, whether it can be drawn, and those that HPR generates.
class SceneCommand final : public CommandGroup {
 public:
  SceneCommand() : CommandGroup("scene", "what a scene holds, whether it loads, and new ones") {}
  [[nodiscard]] std::vector<std::unique_ptr<Command>> subcommands() const override {
    return commands_of<SceneInfoCommand, SceneValidateCommand, SceneMakeCommand, SceneListCommand>();
  }
};

}  // namespace

std::unique_ptr<Command> make_scene_command() {
  return std::make_unique<SceneCommand>();
}

}  // namespace hpr
