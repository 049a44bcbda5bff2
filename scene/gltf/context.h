#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "core/error.h"
#include "scene/load_scene.h"

namespace hpr {

inline constexpr std::string_view kRepairHint = "repair the file";
/// For files whose meshes are compressed (Draco, meshopt): what writes the same scene uncompressed.
inline constexpr std::string_view kDecompressHint =
    "decompress it: npx @gltf-transform/cli copy IN.glb OUT.glb, or export it without compression";

/// What all steps of loading one glTF file share: its name for messages, its limits, and the warnings.
class GltfContext {
 public:
  GltfContext(std::string_view name, const SceneLimits& limits);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const SceneLimits& limits() const { return limits_; }

  /// Throws Error(code): "NAME: WHERE: WHAT". `where` is a path into the document, e.g. "accessors[3].count".
  [[noreturn]] void fail(std::string_view where, std::string_view what, std::string_view hint = kRepairHint,
                         ExitCode code = ExitCode::BadInput) const;

  /// Keeps a warning once; after the hundredth only the number of further ones is kept.
  void warn(std::string_view where, std::string_view what);

  /// Warns of `count` values at `where` that are no finite numbers and get replaced, the first of them of that vertex.
  void warn_not_finite(std::string_view where, std::uint64_t count, std::size_t first_vertex);
  /// The number of all values that warn_not_finite counted.
  [[nodiscard]] std::uint64_t not_finite() const { return not_finite_; }

  /// Counts `bytes` that are about to be allocated for `what`; throws Error (Limit) past limits().memory_bytes.
  void charge(std::uint64_t bytes, std::string_view what);
  /// Throws Error (Limit) as charge() does, for memory that is soon released: it is not counted.
  void check_room(std::uint64_t bytes, std::string_view what) const;
  [[nodiscard]] std::uint64_t memory_left() const { return limits_.memory_bytes - charged_; }

  [[nodiscard]] std::vector<std::string> take_warnings();

 private:
  std::string name_;
  SceneLimits limits_;
  std::vector<std::string> warnings_;
  std::unordered_set<std::string> seen_;
  std::uint64_t dropped_ = 0;
  std::uint64_t charged_ = 0;
  std::uint64_t not_finite_ = 0;
};

}  // namespace hpr
