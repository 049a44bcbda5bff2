#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <memory>
#include <new>
#include <optional>
#include <system_error>
#include <thread>

#include "app/command.h"
#include "app/options/knobs.h"
#include "app/report_error.h"
#include "app/trace_file.h"
#include "core/host_name.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/names.h"
#include "raster/gl_context.h"

namespace hpr {
namespace {

/// CLI11 takes -1 for the largest number.
std::string whole_number(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failed == std::errc() && end == text.data() + text.size()) return "";
  return fmt::format("'{}' is no whole number from 0 to 2^64 - 1", printable(text));
}

void declare_globals(CLI::App& app, Globals& globals) {
  const auto group = [](CLI::Option* option) { option->group("Everywhere"); };
  group(app.add_flag_callback(
      "-q,--quiet", [&] { globals.verbosity = -1; }, "errors only"));
  group(app.add_flag("-v,--verbose", globals.verbosity, "say more; twice: from all ranks"));
  group(app.add_option("--ranks", globals.ranks, "MPI ranks; hpr starts mpiexec itself")
            ->check(CLI::Range(1, 4096))
            ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast));
  group(app.add_option("--threads", globals.threads, "threads of one rank (default: cores / ranks of a host)")
            ->check(CLI::Range(1, 1024)));
  group(app.add_option("--seed", globals.seed, "of everything random")->check(whole_number)->capture_default_str());
  group(app.add_option("--backend", globals.backend, "OpenGL by: auto, egl, osmesa")->capture_default_str());
  group(app.add_option("--device", globals.device, "EGL device (default: by local rank)")->check(CLI::Range(0, 1023)));
  group(app.add_option("--progress", globals.progress, "auto, bar, line or none")
            ->check(CLI::IsMember({"auto", "bar", "line", "none"}))
            ->capture_default_str());
  group(app.add_option("--limit-mem", globals.limit_mem, "refuse scenes larger than this, e.g. 4GiB"));
  group(app.add_option("--limit-image", globals.limit_image, "refuse pictures larger than this, e.g. 8192x8192"));
  group(app.add_option("--hang-timeout", globals.hang_timeout, "longest wait for another rank, e.g. 30s"));
  group(app.add_flag("--force", globals.force, "overwrite files"));
  group(app.add_option("--trace", globals.trace,
                       "write what ranks and threads did when, as chrome://tracing and Perfetto show it")
            ->type_name("FILE.json"));
}

std::vector<std::string> names_of(const std::vector<std::unique_ptr<Command>>& commands) {
  std::vector<std::string> names;
  names.reserve(commands.size());
  for (const auto& command : commands) names.emplace_back(command->name());
  return names;
}

std::vector<std::string> names_of(const std::vector<const CLI::App*>& subcommands) {
  std::vector<std::string> names;
  names.reserve(subcommands.size());
  for (const CLI::App* subcommand : subcommands) names.push_back(subcommand->get_name());
  return names;
}

/// The subcommand chain the words name: `app`, or `wall`, or `wall run`, as far as it goes.
const CLI::App* deepest(const CLI::App* app, const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    if (word.starts_with('-')) break;
    const auto children = app->get_subcommands([&](const CLI::App* child) { return child->get_name() == word; });
    if (children.empty()) break;
    app = children.front();
  }
  return app;
}

