#pragma once

#include <filesystem>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// A head in wall space.
struct HeadPose {
  glm::dvec3 position{0.0};                    ///< metres
  glm::dquat orientation{1.0, 0.0, 0.0, 0.0};  ///< unit; turns the head's right, up, back into wall space

  bool operator==(const HeadPose&) const = default;
};

/// A head at a time, in seconds.
struct HeadSample {
  double time = 0.0;
  HeadPose pose;
};

/// A recorded path of a head: straight between samples, turning along the shortest arc (Shoemake, "Animating Rotation
/// with Quaternion Curves", 1985).
class HeadPath {
 public:
  /// Not empty, times rising.
  explicit HeadPath(std::vector<HeadSample> samples);

  [[nodiscard]] const std::vector<HeadSample>& samples() const { return samples_; }
  /// `seconds` after the first sample; before it the first, after the last the last.
  [[nodiscard]] HeadPose at(double seconds) const;

 private:
  std::vector<HeadSample> samples_;
};

/// Degrees: heading about y (to the left), then pitch about x (upwards), then roll about z.
[[nodiscard]] glm::dquat orientation_of(double heading, double pitch, double roll);

/// The formats, by extension; docs/walls.md describes them.
enum class HeadPathFormat { Csv, JsonLines, Toml };

/// Throws Error (BadInput) with the line that is wrong. `name` stands in errors.
[[nodiscard]] HeadPath parse_head_path(std::string_view text, HeadPathFormat format, const std::string& name);

/// A .csv, .json, .jsonl or .toml file of at most 64 MiB. Throws Error: Io too.
[[nodiscard]] HeadPath load_head_path(const std::filesystem::path& file);

/// "x y z", or "x y z qx qy qz qw": what stands in a line after the time. False where it is no pose.
[[nodiscard]] bool pose_from(std::span<const double> numbers, HeadPose& pose);

}  // namespace hpr
