#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "app/command.h"

/// Runs that go on until somebody ends them: SIGINT and SIGTERM ask them to, a second one ends them as ever.
namespace hpr {

/// What SIGINT and SIGTERM do to a job.
enum class Interrupts : std::uint8_t {
  End,   ///< end it
  Stop,  ///< the first one reaches its ranks as SIGUSR1: they come to an orderly end by themselves
};

/// run_ranks() where `interrupts` says what they do to a job that is started here.
[[nodiscard]] ExitCode run_ranks(const Globals& globals, const std::function<ExitCode(Communicator&)>& body,
                                 Interrupts interrupts);

/// The same of run_mpiexec(), for Interrupts::Stop.
int run_mpiexec_until_interrupted(int ranks, const std::vector<std::string>& args);

/// From now on SIGUSR1, SIGINT and SIGTERM of this process are Request::Stop of take_request(); a second SIGINT or
/// SIGTERM ends it.
void watch_interrupts();

}  // namespace hpr
