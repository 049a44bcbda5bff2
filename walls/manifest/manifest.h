#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/json.h"
#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/tracking/head_path.h"

namespace hpr {

/// What a screen showed in a frame.
enum class ScreenState { Fresh, Stale, Lost };

[[nodiscard]] std::string_view to_string(ScreenState state);

struct ScreenRecord {
  std::string id;
  Size size;                ///< pixels
  std::uint64_t xxh64 = 0;  ///< of the RGBA8 pixels, row by row
  ScreenState state = ScreenState::Fresh;
  int rank = -1;                            ///< that handed it over; -1: not known
  std::optional<double> ms = {};            ///< handing it over: encoding, writing
  std::optional<std::uint64_t> bytes = {};  ///< of what was handed over
};

/// The rank that did most for a frame: drawing and lighting, not waiting for others.
struct SlowestRecord {
  int rank = 0;
  std::string host;
  double ms = 0.0;
  std::string pass;  ///< that took most of it
  double pass_ms = 0.0;
};

/// What a frame with a target time was made with.
struct BudgetRecord {
  double target_ms = 0.0;
  double resolution_scale = 1.0;      ///< of the screens' pixels a side
  std::uint32_t samples = 1;          ///< of the picture shown
  std::vector<std::string> given_up;  ///< in the order in which it is
  bool resting = false;               ///< it added to a picture seen from one place, and has no target
};

/// What was found where some of a frame's tiles were drawn again and compared.
struct VerifyRecord {
  double percent = 0.0;          ///< of the tiles
  std::uint64_t tiles = 0;       ///< drawn again, counted once a sample
  std::uint64_t mismatches = 0;  ///< whose second drawing differed
};

/// How the displays outside the job showed a frame.
struct SwapRecord {
  std::optional<double> skew_ms = {};  ///< between the first and the last display; none: fewer than two showed it
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
  double exposure_stops = 0.0;
  std::string tone = {};  ///< how light was fitted to the display colours
  std::optional<BudgetRecord> budget = {};
  std::optional<SwapRecord> swap = {};  ///< only with such displays
  std::vector<HeadRecord> heads = {};
  std::vector<ScreenRecord> monitors = {};
  std::optional<SlowestRecord> slowest = {};
  std::optional<VerifyRecord> verify = {};
  std::string failed = {};  ///< why it could not be drawn, so that the screens kept their pictures; empty: it was
};

/// What a wall run did, so that it can be replayed elsewhere and checked screen by screen.
struct RunManifest {
  std::uint64_t scene_hash = 0;
  std::uint64_t wall_hash = 0;
  std::uint64_t seed = 0;
  std::map<std::string, std::string> versions;  ///< "hpr", "embree", "gl", ...
  std::vector<std::string> earlier;    ///< records of the frames an earlier job of this run drew, as JSON objects
  std::vector<std::string> restarts;   ///< JSON objects: before which frame a job was started again, and why
  std::vector<FrameRecord> frames;     ///< of this job
  std::optional<int> stopped_of = {};  ///< the frames it was to have, where it was stopped before
  /// How long displays outside the job were missing or behind; none where there are no such displays.
  std::optional<double> degraded_seconds = {};
};

/// What a wall shows while it runs.
struct WallStatusRecord {
  int run = 0;  ///< process id of rank 0
  std::string wall;
  std::string scene;
  int ranks = 1;
  std::uint64_t frame = 0;  ///< the last one
  double ms = 0.0;
  std::vector<std::pair<std::string, ScreenState>> screens = {};  ///< ids; empty before the first frame
  std::vector<std::string> restarts = {};                         ///< as RunManifest has them
};

[[nodiscard]] ScreenRecord record_screen(const std::string& id, const Image<Rgba8>& picture, ScreenState state);

/// The member "budget" of a frame's record and of --stats.
[[nodiscard]] Json budget_json(const BudgetRecord& budget);

/// The member "verify" of a frame's record and of --stats.
[[nodiscard]] Json verify_json(const VerifyRecord& verify);

/// One frame's record, as the manifest has it, on one line.
[[nodiscard]] std::string to_json(const FrameRecord& frame);

/// One JSON document, schema hpr.wall-status/1.
[[nodiscard]] std::string to_json(const WallStatusRecord& status);

/// One JSON document, schema hpr.wall-run/1; hashes are 16 hex digits, a NaN becomes null.
[[nodiscard]] std::string to_json(const RunManifest& manifest);

/// The numbers of the frames that failed, as those records say that an earlier job of a run left.
[[nodiscard]] std::vector<std::uint64_t> failed_frames(std::span<const std::string> records);

/// A manifest as a run left it: what another run, or a drawing, needs of it.
struct ManifestFile {
  std::uint64_t scene_hash = 0;
  std::uint64_t wall_hash = 0;
  std::uint64_t seed = 0;
  std::vector<std::string> frames;    ///< records in order, one JSON object each, on one line
  std::vector<std::string> restarts;  ///< JSON objects
  std::optional<int> stopped_of;      ///< the frames the run was to have, where it was stopped before
};

/// Reads what to_json(RunManifest) writes; `name` stands in errors. Throws Error (BadInput) for anything else.
[[nodiscard]] ManifestFile parse_manifest(std::string_view text, const std::string& name);

/// Throws Error (BadInput) unless the frames are 0, 1, ... of these screens, in their order.
void check_records(const ManifestFile& file, std::span<const WallScreen> screens, const std::string& name);

/// Reads a manifest's file of at most 1 GiB, as parse_manifest does its text. Throws Error: Io too.
[[nodiscard]] ManifestFile load_manifest(const std::string& path);

}  // namespace hpr
