#include <fcntl.h>
#include <fmt/format.h>
#include <hpr/version.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <memory>
#include <new>
#include <optional>
#include <system_error>
#include <thread>

#include "app/command.h"
#include "app/launch/launcher.h"
#include "app/launch/run_ranks.h"
#include "app/options/settings_text.h"
#include "app/results.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/signals.h"
#include "engine/session.h"
#include "raster/gl_context.h"

namespace hpr {
namespace {

/// Answers command lines that need no command (help); none: the arguments name a command.
std::optional<ExitCode> answer_alone(const CommandLine& line, const std::vector<std::string>& arguments) {
  using Arguments = std::vector<std::string>;
  std::string answer;
  if (arguments.empty()) answer = line.help();
  if (arguments == Arguments{"help", "knobs"}) answer = tradeoff_settings_text();
  if (arguments == Arguments{"help", "knobs", "--markdown"}) answer = tradeoff_settings_markdown();
  if (arguments == Arguments{"help", "quality", "--markdown"}) answer = qualities_markdown();
  if (arguments == Arguments{"help", "--markdown"}) {
    answer = line.markdown() +
             "\n## Settings\n\nOf every command that draws a scene. A default of three values is that of the qualities "
             "draft, "
             "good and best.\n\n" +
             settings_markdown();
  }
  if (answer.empty()) return std::nullopt;
  fmt::print("{}", answer);
  return arguments.empty() ? ExitCode::Usage : ExitCode::Done;
}

void configure_log(Globals& globals) {
  const bool errors_only = globals.verbosity < 0 || (launched_rank() != 0 && globals.verbosity < 2);
  if (globals.verbosity < 0 && globals.progress == "auto") globals.progress = "none";
  log::configure(errors_only ? log::Level::Error : globals.verbosity == 0 ? log::Level::Info : log::Level::Debug, "");
  // Of a job the launcher speaks; one that is not of this program passes signals to every rank.
  if (!errors_only && launched_rank() == 0 && !launched_by_hpr()) announce_ends(stderr_is_terminal());
}

/// Checks --backend, also for commands that draw nothing. Windows are GLFW's, whatever draws their pictures.
void settle_backend(Globals& globals, const Command& command) {
  if (globals.backend == "glfw" && command.opens_windows()) globals.backend = "auto";
  if (globals.backend != kVulkan) check_gl_backend(globals.backend);
}

ExitCode run(const std::vector<std::string>& arguments) {
  Globals globals;
  globals.args = arguments;
  CommandLine line("hpr", "Hybrid sort-first/sort-last rasteriser plus ray tracer for tiled displays",
                   fmt::format("hpr {} ({})", kVersion, kCommit));
  globals.declare(line.everywhere());
  for (auto& command : all_commands()) line.add(std::move(command));

  if (const auto answered = answer_alone(line, arguments)) return *answered;
  Command* const command = line.parse(arguments, launched_rank() == 0);
  if (command == nullptr) return ExitCode::Done;
  configure_log(globals);
  (void)globals.scene_limits();  // malformed sizes and durations are found before any work
  (void)globals.hang_limit();
  (void)globals.starter(1);
  settle_backend(globals, *command);
  globals.force |= is_started_again();
  if (!inside_mpi_job() || (launched_rank() == 0 && !command->collective())) check_trace(globals);
  if (command->collective()) return command->run(globals);
  return launched_rank() == 0 ? traced_alone(globals, [&] { return command->run(globals); }) : ExitCode::Done;
}

ExitCode run_and_flush(const std::vector<std::string>& arguments) {
  const ExitCode code = run(arguments);
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    throw Error(ExitCode::Io, "cannot write to standard output", "free some space, or see who closed the pipe");
  }
  return code;
}

/// Prints the exception that is being handled; returns what to leave with. Throws std::bad_alloc.
int report_exception() {
  try {
    throw;
  } catch (const Interrupted& interrupted) {
    std::fflush(nullptr);
    (void)std::raise(interrupted.signal);  // as if it had not been caught
    return 128 + interrupted.signal;
  } catch (const Error& error) {
    // An error that every rank of a job finds before MPI starts is printed once: rank 0's exit ends the others while
    // they wait.
    if (launched_rank() != 0) std::this_thread::sleep_for(std::chrono::seconds(2));
    print_error(error, said_by(launched_rank()));
    return static_cast<int>(error.code());
  } catch (const std::system_error& error) {  // how fmt reports a failed print
    print_error({ExitCode::Io, error.what(), "free some space, or see who closed the pipe"});
    return static_cast<int>(ExitCode::Io);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    print_error({ExitCode::Internal, error.what(), "this is a defect of hpr: please report it with the command line"});
    return static_cast<int>(ExitCode::Internal);
  }
}

}  // namespace

}  // namespace hpr

int main(int argc, char** argv) {
  // A reader that goes away (hpr ... | head) shows as a failed write, not as a killed rank.
  std::signal(SIGPIPE, SIG_IGN);
  // A file that may not grow further shows as a failed write as well.
  std::signal(SIGXFSZ, SIG_IGN);
  // Commands that write no checkpoints ignore the signals that request one (core/signals.h).
  for (const int request : {SIGUSR1, SIGUSR2}) std::signal(request, SIG_IGN);
  // A file opened while 0, 1 or 2 is closed would take its number, and what is meant for stdout or stderr.
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    // Output on a closed stdout is lost: an error where there is output.
    if (::fcntl(standard, F_GETFD) < 0) (void)::open(standard == STDOUT_FILENO ? "/dev/full" : "/dev/null", O_RDWR);
  }
  try {
    return static_cast<int>(hpr::run_and_flush(std::vector<std::string>(argv + 1, argv + argc)));
  } catch (...) {
    try {
      return hpr::report_exception();
    } catch (...) {  // std::bad_alloc, of the run or of the report: this takes no memory
      std::fputs("hpr: error: out of memory\n  hint: use a smaller picture or scene\n", stderr);
      return static_cast<int>(hpr::ExitCode::Limit);
    }
  }
}
