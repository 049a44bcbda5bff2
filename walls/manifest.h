#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/head.h"

namespace hpr {

/// What a screen showed in a frame.
enum class ScreenState { Fresh, Stale, Lost };

[[nodiscard]] std::string_view to_string(ScreenState state);

struct ScreenRecord {
  std::string id;
  Size size;                ///< pixels
  std::uint64_t xxh64 = 0;  ///< of the RGBA8 pixels, row by row
  ScreenState state = ScreenState::Fresh;
};

/// What a frame with a target time was made with.
struct BudgetRecord {
  double target_ms = 0.0;
  double resolution_scale = 1.0;      ///< of the screens' pixels a side
  std::uint32_t samples = 1;          ///< of the picture shown
  std::vector<std::string> given_up;  ///< in the order in which it is
};

/// Where a tracked viewer's head was.
struct HeadRecord {
  std::string viewer;  ///< id
  HeadPose pose;
};

struct FrameRecord {
  std::uint64_t frame = 0;
  double ms = 0.0;
  std::string strategy;
  std::vector<ScreenRecord> screens;
  std::optional<BudgetRecord> budget = {};
  std::vector<HeadRecord> heads = {};
  std::vector<ScreenRecord> monitors = {};
};

/// What a wall run did, so that it can be replayed elsewhere and checked screen by screen.
struct RunManifest {
  std::uint64_t scene_hash = 0;
  std::uint64_t wall_hash = 0;
  std::uint64_t seed = 0;
  std::map<std::string, std::string> versions;  ///< "hpr", "embree", "gl", ...
  std::vector<FrameRecord> frames;
};

[[nodiscard]] ScreenRecord record_screen(const std::string& id, const Image<Rgba8>& picture, ScreenState state);

/// One JSON document, schema hpr.wall-run/1; hashes are 16 hex digits, a NaN becomes null.
[[nodiscard]] std::string to_json(const RunManifest& manifest);

}  // namespace hpr