std::vector<std::string> long_options(const CLI::App* app) {
  std::vector<std::string> names;
  for (; app != nullptr; app = app->get_parent()) {
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

/// CLI11's complaint in our form: what, and the nearest name.
Error usage_error(const CLI::App& app, const std::vector<std::string>& words, const CLI::ParseError& error) {
  const CLI::App* const context = deepest(&app, words);
  std::string command = context->get_name();
  for (const CLI::App* above = context->get_parent(); above != nullptr; above = above->get_parent()) {
    command.insert(0, above->get_name() + " ");
  }
  const std::string help = fmt::format("see '{} --help'", command);
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    const auto known = long_options(context);
    for (const std::string& word : words) {
      const std::string option = word.substr(0, word.find('='));
      if (!option.starts_with("--") || std::ranges::find(known, option) != known.end()) continue;
      const auto nearest = nearest_name(option, known);
      return {ExitCode::Usage, fmt::format("unknown option '{}'", printable(option)),
              nearest ? fmt::format("did you mean '{}'? {}", *nearest, help) : help};
    }
  }
  const auto subcommands = context->get_subcommands([](const CLI::App*) { return true; });
  if (context != &app && !subcommands.empty() && context->get_require_subcommand_min() > 0) {
    const std::vector<std::string> choices = names_of(subcommands);
    const auto word =
        std::ranges::find_if(words.begin() + 1, words.end(), [](const std::string& w) { return !w.starts_with('-'); });
    if (word == words.end())
      return {ExitCode::Usage, fmt::format("{} needs a subcommand", command),
              fmt::format("choices: {}", fmt::join(choices, ", "))};
    return {ExitCode::Usage, fmt::format("unknown subcommand '{} {}'", command, printable(*word)),
            unknown_name_hint(*word, choices)};
  }
  if (app.get_subcommands().empty() && dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    return {ExitCode::Usage, fmt::format("{} needs a command", command),
            fmt::format("choices: {}", fmt::join(names_of(subcommands), ", "))};
  }
  return {ExitCode::Usage, fmt::format("{}: {}", command, error.what()), help};
}

/// An unset variable of a script is no wish to leave an option away.
void refuse_empty_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional() || option->count() == 0 || option->get_expected_min() == 0) continue;
    for (const std::string& value : option->results()) {
      if (!value.empty()) continue;
      throw Error(ExitCode::Usage, fmt::format("{} has an empty value", option->get_name()),
                  "give it one, or leave the option out");
    }
  }
  for (const CLI::App* child : app.get_subcommands()) refuse_empty_values(*child);
}

/// What needs no command; none: the words name one.
std::optional<ExitCode> answer_alone(const CLI::App& app, const std::vector<std::string>& words) {
  if (words.empty()) {
    fmt::print("{}", app.help());
    return ExitCode::Usage;
  }
  if (words == std::vector<std::string>{"help", "knobs"}) {
    fmt::print("{}", knobs_text());
    return ExitCode::Done;
  }
  if (words == std::vector<std::string>{"help", "knobs", "--markdown"}) {
    fmt::print("{}", knobs_markdown());
    return ExitCode::Done;
  }
  return std::nullopt;
}

/// False where the words ask for help or the version, which it tells. Throws Error (Usage).
bool parse(CLI::App& app, const std::vector<std::string>& words,
           const std::vector<std::unique_ptr<Command>>& commands) {
  // `hpr help` and `hpr help COMMAND` are other ways to write --help.
  const auto first = std::ranges::find_if(words, [](const std::string& word) { return word != "help"; });
  const bool asks_for_help = first != words.begin();
  std::vector<std::string> parsed(first, words.end());
  if (asks_for_help) parsed.emplace_back("--help");
  if (!parsed.front().starts_with('-')) {
    const auto names = names_of(commands);
    if (std::ranges::find(names, parsed.front()) == names.end()) {
      throw Error(ExitCode::Usage, fmt::format("unknown command '{}'", printable(parsed.front())),
                  unknown_name_hint(parsed.front(), names));
    }
  }
  try {
    std::vector<std::string> reversed(parsed.rbegin(), parsed.rend());  // CLI11 takes them last first
    app.parse(reversed);
  } catch (const CLI::Success& done) {  // --help, --version
    if (launched_rank() == 0) app.exit(done);
    return false;
  } catch (const CLI::ParseError& error) {
    throw usage_error(app, parsed, error);
  }
  refuse_empty_values(app);
  return true;
}

void configure_log(Globals& globals) {
  const bool listens = launched_rank() != 0 && globals.verbosity < 2;  // rank 0 speaks
  if (globals.verbosity < 0 && globals.progress == "auto") globals.progress = "none";
  log::configure(globals.verbosity < 0 || listens ? log::Level::Error
                 : globals.verbosity == 0         ? log::Level::Info
                                                  : log::Level::Debug,
                 "");
}

