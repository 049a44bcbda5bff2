#pragma once

#include <string_view>

#include "cluster/transport/simulated_communicator.h"
#include "core/json.h"

namespace hpr {

/// "hosts=64,ranks=512,latency=2us,bandwidth=12.5GB/s" and, as far as given, cores, overhead, local-latency,
/// local-bandwidth, merge (SimulatedCluster). `bandwidth` is a host's, which its ranks share. Throws Error (Usage) on
/// unknown keys, with the nearest one, and on values that make no sense.
[[nodiscard]] SimulatedCluster parse_simulation(std::string_view text);

/// All that a simulated cluster is, in seconds and bytes per second.
[[nodiscard]] Json cluster_json(const SimulatedCluster& cluster);

}  // namespace hpr
