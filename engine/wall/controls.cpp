#include "engine/wall/controls.h"

#include <fmt/format.h>

#include <glm/vector_relational.hpp>

#include "core/error.h"
#include "core/text.h"
#include "engine/session.h"
#include "engine/settings_table.h"

namespace hpr {
namespace {

std::string written(const glm::dvec3& point) {
  return fmt::format("{:g},{:g},{:g}", point.x, point.y, point.z);
}

void expect(Arguments arguments, std::size_t least, std::size_t most, const std::string& example) {
  if (arguments.size() < least || arguments.size() > most) {
    refuse(arguments.size() < least ? "something is missing" : "that is too much", example);
  }
}

std::string type_of(const Light& light) {
  switch (light.type) {
    case LightType::Point:
      return "point";
    case LightType::Spot:
      return "spot";
    case LightType::Directional:
      return "directional";
    case LightType::Headlight:
      break;
  }
  return "headlight";
}

}  // namespace

Controls::Controls(Session& session, RenderSettings& settings, std::uint64_t seed, SceneLoader load,
                   CommandTable& table)
    : session_(session),
      settings_(settings),
      seed_(seed),
      load_(std::move(load)),
      initial_fov_degrees_(settings.camera.fov_degrees),
      edits_(session.scene()) {
  add_scene_commands(table);
  add_light_commands(table);
  add_drawing_commands(table);
}

void Controls::add_scene_commands(CommandTable& table) {
  table.add(
      {"load", "SCENE", "another scene in this one's place", [this](Arguments arguments) { return load(arguments); }});
  table.add({"nodes", "", "the scene's nodes and where they are", [this](Arguments) { return list_nodes(); }, true});
  table.add(
      {"move", "NODE by|to X,Y,Z", "metres, world space", [this](Arguments arguments) { return move(arguments); }});
  table.add({"turn", "NODE X,Y,Z DEGREES", "about that axis through its position", [this](Arguments arguments) {
               expect(arguments, 3, 3, "turn NODE 0,1,0 90");
               edits_.turn(arguments[0], direction_of(point_of(arguments[1])), number_of(arguments[2]));
               return scene_changed();
             }});
  for (const bool hidden : {true, false}) {
    const std::string name = hidden ? "hide" : "show";
    table.add({name, "NODE", hidden ? "draw without it" : "draw it again", [this, hidden, name](Arguments arguments) {
                 expect(arguments, 1, 1, name + " NODE");
                 edits_.hide(arguments[0], hidden);
                 return scene_changed();
               }});
  }
}

void Controls::add_light_commands(CommandTable& table) {
  table.add({"lights", "", "the scene's lights", [this](Arguments) { return list_lights(); }, true});
  table.add({"light", "NAME on|off | intensity R,G,B | position X,Y,Z | direction X,Y,Z", "change a light",
             [this](Arguments arguments) { return change_light(arguments); }});
}

void Controls::add_drawing_commands(CommandTable& table) {
  table.add({"cameras", "", "the scene's cameras", [this](Arguments) { return list_cameras(); }, true});
  table.add({"camera", "NAME|INDEX | X,Y,Z at X,Y,Z [up X,Y,Z] [fov DEGREES]", "where the picture is seen from",
             [this](Arguments arguments) { return set_camera(arguments); }});
  for (const char* option : {"passes", "quality", "strategy", "spp"}) {
    table.add({option, "VALUE", fmt::format("as the option --{}", option),
               [this, option](Arguments arguments) { return set(option, arguments); }});
  }
  table.add({"set", "OPTION VALUE", "any other option of render, without its dashes", [this](Arguments arguments) {
               expect(arguments, 2, 2, "set photons 200000");
               return set(arguments[0], arguments.subspan(1));
             }});
}

std::string Controls::scene_changed() {
  session_.change_scene([this](Scene& scene) { edits_.apply(scene); });
  ++changes_;
  return "";
}

std::string Controls::load(Arguments arguments) {
  expect(arguments, 1, 1, "load FILE.glb");
  // What names a camera of the old scene names none of this one.
  RenderSettings settings = settings_;
  reset_setting(settings, "camera");
  session_.load([&] { return load_(arguments[0], settings); });
  edits_ = SceneEdits(session_.scene());
  reset_setting(settings_, "camera");
  ++changes_;
  const Scene& scene = session_.scene();
  return fmt::format("{}: {} triangles, {} nodes, {} lights", printable(scene.name), scene.triangles,
                     edits_.nodes().size(), scene.lights.size());
}

std::string Controls::move(Arguments arguments) {
  expect(arguments, 3, 3, "move NODE by 0,1,0");
  const glm::dvec3 target = point_of(arguments[2]);
  if (arguments[1] == "by") {
    edits_.move_by(arguments[0], target);
  } else if (arguments[1] == "to") {
    edits_.move_to(arguments[0], target);
  } else {
    refuse("a node moves by metres or to a place", "move NODE by 0,1,0");
  }
  return scene_changed();
}

std::string Controls::change_light(Arguments arguments) {
  expect(arguments, 2, 3, "light NAME intensity 10,10,10");
  SceneEdits::EditedLight& edited = edits_.light(arguments[0]);
  const std::string& what = arguments[1];
  if (what == "on" || what == "off") {
    expect(arguments, 2, 2, "light NAME off");
    edited.on = what == "on";
    return scene_changed();
  }
  expect(arguments, 3, 3, "light NAME position 0,2,0");
  const glm::dvec3 value = point_of(arguments[2]);
  if (what == "intensity") {
    if (glm::any(glm::lessThan(value, glm::dvec3(0.0))) || glm::any(glm::greaterThan(value, glm::dvec3(1e30)))) {
      refuse("intensities are from 0 to 1e30", "light NAME intensity 10,10,10");
    }
    edited.light.intensity = value;
  } else if (what == "position") {
    edited.light.position = value;
  } else if (what == "direction") {
    edited.light.direction = direction_of(value);
  } else {
    throw Error(ExitCode::Usage, fmt::format("a light has no '{}'", printable(what)),
                unknown_name_hint(what, std::vector<std::string>{"on", "off", "intensity", "position", "direction"}));
  }
  return scene_changed();
}

std::string Controls::set_camera(Arguments arguments) {
  expect(arguments, 1, 7, "camera 0,1,5 at 0,1,0");
  check_allowed("camera");
  CameraChoice choice{.fov_degrees = initial_fov_degrees_};
  if (arguments.size() == 1) {
    choice.name = arguments[0];
  } else {
    choice.eye = point_of(arguments[0]);
    for (std::size_t i = 1; i < arguments.size(); i += 2) {
      if (i + 1 == arguments.size()) refuse(fmt::format("nothing follows '{}'", printable(arguments[i])), "at 0,1,0");
      if (arguments[i] == "at") {
        choice.at = point_of(arguments[i + 1]);
      } else if (arguments[i] == "up") {
        choice.up = point_of(arguments[i + 1]);
      } else if (arguments[i] == "fov") {
        choice.fov_degrees = number_of(arguments[i + 1]);
        if (!(choice.fov_degrees > 0.0 && choice.fov_degrees < 179.0)) refuse("fov is from 0 to 179 degrees", "fov 45");
      } else {
        refuse(fmt::format("'{}' is none of at, up and fov", printable(arguments[i])), "camera 0,1,5 at 0,1,0 fov 40");
      }
    }
    if (!choice.at) refuse("what does the eye look at?", "camera 0,1,5 at 0,1,0");
  }
  (void)choose_camera(choice, session_.scene());  // a camera there is not is refused, and the old one stays
  settings_.camera = choice;
  ++changes_;
  return "";
}

void Controls::check_allowed(const std::string& name) const {
  const auto found = rejected_.find(name);
  if (found != rejected_.end()) refuse(fmt::format("'{}' stays as it is: {}", name, found->second), "quality draft");
}

std::string Controls::set(const std::string& name, Arguments arguments) {
  expect(arguments, 1, 1, name + " VALUE");
  const Setting* const setting = find_setting(name);
  if (setting != nullptr && (setting->fixed_in_session || setting->scope == SettingScope::Wall)) {
    refuse(fmt::format("--{} is not set from here", name), "set photons 200000");
  }
  check_allowed(name);
  RenderSettings tried = settings_;
  set_setting(tried, name, arguments[0]);
  (void)resolve(tried, seed_);
  settings_ = tried;
  ++changes_;
  return "";
}

std::string Controls::list_nodes() const {
  std::string text;
  for (const SceneEdits::Node& node : edits_.nodes()) {
    text += fmt::format("{}{} at {}{}", text.empty() ? "" : "\n", printable(node.name), written(edits_.position(node)),
                        node.hidden ? ", hidden" : "");
  }
  return text;
}

std::string Controls::list_lights() const {
  std::string text;
  for (const SceneEdits::EditedLight& edited : edits_.lights()) {
    const Light& light = edited.light;
    text += fmt::format("{}{}: {} at {}, intensity {}{}", text.empty() ? "" : "\n", printable(light.name),
                        type_of(light), written(light.position), written(light.intensity), edited.on ? "" : ", off");
  }
  return text;
}

std::string Controls::list_cameras() const {
  std::string text;
  for (const Camera& camera : session_.scene().cameras) {
    text += fmt::format("{}{} at {}", text.empty() ? "" : "\n", printable(camera.name), written(camera.eye));
  }
  return text;
}

}  // namespace hpr
