#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "image/image_io.h"
#include "scene/mesh_reader.h"
#include "scene/picture_source.h"
#include "scene/scene.h"

namespace hpr {

/// What a scene may cost before it is refused (ExitCode::Limit).
struct SceneLimits {
  std::uint64_t file_bytes = std::uint64_t{4} << 30U;
  std::uint64_t memory_bytes = std::uint64_t{16} << 30U;  ///< of the loaded scene, estimated before it is allocated
  ImageLimits image;
};

/// Of pictures whose size nobody gives.
inline constexpr Size kDefaultPictureSize{1280, 720};

/// Which of the scenes and variants that a file holds is loaded.
struct SceneChoice {
  std::string scene = {};    ///< its name or index; empty: the one that the file names, else the first
  std::string variant = {};  ///< of materials; empty: the materials that the file has without any

  bool operator==(const SceneChoice&) const = default;
};

/// A scene as it was read, for one rank to hand out to all.
struct LoadedScene {
  Scene scene;
  /// Whether ranks are to hold parts of its meshes, but for those that is_held_by_all().
  bool in_parts = false;
  /// How many times the ranks hold all of it together, in groups; 0: as often as memory allows, in two parts or more.
  int islands = 1;
  /// Whether a part that is too large for a rank may come from the disk page by page.
  bool in_pages = false;
  std::uint64_t memory_limit = SceneLimits{}.memory_bytes;  ///< of one rank
  /// Reads a mesh again; where some of the scene's have no triangles (without_triangles). As long as this is there, so
  /// are the meshes' readers.
  std::function<std::unique_ptr<MeshReader>(std::uint32_t)> read_mesh = nullptr;
  /// Of each texture where its texels lie, where they were left out (Texels::is_reachable); else null. Empty: none
  /// were.
  std::vector<std::shared_ptr<const PictureSource>> sources = {};

  // NOLINTNEXTLINE(google-explicit-constructor): a scene is one that was read
  LoadedScene(Scene whole) : scene(std::move(whole)) {}
};

/// A format of scene files.
struct SceneImporter {
  std::vector<std::string_view> extensions;  ///< in small letters, with their dots
  /// Loads a file into a finished scene, in which points and lines have no shapes yet. Throws Error (Io, BadInput,
  /// Limit; Usage for a choice that it lacks).
  /// `in_parts`: reads mesh by mesh, and leaves triangles out (LoadedScene::read_mesh).
  LoadedScene (*load)(const std::filesystem::path& path, const SceneLimits& limits, const SceneChoice& choice,
                      bool in_parts);
  /// The files that `load` reads beside the scene's own; none of one it would refuse.
  std::vector<std::filesystem::path> (*files_beside)(const std::filesystem::path& path, const SceneLimits& limits);
};

/// Every importer: X(gltf) stands for a file that defines gltf_importer(). The first one reads files whose extension
/// none of them has.
#define HPR_SCENE_IMPORTERS(X) X(gltf)

#define HPR_DECLARE_IMPORTER(name) [[nodiscard]] SceneImporter name##_importer();
HPR_SCENE_IMPORTERS(HPR_DECLARE_IMPORTER)
#undef HPR_DECLARE_IMPORTER

/// Loads what the command line calls SCENE: a file that an importer reads (.gltf, .glb), or
/// `gen:NAME?key=value&key=value`. The result is finished (finish_scene) and may be drawn as it is; points and lines
/// have their default widths, in a picture of kDefaultPictureSize by the scene's first camera. Throws Error (Io,
/// BadInput, Limit, Usage). Generated scenes are the one scene of their source, 0, without variants.
[[nodiscard]] Scene load_scene(const std::string& source, const SceneLimits& limits = {},
                               const SceneChoice& choice = {});
/// Loads a scene as load_scene does, but for the shapes of points and lines (shape_points_and_lines); `in_parts` for
/// ranks that hold parts of it: then a file may be larger than memory.
[[nodiscard]] LoadedScene load_unshaped_scene(const std::string& source, const SceneLimits& limits,
                                              const SceneChoice& choice, bool in_parts = false);

/// The files load_scene(source, limits) may read: the scene's own, and the buffers and pictures that a glTF names. None
/// of a generated scene; of a file that load_scene would refuse just that file.
[[nodiscard]] std::vector<std::filesystem::path> files_of_scene(const std::string& source,
                                                                const SceneLimits& limits = {});

/// "R,G,B": a radiance; none where it is not three numbers. Throws Error (Usage) where one is below 0 or above 1e12.
[[nodiscard]] std::optional<Rgb> parse_radiance(const std::string& text);

/// What the command line calls an environment: `studio` (make_studio), `R,G,B`, the same radiance from everywhere, or a
/// latitude-longitude picture (.hdr, .exr, .png, .jpg; see Environment for its orientation). PNG and JPEG are read as
/// sRGB, white as radiance 1. Infinite values of a picture become the largest half float, 65504; NaN and negative ones
/// become 0; those that were not finite are counted. Throws Error: Usage for a text that is neither; Io, BadInput or
/// Limit for a picture that can't be read.
[[nodiscard]] Environment load_environment(const std::string& text, const ImageLimits& limits = {});
/// Makes an environment of a latitude-longitude picture that was read; replaces values as load_environment does. Errors
/// name it `name`. Throws Error (BadInput).
[[nodiscard]] Environment environment_of(const FloatImage& picture, const std::string& name);

}  // namespace hpr
