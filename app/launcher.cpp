#include "app/launcher.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "core/error.h"

namespace hpr {
namespace {

/// What Open MPI needs to run as root, with more ranks than cores and without its own banners. Values the user set win.
constexpr std::array<std::pair<const char*, const char*>, 10> kEnvironment{{
    {"OMPI_ALLOW_RUN_AS_ROOT", "1"},
    {"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"},
    {"OMPI_MCA_rmaps_base_oversubscribe", "1"},
    {"OMPI_MCA_hwloc_base_binding_policy", "none"},
    {"OMPI_MCA_mpi_yield_when_idle", "1"},
    {"OMPI_MCA_pml", "ob1"},
    {"OMPI_MCA_btl", "self,vader,tcp"},
    {"OMPI_MCA_orte_execute_quiet", "1"},
    {"OMPI_MCA_opal_signal", ""},  // no stack dumps
    {"HWLOC_COMPONENTS", "-gl"},   // asks X servers, also one that hangs, for nothing that is needed
}};

/// Tells rank 0, which reads from a pipe, that its launcher reads from a terminal.
constexpr const char* kTypedInput = "HPR_TYPED_INPUT";
/// Tells the ranks of a job, whose stderr is a pipe, that their launcher's is a terminal.
constexpr const char* kTerminalVariable = "HPR_TERMINAL";
/// Tells rank 0 to say on its standard output, before all else, that the ranks have started.
constexpr const char* kStartVariable = "HPR_SAY_START";
constexpr std::string_view kStartMark = "\x06hpr ranks have started\n";
/// Seconds after which signals are passed on without that: where ranks run elsewhere, the variable may not reach them.
constexpr unsigned kLongestStart = 30;

/// Runs in the child between fork and exec: only async-signal-safe calls and environment set-up of a single thread.
[[noreturn]] void become(const std::vector<char*>& arguments, const JobOptions& options, int stdout_pipe,
                         pid_t parent) {
  // Ctrl-C is then for the parent alone, which passes on what it stands for. Who reads a terminal stays in its group.
  if (options.input == StandardInput::None) ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(1);
  if (options.input == StandardInput::None) {
    const int null = ::open("/dev/null", O_RDONLY);
    if (null >= 0) ::dup2(null, STDIN_FILENO);
  }
  const bool typed = options.input == StandardInput::OfRank0 && ::isatty(STDIN_FILENO) == 1;
  ::dup2(stdout_pipe, STDOUT_FILENO);
  // NOLINTBEGIN(concurrency-mt-unsafe): after fork there is one thread
  for (const auto& [name, value] : kEnvironment) ::setenv(name, value, 0);
  if (typed) ::setenv(kTypedInput, "1", 1);
  ::setenv(kStartVariable, "1", 1);
  ::isatty(STDERR_FILENO) == 1 ? ::setenv(kTerminalVariable, "1", 1) : ::unsetenv(kTerminalVariable);
  for (const auto& [name, value] : options.environment) ::setenv(name.c_str(), value.c_str(), 1);
  // NOLINTEND(concurrency-mt-unsafe)
  ::execvp(arguments.front(), arguments.data());
  ::_exit(127);
}

// The handler reaches nothing but globals.
std::atomic<pid_t> launched = 0;
std::atomic<bool> stops = false;  ///< Interrupts::Stop
std::atomic<int> interrupted_by = 0;
std::atomic<bool> ends = false;     ///< nothing more is to be said
std::atomic<int> early = 0;         ///< a signal that came before there was anybody to pass it to
std::atomic<bool> started = false;  ///< the ranks; before, mpiexec loses requests, or ranks die of them

bool is_request(int signal) {
  return signal == SIGUSR1 || signal == SIGUSR2;
}

/// Of two signals that wait, the one that asks for more stays.
int weight_of(int signal) {
  return signal == 0 ? 0 : signal == SIGUSR2 ? 1 : signal == SIGUSR1 ? 2 : 3;
}

void pass_on_early() {
  const int signal = early.exchange(0);
  const pid_t to = launched.load();
  if (signal == 0) return;
  if (to > 0 && (started.load() || !is_request(signal))) {
    ::kill(to, signal);
  } else {
    int waiting = 0;  // another may have come meanwhile
    while (weight_of(waiting) < weight_of(signal) && !early.compare_exchange_weak(waiting, signal)) {
    }
  }
}

void note_start() {
  started.store(true);
  pass_on_early();
}

extern "C" void pass_on(int signal) {
  const int error = errno;
  if (signal == SIGALRM) note_start();
  if (signal == SIGINT || signal == SIGTERM || signal == SIGHUP) {
    const bool again = interrupted_by.exchange(signal) != 0;
    ends.store(again || !stops.load());
    if (stops.load()) {
      signal = again ? SIGTERM : SIGUSR1;
    } else {
      signal = again ? SIGKILL : SIGTERM;
    }
  }
  if (signal != SIGALRM && weight_of(signal) >= weight_of(early.load())) {
    if (early.exchange(signal) == 0 && is_request(signal) && !started.load()) ::alarm(kLongestStart);
  }
  pass_on_early();
  errno = error;
}

/// While it lives, SIGUSR1 and SIGUSR2 go on to mpiexec, which sends them to all ranks, and so does what interrupts a
/// job in a process group of its own: this process leaves when its ranks have. A second interrupt is not waited for.
class PassedSignals {
 public:
  explicit PassedSignals(const JobOptions& options)
      : count_(options.input == StandardInput::None ? kSignals.size() : 3) {
    launched.store(0);
    early.store(0);
    started.store(false);
    interrupted_by.store(0);
    ends.store(false);
    stops.store(options.interrupts == Interrupts::Stop);
    struct sigaction action {};
    action.sa_handler = pass_on;
    // One at a time: two that meet in the handler would lose one of them.
    for (const int signal : kSignals) ::sigaddset(&action.sa_mask, signal);
    for (std::size_t i = 0; i < count_; ++i) {
      ::sigaction(kSignals.at(i), nullptr, &before_.at(i));
      // What nohup, or a shell for its background, has us ignore stays ignored.
      if (before_.at(i).sa_handler != SIG_IGN) ::sigaction(kSignals.at(i), &action, nullptr);
    }
  }
  ~PassedSignals() {
    for (std::size_t i = count_; i-- > 1;) ::sigaction(kSignals.at(i), &before_.at(i), nullptr);
    ::alarm(0);  // no handler sets it any more
    ::sigaction(kSignals.front(), &before_.front(), nullptr);
    // As if it had not been caught.
    if (const int signal = interrupted_by.load(); signal != 0 && !stops.load()) ::raise(signal);
  }
  PassedSignals(const PassedSignals&) = delete;
  PassedSignals& operator=(const PassedSignals&) = delete;

