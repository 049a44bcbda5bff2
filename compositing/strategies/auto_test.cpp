#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/simulated_communicator.h"
#include "compositing/compositor.h"
#include "compositing/model/synthetic.h"
#include "core/error.h"

namespace hpr {
namespace {

/// Networks from slow to fast, with and without memory that is shared.
std::vector<Costs> machines() {
  std::vector<Costs> found;
  for (const int ranks : {2, 3, 8, 16}) {
    for (const int hosts : {1, 2}) {
      for (const double message : {1e-6, 1e-4, 1e-2}) {
        for (const double byte : {1e-11, 1e-9, 1e-7}) {
          Costs costs{.ranks = ranks, .hosts = hosts, .message = message, .pull_byte = byte, .swap_byte = 1.5 * byte};
          costs.collect_byte = 0.7 * byte;
          costs.reduce_byte = 5.0 * byte;
          costs.read_byte = 0.1 * byte;
          costs.meet = 0.1 * message;
          found.push_back(costs);
        }
      }
    }
  }
  return found;
}

Load load_of(int ranks, double drawn) {
  constexpr double kFrame = 16e6;
  return {.ranks = ranks,
          .frame = kFrame,
          .mean_layer = drawn * kFrame,
          .packed_fraction = 0.0,
          .drawn_tiles = drawn * kFrame * ranks,
          .area = kFrame * std::min(1.0, drawn * ranks)};
}

double seconds(const Compositor& compositor, const Costs& costs, const Load& load, bool collects) {
  const auto prediction = compositor.predict(costs, load);
  if (!prediction) return std::numeric_limits<double>::infinity();
  return collects ? prediction->collected(costs, load) : prediction->composite;
}

TEST(Auto, SharedMemoryIsReckonedWithHoweverQuickItIs) {
  // Where a meeting takes as long as a meeting and a merge, nothing is left for the merge.
  Costs costs = machines().front();
  costs.read_byte = 0.0;
  const Load load = load_of(costs.ranks, 0.5);
  const auto prediction = make_compositor("shared-memory")->predict(costs, load);
  ASSERT_TRUE(prediction);
  EXPECT_EQ(prediction->composite, 2.0 * costs.meet);
  EXPECT_EQ(seconds(*make_compositor("auto"), costs, load, true),
            seconds(*make_compositor("shared-memory"), costs, load, true));
  costs.read_byte.reset();
  EXPECT_FALSE(make_compositor("shared-memory")->predict(costs, load));
}

TEST(Auto, ChoosesWhatPredictsTheLeast) {
  std::vector<std::string> chosen;
  for (const Costs& costs : machines()) {
    for (const double drawn : {0.01, 0.5, 1.0}) {
      for (const bool collects : {false, true}) {
        for (const bool in_place : {false, true}) {
          const Load load = load_of(costs.ranks, drawn);
          const std::string name = cheapest_compositor(costs, load, collects, in_place);
          chosen.push_back(name);
          const double least = seconds(*make_compositor(name), costs, load, collects);
          for (const auto& other : all_compositors()) {
            if (other->name() == "auto" || (other->merges_in_place() && !in_place) || !other->fits(costs.ranks))
              continue;
            EXPECT_GE(seconds(*other, costs, load, collects), least) << other->name() << " against " << name;
          }
          EXPECT_TRUE(in_place || !make_compositor(name)->merges_in_place()) << name;
        }
      }
    }
  }
  std::ranges::sort(chosen);
  chosen.erase(std::ranges::unique(chosen).begin(), chosen.end());
  EXPECT_GE(chosen.size(), 4U) << "no strategy is best everywhere";
}

TEST(Auto, ChoosesAgainAsTheLoadChanges) {
  const SimulatedCluster cluster{.hosts = 4, .ranks = 4, .latency = 200e-6, .bandwidth = 1e9};
  const Size frame{1024, 512};
  std::vector<std::string> chosen;
  run_local_ranks(LocalRanks{.size = 4, .ranks_per_host = 1}, [&](Communicator& comm) {
    SimulatedCommunicator simulated(comm, cluster);
    const auto strategy = make_compositor("auto");
    for (int i = 0; i < 40; ++i) {
      TileLayer<Key> layer =
          synthetic_layer(i == 0 ? SyntheticKind::Sparse : SyntheticKind::Dense, comm.rank(), frame, 1);
      (void)strategy->composite(simulated, layer, all_tiles(layer.layout()));
      if (comm.rank() == 0) chosen.emplace_back(strategy->chosen());
    }
  });
  EXPECT_EQ(chosen[1], chosen[0]) << "looks cost messages, so not every frame has one";
  EXPECT_NE(chosen[39], chosen[0]);
}

/// A host without room for any memory that ranks share.
class NoRoomToShare final : public ForwardingCommunicator {
 public:
  using ForwardingCommunicator::ForwardingCommunicator;
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t /*bytes*/) override {
    throw Error(ExitCode::Limit, "no room");
  }
};

TEST(Auto, SendsMessagesWhereThereIsNoRoomToShareMemory) {
  run_local_ranks(3, [&](Communicator& comm) {
    NoRoomToShare alone(comm);
    const auto strategy = make_compositor("auto");
    TileLayer<Key> layer = synthetic_layer(SyntheticKind::Dense, comm.rank(), {256, 128}, 1);
    (void)strategy->composite(alone, layer, all_tiles(layer.layout()));
    EXPECT_NE(strategy->chosen(), "shared-memory");
  });
}

}  // namespace
}  // namespace hpr
