#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "app/console/controls.h"
#include "app/console/line_source.h"

namespace hpr {

/// socket_folder(), made if missing: where running walls of this user are reached, and nobody else may write. Throws
/// Error (Io) when it cannot be made, or is another's.
[[nodiscard]] std::filesystem::path control_folder();

/// Lets others tell a running wall what to do, between frames: every command of a console but those about pictures,
/// and `status` and `stop`.
class RunControl {
 public:
  /// Collective. All outlive this. `options`: what the commands change. `status`: one JSON document; called on rank 0.
  RunControl(Session& session, const Globals& globals, RenderOptions& options, std::function<std::string()> status);

  /// Collective. Carries out what was said, waiting for it at most `longest`; true when anything changed.
  bool attend(std::chrono::milliseconds longest);
  [[nodiscard]] bool stops() const { return stops_; }

 private:
  [[nodiscard]] std::optional<std::string> hear(std::chrono::milliseconds longest, std::optional<InputLine>& line);

  Session& session_;
  CommandTable table_;
  Controls controls_;
  std::optional<LineSource> source_;  ///< on rank 0
  bool stops_ = false;
};

/// A wall that runs, as its socket is found.
struct RunningWall {
  std::string run;  ///< what --run names it by
  std::filesystem::path socket;
};

/// Those that answer; sockets that killed runs left are removed.
[[nodiscard]] std::vector<RunningWall> running_walls();

/// Sends one line to a running wall and waits for its answer, at most `longest`. Throws Error: Io when nobody is there
/// or the answer does not come; Usage when the wall refuses.
[[nodiscard]] std::string ask(const RunningWall& wall, const std::string& line, std::chrono::milliseconds longest);

}  // namespace hpr
