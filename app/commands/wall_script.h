#pragma once

#include <memory>
#include <string>

#include "app/command.h"
#include "walls/config/wall.h"

namespace hpr {

/// What a batch script runs.
struct WallScript {
  std::string wall;              ///< the file, as the job's folder finds it
  std::string scene = {};        ///< empty: named when the script is submitted
  std::string show = "window";   ///< what `hpr display` shows with
  int frames = 0;                ///< 0: until the job is stopped
  std::string time = "1:00:00";  ///< of the job, as Slurm has it
  std::string command = {};      ///< that made it, for the first comment; may be empty
};

/// A script for sbatch: a display process on every host with screens, and `hpr wall run` with one task per rank of each
/// node, on its host. Throws Error (Usage) for a wall whose nodes or screens have no hosts Slurm could know.
[[nodiscard]] std::string write_slurm_script(const Wall& wall, const WallScript& script);

/// `hpr wall script WALL [SCENE] --slurm`.
[[nodiscard]] std::unique_ptr<Command> make_wall_script_command();

}  // namespace hpr
