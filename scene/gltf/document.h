#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "core/error.h"
#include "core/json.h"
#include "scene/gltf/usage.h"
#include "scene/load_scene.h"

namespace hpr {

inline constexpr std::string_view kRepairHint = "repair the file";
/// The hint for files whose meshes are compressed (Draco, meshopt): a program that writes the scene uncompressed.
inline constexpr std::string_view kDecompressHint =
    "decompress it: npx @gltf-transform/cli copy IN.glb OUT.glb, or export it without compression";

/// What all steps of loading one glTF file share: its name for messages, its limits, and the warnings.
class GltfContext {
 public:
  GltfContext(std::string_view name, const SceneLimits& limits, bool in_parts = false);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const SceneLimits& limits() const { return limits_; }
  /// Whether meshes are read one by one, and files stay where they are until they are looked at.
  [[nodiscard]] bool reads_in_parts() const { return in_parts_; }

  /// Throws Error(code): "NAME: WHERE: WHAT". `where` is a path into the document, e.g. "accessors[3].count".
  [[noreturn]] void fail(std::string_view where, std::string_view what, std::string_view hint = kRepairHint,
                         ExitCode code = ExitCode::BadInput) const;

  /// Keeps a warning once; after the hundredth only the number of further ones is kept.
  void warn(std::string_view where, std::string_view what);

  /// Warns of `count` values at `where` that are no finite numbers and get replaced, the first of them of that vertex.
  void warn_not_finite(std::string_view where, std::uint64_t count, std::size_t first_vertex);
  /// The number of all values that warn_not_finite counted.
  [[nodiscard]] std::uint64_t not_finite() const { return not_finite_; }

  /// From here on, what `usage` does not contain may be wrong. Before, everything counts as used.
  void set_usage(GltfUsage usage) { usage_ = std::move(usage); }
  [[nodiscard]] bool is_used(std::string_view section, std::size_t entry) const {
    return !usage_ || usage_->contains(section, entry);
  }
  /// Runs `check`, which looks at one entry of a section and throws Error where it is wrong; of an entry that is not
  /// used that becomes a warning. Returns whether the entry is right.
  template <typename Check>
  bool check_entry(std::string_view section, std::size_t entry, const Check& check) {
    if (is_used(section, entry)) {
      check();
      return true;
    }
    try {
      check();
      return true;
    } catch (const Error& error) {
      warn_unused(error);
      return false;
    }
  }

  /// Counts `bytes` that are about to be allocated for `what`; throws Error (Limit) past limits().memory_bytes.
  void charge(std::uint64_t bytes, std::string_view what);
  /// Throws Error (Limit) as charge() does, for memory that is soon released: it is not counted.
  void check_room(std::uint64_t bytes, std::string_view what) const;
  [[nodiscard]] std::uint64_t memory_left() const { return limits_.memory_bytes - charged_; }
  /// What was counted so far, and back to that: what was counted since is released.
  [[nodiscard]] std::uint64_t charged() const { return charged_; }
  void release_to(std::uint64_t charged) { charged_ = charged; }

  [[nodiscard]] std::vector<std::string> take_warnings();

 private:
  void warn_unused(const Error& error);

  std::string name_;
  SceneLimits limits_;
  bool in_parts_;
  std::optional<GltfUsage> usage_;
  std::vector<std::string> warnings_;
  std::unordered_set<std::string> seen_;
  std::uint64_t dropped_ = 0;
  std::uint64_t charged_ = 0;
  std::uint64_t not_finite_ = 0;
};

/// A whole number as JSON may write it, 3.0 included, of up to 53 bits; none for anything else.
[[nodiscard]] std::optional<std::int64_t> whole_number(const Json& value);

enum class Presence { Optional, Required };

/// One JSON object of a glTF document, with checked access to its members. Whatever has the wrong type or an index that
/// points nowhere throws Error (BadInput) naming the path, e.g. "meshes[2].primitives[0].indices".
class GltfItem {
 public:
  static constexpr double kMaxNumber = std::numeric_limits<float>::max();
  static constexpr std::uint64_t kMaxWhole = std::uint64_t{1} << 53;  ///< what JSON numbers hold exactly

  GltfItem(GltfContext& context, Json& root) : context_(&context), root_(&root), value_(&root) {}

  [[nodiscard]] GltfContext& context() const { return *context_; }
  [[nodiscard]] Json& value() const { return *value_; }
  [[nodiscard]] std::string path() const;
  [[nodiscard]] bool has(const char* key) const { return value_->contains(key); }

