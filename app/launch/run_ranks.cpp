#include "app/launch/run_ranks.h"

#include <fmt/format.h>
#include <mpi.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>

#include "app/launch/launcher.h"
#include "app/results.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/mpi_communicator.h"
#include "core/job_board.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/signals.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// A rank that fails alone would leave its peers waiting: the whole job ends with its code. Rank 0 prints first, so
/// that an error all ranks agreed on is printed once.
[[noreturn]] void abort_job(int rank, const Error& error) {
  if (rank != 0) std::this_thread::sleep_for(std::chrono::milliseconds(300));
  if (claim_error(error.what())) print_error(error, said_by(rank));
  std::fflush(nullptr);
  MPI_Abort(MPI_COMM_WORLD, static_cast<int>(error.code()));
  std::abort();  // MPI_Abort does not return
}

/// A time limit for the calls of MPI that cannot be polled: starting and ending. When it passes, this rank prints an
/// error and ends, and the launcher ends the others.
class CallLimit {
 public:
  CallLimit(std::chrono::nanoseconds limit, const char* doing)
      : thread_([this, limit, doing](const std::stop_token& stop) {
          std::unique_lock lock(mutex_);
          if (done_.wait_for(lock, stop, std::min<std::chrono::nanoseconds>(limit, kMaxWait), [] { return false; }))
            return;
          if (stop.stop_requested()) return;
          print_error({ExitCode::Hang, fmt::format("rank {} on {}: still {}", launched_rank(), host_name(), doing),
                       "a rank stands still; raise --hang-timeout if it only needs longer"});
          std::fflush(nullptr);
          ::_exit(static_cast<int>(ExitCode::Hang));
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any done_;
  std::jthread thread_;
};

/// srun without MPI's help starts the program as often as it has tasks, and each would write the same files.
void refuse_lone_tasks() {
  if (srun_tasks() == 1) return;
  throw Error(ExitCode::Usage,
              fmt::format("srun started {0} tasks, but they are not ranks of one MPI job: each of them would do all of "
                          "the work, and write the same files",
                          srun_tasks()),
              fmt::format("run srun --mpi=pmix -n {} hpr ...; srun --mpi=list shows what it has", srun_tasks()));
}

/// What --launcher names has to start ranks of MPI: a program that is none would start it again.
void refuse_launcher_without_mpi() {
  if (std::getenv(kReportStartVariable) == nullptr) return;  // NOLINT(concurrency-mt-unsafe): nobody writes it
  throw Error(ExitCode::Usage, "what --launcher names started hpr, but not as a rank of an MPI job",
              "name a launcher of MPI, e.g. --launcher \"srun --mpi=pmix -n {ranks}\"");
}

/// MPI_Init and, on success only, MPI_Finalize: a rank that left early would hang in it.
ExitCode run_in_mpi_job(const Globals& globals, const std::function<ExitCode(Communicator&)>& body) {
  std::optional<CallLimit> limit;
  limit.emplace(globals.hang_limit(), "starting MPI");
  report_phase("start of MPI");
  join_job_board(launched_rank());
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  ExitCode code = ExitCode::Done;
  try {
    MpiCommunicator comm(MPI_COMM_WORLD, globals.hang_limit());
    limit.reset();
    if (comm.size() == 1) refuse_lone_tasks();
    report_phase("");
    if (rank == 0) notify_launcher();
    if (globals.ranks > 0 && globals.ranks != comm.size()) {
      throw Error(ExitCode::Usage, fmt::format("--ranks {} inside a job of {} ranks", globals.ranks, comm.size()),
                  "leave --ranks out under mpirun or srun: the launcher sets the number");
    }
    if (rank != 0) {
      log::configure(globals.verbosity >= 2 ? log::Level::Debug : log::Level::Error, said_by(rank));
    }
    for (const ExitCode vote : all_gather_value(comm, body(comm))) code = std::max(code, vote);
  } catch (const Error& error) {
    abort_job(rank, error);
  } catch (const std::bad_alloc&) {
    abort_job(rank, Error(ExitCode::Limit, "out of memory", "use more ranks, a smaller picture or a smaller scene"));
  } catch (const std::exception& error) {
    abort_job(rank, Error(ExitCode::Internal, error.what()));
  }
  limit.emplace(globals.hang_limit(), "ending MPI");
  MPI_Finalize();
  return code;
}

}  // namespace

ExitCode run_ranks(const Globals& globals, const std::function<ExitCode(Communicator&)>& untraced,
                   const JobOptions& options) {
  const auto body = [&](Communicator& comm) { return traced(comm, globals, untraced); };
  if (inside_mpi_job()) return run_in_mpi_job(globals, body);
  refuse_lone_tasks();
  refuse_launcher_without_mpi();
  if (globals.ranks > 1 || !globals.launcher.empty()) {
    const int ranks = std::max(1, globals.ranks);
    JobOptions limited = options;
    limited.starter = globals.starter(ranks);
    limited.hang_limit = globals.hang_limit();
    return static_cast<ExitCode>(run_job(ranks, globals.args, limited));
  }
  if (launched_by_hpr()) {
    notify_launcher();
    join_job_board(0);
  }
  ExitCode code = ExitCode::Done;
  run_local_ranks(
      1, [&](Communicator& comm) { code = body(comm); }, globals.hang_limit());
  return code;
}

bool RestartLimit::use(Clock::time_point now) {
  while (!uses_.empty() && now - uses_.front() >= period_) uses_.pop_front();
  if (uses_.size() >= static_cast<std::size_t>(count_)) return false;
  uses_.push_back(now);
  return true;
}

bool is_started_again() {
  const auto journal = RunJournal::of_supervisor();
  return journal && !journal->read().restarts.empty();
}

bool starts_ranks(const Globals& globals, int restarts) {
  return supervises(restarts) || (!inside_mpi_job() && (globals.ranks > 1 || !globals.launcher.empty()));
}

bool supervises(int restarts) {
  return !inside_mpi_job() && !launched_by_hpr() && restarts > 0;
}

namespace {

/// What a supervised job may take to start, unless the user says otherwise.
constexpr std::chrono::seconds kSupervisedLimit{60};

bool is_loss(ExitCode code) {
  return code == ExitCode::Lost || code == ExitCode::Hang;
}

/// Runs one job of a supervised run, and returns its code, or how it was lost.
std::variant<ExitCode, Error> run_one_job(int ranks, const Globals& globals, const JobOptions& options,
                                          const RunJournal& journal) {
  const bool is_first = journal.read().restarts.empty();
  try {
    const auto code = static_cast<ExitCode>(run_job(ranks, globals.args, options));
    // A lone rank that leaves by itself knows what it lost: its desktop, a display.
    if (!is_loss(code) || ranks == 1 || journal.read().ended) return code;
    return Error(code, code == ExitCode::Hang ? "the job stood still" : "the job lost a rank");
  } catch (const LateStart& error) {
    if (is_first) throw;  // another one would hardly start either
    return error;
  } catch (const Error& error) {
    // A job that came to its end may lose ranks that leave late; one that hung may end because it was told to.
    if (!is_loss(error.code()) || (error.code() == ExitCode::Lost && journal.read().ended)) throw;
    return error;
  }
}

/// Decides whether a lost job is started again.
class Restarts {
 public:
  Restarts(RunJournal& journal, int count) : journal_(journal), count_(count), limit_(count) {}

