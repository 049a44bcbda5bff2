#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/json.h"

namespace hpr {

/// Which entries of a glTF document's sections ("accessors", "cameras", ..., "lights") are used by the scene that is
/// drawn: those it refers to, itself or through others. What is used has to be right; what is not only causes warnings.
class GltfUsage {
 public:
  [[nodiscard]] bool contains(std::string_view section, std::size_t entry) const;
  /// Adds an entry; returns whether it is new.
  bool add(std::string_view section, std::size_t entry);

 private:
  std::map<std::string, std::vector<bool>, std::less<>> entries_;
};

/// The top-level array `section` of a document; KHR_lights_punctual has that of "lights". Null where there is none.
[[nodiscard]] const Json* section_of(const Json& document, std::string_view section);

/// What the scene `scene` of a document uses, or all of its nodes where it has no scenes. The document need not have
/// been checked: references that lead nowhere are left out. Hidden nodes and nodes that only place others (joints,
/// ancestors) are used; the contents of the latter are not.
[[nodiscard]] GltfUsage usage_of(const Json& document, std::size_t scene);

}  // namespace hpr
