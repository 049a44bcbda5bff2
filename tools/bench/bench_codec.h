#pragma once

#include <string>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "tools/bench/bench_rows.h"

namespace hpr {

/// Frames of one scene to measure codecs on.
struct CodecFrames {
  std::string scene;
  std::vector<Image<Rgba8>> turning;   ///< the camera turns by a quarter of a degree from each to the next; not empty
  std::vector<Image<Rgba8>> standing;  ///< the same view again and again, each with its own noise
};

/// Every codec on one core: how it encodes and decodes the first frame, and how much smaller the frame gets, against
/// the bare library's call on the same pixels (raw: a copy), both in turn, medians of CPU time; the largest error seen
/// against its bound, for jpeg without one against the bare library's; and what deltas save over sequences. A second or
/// two.
[[nodiscard]] std::vector<BenchRow> bench_codec(const CodecFrames& frames);

}  // namespace hpr
