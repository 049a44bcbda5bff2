#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "engine/wall/command_table.h"
#include "engine/wall/scene_edits.h"
#include "scene/load_scene.h"

namespace hpr {

class Session;
struct RenderSettings;
struct Scene;

/// Loads a scene and lights it as the settings say.
using SceneLoader = std::function<LoadedScene(const std::string& source, const RenderSettings& settings)>;

/// What can be changed about a resident scene and how it is drawn, by the same commands wherever they come from. Every
/// rank has one and runs the same lines: a change travels as its command, not as the scene.
class Controls {
 public:
  /// All outlive this. Adds its commands to `table`.
  Controls(Session& session, RenderSettings& settings, std::uint64_t seed, SceneLoader load, CommandTable& table);

  /// Counts the changes: a plan or a picture made at another count is of an earlier state.
  [[nodiscard]] std::uint64_t changes() const { return changes_; }
  /// From now on the command or option `name` is refused; `why` is what its user reads.
  void reject_change(const std::string& name, const std::string& why) { rejected_[name] = why; }

 private:
  void add_scene_commands(CommandTable& table);
  void add_light_commands(CommandTable& table);
  void add_drawing_commands(CommandTable& table);
  std::string load(Arguments arguments);
  std::string move(Arguments arguments);
  std::string change_light(Arguments arguments);
  std::string set_camera(Arguments arguments);
  std::string set(const std::string& option, Arguments arguments);
  [[nodiscard]] std::string list_nodes() const;
  [[nodiscard]] std::string list_lights() const;
  [[nodiscard]] std::string list_cameras() const;
  std::string scene_changed();
  void check_allowed(const std::string& name) const;

  Session& session_;
  RenderSettings& settings_;
  std::uint64_t seed_;
  SceneLoader load_;
  double initial_fov_degrees_;
  std::map<std::string, std::string> rejected_;
  SceneEdits edits_;
  std::uint64_t changes_ = 0;
};

}  // namespace hpr
