#include "gpu/light/gpu_photon_tracer.h"

#include <hpr/shaders/photon_arrive.h>
#include <hpr/shaders/photon_arrive_plain.h>
#include <hpr/shaders/photon_directions.h>
#include <hpr/shaders/photon_directions_plain.h>
#include <hpr/shaders/photon_scatter.h>
#include <hpr/shaders/photon_scatter_plain.h>
#include <hpr/shaders/photon_start.h>
#include <hpr/shaders/photon_start_plain.h>
#include <hpr/shaders/photon_trace.h>
#include <hpr/shaders/photon_trace_plain.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "core/error.h"
#include "scene/requirements.h"

namespace hpr {
namespace {

/// As in photon_state.glsl.
struct GpuPhotonInput {
  GpuPhotonInputs tables;
  std::uint64_t states = 0;
  std::uint64_t flights = 0;
  std::uint64_t live = 0;
  std::uint64_t kept = 0;
  std::uint64_t statuses = 0;
  std::uint64_t stream = 0;
  std::uint64_t first = 0;
  double fraction = 1.0;
  double glossy_cutoff = 0.0;
  double flux_unit = 1.0;
  std::uint32_t max_bounces = 0;
  std::uint32_t max_flights = 0;
  std::uint32_t caustics_only = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuPhotonInput) == 128);

struct GpuPhotonStatus {
  std::uint32_t waiting = 0;
  std::uint32_t rays = 0;
  std::uint32_t sent = 0;
  std::uint32_t lost = 0;
  std::uint32_t is_cut_off = 0;
};
static_assert(sizeof(GpuPhotonStatus) == 20);

struct GpuKeptPhoton {
  Photon stored;
  std::uint32_t kind = 0;
};
static_assert(sizeof(GpuKeptPhoton) == 40);
constexpr std::uint32_t kNotKept = 0;
constexpr std::uint32_t kKeptCaustic = 1;

/// Traced at once: a batch has a time limit, and each photon has kilobytes of memory while it is traced.
constexpr std::size_t kSoftwarePhotons = 8192;
constexpr std::size_t kDevicePhotons = 65536;
/// Of a photon that are under way together: more are rare, as smooth surfaces seldom make many of one.
constexpr std::uint32_t kMaxFlights = 8;
/// Surfaces that each photon may meet before the CPU looks.
constexpr std::size_t kMaxRounds = 8;
/// Of the photons traced at once: surfaces they may meet before the CPU looks, while all are under way.
constexpr std::size_t kFirstRounds = 2;

/// The steps of photons; those from the second on are repeated.
enum Step : std::size_t { Start, Trace, Arrive, Directions, Scatter };

/// By step.
std::array<GpuStep, 5> steps() {
  return {{{"device photon start", photon_start, photon_start_plain},
           {"device photon trace", photon_trace, photon_trace_plain},
           {"device photon arrive", photon_arrive, photon_arrive_plain},
           {"device photon directions", photon_directions, photon_directions_plain},
           {"device photon scatter", photon_scatter, photon_scatter_plain}}};
}

}  // namespace

std::string refusal_of_photons(const Scene& scene) {
  return has_coverage(scene) ? "photons that pass surfaces of partial coverage are the CPU's" : "";
}

/// Photons while they are traced.
struct GpuPhotonTracer::Piece {
  std::vector<std::uint32_t> live;          ///< those still under way
  std::vector<std::uint8_t> is_unfinished;  ///< by photon
  DevicePhotons left;                       ///< in the order it was read; by photon in the end

  /// By photon, each one's bounces in their order, without those that are not finished.
  void sort();
};

void GpuPhotonTracer::Piece::sort() {
  std::ranges::sort(left.unfinished);
  std::vector<std::size_t> starts(is_unfinished.size() + 1, 0);
  for (const KeptPhoton& one : left.kept) ++starts[one.photon + 1];
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  std::vector<KeptPhoton> sorted(left.kept.size());
  for (const KeptPhoton& one : left.kept) sorted[starts[one.photon]++] = one;
  std::erase_if(sorted, [&](const KeptPhoton& one) { return is_unfinished[one.photon] != 0; });
  left.kept = std::move(sorted);
}

GpuPhotonTracer::GpuPhotonTracer(const GpuDevice& device, const GpuPhotonInputs& inputs, bool extended)
    : device_(device),
      inputs_(inputs),
      photons_(device.info().software ? kSoftwarePhotons : kDevicePhotons),
      input_(device, sizeof(GpuPhotonInput), GpuMemory::Upload),
      steps_(device, steps(), {.extended = extended, .input = input_.address()}) {
  const auto layout = extended ? steps()[Scatter].shader : steps()[Scatter].plain_shader;
  state_bytes_ = array_stride(layout, "PhotonState");
  flight_bytes_ = array_stride(layout, "PhotonFlight");
}

