#include "app/launch/launcher.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "app/launch/job_folder.h"
#include "app/launch/rank_watch.h"
#include "core/error.h"
#include "core/file.h"
#include "core/job_board.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/signals.h"
#include "core/text.h"

namespace hpr {

/// While it lives, SIGUSR1 and SIGUSR2 go on to mpiexec, which sends them to all ranks, unless this process ignores
/// them, and so does what interrupts a job in a process group of its own: this process leaves when its ranks have. A
/// second interrupt is not waited for. One at a time: signal handlers reach nothing but globals.
class PassedSignals {
 public:
  explicit PassedSignals(const JobOptions& options);
  /// A signal that came too late for check() ends this process, as if it had not been caught.
  ~PassedSignals();
  PassedSignals(const PassedSignals&) = delete;
  PassedSignals& operator=(const PassedSignals&) = delete;

  static void to(pid_t child);
  /// The child was waited for: its number may soon be another process's.
  static void to_nobody();
  /// The ranks have started: requests that waited for that go out.
  static void note_start();

  /// Whether mpiexec was sent a signal that ends it, or will be as soon as it runs: no further message is printed.
  [[nodiscard]] static bool ends();
  /// The last signal that interrupted the job; 0: none did.
  [[nodiscard]] static int interrupted_by();
  /// Throws Interrupted where the job was interrupted, and that was to end it.
  void check();

 private:
  static constexpr std::array kSignals{SIGALRM, SIGUSR1, SIGUSR2, SIGINT, SIGTERM, SIGHUP};
  std::size_t count_;  ///< how many of kSignals are handled, from the front
  bool checked_ = false;
  bool suspends_;  ///< SIGTSTP too
  struct sigaction suspend_before_ {};
  std::array<struct sigaction, kSignals.size()> before_{};
};

namespace {

/// Seconds after which signals are passed on although no start was reported.
constexpr unsigned kMaxStartSeconds = 30;

std::atomic<pid_t> launched = 0;
std::atomic<bool> stops = false;  ///< Interrupts::Stop
std::atomic<int> interrupt = 0;
std::atomic<bool> ending = false;   ///< PassedSignals::ends
std::atomic<int> early = 0;         ///< a signal that came before there was anybody to pass it to
std::atomic<bool> started = false;  ///< the ranks; before, mpiexec loses requests, or ranks die of them

bool is_request(int signal) {
  return signal == SIGUSR1 || signal == SIGUSR2;
}

/// The strength of a request: of two pending signals the stronger one is kept.
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

extern "C" void pass_on(int signal) {
  const int error = errno;
  if (signal == SIGALRM) started.store(true);
  if (signal == SIGINT || signal == SIGTERM || signal == SIGHUP) {
    const bool again = interrupt.exchange(signal) != 0;
    announce_end();
    ending.store(again || !stops.load());
    if (stops.load()) {
      signal = again ? SIGTERM : SIGUSR1;
    } else {
      signal = again ? SIGKILL : SIGTERM;
    }
  }
  if (signal != SIGALRM && weight_of(signal) >= weight_of(early.load())) {
    if (early.exchange(signal) == 0 && is_request(signal) && !started.load()) ::alarm(kMaxStartSeconds);
  }
  pass_on_early();
  errno = error;
}

/// Ctrl-Z: the rank, in a group of its own, stands still as long as this process.
extern "C" void suspend(int /*signal*/) {
  const int error = errno;
  const pid_t rank = launched.load();
  if (rank > 0) ::kill(rank, SIGSTOP);
  (void)::raise(SIGSTOP);
  if (rank > 0) ::kill(rank, SIGCONT);
  errno = error;
}

bool is_lone(const JobOptions& options) {
  return options.starter && options.starter->empty();
}

}  // namespace

PassedSignals::PassedSignals(const JobOptions& options)
    : count_(options.input == StandardInput::None ? kSignals.size() : 3),
      suspends_(is_lone(options) && options.input == StandardInput::None) {
  launched.store(0);
  early.store(0);
  started.store(false);
  interrupt.store(0);
  ending.store(false);
  stops.store(options.interrupts == Interrupts::Stop);
  struct sigaction action {};
  action.sa_handler = pass_on;
  // One at a time: two that meet in the handler would lose one of them.
  for (const int signal : kSignals) ::sigaddset(&action.sa_mask, signal);
  for (std::size_t i = 0; i < count_; ++i) {
    ::sigaction(kSignals.at(i), nullptr, &before_.at(i));
    // What nohup, or a shell for its background, has us ignore stays ignored, and so do requests nobody here takes.
    if (before_.at(i).sa_handler != SIG_IGN) ::sigaction(kSignals.at(i), &action, nullptr);
  }
  if (!suspends_) return;
  ::sigaction(SIGTSTP, nullptr, &suspend_before_);
  action.sa_handler = suspend;
  if (suspend_before_.sa_handler != SIG_IGN) ::sigaction(SIGTSTP, &action, nullptr);
}

PassedSignals::~PassedSignals() {
  for (std::size_t i = count_; i-- > 1;) ::sigaction(kSignals.at(i), &before_.at(i), nullptr);
  ::alarm(0);  // no handler sets it any more
  ::sigaction(kSignals.front(), &before_.front(), nullptr);
  if (suspends_) ::sigaction(SIGTSTP, &suspend_before_, nullptr);
  if (const int signal = interrupt.load(); signal != 0 && !stops.load() && !checked_) ::raise(signal);
}

void PassedSignals::check() {
  const int signal = interrupt.load();
  if (signal == 0 || stops.load()) return;
  checked_ = true;
  throw Interrupted{signal};
}

void PassedSignals::to(pid_t child) {
  launched.store(child);
  pass_on_early();
}

void PassedSignals::to_nobody() {
  launched.store(0);
}

void PassedSignals::note_start() {
  started.store(true);
  pass_on_early();
}

bool PassedSignals::ends() {
  return ending.load();
}

int PassedSignals::interrupted_by() {
  return interrupt.load();
}

namespace {

/// 0: it has gone.
pid_t parent_of(const std::filesystem::path& process) {
  std::ifstream file(process / "stat");
  std::string stat;
  std::getline(file, stat, '\0');  // a name may hold anything but that
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos || name_end + 4 > stat.size()) return 0;
  pid_t parent = 0;
  std::from_chars(stat.data() + name_end + 4, stat.data() + stat.size(), parent);  // after ") S "
  return parent;
}

/// A process before those it started.
std::vector<pid_t> with_descendants(pid_t process) {
  std::vector<std::pair<pid_t, pid_t>> parents;  ///< a process and its parent
  for (const std::filesystem::path& entry : entries_of("/proc")) {
    const std::string name = entry.filename().string();
    pid_t number = 0;
    const auto [stop, wrong] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (wrong == std::errc() && stop == name.data() + name.size()) parents.emplace_back(number, parent_of(entry));
  }
  std::vector<pid_t> found{process};
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const auto& [number, parent] : parents) {
      if (parent == found[i]) found.push_back(number);
    }
  }
  return found;
}

