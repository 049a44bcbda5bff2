#include "tools/compare/compare_threads.h"

#include <utility>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/simulated_communicator.h"
#include "tools/compare/simulate_option.h"

namespace hpr {

CompareResult compare_on_threads(int ranks, const std::string& simulate, std::chrono::nanoseconds hang_timeout,
                                 const CompareInput& input, const CompareSettings& settings) {
  CompareResult result;
  const auto compare = [&](Communicator& untraced) {
    TracingCommunicator comm(untraced);
    CompareResult here = compare_strategies(comm, input, settings);
    if (comm.rank() == 0) result = std::move(here);
  };
  LocalRanks local{.size = ranks, .hang_timeout = hang_timeout};
  if (simulate.empty()) {
    run_local_ranks(local, compare);
    return result;
  }
  const SimulatedCluster cluster = parse_simulation(simulate);
  local.ranks_per_host = cluster.ranks_per_host();
  run_local_ranks(local, [&](Communicator& comm) {
    SimulatedCommunicator simulated(comm, cluster);
    compare(simulated);
  });
  return result;
}

}  // namespace hpr
