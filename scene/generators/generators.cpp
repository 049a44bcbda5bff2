#include "scene/generators/generators.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>

#include "core/error.h"
#include "core/text.h"
#include "scene/view.h"

namespace hpr {
namespace {

std::vector<std::string> keys_of(const std::map<std::string, std::string>& options) {
  std::vector<std::string> keys;
  keys.reserve(options.size());
  for (const auto& [key, text] : options) keys.push_back(key);
  return keys;
}

/// "s=2&k=4" as key and value pairs; `text` is the whole source, for messages.
GeneratorOptions parse_options(std::string_view list, std::string_view text) {
  GeneratorOptions options;
  while (!list.empty()) {
    const std::string_view item = list.substr(0, list.find('&'));
    list.remove_prefix(std::min(item.size() + 1, list.size()));
    const std::size_t equals = item.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      throw Error(ExitCode::Usage, fmt::format("gen:{}: '{}' is no option", printable(text), printable(item)),
                  "write options as gen:NAME?key=value&key=value");
    }
    const auto [entry, added] = options.try_emplace(std::string(item.substr(0, equals)), item.substr(equals + 1));
    if (!added) {
      throw Error(ExitCode::Usage,
                  fmt::format("gen:{}: option '{}' is given twice", printable(text), printable(entry->first)),
                  "keep one of them");
    }
  }
  return options;
}

}  // namespace

const std::vector<Generator>& all_generators() {
#define HPR_GENERATOR(name) name##_generator(),
  static const std::vector<Generator> generators{HPR_GENERATORS(HPR_GENERATOR)};
#undef HPR_GENERATOR
  return generators;
}

const Generator& find_generator(std::string_view name) {
  const std::vector<Generator>& generators = all_generators();
  const auto found = std::ranges::find(generators, name, &Generator::name);
  if (found == generators.end()) {
    std::vector<std::string> names;
    names.reserve(generators.size());
    for (const Generator& generator : generators) names.push_back(generator.name);
    throw Error(ExitCode::Usage, fmt::format("gen:{}: there is no such generated scene", printable(name)),
                unknown_name_hint(name, names));
  }
  return *found;
}

Scene generate_scene(std::string_view text) {
  const std::size_t question = std::min(text.find('?'), text.size());
  const Generator& generator = find_generator(text.substr(0, question));
  return generator.make(parse_options(text.substr(std::min(question + 1, text.size())), text));
}

GeneratorOptions options_for_triangles(const Generator& generator, std::uint64_t triangles) {
  return generator.sized ? generator.sized(triangles) : GeneratorOptions{};
}

OptionReader::OptionReader(const Generator& generator, const GeneratorOptions& options)
    : generator_(generator.name), options_(options) {
  for (const auto& [key, value] : options) {
    if (generator.options.contains(key)) continue;
    throw Error(ExitCode::Usage, fmt::format("gen:{} has no option '{}'", generator_, printable(key)),
                unknown_name_hint(key, keys_of(generator.options)));
  }
}

int OptionReader::integer(const std::string& key, int fallback, int low, int high) const {
  const auto found = options_.find(key);
  if (found == options_.end()) return fallback;
  const std::string& text = found->second;
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high) {
    throw Error(ExitCode::Usage, fmt::format("gen:{}: {}={} is out of range", generator_, key, printable(text)),
                fmt::format("give an integer from {} to {}; the default is {}", low, high, fallback));
  }
  return value;
}

std::string OptionReader::choice(const std::string& key, const std::vector<std::string>& choices) const {
  const auto found = options_.find(key);
  if (found == options_.end()) return choices.front();
  if (std::ranges::find(choices, found->second) == choices.end()) {
    throw Error(ExitCode::Usage, fmt::format("gen:{}: {}={} is not known", generator_, key, printable(found->second)),
                unknown_name_hint(found->second, choices));
  }
  return found->second;
}

Generator filled_by(Generator generator, void (*fill)(Scene& scene, const OptionReader& options)) {
  generator.make = [described = generator, fill](const GeneratorOptions& options) {
    Scene scene;
    scene.name = described.name;
    fill(scene, OptionReader(described, options));
    finish_scene(scene);
    return scene;
  };
  return generator;
}

GeneratorOptions nearest_size(const std::vector<SceneSize>& sizes, std::uint64_t triangles) {
  const auto distance = [&](const SceneSize& size) {
    return size.triangles > triangles ? size.triangles - triangles : triangles - size.triangles;
  };
  return std::ranges::min_element(sizes, {},
                                  [&](const SceneSize& size) { return std::make_pair(distance(size), size.triangles); })
      ->options;
}

std::uint32_t add_material(Scene& scene, Material material) {
  scene.materials.push_back(std::move(material));
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

std::uint32_t add_mesh(Scene& scene, Mesh mesh, std::string name, std::uint32_t material) {
  mesh.name = std::move(name);
  mesh.material = material;
  scene.meshes.push_back(std::move(mesh));
  return static_cast<std::uint32_t>(scene.meshes.size() - 1);
}

void add_single(Scene& scene, Mesh mesh, std::string name, std::uint32_t material) {
  add_instance(scene, add_mesh(scene, std::move(mesh), std::move(name), material));
}

void add_instance(Scene& scene, std::uint32_t mesh, const glm::dmat4& to_world) {
  Instance instance;
  instance.mesh = mesh;
  instance.to_world = to_world;
  scene.instances.push_back(instance);
}

void add_point_light(Scene& scene, std::string name, const glm::dvec3& position, const glm::vec3& intensity) {
  Light light;
  light.name = std::move(name);
  light.position = position;
  light.intensity = intensity;
  scene.lights.push_back(std::move(light));
}

void add_spd_light(Scene& scene, const glm::dvec3& position, double irradiance) {
  const double candela = irradiance * glm::dot(position, position);
  add_point_light(scene, "light", from_spd(position), glm::vec3(static_cast<float>(candela)));
}

void add_camera(Scene& scene, std::string name, const glm::dvec3& eye, const glm::dvec3& at, const glm::dvec3& up,
                double vertical_fov_degrees) {
  Camera camera = look_at(eye, at, up, vertical_fov_degrees * (std::numbers::pi / 180.0));
  std::get<PerspectiveLens>(camera.lens).at_distance = 0.0;  // as of cameras of files
  camera.name = std::move(name);
  scene.cameras.push_back(std::move(camera));
}

Material plastic(std::string name, const glm::vec3& color, float roughness) {
  Material material;
  material.name = std::move(name);
  material.base_color = glm::vec4(color, 1.0F);
  material.metallic = 0.0F;
  material.roughness = roughness;
  return material;
}

Material metal(std::string name, const glm::vec3& color, float roughness) {
  Material material = plastic(std::move(name), color, roughness);
  material.metallic = 1.0F;
  return material;
}

Material glass(std::string name, float ior) {
  Material material = plastic(std::move(name), glm::vec3(1.0F), 0.0F);
  material.transmission = 1.0F;
  material.ior = ior;
  material.thickness = 1.0F;
  return material;
}

}  // namespace hpr
