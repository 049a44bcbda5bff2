#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/timing.h"
#include "walls/codecs/jpeg.h"
#include "walls/displays/display.h"
#include "walls/geometry/geometry.h"

namespace hpr {

/// One picture of a stream.
struct WebPicture {
  std::uint64_t frame = 0;
  std::uint64_t serial = 0;  ///< of what was published: a frame may be shown again with other pictures
  std::vector<std::byte> jpeg;
};

/// Between the run, which publishes frames and asks what viewers did, and the server, which asks for pictures: any
/// thread may call it.
class WebHub {
 public:
  /// `wall` must outlive it.
  explicit WebHub(const Wall& wall);

  // Of the run.
  /// Screens the frame lacks keep the picture they have.
  void publish(const WallFrame& frame);
  [[nodiscard]] DisplayInput take_input();

  // Of the server.
  /// The newest picture of a stream: 0 is the assembled wall, 1 + i screen i. Encoded when first asked for; null before
  /// the first one. Throws Error (Limit, Internal).
  [[nodiscard]] std::shared_ptr<const WebPicture> picture(std::size_t stream);
  /// The stream of a screen's id; none where there is no such screen.
  [[nodiscard]] std::optional<std::size_t> stream_of(std::string_view screen) const;
  void add(const DisplayInput& input);
  /// {"frame", "fps"}, the latter over the last two seconds.
  [[nodiscard]] std::string status();
  [[nodiscard]] const Wall& wall() const { return wall_; }

 private:
  struct Frame {
    std::uint64_t number = 0;
    std::uint64_t serial = 0;
    std::vector<std::shared_ptr<const Image<Rgba8>>> screens;  ///< null before a screen's first picture
  };

  [[nodiscard]] std::shared_ptr<const WebPicture> encode(const Frame& frame, std::size_t stream);
  void forget_old_times(double now_ms);

  const Wall& wall_;
  WallPicture assembled_;
  Stopwatch clock_;
  std::mutex mutex_;
  std::shared_ptr<const Frame> newest_;  ///< never null
  std::deque<double> times_ms_;          ///< of the last frames
  DisplayInput input_;
  std::mutex encoding_;  ///< held while a picture is made
  JpegEncoder encoder_;
  std::vector<std::shared_ptr<const WebPicture>> pictures_;  ///< per stream, the last one made
};

}  // namespace hpr
