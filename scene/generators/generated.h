#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// The options of `gen:NAME?key=value&...`; every generator refuses keys it does not know (ExitCode::Usage, nearest
/// name).
using GeneratorOptions = std::map<std::string, std::string>;

/// A scene HPR makes itself: deterministic on every rank, compiler and machine.
struct Generator {
  std::string name;
  std::string summary;                         ///< one line for `hpr scene list`
  std::map<std::string, std::string> options;  ///< key -> what it does, with its default
  /// The finished scene. Throws Error (Usage) for an option it does not know or a value out of range.
  std::function<Scene(const GeneratorOptions&)> make;
  /// The size options whose triangle count is nearest to the given one; empty where the scene has only one size.
  std::function<GeneratorOptions(std::uint64_t)> sized;
};

/// Every generator this build knows, in the order lists show them.
[[nodiscard]] const std::vector<Generator>& all_generators();

/// Throws Error (Usage) for an unknown name, with the nearest one.
[[nodiscard]] const Generator& find_generator(std::string_view name);

/// `text` is what follows "gen:", e.g. "gallery?s=2&k=4". The scene is finished. Throws Error (Usage) for an unknown
/// name or option, or a value out of range.
[[nodiscard]] Scene generate_scene(std::string_view text);

/// Options that make the generator's scene about `triangles` triangles large, instances counted: the nearest size it
/// has.
[[nodiscard]] GeneratorOptions options_for_triangles(const Generator& generator, std::uint64_t triangles);

}  // namespace hpr
