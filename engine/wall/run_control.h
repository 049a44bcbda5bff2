#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "engine/wall/controls.h"
#include "engine/wall/line_source.h"

namespace hpr {

/// Runs the commands that other processes send to a running wall, between frames: every command of a console but those
/// about pictures, and `status` and `stop`.
class RunControl {
 public:
  /// Collective. Session and settings outlive this. `settings`: what the commands change. `status`: one JSON document;
  /// called on rank 0. `apply`: called on all ranks after every line that changed something; where it throws what
  /// is_recoverable, the settings are put back and it is called again. `record`: called with every line that could be
  /// applied.
  RunControl(Session& session, RenderSettings& settings, std::uint64_t seed, SceneLoader load,
             std::function<std::string()> status, std::function<void()> apply,
             std::function<void(const std::string& line)> record);

  /// See Controls::reject_change().
  void reject_change(const std::string& name, const std::string& why) { controls_.reject_change(name, why); }
  /// Collective. Carries out the commands that an earlier job of this run carried out, and answers nobody.
  void replay(std::span<const std::string> lines);

  /// Collective. Carries out the commands that have arrived; never waits.
  void poll();
  /// On rank 0: whether a command has arrived that may change something; never waits.
  [[nodiscard]] bool any_waiting();
  [[nodiscard]] bool stops() const { return stops_; }

 private:
  [[nodiscard]] std::string apply_command(const std::string& line);

  Session& session_;
  CommandTable table_;
  Controls controls_;
  RenderSettings& settings_;
  std::function<void()> apply_;
  std::function<void(const std::string&)> record_;
  std::optional<LineSource> source_;  ///< on rank 0
  bool stops_ = false;
};

/// A wall that runs, as its socket is found.
struct RunningWall {
  std::string run;  ///< what --run names it by
  std::filesystem::path socket;
};

/// The running walls of this user on this host; sockets that killed runs left are removed.
[[nodiscard]] std::vector<RunningWall> running_walls();

/// Sends one line to a running wall and waits for its answer, at most `timeout`. Throws Error: Io when nobody is there
/// or the answer does not come; what the wall's own error is (Usage, BadInput, Io, Limit) when it refuses.
[[nodiscard]] std::string send_command(const RunningWall& wall, const std::string& line,
                                       std::chrono::milliseconds timeout);

}  // namespace hpr
