#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <iomanip>
#include <optional>
#include <sstream>

#include "app/command.h"
#include "core/error.h"
#include "core/json.h"
#include "core/text.h"
#include "engine/wall/run_control.h"

namespace hpr {
namespace {

/// What they share: which run is meant, and how long it may take to answer.
class WallRemoteCommand : public Command {
 public:
  void declare(const OptionSet& options) override {
    options.option("--run", run_, "which one, where several run: its number in wall status");
    options.option("--wait", wait_, "how long the run may take to answer").show_default().type("DURATION");
  }

 protected:
  [[nodiscard]] std::string send_line(const std::string& line) const {
    return send_command(chosen(), line, to_milliseconds(parse_time_limit("--wait", wait_, "10s")));
  }
  [[nodiscard]] RunningWall chosen() const {
    const std::vector<RunningWall> walls = running_walls();
    if (walls.empty()) {
      throw Error(ExitCode::Lost, "no wall of this user runs on this host", "start one with hpr wall run");
    }
    std::vector<std::string> runs;
    for (const RunningWall& wall : walls) {
      if (wall.run == run_) return wall;
      runs.push_back(wall.run);
    }
    if (!run_.empty()) {
      throw Error(ExitCode::Usage, fmt::format("there is no run '{}'", printable(run_)), unknown_name_hint(run_, runs));
    }
    if (walls.size() > 1) {
      throw Error(ExitCode::Usage, fmt::format("{} walls run: {}", walls.size(), fmt::join(runs, ", ")),
                  "name one of them with --run");
    }
    return walls.front();
  }

 private:
  std::string run_;
  std::string wait_ = "10s";
};

class WallStatusCommand final : public WallRemoteCommand {
 public:
  [[nodiscard]] std::string_view name() const override { return "status"; }
  [[nodiscard]] std::string_view summary() const override { return "what a running wall shows, and how fast"; }
  void declare(const OptionSet& options) override {
    WallRemoteCommand::declare(options);
    options.flag("--json", json_, "print one JSON document (hpr.wall-status/1)");
  }
  [[nodiscard]] ExitCode run(const Globals&) override {
    const std::string reply = send_line("status");
    if (json_) {
      fmt::print("{}", reply);
      return ExitCode::Done;
    }
    const auto status = Json::parse(reply);
    fmt::print("run {}: {} on {}, frame {}, {:.1f} ms a frame, {} rank{}, {} restart{}\n", status["run"].get<int>(),
               printable(status["scene"].get<std::string>()), printable(status["wall"].get<std::string>()),
               status["frame"].get<std::uint64_t>(), status["ms"].get<double>(), status["ranks"].get<int>(),
               status["ranks"] == 1 ? "" : "s", status["restarts"].size(), status["restarts"].size() == 1 ? "" : "s");
    for (const Json& screen : status["screens"].elements()) {
      fmt::print("screen {}: {}\n", screen["id"].get<std::string>(), screen["state"].get<std::string>());
    }
    return ExitCode::Done;
  }

 private:
  bool json_ = false;
};

class WallCtlCommand final : public WallRemoteCommand {
 public:
  [[nodiscard]] std::string_view name() const override { return "ctl"; }
  [[nodiscard]] std::string_view summary() const override {
    return "tell a running wall what to do, as in a console: 'ctl help' lists it";
  }
  void declare(const OptionSet& options) override {
    WallRemoteCommand::declare(options);
    options.keep_remaining();  // a command's arguments may look like an option: -1,0,0
    options_.emplace(options);
  }
  [[nodiscard]] ExitCode run(const Globals&) override {
    std::ostringstream line;
    const std::vector<std::string> arguments = options_->remaining();
    if (arguments.empty())
      throw Error(ExitCode::Usage, "there is nothing to tell", "write e.g. hpr wall ctl quality draft");
    for (const std::string& argument : arguments) {
      if (std::ranges::any_of(argument, [](unsigned char c) { return std::iscntrl(c) != 0; })) {
        throw Error(ExitCode::Usage, fmt::format("'{}' holds what no line may", printable(argument)),
                    "tell one thing a time");
      }
      const bool plain = !argument.empty() && argument.find_first_of(" \"\\#") == std::string::npos;
      line << (line.tellp() > 0 ? " " : "");
      plain ? line << argument : line << std::quoted(argument);
    }
    fmt::print("{}", send_line(line.str()));
    return ExitCode::Done;
  }

 private:
  std::optional<OptionSet> options_;
};

class WallStopCommand final : public WallRemoteCommand {
 public:
  [[nodiscard]] std::string_view name() const override { return "stop"; }
  [[nodiscard]] std::string_view summary() const override { return "end a running wall after its frame"; }
  [[nodiscard]] ExitCode run(const Globals&) override {
    (void)send_line("stop");
    return ExitCode::Done;
  }
};

}  // namespace

std::unique_ptr<Command> make_wall_status_command() {
  return std::make_unique<WallStatusCommand>();
}

std::unique_ptr<Command> make_wall_ctl_command() {
  return std::make_unique<WallCtlCommand>();
}

std::unique_ptr<Command> make_wall_stop_command() {
  return std::make_unique<WallStopCommand>();
}

}  // namespace hpr
