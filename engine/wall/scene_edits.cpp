#include "engine/wall/scene_edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <unordered_map>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

/// As far as a file may place a node.
constexpr double kMaxCoordinate = 1e18;

[[noreturn]] void throw_unknown(std::string_view what, const std::string& name, const std::vector<std::string>& names) {
  constexpr std::size_t kMaxListed = 40;
  if (names.empty()) {
    throw Error(ExitCode::Usage, fmt::format("the scene has no {} '{}'", what, printable(name)), "it has none at all");
  }
  const auto nearest = nearest_name(name, names);
  throw Error(ExitCode::Usage, fmt::format("the scene has no {} '{}'", what, printable(name)),
              names.size() <= kMaxListed ? unknown_name_hint(name, names)
              : nearest                  ? fmt::format("did you mean '{}'?", *nearest)
                                         : fmt::format("it has {} others: {}s lists them", names.size(), what));
}

}  // namespace

SceneEdits::SceneEdits(const Scene& scene) : instances_(scene.instances) {
  std::unordered_map<std::string, std::size_t> known;
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    names_.push_back(scene.node_names.empty() ? scene.mesh_of(instances_[i]).name : scene.node_names[i]);
    if (names_.back().empty()) names_.back() = fmt::format("mesh{}", instances_[i].mesh);
    const auto [found, is_new] = known.try_emplace(names_.back(), nodes_.size());
    if (is_new) nodes_.push_back({names_.back(), {}, false});
    nodes_[found->second].instances.push_back(i);
  }
  for (const std::vector<SurfaceRange>& part : scene.parts) parts_.push_back(split_by_instance(scene, part));
  for (const std::vector<SurfaceRange>& page : scene.pages) pages_.push_back(split_by_instance(scene, page));
  for (const Light& light : scene.lights) {
    lights_.push_back({light, true});
    if (light.name.empty()) lights_.back().light.name = fmt::format("light{}", lights_.size() - 1);
  }
}

SceneEdits::Node& SceneEdits::find(const std::string& name) {
  const auto found = std::ranges::find(nodes_, name, &Node::name);
  if (found != nodes_.end()) return *found;
  std::vector<std::string> names;
  for (const Node& node : nodes_) names.push_back(printable(node.name));
  throw_unknown("node", name, names);
}

SceneEdits::EditedLight& SceneEdits::light(const std::string& name) {
  const auto found = std::ranges::find(lights_, name, [](const EditedLight& edited) { return edited.light.name; });
  if (found != lights_.end()) return *found;
  std::vector<std::string> names;
  for (const EditedLight& edited : lights_) names.push_back(printable(edited.light.name));
  throw_unknown("light", name, names);
}

glm::dvec3 SceneEdits::position(const Node& node) const {
  return instances_[node.instances.front()].to_world[3];
}

void SceneEdits::transform(const Node& node, const glm::dmat4& change) {
  for (const std::size_t i : node.instances) {
    const glm::dmat4 moved = change * instances_[i].to_world;
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) {
        if (!(std::abs(moved[column][row]) <= kMaxCoordinate)) {
          throw Error(ExitCode::Usage, fmt::format("node '{}' would lie beyond 1e18 metres", printable(node.name)),
                      "keep it nearer");
        }
      }
    }
  }
  for (const std::size_t i : node.instances) instances_[i].to_world = change * instances_[i].to_world;
}

void SceneEdits::move_by(const std::string& node, const glm::dvec3& offset) {
  transform(find(node), glm::translate(glm::dmat4(1.0), offset));
}

void SceneEdits::move_to(const std::string& node, const glm::dvec3& position) {
  Node& found = find(node);
  const glm::dvec3 from = this->position(found);
  transform(found, glm::translate(glm::dmat4(1.0), position - from));
  // Exactly there, whatever the difference was rounded to.
  for (int i = 0; i < 3; ++i) instances_[found.instances.front()].to_world[3][i] = position[i];
}

void SceneEdits::turn(const std::string& node, const glm::dvec3& axis, double degrees) {
  if (!(glm::length(axis) > 0.0) || !std::isfinite(degrees)) {
    throw Error(ExitCode::Usage, "a node turns about an axis other than 0,0,0 by a number of degrees",
                "write e.g. turn NODE 0,1,0 90");
  }
  Node& found = find(node);
  const glm::dvec3 about = position(found);
  glm::dmat4 change = glm::translate(glm::dmat4(1.0), about);
  change = glm::rotate(change, glm::radians(degrees), glm::normalize(axis));
  transform(found, glm::translate(change, -about));
}

void SceneEdits::hide(const std::string& node, bool hidden) {
  find(node).hidden = hidden;
}

void SceneEdits::apply(Scene& scene) const {
  std::vector<bool> hidden(instances_.size(), false);
  for (const Node& node : nodes_) {
    for (const std::size_t i : node.instances) hidden[i] = node.hidden;
  }
  scene.instances.clear();
  scene.node_names.clear();
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    if (hidden[i]) continue;
    scene.instances.push_back(instances_[i]);
    scene.node_names.push_back(names_[i]);
  }
  scene.lights.clear();
  for (const EditedLight& edited : lights_) {
    if (edited.on) scene.lights.push_back(edited.light);
  }
  finish_scene(scene);
  scene.parts = renumbered(parts_, scene, hidden);
  scene.pages = renumbered(pages_, scene, hidden);
}

/// The parts of a scene that is shared out, by the numbers that surfaces have once some instances are hidden.
std::vector<std::vector<SurfaceRange>> SceneEdits::renumbered(const std::vector<std::vector<InstanceRange>>& old_parts,
                                                              const Scene& scene,
                                                              const std::vector<bool>& hidden) const {
  std::vector<std::uint32_t> now(instances_.size(), 0);
  for (std::size_t i = 0, next = 0; i < instances_.size(); ++i) {
    if (!hidden[i]) now[i] = scene.instances[next++].first_surface;
  }
  std::vector<std::vector<SurfaceRange>> parts(old_parts.size());
  for (std::size_t rank = 0; rank < parts.size(); ++rank) {
    for (const InstanceRange& range : old_parts[rank]) {
      if (hidden[range.instance]) continue;
      const std::uint32_t first = now[range.instance];
      parts[rank].push_back({first + range.range.first, first + range.range.last});
    }
    parts[rank] = merged_ranges(std::move(parts[rank]), scene.triangles);
  }
  return parts;
}

}  // namespace hpr
