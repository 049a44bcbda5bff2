#include "engine/wall/viewpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <numbers>
#include <optional>
#include <sstream>
#include <type_traits>
#include <variant>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/file.h"
#include "core/text.h"
#include "scene/view.h"
#include "walls/displays/display.h"
#include "walls/geometry/geometry.h"
#include "walls/manifest/manifest.h"
#include "walls/tracking/tracker.h"

namespace hpr {
namespace {

constexpr std::uint64_t kMaxFileBytes = 16U << 20U;

std::optional<double> number(std::string_view word) {
  double value = 0.0;
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error != std::errc() || stop != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<glm::dvec3> point(std::string_view word) {
  glm::dvec3 value(0.0);
  for (int i = 0; i < 3; ++i) {
    const std::size_t comma = i < 2 ? word.find(',') : word.size();
    if (comma == std::string_view::npos) return std::nullopt;
    const auto part = number(word.substr(0, comma));
    if (!part) return std::nullopt;
    value[i] = *part;
    word.remove_prefix(std::min(comma + 1, word.size()));
  }
  return value;
}

/// None where a name or value is not understood, or eye or target is missing.
std::optional<CameraKey> parse_key(const std::string& line) {
  CameraKey key;
  bool eye = false;
  bool at = false;
  std::istringstream arguments(line);
  for (std::string name, value; arguments >> name;) {
    if (!(arguments >> value)) return std::nullopt;
    const auto position = point(value);
    const auto angle = number(value);
    if (name == "eye" && position) {
      key.eye = *position;
      eye = true;
    } else if (name == "at" && position) {
      key.at = *position;
      at = true;
    } else if (name == "up" && position) {
      key.up = *position;
    } else if (name == "fov" && angle && *angle > 0.0 && *angle < 180.0) {
      key.fov_degrees = *angle;
    } else {
      return std::nullopt;
    }
  }
  return eye && at ? std::optional(key) : std::nullopt;
}

template <typename Value>
Value spline(const Value& before, const Value& from, const Value& to, const Value& after, double t) {
  const Value slope = to - before;
  const Value bend = 2.0 * before - 5.0 * from + 4.0 * to - after;
  const Value twist = 3.0 * (from - to) + after - before;
  return from + 0.5 * t * (slope + t * (bend + t * twist));
}

bool same(const CameraKey& a, const CameraKey& b) {
  return a.eye == b.eye && a.at == b.at && a.up == b.up && a.fov_degrees == b.fov_degrees;
}

}  // namespace

CameraPath::CameraPath(std::vector<CameraKey> keys) : keys_(std::move(keys)) {
  HPR_CHECK(!keys_.empty());
}

CameraKey CameraPath::at_frame(std::size_t index, std::size_t frames) const {
  const std::size_t last = keys_.size() - 1;
  if (frames < 2 || last == 0) return keys_.front();
  const double position = static_cast<double>(index) * static_cast<double>(last) / static_cast<double>(frames - 1);
  const std::size_t first = std::min(static_cast<std::size_t>(position), last);
  const double t = position - static_cast<double>(first);
  const CameraKey& from = keys_[first];
  const CameraKey& to = keys_[std::min(first + 1, last)];
  if (t == 0.0 || same(from, to)) return from;
  const CameraKey& before = keys_[first > 0 ? first - 1 : 0];
  const CameraKey& after = keys_[std::min(first + 2, last)];
  CameraKey key;
  key.eye = spline(before.eye, from.eye, to.eye, after.eye, t);
  key.at = spline(before.at, from.at, to.at, after.at, t);
  key.up = spline(before.up, from.up, to.up, after.up, t);
  const double fov = spline(before.fov_degrees, from.fov_degrees, to.fov_degrees, after.fov_degrees, t);
  key.fov_degrees = std::clamp(fov, 0.001, 179.0);  // a spline may swing beyond its keys
  return key;
}

CameraPath parse_camera_path(std::string_view text, const std::string& name) {
  std::vector<CameraKey> keys;
  std::istringstream lines{std::string(without_mark(text))};
  int number_of_line = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number_of_line;
    const std::string content = line.substr(0, line.find('#'));
    if (content.find_first_not_of(" \t\r") == std::string::npos) continue;
    const auto key = parse_key(content);
    const std::string hint = "write e.g. eye 0,1,5 at 0,1,0 up 0,1,0 fov 45; up and fov may be left out";
    if (!key) {
      throw Error(ExitCode::BadInput, fmt::format("{}:{}: no key of a camera path", name, number_of_line), hint,
                  printable(line));
    }
    try {
      (void)camera_of(*key);
    } catch (const Error& error) {
      throw Error(ExitCode::BadInput, fmt::format("{}:{}: {}", name, number_of_line, error.what()), error.hint(),
                  printable(line));
    }
    keys.push_back(*key);
  }
  if (keys.empty()) {
    throw Error(ExitCode::BadInput, fmt::format("{}: a camera path without keys", name),
                "write one per line, e.g. eye 0,1,5 at 0,1,0");
  }
  return CameraPath(std::move(keys));
}

CameraPath load_camera_path(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMaxFileBytes);
  return parse_camera_path({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, printable(file.string()));
}

void check_directions(const CameraPath& path, std::size_t frames, const std::string& name) {
  for (std::size_t i = 0; i < frames; ++i) {
    try {
      (void)camera_of(path.at_frame(i, frames));
    } catch (const Error& error) {
      throw Error(ExitCode::BadInput,
                  fmt::format("{}: frame {} of {}: {}", printable(name), i + 1, frames, error.what()),
                  "the path passes through what it looks at, or past it along `up`: add a key that leads around it, or "
                  "another up");
    }
  }
}

Camera camera_of(const CameraKey& key) {
  return look_at(key.eye, key.at, key.up, glm::radians(key.fov_degrees));
}

namespace {

constexpr double kSteepest = 89.0 * std::numbers::pi / 180.0;

/// Metres that the picture is high, as far away as what the camera looks at.
double height_of(const Camera& camera, double distance) {
  if (const auto* const lens = std::get_if<OrthographicLens>(&camera.lens)) return 2.0 * lens->half_height;
  return 2.0 * distance * std::tan(0.5 * std::get<PerspectiveLens>(camera.lens).vertical_fov_radians);
}

}  // namespace

OrbitCamera::OrbitCamera(const Camera& start, const Bounds& bounds) : camera_(start), vertical_(0.0, 1.0, 0.0) {
  constexpr double kMinUpright = 0.3;
  if (start.axes[1].y < kMinUpright) vertical_ = start.axes[1];
  const double extent = std::max(glm::length(bounds.high - bounds.low), 1e-6);
  const double ahead = glm::dot(start.axes[2], start.eye - 0.5 * (bounds.low + bounds.high));
  distance_ = std::max(ahead, 0.1 * extent);
  nearest_ = 1e-4 * extent;
  farthest_ = std::max(1e4 * extent, distance_);
}

void OrbitCamera::move(const OrbitInput& input) {
  if (input == OrbitInput{}) return;
  const double height = height_of(camera_, distance_);
  const glm::dvec3 drag = input.pan_right * camera_.axes[0] + input.pan_up * camera_.axes[1];
  const glm::dvec3 target = camera_.eye - distance_ * camera_.axes[2] - height * drag;

  // The scene turns to the right when the camera goes to the left.
  const glm::dvec3 side = glm::normalize(glm::cross(vertical_, camera_.axes[2]));
  const glm::dvec3 level = glm::cross(side, vertical_);
  const double steep = std::asin(std::clamp(glm::dot(camera_.axes[2], vertical_), -1.0, 1.0));
  const double elevation = std::clamp(steep - input.turn_up, std::min(-kSteepest, steep), std::max(kSteepest, steep));
  const glm::dvec3 turned = std::cos(input.turn_right) * level - std::sin(input.turn_right) * side;
  camera_.axes[2] = std::cos(elevation) * turned + std::sin(elevation) * vertical_;
  camera_.axes[0] = glm::normalize(glm::cross(vertical_, camera_.axes[2]));
  camera_.axes[1] = glm::cross(camera_.axes[2], camera_.axes[0]);

  const double nearer = std::exp(-std::clamp(input.dolly, -10.0, 10.0));
  if (auto* const lens = std::get_if<OrthographicLens>(&camera_.lens)) {
    const double low = std::min(nearest_, lens->half_height);
    const double high = std::max(farthest_, lens->half_height);
    const double factor = std::clamp(lens->half_height * nearer, low, high) / lens->half_height;
    lens->half_height *= factor;
    lens->half_width *= factor;
  } else {
    distance_ = std::clamp(distance_ * nearer, nearest_, farthest_);
  }
  camera_.eye = target + distance_ * camera_.axes[2];
}

namespace {

bool is_tracked(const WallViewer& viewer) {
  return viewer.tracker.kind != WallTracker::Kind::None;
}

}  // namespace

WallHeads::WallHeads(const Wall& wall, Communicator& comm)
    : wall_(wall),
      comm_(comm),
      heads_(resting_heads(wall)),
      any_tracked_(std::ranges::any_of(wall.viewers, is_tracked)) {
  if (!any_tracked_) return;
  check_on_root(comm, [&] {
    for (std::size_t i = 0; i < heads_.size(); ++i) {
      trackers_.push_back(make_tracker(wall.viewers[i].tracker, heads_[i]));
      recorded_frames_ = std::max(recorded_frames_, trackers_.back()->ends_at() * wall.viewers[i].tracker.rate_hz);
    }
  });
  recorded_frames_ = all_gather_value(comm, recorded_frames_)[0];
}

WallHeads::~WallHeads() = default;

std::vector<HeadPose> WallHeads::at(std::uint64_t number) {
  if (!any_tracked_) return heads_;
  static_assert(std::is_trivially_copyable_v<HeadPose>);
  for (std::size_t i = 0; i < trackers_.size(); ++i) {
    const WallTracker& tracker = wall_.viewers[i].tracker;
    const bool recorded = tracker.kind == WallTracker::Kind::File;
    const double time = recorded ? static_cast<double>(number) / tracker.rate_hz : 1e-3 * since_start_.ms();
    heads_[i] = trackers_[i]->sample(time);
  }
  const auto own = std::as_bytes(std::span(heads_));
  std::vector<std::byte> bytes(own.begin(), own.end());
  broadcast(comm_, bytes);
  HPR_CHECK(bytes.size() == own.size());
  std::memcpy(heads_.data(), bytes.data(), bytes.size());
  return heads_;
}

bool WallHeads::plays_on(std::uint64_t number) const {
  return static_cast<double>(number) <= recorded_frames_;
}

std::vector<HeadRecord> WallHeads::report() const {
  std::vector<HeadRecord> records;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (is_tracked(wall_.viewers[i])) records.push_back({wall_.viewers[i].id, heads_[i]});
  }
  return records;
}

}  // namespace hpr