void kill_with_descendants(pid_t process) {
  ::kill(process, SIGSTOP);  // starts nobody more while they are listed
  const std::vector<pid_t> all = with_descendants(process);
  if (::getpgid(process) == process) ::kill(-process, SIGKILL);
  for (const pid_t one : all) ::kill(one, SIGKILL);
}

/// What Open MPI needs to run as root, with more ranks than cores and without its own banners. Values the user set win.
constexpr std::array<std::pair<const char*, const char*>, 9> kEnvironment{{
    {"OMPI_ALLOW_RUN_AS_ROOT", "1"},
    {"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"},
    {"OMPI_MCA_rmaps_base_oversubscribe", "1"},
    {"OMPI_MCA_hwloc_base_binding_policy", "none"},
    {"OMPI_MCA_mpi_yield_when_idle", "1"},
    {"OMPI_MCA_pml", "ob1"},
    {"OMPI_MCA_orte_execute_quiet", "1"},
    {"OMPI_MCA_opal_signal", ""},  // no stack dumps
    {"HWLOC_COMPONENTS", "-gl"},   // asks X servers, also one that hangs, for nothing that is needed
}};

/// What it needs besides for jobs of one host: no ssh, which may not be there, and no ranks that listen to the network.
constexpr std::array<std::pair<const char*, const char*>, 2> kOneHost{{
    {"OMPI_MCA_plm", "isolated"},
    {"OMPI_MCA_btl", "self,vader"},
}};

constexpr std::string_view kStartMark = "\x06hpr ranks have started\n";

