#include "walls/tracking/head_path.h"
#include "walls/tracking/tracker.h"

namespace hpr {
namespace {

class FileTracker final : public Tracker {
 public:
  explicit FileTracker(HeadPath path) : path_(std::move(path)) {}
  [[nodiscard]] HeadPose sample(double time) override { return path_.at(time); }
  [[nodiscard]] double ends_at() const override { return path_.samples().back().time - path_.samples().front().time; }

 private:
  HeadPath path_;
};

}  // namespace

std::unique_ptr<Tracker> make_file_tracker(const WallTracker& tracker) {
  return std::make_unique<FileTracker>(load_head_path(tracker.file));
}

}  // namespace hpr
