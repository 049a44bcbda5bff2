#include "engine/wall/wall_heads.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "cluster/transport/collectives.h"
#include "walls/geometry/geometry.h"

namespace hpr {
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