  static void to(pid_t child) {
    launched.store(child);
    pass_on_early();
  }
  /// The child was waited for: its number may soon be another process's.
  static void to_nobody() { launched.store(0); }

 private:
  static constexpr std::array kSignals{SIGALRM, SIGUSR1, SIGUSR2, SIGINT, SIGTERM, SIGHUP};
  std::size_t count_;  ///< of them, from the front
  std::array<struct sigaction, kSignals.size()> before_{};
};

/// False with errno. A reader that stands still keeps nobody who wants to end this.
bool write_all(int file, std::string_view text) {
  while (!text.empty()) {
    errno = EINTR;
    const ssize_t written = ends.load() ? -1 : ::write(file, text.data(), text.size());
    if (written < 0 && errno == EINTR && !ends.load()) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// Takes the mark of the start from the front of what a job says.
class StartMark {
 public:
  /// What of `text`, the next piece of that, is not the mark. Meaningful until the next call.
  std::string_view take(std::string_view text) {
    if (looked_) return text;
    front_.append(text);
    const std::size_t length = std::min(front_.size(), kStartMark.size());
    const bool like = front_.compare(0, length, kStartMark, 0, length) == 0;
    if (like && length < kStartMark.size()) return {};
    looked_ = true;
    note_start();
    return std::string_view(front_).substr(like ? length : 0);
  }

  /// Whether the job has said anything. Where ranks run elsewhere that may be all there is to go by.
  [[nodiscard]] bool heard() const { return looked_; }

 private:
  std::string front_;
  bool looked_ = false;
};

/// Collects what the job says on its standard output in `collected`, or says it here as it comes: mpiexec does not
/// tell when nobody can take it. Returns the errno that ended that, and the job; 0: all was said.
int hear_out(int pipe, std::string* collected, pid_t child, StartMark& mark) {
  int failed = 0;
  std::array<char, 65536> buffer{};
  while (true) {
    const ssize_t got = ::read(pipe, buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return failed;
    const std::string_view text = mark.take({buffer.data(), static_cast<std::size_t>(got)});
    if (collected != nullptr) {
      collected->append(text);
    } else if (failed == 0 && !write_all(STDOUT_FILENO, text)) {
      failed = errno;
      if (!ends.load()) ::kill(child, SIGTERM);  // else it was told already, and twice is without mercy
    }
  }
}

}  // namespace

std::optional<std::filesystem::path> find_on_path(std::string_view program) {
  const char* const path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const std::string_view folder = rest.substr(0, rest.find(':'));
    rest.remove_prefix(std::min(folder.size() + 1, rest.size()));
    std::filesystem::path candidate = std::filesystem::path(folder.empty() ? "." : folder) / program;
    std::error_code error;
    if (std::filesystem::is_regular_file(candidate, error) && ::access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  return std::nullopt;
}

int launched_rank() {
  for (const char* const name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}) {
    if (const char* const value = std::getenv(name); value != nullptr) return std::atoi(value);
  }
  return 0;
}

bool inside_mpi_job() {
  for (const char* const name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMI_RANK", "PMIX_RANK"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

bool launched_by_hpr() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nobody writes the environment
  return inside_mpi_job() && std::getenv(kStartVariable) != nullptr;
}

void tell_launcher() {
  if (!launched_by_hpr()) return;
  std::fwrite(kStartMark.data(), 1, kStartMark.size(), stdout);
  std::fflush(stdout);
}

std::string program_path() {
  return std::filesystem::read_symlink("/proc/self/exe").string();
}

bool input_is_typed() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nobody writes the environment
  return ::isatty(STDIN_FILENO) == 1 || std::getenv(kTypedInput) != nullptr;
}

bool stderr_is_terminal() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nobody writes the environment
  return ::isatty(STDERR_FILENO) == 1 || (inside_mpi_job() && std::getenv(kTerminalVariable) != nullptr);
}

int run_mpiexec(int ranks, const std::vector<std::string>& args, const JobOptions& options) {
  if (!find_on_path("mpiexec")) {
    throw Error(ExitCode::Io, fmt::format("cannot start {} ranks: there is no mpiexec on the PATH", ranks),
                "install openmpi-bin, or run with --ranks 1");
  }
  std::vector<std::string> words{"mpiexec", "-n", std::to_string(ranks), program_path()};
  words.insert(words.end(), args.begin(), args.end());
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  std::array<int, 2> pipe{-1, -1};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot start mpiexec: {}", std::generic_category().message(errno)));
  }
  const PassedSignals passed(options);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0)
    throw Error(ExitCode::Io, fmt::format("cannot start mpiexec: {}", std::generic_category().message(errno)));
  if (child == 0) become(arguments, options, pipe[1], parent);
  PassedSignals::to(child);

