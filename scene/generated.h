#pragma once

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
  std::function<Scene(const GeneratorOptions&)> make;
};

/// Every generator this build knows, in the order lists show them.
[[nodiscard]] const std::vector<Generator>& all_generators();

/// `text` is what follows "gen:". Throws Error (Usage) for an unknown name or option, or a value out of range.
[[nodiscard]] Scene generate_scene(std::string_view text);

}  // namespace hpr
