#include "walls/tracking/tracker.h"

#include "core/error.h"

namespace hpr {
namespace {

class RestingHead final : public Tracker {
 public:
  explicit RestingHead(const HeadPose& rest) : rest_(rest) {}
  [[nodiscard]] HeadPose sample(double /*time*/) override { return rest_; }

 private:
  HeadPose rest_;
};

}  // namespace

std::unique_ptr<Tracker> make_tracker(const WallTracker& tracker, const HeadPose& rest) {
  switch (tracker.kind) {
    case WallTracker::Kind::None:
      break;
    case WallTracker::Kind::File:
      return make_file_tracker(tracker);
    case WallTracker::Kind::Udp:
      return make_udp_tracker(tracker, rest);
  }
  return std::make_unique<RestingHead>(rest);
}

}  // namespace hpr
