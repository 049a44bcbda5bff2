#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/command.h"
#include "walls/config/wall_file.h"

namespace hpr {

/// What `hpr wall check` says about a wall.
struct WallCheck {
  std::string spec;  ///< as the user named it
  WallReading reading;
};

/// Every finding on stderr: errors in their three lines, warnings in one.
void report_findings(const WallCheck& check);

/// A sound wall's figures in words: pixels, hosts, gaps, seams, viewer.
[[nodiscard]] std::string describe_wall(const Wall& wall);

/// The same as JSON, schema hpr.wall-check/1.
[[nodiscard]] std::string check_json(const WallCheck& check);

/// `hpr wall init|check|plan|expand|schema|pattern|import|script|run|status|ctl|stop`.
[[nodiscard]] std::unique_ptr<Command> make_wall_command();

}  // namespace hpr
