#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "engine/display/exposure.h"
#include "engine/frame_settings.h"
#include "engine/samples.h"
#include "image/color.h"
#include "scene/load_scene.h"
#include "scene/points_lines.h"

namespace hpr {

struct Camera;
struct ImageLimits;
struct Scene;
struct SceneLimits;

/// Which camera sees the scene. By default the scene's first, else one that frames the scene.
struct CameraChoice {
  std::string name = {};               ///< or index of one of the scene's cameras; empty: see above
  std::optional<glm::dvec3> eye = {};  ///< a camera here, in place of the scene's
  std::optional<glm::dvec3> at = {};   ///< what it looks at
  std::optional<glm::dvec3> up = {};   ///< none: +y
  double fov_degrees = 0.0;            ///< vertical angle of view; 0: the camera's own, or kDefaultFovDegrees

  bool operator==(const CameraChoice&) const = default;
};
inline constexpr double kDefaultFovDegrees = 45.0;

/// The value of RenderSettings::environment that adds nothing to what the scene brings.
inline constexpr std::string_view kNoEnvironment = "none";

/// Which defaults the settings without a given value take.
enum class Quality : std::uint8_t { Draft, Good, Best };
inline constexpr std::array<std::string_view, 3> kQualityNames{"draft", "good", "best"};

/// Which faces of single-sided materials are drawn: the front ones, as glTF has it, or all.
enum class Cull : std::uint8_t { Gltf, None };
inline constexpr std::array<std::string_view, 2> kCullNames{"gltf", "none"};

/// How pictures are encoded for displays outside the job.
struct LinkCodec {
  std::string name = "auto";
  int quality = 90;  ///< of lossy codecs, 1 to 100
  int error = 0;     ///< levels of 255 a color may be off
};

/// How a scene is drawn: everything that a user may choose about a picture. engine/settings_table.cpp lists each
/// setting once; the command line, the console, sweeps, checkpoints and docs come from that table.
struct RenderSettings {
  SceneChoice scene;
  CameraChoice camera;
  Quality quality = Quality::Good;
  Sampling sampling;
  FrameSettings frame;
  std::string environment;  ///< see load_environment; kNoEnvironment: the scene's own; empty: one where it needs_studio
  Cull cull = Cull::Gltf;
  PointLineWidths widths;
  DisplaySettings display;
  ColorFormat color_format = ColorFormat::Float32;  ///< of radiance sent to the rank that writes it
  LinkCodec codec;
  bool strict = false;  ///< values that are not finite are errors, not replaced
  /// Pictures are for looking at, not for measuring: under quality good, where the samples are not given, settings that
  /// are not given make them free of noise, with indirect light (Setting::finished). Commands choose, not users.
  bool finishes = false;

  std::set<std::string_view> specified = {};  ///< names of the settings that have a value of their own

  [[nodiscard]] bool is_given(std::string_view name) const { return specified.contains(name); }
};

/// Fills in what was not given, by the quality and by what goes together, and checks the whole. `seed`: of everything
/// random. Throws Error (Usage) for settings that exclude each other.
[[nodiscard]] RenderSettings resolve(RenderSettings settings, std::uint64_t seed);

/// The camera that the settings choose in a scene. Throws Error (Usage) with the choices for a camera there is not.
[[nodiscard]] Camera choose_camera(const CameraChoice& choice, const Scene& scene);

/// The views of a scene whose pixels widths of points and lines count: those of all screens in the first frame.
using FirstViews = std::function<std::vector<View>(const Scene&)>;
/// That of a picture by the camera that the settings choose.
[[nodiscard]] FirstViews first_view(const RenderSettings& settings, Size size = kDefaultPictureSize);

/// Loads a scene, lights it and shapes its points and lines as the settings say. `pictures`: how large an environment
/// may be. Throws Error as load_scene, choose_camera and load_environment do, and BadInput for values that are not
/// finite where the settings are strict.
[[nodiscard]] LoadedScene load_scene(const std::string& source, const RenderSettings& settings,
                                     const SceneLimits& limits, const ImageLimits& pictures, const FirstViews& views);

/// Throws Error (Usage) where the settings leave no surface for every pixel of a file of keys.
void check_raw(const RenderSettings& settings);

/// What finished pictures have and these settings leave out, without having been asked to, with what brings it:
/// "indirect light (--indirect), ..."; empty: nothing.
[[nodiscard]] std::string what_is_left_out(const RenderSettings& settings);
/// Says it in the log, if it is anything.
void note_what_is_left_out(const RenderSettings& settings);

/// Settings that were given and change nothing beside the others, each as a sentence: "--reference has no use for
/// --photons".
[[nodiscard]] std::vector<std::string> unused_settings(const RenderSettings& settings);

}  // namespace hpr
