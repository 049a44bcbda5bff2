#pragma once

#include <string>

#include "app/options/globals.h"
#include "tools/bench/bench_codec.h"

namespace hpr {

/// Draws what codecs are measured on: `count` frames of a turning camera and as many of a standing one, with the
/// settings `hpr render` has by default. By this process alone.
[[nodiscard]] CodecFrames draw_codec_frames(const std::string& scene, Size size, int count, const Globals& globals);

}  // namespace hpr