/// What starting processes may take beside what its ranks may take to start MPI, which they time themselves.
constexpr std::chrono::seconds kStartGrace{10};
constexpr std::chrono::milliseconds kStartOfRank{500};
/// Between these a job may take as long as its ranks wait for each other to end after SIGTERM. Open MPI gives
/// ranks a second.
constexpr std::chrono::seconds kMinEnd{2};
constexpr std::chrono::seconds kMaxEnd{10};

/// What the child between fork and exec leaves with where it cannot become what it is to start.
constexpr int kNoMemory = 126;
constexpr int kNotStarted = 127;

/// In the child between fork and exec. False where there was no memory for it: a job that lacked a variable would be
/// another one.
bool set_environment(const JobOptions& options, const std::string& board, bool is_typed, pid_t parent) {
  // NOLINTBEGIN(concurrency-mt-unsafe): after fork there is one thread
  bool set = true;
  const auto put = [&](const char* name, const char* value, bool replace) {
    set = ::setenv(name, value, replace ? 1 : 0) == 0 && set;
  };
  if (is_lone(options)) {
    put(kLoneRankVariable, std::to_string(parent).c_str(), true);
  } else {
    // It alone can name lost ranks of other hosts.
    if (options.starter || !is_one_host()) put("OMPI_MCA_orte_execute_quiet", "0", false);
    for (const auto& [name, value] : kEnvironment) put(name, value, false);
    put(kReportStartVariable, "1", true);
  }
  if (!options.starter && is_one_host()) {
    for (const auto& [name, value] : kOneHost) put(name, value, false);
  }
  if (is_typed) put(kTypedInputVariable, "1", true);
  put(JobBoard::kVariable, board.c_str(), true);
  ::unsetenv(kTerminalVariable);
  if (::isatty(STDERR_FILENO) == 1) put(kTerminalVariable, "1", true);
  for (const auto& [name, value] : options.environment) put(name.c_str(), value.c_str(), true);
  // NOLINTEND(concurrency-mt-unsafe)
  return set;
}

/// Runs in the child between fork and exec: only async-signal-safe calls and environment set-up of a single thread.
[[noreturn]] void become(const std::vector<char*>& pointers, const JobOptions& options, const std::string& board,
                         const std::optional<JobFolder>& folder, int stdout_pipe, pid_t parent) {
  const bool reads = options.input == StandardInput::OfRank0;
  // Ctrl-C is then for the parent alone, which passes on what it stands for. Who reads a terminal stays in its group.
  if (!reads) ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(1);
  if (!reads) {
    const int null = ::open("/dev/null", O_RDONLY);
    if (null >= 0) ::dup2(null, STDIN_FILENO);
  }
  const bool is_typed = reads && ::isatty(STDIN_FILENO) == 1;
  ::dup2(stdout_pipe, STDOUT_FILENO);
  if (!set_environment(options, board, is_typed, parent)) ::_exit(kNoMemory);
  if (folder) folder->pass_on();
  // Also when the file was replaced or removed since: what runs on is what ran before.
  if (is_lone(options)) ::execv("/proc/self/exe", pointers.data());
  ::execvp(pointers.front(), pointers.data());
  ::_exit(errno == ENOMEM ? kNoMemory : kNotStarted);
}

/// The path of the running program, as it was at the first call.
const std::string& program_path() {
  static const std::string path = std::filesystem::read_symlink("/proc/self/exe").string();
  return path;
}

