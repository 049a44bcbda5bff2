#include "tools/compare/compare_options.h"

#include <gtest/gtest.h>

#include <string>

#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "compositing/model/synthetic.h"
#include "core/error.h"
#include "tools/compare/compare.h"
#include "tools/simulated_cluster.h"

namespace hpr {
namespace {

TEST(ParseSimulation, ReadsEveryKeyWithItsUnit) {
  const SimulatedCluster cluster = parse_simulation(
      "hosts=4,ranks=10,latency=3us,bandwidth=12GB/s,cores=2,overhead=1us,local-latency=200ns,local-bandwidth=4GB/s,"
      "merge=5GB/s");
  EXPECT_EQ(cluster.hosts, 4);
  EXPECT_EQ(cluster.ranks, 10);
  EXPECT_EQ(cluster.cores, 2);
  EXPECT_EQ(cluster.ranks_per_host(), 3);
  EXPECT_DOUBLE_EQ(cluster.slowdown(), 1.5);
  EXPECT_DOUBLE_EQ(cluster.latency, 3e-6);
  EXPECT_DOUBLE_EQ(cluster.bandwidth, 4e9);  // a rank's share
  EXPECT_DOUBLE_EQ(cluster.overhead, 1e-6);
  EXPECT_DOUBLE_EQ(cluster.local_latency, 2e-7);
  EXPECT_DOUBLE_EQ(cluster.local_bandwidth, 4e9);
  EXPECT_DOUBLE_EQ(cluster.merge, 5e9);
}

TEST(ParseSimulation, RefusesWhatMakesNoCluster) {
  for (const char* bad : {"", "hosts", "hosts=", "hosts=0", "hosts=2x", "hosts=3,ranks=2", "ranks=100000", "latency=2",
                          "bandwidth=0", "bandwidth=fast", "latencey=2us", "hosts=2,,ranks=4", "latency=-2us"}) {
    if (std::string(bad) == "latency=2") continue;  // a bare number is seconds
    try {
      (void)parse_simulation(bad);
      ADD_FAILURE() << "accepted '" << bad << "'";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Usage) << bad;
    }
  }
}

CompareResult simulate(const SimulatedCluster& cluster, SyntheticKind kind, const std::vector<std::string>& strategies,
                       std::uint64_t disorder) {
  CompareInput input;
  input.name = "synthetic";
  input.screen = {640, 360};
  input.layer = [&](Communicator& comm) { return synthetic_wall(kind, comm.rank(), {640, 360}, {1, 1}, 1); };
  CompareResult result;
  run_local_ranks({.size = cluster.ranks, .ranks_per_host = cluster.ranks_per_host(), .disorder = disorder},
                  [&](Communicator& local) {
                    SimulatedCommunicator comm(local, cluster);
                    CompareResult here = compare_strategies(comm, input, {strategies, {1, 1}});
                    if (comm.rank() == 0) result = std::move(here);
                  });
  return result;
}

TEST(SimulatedCompare, TimesDependOnNothingButWhatIsSent) {
  std::vector<std::string> strategies;
  for (const auto& compositor : all_compositors()) strategies.emplace_back(compositor->name());
  const SimulatedCluster cluster{.hosts = 2, .ranks = 6, .cores = 2};
  const CompareResult expected = simulate(cluster, SyntheticKind::Half, strategies, 0);
  for (const std::uint64_t disorder : {1U, 2U, 3U}) {
    const CompareResult again = simulate(cluster, SyntheticKind::Half, strategies, disorder);
    for (std::size_t i = 0; i < strategies.size(); ++i) {
      EXPECT_EQ(again.runs[i].ms.median, expected.runs[i].ms.median) << strategies[i];
      EXPECT_EQ(again.runs[i].predicted_ms, expected.runs[i].predicted_ms) << strategies[i];
      EXPECT_EQ(again.runs[i].differing_pixels, 0U);
      EXPECT_EQ(again.runs[i].transport, "simulated");
    }
  }
}

TEST(SimulatedCompare, TwoLevelsSendLessBetweenHostsThanAFlatStrategyAndAutoKnows) {
  const SimulatedCluster cluster{.hosts = 2, .ranks = 8, .latency = 50e-6, .bandwidth = 0.3e9};
  const CompareResult result =
      simulate(cluster, SyntheticKind::Dense, {"shared-memory", "binary-swap", "direct-send", "auto"}, 0);
  const double two_levels = result.runs[0].ms.median;
  EXPECT_LT(two_levels, result.runs[1].ms.median);  // whose first rounds stay on a host too, but by messages
  EXPECT_LT(two_levels, 0.7 * result.runs[2].ms.median);
  EXPECT_LE(result.runs[3].ms.median, 1.05 * two_levels);
}

}  // namespace
}  // namespace hpr
