#include "tools/compare/distributions/distribution_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <limits>
#include <utility>

#include "cluster/distribution/balance.h"
#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "core/text.h"

namespace hpr {
namespace {

template <typename Value>
void append_all(std::vector<Value>& to, const std::vector<Value>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// What a file of a frame begins with.
struct FrameSizes {
  std::array<std::int32_t, 2> keys{};
  std::array<std::int32_t, 2> picture{};
};

}  // namespace

FrameStages stages_of(std::span<const RankFrame> ranks, Shading shading) {
  FrameStages stages;
  std::vector<double> done(ranks.size());  // per rank, by the stages so far
  double last = 0.0;
  const auto lasts = [&](double RankStages::*stage) {
    const double begin = last;
    for (std::size_t rank = 0; rank < ranks.size(); ++rank) {
      done[rank] += ranks[rank].stages.*stage;
      last = std::max(last, done[rank]);
    }
    return last - begin;
  };
  stages.exchange_ms = lasts(&RankStages::chunks_ms);
  stages.draw_ms = lasts(&RankStages::draw_ms);
  if (shading == Shading::Local) stages.light_ms = lasts(&RankStages::light_ms);
  stages.composite_ms = lasts(&RankStages::composite_ms);
  stages.exchange_ms += lasts(&RankStages::move_ms);
  if (shading == Shading::Deferred) stages.light_ms = lasts(&RankStages::light_ms);
  stages.exchange_ms += lasts(&RankStages::return_ms);
  stages.collect_ms = lasts(&RankStages::collect_ms);
  stages.exchange_ms += stages.collect_ms;
  return stages;
}

void DistributionRun::add(std::span<const RankFrame> frame, Shading shading) {
  const FrameStages stages = stages_of(frame, shading);
  ms.push_back(std::ranges::max(frame, {}, &RankFrame::ms).ms);
  draw_ms.push_back(stages.draw_ms);
  composite_ms.push_back(stages.composite_ms);
  light_ms.push_back(stages.light_ms);
  exchange_ms.push_back(stages.exchange_ms);
  collect_ms.push_back(stages.collect_ms);
  std::vector<double> work;
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
  for (const RankFrame& rank : frame) {
    work.push_back(rank.work_ms);
    bytes += rank.bytes;
    messages += rank.messages;
  }
  imbalance.push_back(slowest_over_mean(work));
  bytes_total.push_back(bytes);
  bytes_max_rank.push_back(std::ranges::max(frame, {}, &RankFrame::bytes).bytes);
  messages_total.push_back(messages);
}

void DistributionRun::append(const DistributionRun& more) {
  HPR_CHECK(distribution == more.distribution && ranks == more.ranks);
  for (const auto member :
       {&DistributionRun::ms, &DistributionRun::draw_ms, &DistributionRun::exchange_ms, &DistributionRun::composite_ms,
        &DistributionRun::light_ms, &DistributionRun::collect_ms, &DistributionRun::imbalance}) {
    append_all(this->*member, more.*member);
  }
  for (const auto member :
       {&DistributionRun::bytes_total, &DistributionRun::bytes_max_rank, &DistributionRun::messages_total}) {
    append_all(this->*member, more.*member);
  }
  for (std::size_t rank = 0; rank < memory_peak_bytes.size(); ++rank) {
    memory_peak_bytes[rank] = std::max(memory_peak_bytes[rank], more.memory_peak_bytes.at(rank));
  }
  if (memory_of == kMemoryOfRank) memory_of = more.memory_of;  // what is said of the peaks holds for all of them
  differing_pixels = std::max(differing_pixels, more.differing_pixels);
  if (chosen.find(more.chosen) == std::string::npos) chosen += ", " + more.chosen;
  if (!predicted_ms) predicted_ms = more.predicted_ms;
}

const std::vector<Column<DistributionRun>>& distribution_job_columns() {
  using Run = DistributionRun;
  static const std::vector<Column<Run>> columns{field<Run>("distribution", &Run::distribution),
                                                field<Run>("chosen", &Run::chosen),
                                                field<Run>("strategy", &Run::strategy),
                                                field<Run>("ranks", &Run::ranks),
                                                field<Run>("threads", &Run::threads),
                                                field<Run>("transport", &Run::transport),
                                                field<Run>("ms", &Run::ms),
                                                field<Run>("draw_ms", &Run::draw_ms),
                                                field<Run>("exchange_ms", &Run::exchange_ms),
                                                field<Run>("composite_ms", &Run::composite_ms),
                                                field<Run>("light_ms", &Run::light_ms),
                                                field<Run>("collect_ms", &Run::collect_ms),
                                                field<Run>("imbalance", &Run::imbalance),
                                                field<Run>("bytes_total", &Run::bytes_total),
                                                field<Run>("bytes_max_rank", &Run::bytes_max_rank),
                                                field<Run>("messages_total", &Run::messages_total),
                                                field<Run>("memory_peak_bytes", &Run::memory_peak_bytes),
                                                field<Run>("memory_of", &Run::memory_of),
                                                field<Run>("differing_pixels", &Run::differing_pixels),
                                                field<Run>("frame_xxh64", &Run::frame_xxh64),
                                                field<Run>("picture_xxh64", &Run::picture_xxh64),
                                                field<Run>("predicted_ms", &Run::predicted_ms)};
  return columns;
}

std::uint64_t count_differing(const WholeFrame& a, const WholeFrame& b) {
  if (a.keys.size() != b.keys.size() || a.picture.size() != b.picture.size()) return a.picture.size().area();
  const std::span<const Key> keys = a.keys.pixels();
  const std::span<const Rgba8> colors = a.picture.pixels();
  std::vector<bool> wrong(colors.size());
  std::uint64_t wrong_keys = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (keys[i] == b.keys.pixels()[i]) continue;
    ++wrong_keys;
    if (keys.size() == colors.size()) wrong[i] = true;
  }
  for (std::size_t i = 0; i < colors.size(); ++i) {
    if (!(colors[i] == b.picture.pixels()[i])) wrong[i] = true;
  }
  return std::max(wrong_keys, static_cast<std::uint64_t>(std::ranges::count(wrong, true)));
}

void write_frame(const std::filesystem::path& file, const WholeFrame& frame) {
  const FrameSizes sizes{{frame.keys.width(), frame.keys.height()}, {frame.picture.width(), frame.picture.height()}};
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  const auto write = [&](std::span<const std::byte> bytes) {
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  };
  write(std::as_bytes(std::span(&sizes, 1)));
  write(std::as_bytes(frame.keys.pixels()));
  write(std::as_bytes(frame.picture.pixels()));
  out.close();
  if (out.fail()) {
    throw Error(ExitCode::Io, "cannot keep the frame that others are compared with",
                fmt::format("free some space in {}, or name another folder with TMPDIR",
                            printable(temporary_folder().string(), 300)));
  }
}

WholeFrame read_frame(const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = read_file(file, std::numeric_limits<std::uint64_t>::max());
  FrameSizes sizes;
  HPR_CHECK(bytes.size() >= sizeof(sizes));
  std::memcpy(&sizes, bytes.data(), sizeof(sizes));
  WholeFrame frame{Image<Key>({sizes.keys[0], sizes.keys[1]}), Image<Rgba8>({sizes.picture[0], sizes.picture[1]})};
  const auto keys = std::as_writable_bytes(frame.keys.pixels());
  const auto colors = std::as_writable_bytes(frame.picture.pixels());
  HPR_CHECK(bytes.size() == sizeof(sizes) + keys.size() + colors.size());
  std::memcpy(keys.data(), bytes.data() + sizeof(sizes), keys.size());
  std::memcpy(colors.data(), bytes.data() + sizeof(sizes) + keys.size(), colors.size());
  return frame;
}

std::string DistributionJob::text() const {
  return Json{{"distribution", distribution},       {"ranks", ranks},        {"warmup", frames.warmup},
              {"frames", frames.measured},          {"quiet", is_quiet},     {"last", is_last},
              {"makes_reference", makes_reference}, {"reference", reference}}
      .dump();
}

std::optional<DistributionJob> DistributionJob::of_this_process() {
  const std::optional<std::string> text = job_request(kVariable);
  if (!text) return std::nullopt;
  try {
    const Json json = Json::parse(*text);
    return DistributionJob{.distribution = json.at("distribution").get<std::string>(),
                           .ranks = json.at("ranks").get<int>(),
                           .frames = {json.at("warmup").get<int>(), json.at("frames").get<int>()},
                           .is_quiet = json.at("quiet").get<bool>(),
                           .is_last = json.at("last").get<bool>(),
                           .makes_reference = json.at("makes_reference").get<bool>(),
                           .reference = json.at("reference").get<std::string>()};
  } catch (const JsonError& error) {
    throw Error(ExitCode::Internal, fmt::format("{} holds no request: {}", kVariable, error.what()));
  }
}

}  // namespace hpr