/// False with errno. A reader that stands still keeps nobody who wants to end this.
bool write_all(int file, std::string_view text) {
  while (!text.empty()) {
    errno = EINTR;
    const ssize_t written = PassedSignals::ends() ? -1 : ::write(file, text.data(), text.size());
    if (written < 0 && errno == EINTR && !PassedSignals::ends()) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// Removes the mark of the start from the front of a job's output.
class StartMark {
 public:
  /// Returns what of `text`, the next piece of the output, is not the mark; valid until the next call.
  std::string_view take(std::string_view text) {
    if (has_output_) return text;
    front_.append(text);
    const std::size_t length = std::min(front_.size(), kStartMark.size());
    const bool like = front_.compare(0, length, kStartMark, 0, length) == 0;
    if (like && length < kStartMark.size()) return {};
    has_output_ = true;
    PassedSignals::note_start();
    return std::string_view(front_).substr(like ? length : 0);
  }

  /// Whether the job has written any output. For ranks on other hosts that may be the only sign of a start.
  [[nodiscard]] bool has_output() const { return has_output_; }

 private:
  std::string front_;
  bool has_output_ = false;
};

/// A job from its start to its end. Its standard output is collected, or copied to ours as it arrives: mpiexec
/// does not report a reader that went away. No wait for mpiexec is without a limit. `name`: what was started.
class RunningJob {
 public:
  RunningJob(pid_t child, std::string name, const JobBoard& board, int output, const JobOptions& options)
      : child_(child),
        name_(std::move(name)),
        watch_(board),
        output_(output),
        collected_(options.captured_stdout),
        hang_limit_(options.hang_limit),
        start_limit_(std::min<std::chrono::nanoseconds>(options.hang_limit, kMaxWait) + kStartGrace +
                     board.ranks() * kStartOfRank),
        end_limit_(std::clamp<std::chrono::nanoseconds>(options.hang_limit, kMinEnd, kMaxEnd)) {}

  /// Waits for its end; returns its status as waitpid has it.
  int follow() {
    while (true) {
      const bool has_output = poll_output(output_ < 0 ? kToTheEnd_ms : is_starting() ? kStart_ms : kPollInterval_ms);
      enforce_limits();
      if (has_output && !killed_) continue;
      const std::optional<int> status = check_end();
      if (!status) continue;
      while (poll_output(0)) {  // its last output
      }
      if (output_ >= 0) ::close(output_);  // somebody it left behind holds the other end
      return *status;
    }
  }

  [[nodiscard]] bool has_output() const { return mark_.has_output(); }
  /// The errno of the write that failed and ended the job; 0: all output was written.
  [[nodiscard]] int output_error() const { return output_error_; }
  /// It stood still, and was ended: what stood still. Empty: it did not.
  [[nodiscard]] const std::string& hang() const { return hang_; }
  [[nodiscard]] const RankWatch& ranks() const { return watch_; }
  /// Its ranks had not started in time, and it was ended.
  [[nodiscard]] bool late() const { return late_; }
  /// A rank ended while they started, and what started them went on, until it was ended.
  [[nodiscard]] bool lost_early() const { return lost_early_; }
  /// Whether the job was killed, because it did not end in time after SIGTERM.
  [[nodiscard]] bool killed() const { return killed_; }
  [[nodiscard]] std::chrono::duration<double> start_limit() const { return start_limit_; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr int kPollInterval_ms = 200;
  static constexpr int kToTheEnd_ms = 5;
  static constexpr int kStart_ms = 20;
  static constexpr std::chrono::seconds kMaxStart{30};
  static constexpr std::chrono::milliseconds kUpdateInterval{100};
  static constexpr std::chrono::seconds kMaxUpdateInterval{1};

  /// Copies output that has arrived; waits at most `wait_ms`. False when there is none now, or none will come.
  bool poll_output(int wait_ms) {
    std::vector<pollfd> waited{{.fd = output_, .events = POLLIN, .revents = 0}};  // one below 0 is passed over
    watch_.add_to(waited);
    if (::poll(waited.data(), waited.size(), wait_ms) <= 0) return false;
    watch_.note_ends(waited);
    if (waited.front().revents == 0) return false;
    std::array<char, 65536> buffer{};
    const ssize_t got = ::read(output_, buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) return true;
    if (got <= 0) {
      ::close(std::exchange(output_, -1));
      return false;
    }
    const std::string_view text = mark_.take({buffer.data(), static_cast<std::size_t>(got)});
    if (collected_ != nullptr) {
      collected_->append(text);
    } else if (output_error_ == 0 && !write_all(STDOUT_FILENO, text)) {
      const int reason = errno;
      if (PassedSignals::ends()) return true;  // a second signal would kill it
      output_error_ = reason;
      ::kill(child_, SIGTERM);
    }
    return true;
  }

  /// Its status once it has ended.
  std::optional<int> check_end() {
    int status = 0;
    const pid_t changed = ::waitpid(child_, &status, WNOHANG | WUNTRACED | WCONTINUED);
    if (changed < 0 && errno != EINTR) throw Error(ExitCode::Io, fmt::format("lost track of {}", name_));
    if (changed != child_) return std::nullopt;
    if (!WIFSTOPPED(status) && !WIFCONTINUED(status)) return status;
    note_stop(WIFSTOPPED(status));
    return std::nullopt;
  }

  void note_stop(bool is_stopped) {
    is_stopped_ = is_stopped;
    stopped_for_ = {};
    if (is_stopped) log::warning("{} was stopped", name_);
  }

  /// Whether ranks may still join the board.
  [[nodiscard]] bool is_starting() const { return !watch_.knows_all() && Clock::now() - begin_ < kMaxStart; }

  /// Ends the job where it stands still.
  void check_ranks(Clock::time_point now) {
    if (now - updated_at_ < kUpdateInterval && !is_starting()) return;
    // More than that has passed only where this process stood still itself, or the machine slept.
    const auto passed = std::min<std::chrono::nanoseconds>(now - updated_at_, kMaxUpdateInterval);
    updated_at_ = now;
    watch_.update(passed);
    if (is_stopped_) stopped_for_ += passed;
    const std::chrono::nanoseconds limit = watch_.stall_limit().count() > 0 ? watch_.stall_limit() : hang_limit_;
    if (watch_.stalled()) {
      hang_ = fmt::format("no rank has got on for {:g} s: {}", std::chrono::duration<double>(limit).count(),
                          watch_.roll_call());
    } else if (stopped_for_ > limit) {
      hang_ = fmt::format("{} has been stopped for {:g} s", name_, std::chrono::duration<double>(limit).count());
    }
    if (hang_.empty()) return;
    end_requested_at_ = now;
    ::kill(child_, SIGTERM);
    ::kill(child_, SIGCONT);
  }

  void enforce_limits() {
    const Clock::time_point now = Clock::now();
    if (!end_requested_at_) check_ranks(now);
    if (!end_requested_at_ && (PassedSignals::ends() || output_error_ != 0)) end_requested_at_ = now;
    if (!end_requested_at_ && !mark_.has_output()) {
      // Open MPI notices most ranks that end, but not one that ends while it connects to mpiexec. Ranks that have
      // waited for the others as long as they may end by themselves: late.
      if (!lost_at_ && now - begin_ < hang_limit_ && watch_.first_known_to_end()) lost_at_ = now;
      lost_early_ = lost_at_ && now - *lost_at_ > end_limit_;
      late_ = !lost_early_ && now - begin_ > start_limit_;
      if (lost_early_ || late_) {
        end_requested_at_ = now;
        ::kill(child_, SIGTERM);
      }
    }
    if (!end_requested_at_ || killed_ || now - *end_requested_at_ <= end_limit_) return;
    log::warning("{} has not ended {:g} s after it was told to, and is killed", name_,
                 std::chrono::duration<double>(end_limit_).count());
    kill_with_descendants(child_);
    killed_ = true;
  }

  pid_t child_;
  std::string name_;
  RankWatch watch_;
  int output_;
  std::string* collected_;
  std::chrono::nanoseconds hang_limit_;
  std::chrono::nanoseconds start_limit_;
  std::chrono::nanoseconds end_limit_;
  StartMark mark_;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point updated_at_ = begin_;
  bool is_stopped_ = false;
  std::chrono::nanoseconds stopped_for_{0};
  std::string hang_;
  std::optional<Clock::time_point> end_requested_at_;  ///< when it was sent SIGTERM, or another signal that ends it
  int output_error_ = 0;
  std::optional<Clock::time_point> lost_at_;  ///< when a rank was found to have ended before all had started
  bool late_ = false;
  bool lost_early_ = false;
  bool killed_ = false;
};

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

void notify_launcher() {
  if (!launched_by_hpr()) return;
  std::fwrite(kStartMark.data(), 1, kStartMark.size(), stdout);
  std::fflush(stdout);
}

namespace {

/// Its first word is what is started.
std::vector<std::string> command_line(int ranks, const std::vector<std::string>& args, const JobOptions& options) {
  std::vector<std::string> words =
      options.starter.value_or(std::vector<std::string>{"mpiexec", "-n", std::to_string(ranks)});
  if (!words.empty() && words.front().find('/') == std::string::npos && !find_on_path(words.front())) {
    throw Error(ExitCode::Io,
                fmt::format("cannot start {} ranks: there is no {} on the PATH", ranks, printable(words.front())),
                options.starter ? "see --launcher" : "install openmpi-bin, or run with --ranks 1");
  }
  words.push_back(program_path());
  words.insert(words.end(), args.begin(), args.end());
  return words;
}

/// Throws Error where a job ended by what was done to it. `code`: as a shell has it.
void check_ending(const RunningJob& job, const std::string& name, int ranks, int code) {
  if (job.output_error() != 0) {
    throw Error(ExitCode::Io,
                fmt::format("cannot write to standard output: {}", std::generic_category().message(job.output_error())),
                "free some space, or see who closed the pipe");
  }
  if (job.lost_early()) {
    throw Error(
        ExitCode::Lost,
        fmt::format("a rank ended while {} ranks started: {}", ranks, job.ranks().first_known_to_end().value_or("one")),
        "the system's log may say why (out of memory?)");
  }
  if (job.late()) {
    throw LateStart(
        ExitCode::Io, fmt::format("{} has not started {} ranks in {:g} s", name, ranks, job.start_limit().count()),
        "its own words, if any, stand above; see that TMPDIR may be written and has space, and that no limit of "
        "file sizes (ulimit -f) is in its way; raise --hang-timeout if it only needs longer; or use --ranks 1");
  }
  if (!job.hang().empty()) throw Error(ExitCode::Hang, job.hang(), "raise --hang-timeout if it only needs longer");
  // A rank that is killed shows as 128 + its signal in mpiexec's own code; an interrupt is the user's doing.
  if (job.killed() || code <= 128 || code == 128 + SIGINT || code == 128 + SIGTERM || code == 128 + SIGHUP) return;
  const char* const signal = ::sigdescr_np(code - 128);
  const std::string end = fmt::format("ended by signal {} ({})", code - 128, signal ? signal : "unknown");
  const std::string hint = "the system's log may say why (out of memory?); nothing partial was left";
  if (const auto first = job.ranks().first_to_end())
    throw Error(ExitCode::Lost, fmt::format("a rank was {}: {}", end, *first), hint);
  throw Error(ExitCode::Lost, fmt::format("a rank or {} was {}", name, end), hint);
}

}  // namespace

int last_job_interrupt() {
  return PassedSignals::interrupted_by();
}

int run_job(int ranks, const std::vector<std::string>& args, const JobOptions& options) {
  std::vector<std::string> words = command_line(ranks, args, options);
  const std::string name = is_lone(options) ? "the rank" : std::filesystem::path(words.front()).filename().string();
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);

  std::array<int, 2> pipe{-1, -1};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot start {}: {}", name, std::generic_category().message(errno)));
  }
  const JobBoard board(ranks);
  PassedSignals passed(options);
  std::optional<JobFolder> folder;
  if (!options.starter) folder.emplace();
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0)
    throw Error(ExitCode::Io, fmt::format("cannot start {}: {}", name, std::generic_category().message(errno)));
  if (child == 0) become(pointers, options, board.address(), folder, pipe[1], parent);
  PassedSignals::to(child);

  ::close(pipe[1]);
  RunningJob job(child, name, board, pipe[0], options);
  const int status = job.follow();
  PassedSignals::to_nobody();
  passed.check();
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  check_ending(job, name, ranks, code);
  if (job.killed()) return 128 + PassedSignals::interrupted_by();
  if (code == kNoMemory)
    throw Error(ExitCode::Limit, fmt::format("cannot start {}: out of memory", name),
                "end other programs, or use --ranks 1");
  if (code == kNotStarted)
    throw Error(ExitCode::Io, fmt::format("cannot start {}", name), "run 'hpr doctor'; or use --ranks 1");
  // Open MPI's own failures end with 1 as well, and so do ranks whose MPI_Init fails.
  if (code == static_cast<int>(ExitCode::CheckFailed) && !job.has_output() && PassedSignals::interrupted_by() == 0) {
    throw Error(
        ExitCode::Io, fmt::format("MPI could not start {} ranks", ranks),
        "its own words, if any, stand above; see that TMPDIR may be written and OMPI_MCA_* variables are right, "
        "or use --ranks 1");
  }
  // The ranks that noticed it have reported themselves; whom they waited for has not.
  if (code == static_cast<int>(ExitCode::Hang) && !job.ranks().roll_call().empty())
    log::warning("where the ranks were: {}", job.ranks().roll_call());
  return code;
}

}  // namespace hpr
