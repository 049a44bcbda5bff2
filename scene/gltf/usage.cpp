#include "scene/gltf/usage.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "scene/gltf/document.h"

namespace hpr {
namespace {

/// A key whose value, a number or numbers at any depth, are indices into a section.
struct Reference {
  std::string_view key;
  std::string_view section;
};
constexpr std::array<Reference, 16> kReferences{{{"attributes", "accessors"},
                                                 {"buffer", "buffers"},
                                                 {"bufferView", "bufferViews"},
                                                 {"camera", "cameras"},
                                                 {"children", "nodes"},
                                                 {"index", "textures"},
                                                 {"indices", "accessors"},
                                                 {"inverseBindMatrices", "accessors"},
                                                 {"light", "lights"},
                                                 {"material", "materials"},
                                                 {"mesh", "meshes"},
                                                 {"nodes", "nodes"},
                                                 {"sampler", "samplers"},
                                                 {"skin", "skins"},
                                                 {"source", "images"},
                                                 {"targets", "accessors"}}};

/// The section that the member `key` refers to; empty where it refers to none. `indices` of sparse accessors are an
/// object with references of its own.
std::string_view section_referred_to(std::string_view key, const Json& value) {
  if (value.is_object() && key != "attributes") return {};
  const auto found = std::ranges::find(kReferences, key, &Reference::key);
  return found == kReferences.end() ? std::string_view() : found->section;
}

/// Calls visit(number) for every index within `value`, at any depth: JSON nests no deeper than kGltfJsonDepth.
template <typename Visit>
void each_index(const Json& value, const Visit& visit) {
  if (value.is_array()) {
    for (const Json& element : value.elements()) each_index(element, visit);
  } else if (value.is_object()) {
    for (const auto& [key, member] : value.members()) each_index(member, visit);
  } else if (const auto number = whole_number(value); number && *number >= 0) {
    visit(static_cast<std::size_t>(*number));
  }
}

class UsageFinder {
 public:
  explicit UsageFinder(const Json& document) : document_(document) {
    const Json* const nodes = section_of(document, "nodes");
    if (nodes == nullptr) return;
    parents_.resize(nodes->size());
    for (std::size_t i = nodes->size(); i-- > 0;) claim_children(i, (*nodes)[i]);
  }

  GltfUsage find(std::size_t scene) {
    const Json* const scenes = section_of(document_, "scenes");
    if (scenes != nullptr && !scenes->empty()) {
      open("scenes", scene);
    } else {
      for (std::size_t node = 0; node < parents_.size(); ++node) open("nodes", node);
    }
    while (!open_.empty()) {
      const auto [section, entry] = open_.back();
      open_.pop_back();
      const Json& json = (*section_of(document_, section))[entry];
      if (section == "nodes") claim_children(entry, json);
      follow(json);
    }
    for (const std::size_t node : placed_) place(node);
    return std::move(usage_);
  }

 private:
  void open(std::string_view section, std::size_t entry) {
    const Json* const entries = section_of(document_, section);
    if (entries == nullptr || entry >= entries->size() || !usage_.add(section, entry)) return;
    open_.emplace_back(section, entry);
    if (section == "nodes") placed_.push_back(entry);
  }

  void claim_children(std::size_t node, const Json& json) {
    each_index(json["children"], [&](std::size_t child) {
      if (child < parents_.size()) parents_[child] = node;
    });
  }

  /// Opens what an entry refers to.
  void follow(const Json& entry) {
    if (entry.is_array()) {
      for (const Json& element : entry.elements()) follow(element);
    } else if (entry.is_object()) {
      for (const auto& [key, value] : entry.members()) follow_member(key, value);
    }
  }

  void follow_member(std::string_view key, const Json& value) {
    // The material of the chosen variant is the primitive's own by now.
    if (key == "extras" || key == "KHR_materials_variants") return;
    if (const std::string_view section = section_referred_to(key, value); !section.empty()) {
      each_index(value, [&](std::size_t index) { open(section, index); });
    } else if (key == "joints") {
      each_index(value, [&](std::size_t index) { placed_.push_back(index); });
    } else {
      follow(value);
    }
  }

  /// Adds a node and its ancestors without what they refer to.
  void place(std::size_t node) {
    for (std::optional<std::size_t> above = node; above && *above < parents_.size(); above = parents_[*above]) {
      if (!ancestors_.add("nodes", *above)) return;
      usage_.add("nodes", *above);
    }
  }

  const Json& document_;
  std::vector<std::optional<std::size_t>> parents_;  ///< of every node: one that is used, else the first
  GltfUsage usage_;
  std::vector<std::pair<std::string_view, std::size_t>> open_;  ///< used, and not yet followed
  std::vector<std::size_t> placed_;                             ///< nodes whose transform is used
  GltfUsage ancestors_;
};

}  // namespace

bool GltfUsage::contains(std::string_view section, std::size_t entry) const {
  const auto found = entries_.find(section);
  return found != entries_.end() && entry < found->second.size() && found->second[entry];
}

bool GltfUsage::add(std::string_view section, std::size_t entry) {
  std::vector<bool>& entries = entries_.try_emplace(std::string(section)).first->second;
  if (entry >= entries.size()) entries.resize(entry + 1, false);
  const bool is_new = !entries[entry];
  entries[entry] = true;
  return is_new;
}

const Json* section_of(const Json& document, std::string_view section) {
  const Json& holder = section == "lights" ? document["extensions"]["KHR_lights_punctual"] : document;
  const Json* const found = holder.find(section);
  return found != nullptr && found->is_array() ? found : nullptr;
}

GltfUsage usage_of(const Json& document, std::size_t scene) {
  return UsageFinder(document).find(scene);
}

}  // namespace hpr
