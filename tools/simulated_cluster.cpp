#include "tools/simulated_cluster.h"

#include <fmt/format.h>

#include <charconv>
#include <chrono>
#include <string>
#include <system_error>
#include <vector>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr int kMaxSimulatedRanks = 4096;

[[noreturn]] void refuse(std::string_view key, std::string_view value, const char* wanted) {
  throw Error(ExitCode::Usage, fmt::format("--simulate: {}={} is no {}", key, printable(value), wanted),
              "write it like hosts=64,ranks=512,latency=2us,bandwidth=12.5GB/s");
}

int whole_number(std::string_view key, std::string_view value) {
  int number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || number < 1 || number > kMaxSimulatedRanks) {
    refuse(key, value, "number from 1 to 4096");
  }
  return number;
}

double duration(std::string_view key, std::string_view value) {
  const auto time = parse_duration(value);
  if (!time) refuse(key, value, "duration");
  return std::chrono::duration<double>(*time).count();
}

double rate(std::string_view key, std::string_view value) {
  const std::string_view amount = value.ends_with("/s") ? value.substr(0, value.size() - 2) : value;
  const auto bytes = parse_bytes(amount);
  if (!bytes || *bytes == 0) refuse(key, value, "rate of bytes per second");
  return static_cast<double>(*bytes);
}

void apply(SimulatedCluster& cluster, std::string_view key, std::string_view value) {
  struct Count {
    const char* name;
    int* value;
  };
  struct Amount {
    const char* name;
    double* value;
    double (*parse)(std::string_view, std::string_view);
  };
  const std::vector<Count> counts{{"hosts", &cluster.hosts}, {"ranks", &cluster.ranks}, {"cores", &cluster.cores}};
  const std::vector<Amount> amounts{{"latency", &cluster.latency, duration},
                                    {"bandwidth", &cluster.bandwidth, rate},
                                    {"overhead", &cluster.overhead, duration},
                                    {"local-latency", &cluster.local_latency, duration},
                                    {"local-bandwidth", &cluster.local_bandwidth, rate},
                                    {"merge", &cluster.merge, rate}};
  std::vector<std::string> names;
  for (const Count& count : counts) {
    names.emplace_back(count.name);
    if (key != count.name) continue;
    *count.value = whole_number(key, value);
    return;
  }
  for (const Amount& amount : amounts) {
    names.emplace_back(amount.name);
    if (key != amount.name) continue;
    *amount.value = amount.parse(key, value);
    return;
  }
  throw Error(ExitCode::Usage, fmt::format("--simulate: a cluster has no '{}'", printable(key)),
              unknown_name_hint(printable(key), names));
}

}  // namespace

SimulatedCluster parse_simulation(std::string_view text) {
  SimulatedCluster cluster;
  for (const std::string& item : split_commas(text)) {
    const auto equals = item.find('=');
    if (equals == std::string::npos) refuse(item, "", "key with a value");
    apply(cluster, item.substr(0, equals), item.substr(equals + 1));
  }
  if (cluster.ranks < cluster.hosts) {
    throw Error(ExitCode::Usage,
                fmt::format("--simulate: {} ranks cannot be spread over {} hosts", cluster.ranks, cluster.hosts),
                "say ranks=N with at least one for every host");
  }
  cluster.bandwidth /= cluster.ranks_per_host();
  return cluster;
}

Json cluster_json(const SimulatedCluster& cluster) {
  return {{"hosts", cluster.hosts},
          {"ranks", cluster.ranks},
          {"cores", cluster.cores},
          {"latency_s", cluster.latency},
          {"bandwidth_of_a_rank", cluster.bandwidth},
          {"overhead_s", cluster.overhead},
          {"local_latency_s", cluster.local_latency},
          {"local_bandwidth", cluster.local_bandwidth},
          {"merge", cluster.merge}};
}

}  // namespace hpr