  /// Writes the restart down. Throws Error where there is to be none.
  void note(const Error& lost) {
    const RunJournal::Entries entries = journal_.read();
    const std::size_t done = entries.frames.size();
    const bool drew = entries.begun > std::exchange(begun_, entries.begun);
    if (drew && ended_at_ == done)
      give_up(lost, done, fmt::format("frame {} ended two jobs; draw it alone to see why", done));
    if (!limit_.use(RestartLimit::Clock::now()))
      give_up(lost, done, fmt::format("it was started again {} times within an hour; see --restarts", count_));
    if (drew) ended_at_ = done;
    log::warning("{}; starting it again from frame {} (restart {} of {} in this hour)", lost.what(), done,
                 limit_.used(), count_);
    journal_.add_restart(lost.what());
  }

 private:
  [[noreturn]] static void give_up(const Error& lost, std::size_t done, const std::string& hint) {
    throw Error(lost.code(), fmt::format("{}; {} of its frames are done", lost.what(), done), hint);
  }

  RunJournal& journal_;
  int count_;
  RestartLimit limit_;
  std::optional<std::size_t> ended_at_;  ///< by a job that drew
  std::size_t begun_ = 0;
};

}  // namespace

ExitCode run_supervised(const Globals& globals, int restarts, Interrupts interrupts,
                        const std::filesystem::path& folder, const std::function<ExitCode(Communicator&)>& body) {
  if (!supervises(restarts)) return run_ranks(globals, body, {.interrupts = interrupts});
  refuse_lone_tasks();
  refuse_launcher_without_mpi();
  const int ranks = std::max(1, globals.ranks);
  RunJournal journal(globals.launcher.empty() ? TemporaryFile() : TemporaryFile(folder));
  const JobOptions options{
      .environment = {{RunJournal::kVariable, journal.path().string()}},
      .starter = ranks > 1 || !globals.launcher.empty() ? globals.starter(ranks) : std::vector<std::string>{},
      .interrupts = interrupts,
      .hang_limit = globals.hang_timeout.empty() ? kSupervisedLimit : globals.hang_limit()};
  Restarts allowed(journal, restarts);
  while (true) {
    const auto outcome = run_one_job(ranks, globals, options, journal);
    if (const auto* const code = std::get_if<ExitCode>(&outcome)) return *code;
    if (last_job_interrupt() != 0 || take_request() == Request::Stop) throw Error(std::get<Error>(outcome));
    allowed.note(std::get<Error>(outcome));
  }
}

}  // namespace hpr
