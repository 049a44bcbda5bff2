#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// What a session did to the nodes and lights of a scene since it was loaded. Pure data, the same on every rank.
class SceneEdits {
 public:
  /// Of the scene as loaded.
  explicit SceneEdits(const Scene& scene);

  /// Nodes of one name are one: they move and hide together.
  struct Node {
    std::string name;
    std::vector<std::size_t> instances;  ///< as loaded
    bool hidden = false;
  };
  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  /// World space: where the first instance's origin is.
  [[nodiscard]] glm::dvec3 position(const Node& node) const;
  struct EditedLight {
    Light light;
    bool on = true;
  };
  [[nodiscard]] const std::vector<EditedLight>& lights() const { return lights_; }

  // All throw Error (Usage) for a name there is not, with the nearest one; positions must be finite.
  void move_by(const std::string& node, const glm::dvec3& offset);
  void move_to(const std::string& node, const glm::dvec3& position);
  /// About the axis through the node's position, counterclockwise seen from the axis's tip.
  void turn(const std::string& node, const glm::dvec3& axis, double degrees);
  void hide(const std::string& node, bool hidden);
  /// A light by its name; one without a name is called lightN, N its place from 0.
  [[nodiscard]] EditedLight& light(const std::string& name);

  /// Puts visible nodes, where they are now, and lights that are on into the scene, as if a file had held no others.
  void apply(Scene& scene) const;

 private:
  [[nodiscard]] Node& find(const std::string& name);
  void transform(const Node& node, const glm::dmat4& change);
  [[nodiscard]] std::vector<std::vector<SurfaceRange>> renumbered(
      const std::vector<std::vector<InstanceRange>>& old_parts, const Scene& scene,
      const std::vector<bool>& hidden) const;

  std::vector<Node> nodes_;
  std::vector<Instance> instances_;  ///< all, where they are now
  std::vector<std::string> names_;   ///< per instance
  std::vector<EditedLight> lights_;
  std::vector<std::vector<InstanceRange>> parts_;  ///< Scene::parts, where it is shared out
  std::vector<std::vector<InstanceRange>> pages_;  ///< Scene::pages
};

}  // namespace hpr