/// Also where nothing will be drawn by it. Windows are GLFW's, whatever draws what they show.
void settle_backend(Globals& globals, const Command& command) {
  const bool may_show_windows = command.name() == "display" || command.name() == "view" || command.name() == "wall";
  if (globals.backend == "glfw" && may_show_windows) globals.backend = "auto";
  check_gl_backend(globals.backend);
}

ExitCode run(const std::vector<std::string>& words) {
  Globals globals;
  globals.args = words;
  CLI::App app("Hybrid sort-first/sort-last rasteriser plus ray tracer for tiled displays", "hpr");
  app.set_version_flag("--version", fmt::format("hpr {} ({})", kVersion, kCommit));
  app.require_subcommand(1);
  app.fallthrough();
  declare_globals(app, globals);
  const auto commands = all_commands();
  for (const auto& command : commands) {
    CLI::App* const sub = app.add_subcommand(std::string(command->name()), std::string(command->summary()));
    sub->fallthrough();
    command->declare(*sub);
  }

  if (const auto answered = answer_alone(app, words)) return *answered;
  if (!parse(app, words, commands)) return ExitCode::Done;
  configure_log(globals);
  (void)globals.scene_limits();  // malformed sizes and durations are found before any work
  (void)globals.hang_limit();
  for (const auto& command : commands) {
    if (!app.got_subcommand(std::string(command->name()))) continue;
    settle_backend(globals, *command);
    if (!inside_mpi_job() || (launched_rank() == 0 && !command->collective())) check_trace(globals);
    if (command->collective()) return command->run(globals);
    return launched_rank() == 0 ? traced_alone(globals, [&] { return command->run(globals); }) : ExitCode::Done;
  }
  return ExitCode::Usage;
}

}  // namespace

}  // namespace hpr

int main(int argc, char** argv) {
  // A reader that goes away (hpr ... | head) shows as a failed write, not as a killed rank.
  std::signal(SIGPIPE, SIG_IGN);
  // So does a file that may not grow further.
  std::signal(SIGXFSZ, SIG_IGN);
  // What a checkpoint is asked for by is nothing to commands that write none (engine/signals.h).
  for (const int request : {SIGUSR1, SIGUSR2}) std::signal(request, SIG_IGN);
  // A file opened while 0, 1 or 2 is closed would take its number, and what is meant for stdout or stderr.
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    // What is said on a closed stdout is lost, and that is an error where there is something to say.
    if (::fcntl(standard, F_GETFD) < 0) (void)::open(standard == STDOUT_FILENO ? "/dev/full" : "/dev/null", O_RDWR);
  }
  try {
    const hpr::ExitCode code = hpr::run(std::vector<std::string>(argv + 1, argv + argc));
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
      throw hpr::Error(hpr::ExitCode::Io, "cannot write to standard output",
                       "free some space, or see who closed the pipe");
    }
    return static_cast<int>(code);
  } catch (const hpr::Error& error) {
    // What every rank of a job finds before MPI starts is said once: rank 0's exit ends the others while they wait.
    if (hpr::launched_rank() != 0) std::this_thread::sleep_for(std::chrono::seconds(2));
    hpr::print_error(error, hpr::said_by(hpr::launched_rank()));
    return static_cast<int>(error.code());
  } catch (const std::system_error& error) {  // how fmt reports a failed print
    hpr::print_error({hpr::ExitCode::Io, error.what(), "free some space, or see who closed the pipe"});
    return static_cast<int>(hpr::ExitCode::Io);
  } catch (const std::bad_alloc&) {
    hpr::print_error({hpr::ExitCode::Limit, "out of memory", "use a smaller picture or scene"});
    return static_cast<int>(hpr::ExitCode::Limit);
  } catch (const std::exception& error) {
    hpr::print_error(
        {hpr::ExitCode::Internal, error.what(), "this is a defect of hpr: please report it with the command line"});
    return static_cast<int>(hpr::ExitCode::Internal);
  }
}
