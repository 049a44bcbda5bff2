#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "app/options/globals.h"
#include "app/options/render_options.h"
#include "image/image.h"

/// How frames scale with ranks and threads: the measurement of `hpr bench scale`.
namespace hpr {

/// What is drawn, whoever draws it.
struct ScaleInput {
  std::string scene;
  RenderSettings settings;  ///< resolved
  Size size;                ///< pixels of a screen
  std::vector<Size> grids;  ///< walls: screens side by side and one above the other
  int warmup = 1;           ///< frames before those that are measured
};

/// In place of the hash of frames that were not alike.
inline constexpr const char* kDiffering = "differs from job to job";

/// The frames of one wall by one size of job, as the slowest rank took them.
struct ScaleRun {
  Size grid;
  int ranks = 1;
  int threads = 1;  ///< of each rank
  int hosts = 1;
  std::vector<double> ms;  ///< per frame, from its first triangle to its last tile on a screen
  /// Per rank the median of what keys and light took it, compositing and the way to the screen left out; of several
  /// jobs the least. Where photons are sent, that includes waiting for those of the others.
  std::vector<double> rank_ms;
  std::uint64_t bytes_sent = 0;  ///< of one frame, by all ranks
  std::string frame_xxh64;       ///< of the screen's RGBA8 pixels; of several screens' hashes in their order
};

/// Collective. Draws each wall `frames` times, every time the same frame. The runs stand on rank 0.
[[nodiscard]] std::vector<ScaleRun> measure_scale(Communicator& comm, const Globals& globals, const ScaleInput& input,
                                                  int frames);

/// Runs as one JSON document on one line, and back: how a job hands them to the process that started it.
[[nodiscard]] std::string scale_runs_to_json(const std::vector<ScaleRun>& runs);
[[nodiscard]] std::vector<ScaleRun> scale_runs_from_json(std::string_view text);

/// The frames of one more job of the same size: `more` has the same walls in the same order.
void append_frames(std::vector<ScaleRun>& runs, std::vector<ScaleRun> more);

}  // namespace hpr
