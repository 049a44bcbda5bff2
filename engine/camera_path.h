#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// Where a camera is at one point of its path.
struct CameraKey {
  glm::dvec3 eye{0.0};
  glm::dvec3 at{0.0};
  glm::dvec3 up{0.0, 1.0, 0.0};
  double fov_degrees = 45.0;
};

/// A recorded way of a camera, docs/commands.md has its format. Passes through its keys on a Catmull-Rom spline
/// (Catmull, Rom, "A Class of Local Interpolating Splines", 1974), and rests between two equal keys that follow each
/// other.
class CameraPath {
 public:
  /// Not empty.
  explicit CameraPath(std::vector<CameraKey> keys);

  [[nodiscard]] const std::vector<CameraKey>& keys() const { return keys_; }
  /// Frame `index` of `frames`: the first key at the first frame, the last at the last, equal times between keys.
  [[nodiscard]] CameraKey at_frame(std::size_t index, std::size_t frames) const;

 private:
  std::vector<CameraKey> keys_;
};

/// Throws Error (BadInput) with the line that is wrong. `name` stands in errors.
[[nodiscard]] CameraPath parse_camera_path(std::string_view text, const std::string& name);

/// Throws Error: Io too.
[[nodiscard]] CameraPath load_camera_path(const std::filesystem::path& file);

/// Throws Error (BadInput) where the camera of one of `frames` frames has no direction: between keys a path may pass
/// through what it looks at, or straight above it.
void check_directions(const CameraPath& path, std::size_t frames, const std::string& name);

/// Throws Error (Usage) where the key has no direction.
[[nodiscard]] Camera camera_of(const CameraKey& key);

}  // namespace hpr
