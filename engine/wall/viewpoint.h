#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/timing.h"
#include "scene/scene.h"
#include "walls/tracking/head_path.h"

namespace hpr {

class Communicator;
class Tracker;
struct HeadRecord;
struct OrbitInput;
struct Wall;

/// Where a camera is at one point of its path.
struct CameraKey {
  glm::dvec3 eye{0.0};
  glm::dvec3 at{0.0};
  glm::dvec3 up{0.0, 1.0, 0.0};
  double fov_degrees = 45.0;
};

/// A recorded path of a camera, docs/commands.md has its format. Passes through its keys on a Catmull-Rom spline
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

/// A camera that viewers turn about what it looks at. Turns go about the world's vertical (+y), or the camera's own
/// where it lies on its side, and stop short of looking straight up or down.
class OrbitCamera {
 public:
  /// Turns about the center of `bounds`, or about the point straight ahead at its distance.
  OrbitCamera(const Camera& start, const Bounds& bounds);

  /// Stays at distances, and an orthographic camera at picture sizes, from which there is a way back.
  void move(const OrbitInput& input);
  /// The start's own bits until moved.
  [[nodiscard]] const Camera& camera() const { return camera_; }

 private:
  Camera camera_;
  glm::dvec3 vertical_;
  double distance_;  ///< to what it looks at
  double nearest_;
  double farthest_;
};

/// Where the viewers' heads are from frame to frame: rank 0 reads the trackers and broadcasts the poses.
class WallHeads {
 public:
  /// Collective. Both outlive this.
  WallHeads(const Wall& wall, Communicator& comm);
  ~WallHeads();
  WallHeads(const WallHeads&) = delete;
  WallHeads& operator=(const WallHeads&) = delete;

  /// Collective. One pose per viewer, for frame `number`: recordings are read frame after frame at their own rate,
  /// so that a run is the same however long its frames take; live trackers give the current pose.
  [[nodiscard]] std::vector<HeadPose> at(std::uint64_t number);

  /// Whether later frames have other poses because recordings go on after frame `number`.
  [[nodiscard]] bool plays_on(std::uint64_t number) const;

  /// The poses of tracked viewers at the last call of at().
  [[nodiscard]] std::vector<HeadRecord> report() const;

 private:
  const Wall& wall_;
  Communicator& comm_;
  Stopwatch since_start_;
  std::vector<std::unique_ptr<Tracker>> trackers_;  ///< per viewer, on rank 0
  std::vector<HeadPose> heads_;
  bool any_tracked_ = false;
  double recorded_frames_ = 0.0;  ///< until the longest recording has ended
};

}  // namespace hpr
