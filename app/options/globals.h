#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/options/option_set.h"
#include "image/image_io.h"
#include "scene/load_scene.h"

namespace hpr {

struct SessionSettings;

/// A time above 0 as `option` has it: "30s". Throws Error (Usage) that shows `example`.
[[nodiscard]] std::chrono::nanoseconds parse_time_limit(std::string_view option, const std::string& text,
                                                        std::string_view example);
/// A time limit in whole milliseconds, rounded up, at most kMaxWait.
[[nodiscard]] std::chrono::milliseconds to_milliseconds(std::chrono::nanoseconds limit);

/// The options every command has.
struct Globals {
  int verbosity = 0;  ///< -v, -vv; -1 is -q
  std::uint64_t seed = 1;
  std::string backend = "auto";
  int device = -1;  ///< -1: by local rank
  std::string progress = "auto";
  std::string limit_mem;
  std::string limit_image;
  std::string hang_timeout;
  std::string launcher;              ///< command line that starts ranks; empty: mpiexec
  bool force = false;                ///< overwrite files
  std::vector<std::string> plugins;  ///< shared objects with further strategies, as they were named; loaded
  std::string trace;                 ///< file for the timeline of ranks and threads; empty: none
  int ranks = 0;                     ///< 0: as many as the launcher started, else 1
  int threads = 0;                   ///< of one rank; 0: the machine's cores divided among the ranks of a host
  std::vector<std::string> args;     ///< this process's command line after the program's name

  void declare(const OptionSet& options);

  /// Throws Error (Usage) for malformed sizes.
  [[nodiscard]] SceneLimits scene_limits() const;
  /// How large a picture may be that HPR itself draws or reads back: --limit-image, or kPictureLimits.
  [[nodiscard]] ImageLimits picture_limits() const;
  [[nodiscard]] std::chrono::nanoseconds hang_limit() const;
  /// The words that start `count` ranks; none: as run_job() does by itself. Throws Error (Usage).
  [[nodiscard]] std::optional<std::vector<std::string>> starter(int count) const;
  [[nodiscard]] SessionSettings session() const;
};

}  // namespace hpr
