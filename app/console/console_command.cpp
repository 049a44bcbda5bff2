#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <utility>

#include "app/command.h"
#include "app/console/console.h"
#include "app/launch/launcher.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "app/report_error.h"
#include "cluster/transport/collectives.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/text.h"
#include "engine/wall/hearing.h"
#include "engine/wall/recoverable.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

/// The other ranks hear from rank 0 at least so often: to them silence is a hang.
constexpr std::chrono::milliseconds kHeartbeat{250};

class ConsoleCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "console"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a resident scene, told what to do line by line; 'help' lists the commands";
  }

  void declare(const OptionSet& options) override {
    options.option("scene", source_, "a .gltf or .glb file, or gen:NAME?key=value").required();
    options.option("--listen", listen_, "also take lines from a Unix socket (a path) or from TCP (ADDRESS:PORT)")
        .type("ADDRESS");
    options.flag("--keep-going", keeps_going_, "a command that fails in a script does not end it");
    options.option("--size", size_, "pixels of the picture").show_default().type("WxH");
    declare_settings(options, settings_);
    report_.declare(options);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1920x1080");
    check_size({extent->first, extent->second}, globals.picture_limits());
    if (!report_.stats.empty() || report_.explain) {
      throw Error(ExitCode::Usage, "--stats and --explain are commands here", "say stats FILE.json, or explain");
    }
    (void)resolve(settings_, globals.seed);
    return run_ranks(globals,
                     [&](Communicator& comm) {
                       Session session(comm, globals.session(),
                                       [&] { return load_scene(source_, settings_, globals); });
                       Console console(session, globals, settings_, {extent->first, extent->second});
                       return converse(session.comm(), console);
                     },
                     {.input = StandardInput::OfRank0});
  }

 private:
  ExitCode converse(Communicator& comm, Console& console) {
    const bool speaks = comm.rank() == 0;
    std::optional<LineSource> source;
    agree_on_failure(comm, [&] {
      if (speaks) source.emplace(LineSource::Options{true, listen_});
    });
    if (speaks) tell_where(*source);
    ExitCode worst = ExitCode::Done;
    while (!console.quits()) {
      const std::optional<Line> line = next_line(comm, source ? &*source : nullptr);
      if (!line) break;
      const ExitCode code = obey(comm, console, *line);
      if (line->scripted) worst = std::max(worst, code);
    }
    return worst;
  }

  /// A line as all ranks heard it.
  struct Line {
    std::string text;
    bool scripted = false;         ///< by a file or a pipe
    LineSource* source = nullptr;  ///< rank 0's; null: nobody is answered here
    InputLine from;                ///< rank 0's
  };

  /// Collective. None: no line can come any more. `source`: null on ranks other than 0.
  [[nodiscard]] static std::optional<Line> next_line(Communicator& comm, LineSource* source) {
    const bool typed = source != nullptr && input_is_typed();
    if (typed) fmt::print("> ");
    if (source != nullptr) std::fflush(stdout);
    std::optional<InputLine> from;
    Heard heard;
    while (!heard.line && !heard.ended) heard = hear_line(comm, source, kHeartbeat, from);
    if (heard.ended) return std::nullopt;
    const bool scripted = source != nullptr && !typed && from->from == STDIN_FILENO;
    return Line{std::move(*heard.line), all_gather_value(comm, scripted ? 1 : 0)[0] == 1, source,
                std::move(from).value_or(InputLine{})};
  }

  /// Collective. Runs a line and answers it; what it failed with, where the session goes on all the same.
  ExitCode obey(Communicator& comm, Console& console, const Line& line) const {
    try {
      const std::string told = console.run(line.text);
      if (line.source != nullptr) line.source->answer(line.from, answer_of(told, line.from));
      return ExitCode::Done;
    } catch (const Error& error) {
      if (!is_recoverable(error) || (console.drawing() && comm.size() > 1)) throw;
      const bool ends = line.scripted && !keeps_going_;
      if (ends && line.source != nullptr) throw in_line(error, line.from);
      if (ends) throw;
      if (line.source != nullptr) refuse_line(*line.source, line.from, error);
      return error.code();
    }
  }

  static void tell_where(const LineSource& source) {
    if (source.address().empty()) return;
    log::info("listening on {}", source.address());
    // Not the token of the environment: who set it knows it, and logs are read by others. One made up is told always.
    if (!source.token().empty() && source.token() != link_token()) {
      fmt::print(stderr, "hpr: the first line of a client is: token {}\n", source.token());
    }
  }

  /// Which line of a script it was.
  [[nodiscard]] static Error in_line(const Error& error, const InputLine& line) {
    return {error.code(), fmt::format("line {}: {}", line.number, error.what()), error.hint(), line.text};
  }

  /// Clients of a socket see by a last line that an answer is whole.
  [[nodiscard]] static std::string answer_of(const std::string& told, const InputLine& line) {
    std::string answer = told.empty() ? "" : told + "\n";
    if (line.from != STDIN_FILENO) answer += "ok\n";
    return answer;
  }

  static void refuse_line(LineSource& source, const InputLine& line, const Error& error) {
    if (line.from == STDIN_FILENO) {
      print_error(input_is_typed() ? error : in_line(error, line));
    } else {
      source.answer(line, fmt::format("error: {} ({})\n", error.what(), error.hint()));
    }
  }

  std::string source_;
  std::string listen_;
  std::string size_ = "1280x720";
  bool keeps_going_ = false;
  RenderSettings settings_;
  ReportOptions report_;
};

}  // namespace

/// `hpr console SCENE`.
std::unique_ptr<Command> make_console_command() {
  return std::make_unique<ConsoleCommand>();
}

}  // namespace hpr