  ::close(pipe[1]);
  StartMark mark;
  const int unsaid = hear_out(pipe[0], options.captured_stdout, child, mark);
  ::close(pipe[0]);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) throw Error(ExitCode::Io, "lost track of mpiexec");
  }
  PassedSignals::to_nobody();
  if (unsaid != 0) {
    throw Error(ExitCode::Io,
                fmt::format("cannot write to standard output: {}", std::generic_category().message(unsaid)),
                "free some space, or see who closed the pipe");
  }
  // A rank that is killed shows as 128 + its signal in mpiexec's own code; an interrupt is the user's doing.
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (code > 128 && code != 128 + SIGINT && code != 128 + SIGTERM && code != 128 + SIGHUP) {
    const char* const signal = ::sigdescr_np(code - 128);
    throw Error(ExitCode::Lost,
                fmt::format("a rank or mpiexec was ended by signal {} ({})", code - 128, signal ? signal : "unknown"),
                "the system's log may say why (out of memory?); nothing partial was left");
  }
  if (code == 127) {
    throw Error(ExitCode::Io, "cannot start mpiexec", "run 'hpr doctor'; or use --ranks 1");
  }
  // Open MPI's own failures end with 1 as well, and so do ranks whose MPI_Init fails.
  if (code == static_cast<int>(ExitCode::CheckFailed) && !mark.heard() && interrupted_by.load() == 0) {
    throw Error(
        ExitCode::Io, fmt::format("MPI could not start {} ranks", ranks),
        "its own words, if any, stand above; see that TMPDIR may be written and OMPI_MCA_* variables are right, "
        "or use --ranks 1");
  }
  return code;
}

}  // namespace hpr
