#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/frame.h"
#include "engine/output.h"
#include "image/color.h"

namespace hpr {

/// The files one picture may become; empty names are not written.
struct PictureFiles {
  std::string picture;    ///< .png or .exr
  std::string raw;        ///< keys
  double exposure = 0.0;  ///< stops, of a .png
  std::vector<Aov> aovs;
  ColorFormat colors = ColorFormat::Float32;  ///< on their way to an .exr

  [[nodiscard]] bool is_png() const { return picture.ends_with(".png"); }
  /// Where AOVs go: into the .exr, or FILE.aov.exr beside a .png. Empty when there are none.
  [[nodiscard]] std::string aov_file() const;
  /// For --explain.
  [[nodiscard]] std::string explain_colors() const;
};

/// On the rank that has all of `frame`: the layers of the pixels of `screen`.
[[nodiscard]] std::vector<ExrLayer> exr_layers(const Frame& frame, const Blocks& blocks, std::size_t screen,
                                               std::span<const Aov> aovs);

/// A frame of one screen on its way to its files.
class CollectedPicture {
 public:
  /// Collective. Brings what the files need of `frame` to rank 0. `blocks` are the screen's; both must outlive this. A
  /// frame made of other than `size` pixels is enlarged by a filter; it has neither keys nor AOVs for files.
  CollectedPicture(Session& session, Frame& frame, const Blocks& blocks, Size size, PictureFiles files);

  /// On rank 0. Throws Error (Io).
  void write(const std::string& scene_name) const;
  /// On rank 0, for an .exr: what it will hold.
  [[nodiscard]] Image<Rgb> radiance() const;

 private:
  void write_picture(const std::string& scene_name) const;
  void collect_radiance(Session& session, Frame& frame) const;
  [[nodiscard]] bool enlarged() const { return blocks_.views.front().screen != size_; }

  const Frame& frame_;
  const Blocks& blocks_;
  Size size_;
  int threads_;
  PictureFiles files_;
  TileLayer<Rgba8> display_;  ///< where a .png is wanted
};

}  // namespace hpr
