#include "tools/compare/compare_measure.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "cluster/transport/collectives.h"
#include "core/error.h"

namespace hpr {

void wait_for_all(Communicator& comm, PeerMemory* peers) {
  if (peers != nullptr && shared_by_all(*peers, comm.size())) {
    peers->meet();
  } else {
    barrier(comm);
  }
}

std::vector<std::vector<Sample>> gather_samples(Communicator& comm, const std::vector<Sample>& samples) {
  std::vector<std::vector<Sample>> all;
  for (const auto& bytes : gather(comm, std::as_bytes(std::span(samples)))) {
    all.emplace_back(bytes.size() / sizeof(Sample));
    std::memcpy(all.back().data(), bytes.data(), bytes.size());
  }
  return all;
}

void summarize(const std::vector<std::vector<Sample>>& ranks, CompareRun& run) {
  const std::size_t frames = ranks.front().size();
  std::vector<double> total(frames);
  std::vector<double> composite(frames);
  std::vector<double> collect(frames);
  std::vector<double> imbalance(frames);
  for (std::size_t frame = 0; frame < frames; ++frame) {
    double sum = 0.0;
    for (const auto& samples : ranks) {
      const Sample& sample = samples[frame];
      total[frame] = std::max(total[frame], sample.composite_ms + sample.collect_ms);
      composite[frame] = std::max(composite[frame], sample.composite_ms);
      collect[frame] = std::max(collect[frame], sample.collect_ms);
      sum += sample.composite_ms;
    }
    const double mean = sum / static_cast<double>(ranks.size());
    imbalance[frame] = mean > 0.0 ? composite[frame] / mean : 1.0;
  }
  run.ms = spread_of(total);
  run.ms_composite = spread_of(composite).median;
  run.ms_collect = spread_of(collect).median;
  run.imbalance = spread_of(imbalance).median;
  // Every frame sends the same.
  for (const auto& samples : ranks) {
    run.bytes_total += samples.back().bytes;
    run.bytes_max_rank = std::max(run.bytes_max_rank, samples.back().bytes);
    run.messages_total += samples.back().messages;
  }
}

Spread spread_of(std::vector<double> values) {
  HPR_CHECK(!values.empty());
  std::ranges::sort(values);
  const std::size_t count = values.size();
  const double median = (values[(count - 1) / 2] + values[count / 2]) / 2.0;
  const auto nearest_rank = static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(count)));
  return {values.front(), median, values[nearest_rank - 1], values.back()};
}

}  // namespace hpr
