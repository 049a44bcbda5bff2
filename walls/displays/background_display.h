#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/displays/display.h"

namespace hpr {

/// The pictures of a frame.
struct WallPictures {
  std::vector<Image<Rgba8>> screens;   ///< per screen; empty where another rank shows it
  std::vector<Image<Rgba8>> monitors;  ///< per monitor, on rank 0
};

/// Has a display show frames on another thread, one at a time and in their order, while the next one is drawn.
class BackgroundDisplay {
 public:
  /// The display's kind has shows_on_any_thread. It outlives this; nothing else calls it before wait() has returned.
  explicit BackgroundDisplay(Display& display) : display_(display) {}
  ~BackgroundDisplay();
  BackgroundDisplay(const BackgroundDisplay&) = delete;
  BackgroundDisplay& operator=(const BackgroundDisplay&) = delete;

  /// Begins to show the pictures of `screens`, and all monitors that have one. The frame before has been waited for.
  void show(std::uint64_t number, std::shared_ptr<const WallPictures> pictures, std::vector<std::size_t> screens);
  /// Returns once the frame that was handed over is shown; at once where there is none. Throws what showing it threw.
  void wait();
  /// What the last frame took, once it was waited for.
  [[nodiscard]] double shown_ms() const { return shown_ms_; }

 private:
  Display& display_;
  std::future<double> shown_;
  double shown_ms_ = 0.0;
};

/// Shows those pictures of a frame by a display; returns when it is handed over.
void show_pictures(Display& display, std::uint64_t number, const WallPictures& pictures,
                   const std::vector<std::size_t>& screens);

}  // namespace hpr
