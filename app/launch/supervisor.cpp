#include "app/launch/supervisor.h"

#include <fmt/format.h>

#include <optional>
#include <string>

#include "app/launch/run_ranks.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "walls/manifest/run_journal.h"

namespace hpr {

ExitCode run_supervised(const Globals& globals, int restarts, Interrupts interrupts,
                        const std::function<ExitCode(Communicator&)>& body) {
  if (inside_mpi_job() || globals.ranks <= 1 || restarts <= 0)
    return run_ranks(globals, body, {.interrupts = interrupts});
  RunJournal journal;
  // The launcher's own words, which name the rank and its host, are wanted here.
  const JobOptions options{
      .environment = {{RunJournal::kVariable, journal.path().string()}, {"OMPI_MCA_orte_execute_quiet", "0"}},
      .interrupts = interrupts,
      .hang_limit = globals.hang_limit()};
  std::optional<std::size_t> ended_at;
  for (int restart = 0;; ++restart) {
    std::optional<Error> lost;
    try {
      const auto code = static_cast<ExitCode>(run_mpiexec(globals.ranks, globals.args, options));
      if ((code != ExitCode::Hang && code != ExitCode::Lost) || journal.read().ended) return code;
      lost.emplace(code, code == ExitCode::Hang ? "the job stood still" : "the job lost a rank");
    } catch (const Error& error) {
      if (error.code() != ExitCode::Lost) throw;
      lost.emplace(error);
    }
    const std::size_t done = journal.read().frames.size();
    if (restart == restarts || ended_at == done) {
      throw Error(lost->code(), fmt::format("{}; {} of its frames are done", lost->what(), done),
                  ended_at == done ? "frame " + std::to_string(done) + " ended two jobs; draw it alone to see why"
                                   : fmt::format("it was started again {} times; see --restarts", restart));
    }
    ended_at = done;
    log::warning("{}; starting it again from frame {} (restart {} of {})", lost->what(), done, restart + 1, restarts);
    journal.add_restart(lost->what());
  }
}

}  // namespace hpr