  [[noreturn]] void fail(std::string_view key, std::string_view what, std::string_view hint = kRepairHint) const;
  void warn(std::string_view key, std::string_view what) const;

  /// A member object; none when it is absent.
  [[nodiscard]] std::optional<GltfItem> object(const char* key, Presence presence = Presence::Optional) const;

  /// Calls body(item) for every object of the array `key`; returns how many there are.
  template <typename Body>
  std::size_t each(const char* key, Presence presence, const Body& body) const {
    const Json* const list = array(key, presence);
    if (list == nullptr) return 0;
    for (std::size_t i = 0; i < list->size(); ++i) body(element(key, i));
    return list->size();
  }

  /// each() for a section of the document, see GltfContext::check_entry: in place of an entry that is wrong and not
  /// used stands one that does no harm.
  template <typename Body>
  void each_entry(const char* section, Presence presence, const Body& body) const {
    Json* const list = array(section, presence);
    if (list == nullptr) return;
    for (std::size_t i = 0; i < list->size(); ++i) {
      if (!context_->check_entry(section, i, [&] { body(element(section, i)); })) (*list)[i] = stand_in(section);
    }
  }

  std::optional<std::string> text(const char* key, Presence presence = Presence::Optional) const;
  std::optional<bool> flag(const char* key) const;
  /// A whole number in [low, high]; 3.0 counts as 3 and is rewritten so, because stricter readers follow.
  std::optional<std::uint64_t> whole(const char* key, Presence presence = Presence::Optional, std::uint64_t low = 0,
                                     std::uint64_t high = kMaxWhole) const;
  /// An index into the top-level array `section`, or into `count` entries.
  std::optional<std::size_t> index(const char* key, const char* section, Presence presence = Presence::Optional) const;
  std::optional<std::size_t> index_below(const char* key, std::size_t count, Presence presence) const;
  /// An array of indices into `section`, or into `count` entries; returns how many.
  std::size_t indices(const char* key, const char* section, Presence presence = Presence::Optional) const;
  std::size_t indices_below(const char* key, std::size_t count, Presence presence) const;
  /// An object whose values are all indices into `section`.
  std::size_t index_map(const char* key, const char* section, Presence presence) const;
  /// A number in [low, high].
  std::optional<double> number(const char* key, Presence presence = Presence::Optional, double low = -kMaxNumber,
                               double high = kMaxNumber) const;
  /// A number that is brought into [low, high], with a warning, when it lies outside.
  std::optional<double> clamped(const char* key, double low, double high) const;
  /// `count` numbers (any number of them when count is 0), brought into [low, high] with a warning.
  bool numbers(const char* key, std::size_t count, double low = -kMaxNumber, double high = kMaxNumber) const;

  /// Entries of the top-level array `section`.
  [[nodiscard]] std::size_t section_size(const char* section) const;
  /// Entry `index` of the top-level array `section`; it must be there.
  [[nodiscard]] const Json& top(const char* section, std::size_t index) const { return (*root_)[section][index]; }

 private:
  GltfItem(const GltfItem& parent, const char* key, std::size_t position, Json& value)
      : context_(parent.context_), root_(parent.root_), value_(&value), parent_(&parent), key_(key), index_(position) {}

  [[nodiscard]] Json* find(const char* key, Presence presence) const;
  [[nodiscard]] Json* array(const char* key, Presence presence) const;
  [[nodiscard]] GltfItem element(const char* key, std::size_t position) const;
  [[nodiscard]] static Json stand_in(std::string_view section);
  void check_index(Json& value, std::string_view where, std::size_t count) const;
  bool clamp_value(Json& value, double low, double high) const;

  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  GltfContext* context_;
  Json* root_;
  Json* value_;
  const GltfItem* parent_ = nullptr;  ///< outlives this: items are made on the way down
  const char* key_ = "";
  std::size_t index_ = kNone;
};

/// The text as JSON. Throws Error (BadInput) with line, column and the offending line. Call scan_json first.
[[nodiscard]] Json parse_json(std::string_view text, const GltfContext& context);

/// Checks the shape of a glTF document before the model is built from it: the types of all members HPR reads, required
/// ones, and that every index points into its section. Entries that are wrong and not used are replaced. Values of
/// materials and lights outside of what the specification allows are brought inside, with a warning. What depends on
/// several members (ranges of bytes, the node hierarchy) is checked on the model, see accessors.h, mesh.h and
/// loader.cpp. Throws Error (BadInput).
void check_shape(Json& root, GltfContext& context);

/// Refuses documents that require extensions HPR does not have, by name, and warns once of each one it ignores.
void check_extensions(Json& root, GltfContext& context);

}  // namespace hpr