std::vector<PassTime> GpuPhotonTracer::take_times() {
  std::vector<PassTime> times(steps_.times().begin(), steps_.times().end());
  steps_.clear_times();
  return times;
}

void GpuPhotonTracer::grow() {
  if (states_) return;
  const std::size_t kept_bytes = kFirstRounds * photons_ * sizeof(GpuKeptPhoton);
  flights_.emplace(device_, photons_ * kMaxFlights * flight_bytes_, GpuMemory::Device);
  live_.emplace(device_, photons_ * sizeof(std::uint32_t), GpuMemory::Upload);
  kept_.emplace(device_, kept_bytes, GpuMemory::Device);
  read_.emplace(device_, kept_bytes, GpuMemory::Readback);
  statuses_.emplace(device_, photons_ * sizeof(GpuPhotonStatus), GpuMemory::Readback);
  states_.emplace(device_, photons_ * state_bytes_, GpuMemory::Device);
}

void GpuPhotonTracer::write_input(const PhotonsToTrace& wanted) {
  input_.mapped<GpuPhotonInput>()[0] = {.tables = inputs_,
                                        .states = states_->address(),
                                        .flights = flights_->address(),
                                        .live = live_->address(),
                                        .kept = kept_->address(),
                                        .statuses = statuses_->address(),
                                        .stream = wanted.stream,
                                        .first = wanted.range.first,
                                        .fraction = wanted.fraction,
                                        .glossy_cutoff = wanted.settings.glossy_cutoff,
                                        .flux_unit = wanted.settings.flux_unit,
                                        .max_bounces = static_cast<std::uint32_t>(wanted.settings.max_bounces),
                                        .max_flights = kMaxFlights,
                                        .caustics_only = wanted.settings.caustics_only ? 1U : 0U};
}

/// What the live photons left in so many rounds, and which of them are still under way.
void GpuPhotonTracer::read_rounds(std::size_t rounds, Piece& piece) const {
  const std::size_t count = piece.live.size();
  const std::span<const GpuKeptPhoton> kept = read_->mapped<const GpuKeptPhoton>();
  const std::span<const GpuPhotonStatus> statuses = statuses_->mapped<const GpuPhotonStatus>();
  std::vector<std::uint32_t> live;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t photon = piece.live[i];
    for (std::size_t round = 0; round < rounds; ++round) {
      const GpuKeptPhoton& one = kept[round * count + i];
      if (one.kind != kNotKept) piece.left.kept.push_back({photon, one.kind == kKeptCaustic, one.stored});
    }
    const GpuPhotonStatus& status = statuses[i];
    if (status.is_cut_off != 0) {
      piece.left.unfinished.push_back(photon);
      piece.is_unfinished[photon] = 1;
    } else if (status.waiting > 0) {
      live.push_back(photon);
    } else {
      piece.left.counts.sent += status.sent;
      piece.left.counts.rays += status.rays;
      piece.left.counts.lost += status.lost;
    }
  }
  piece.live = std::move(live);
}

DevicePhotons GpuPhotonTracer::trace(const PhotonsToTrace& wanted) {
  HPR_CHECK(wanted.range.count <= photons_);
  grow();
  write_input(wanted);
  Piece piece;
  piece.is_unfinished.assign(wanted.range.count, 0);
  piece.live.resize(wanted.range.count);
  std::iota(piece.live.begin(), piece.live.end(), 0U);
  for (bool starts = true; !piece.live.empty(); starts = false) {
    if (wanted.is_overtaken && wanted.is_overtaken()) break;
    std::ranges::copy(piece.live, live_->mapped<std::uint32_t>().begin());
    const std::size_t count = piece.live.size();
    const std::size_t rounds = std::min(kFirstRounds * photons_ / count, kMaxRounds);
    if (starts) steps_.run(Start, count, count);
    for (std::size_t round = 0; round < rounds; ++round) {
      for (const Step step : {Trace, Arrive, Directions, Scatter}) {
        steps_.run(step, count, count, static_cast<std::uint32_t>(round));
      }
    }
    steps_.batch().copy(*kept_, *read_, rounds * count * sizeof(GpuKeptPhoton));
    steps_.finish();
    read_rounds(rounds, piece);
  }
  piece.sort();
  return std::move(piece.left);
}

}  // namespace hpr
