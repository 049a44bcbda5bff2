#include "rt/photons/photon_maps.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/parallel.h"

namespace hpr {
namespace {

/// The power of two below what a photon carries in the mean, so that no scene's light leaves the range of floats.
double flux_unit_of(const LightSet& lights, const RaySettings& settings) {
  const double each = lights.power() / settings.photons;
  return each > 0.0 && std::isfinite(each) ? std::ldexp(1.0, std::ilogb(each)) : 1.0;
}

/// Photons that a rank's share of this machine's memory holds in all the places they take while maps are made of them.
std::uint64_t most_in_memory(const RaySettings& settings) {
  constexpr std::uint64_t kBytes = 128;
  const auto bytes =
      static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return bytes / (kBytes * static_cast<std::uint64_t>(settings.host_ranks));
}

PhotonSettings tracer_settings(const RaySettings& settings, const LightSet& lights) {
  PhotonSettings own;
  own.glossy_cutoff = settings.glossy_cutoff;
  own.caustics_only = !settings.global_photons;
  own.threads = settings.threads;
  own.flux_unit = flux_unit_of(lights, settings);
  own.most_kept = std::max<std::uint64_t>(most_in_memory(settings), 1);
  return own;
}

}  // namespace

PhotonSender::PhotonSender(const Scene& scene, const Surfaces& surfaces, const RaySpace& space, const RayScene& rays,
                           const LightSet& lights, const RaySettings& settings)
    : space_(space),
      settings_(settings),
      tracer_(
          scene, surfaces, space, rays,
          [&lights](double choice, const glm::dvec2& place, const glm::dvec2& direction) {
            return lights.emit(choice, place, direction);
          },
          tracer_settings(settings, lights)) {}

void PhotonSender::settle(Communicator& comm) {
  if (std::exchange(settled_, true)) return;
  // The power of lights is a sum of sines and cosines, which other machines may round otherwise.
  tracer_.set_flux_unit(all_gather_value(comm, tracer_.settings().flux_unit).front());
  // Every rank gets the photons of all; its own are a share of them.
  const auto ranks = static_cast<std::uint64_t>(comm.size());
  tracer_.set_most_kept(std::max<std::uint64_t>(tracer_.settings().most_kept / ranks, 1));
}

TracedPhotons PhotonSender::trace(const SampleNumber& number, Communicator* comm) {
  const std::uint64_t each = settings_.photons;
  PhotonRange range{each * number.sample, each};
  if (comm != nullptr) {
    settle(*comm);
    range = share_of_rank(range, comm->rank(), comm->size());
  }
  TracedPhotons traced = tracer_.trace({settings_.seed, number.frame}, range, each);
  counts_ += traced.counts;
  if (comm != nullptr) share_photons(*comm, traced);
  return traced;
}

void PhotonSender::choose_radii(const TracedPhotons& first) {
  caustic_radius_ = settings_.photon_radius;
  global_radius_ = settings_.photon_radius;
  if (settings_.photon_radius > 0.0) return;
  caustic_radius_ = first_radius(first.caustic, space_);
  global_radius_ = first_radius(first.global, space_);
}

const PhotonMaps& PhotonSender::send(const SampleNumber& number, Communicator* comm) {
  if (sent_ == number) return maps_;
  // Whatever sample comes first, radii are those of the very first one: a run that is resumed gives the same bits.
  const bool chooses = caustic_radius_ == 0.0;
  TracedPhotons traced;
  if (chooses && number != SampleNumber{}) choose_radii(trace({}, comm));
  traced = trace(number, comm);
  if (chooses && number == SampleNumber{}) choose_radii(traced);
  parallel_for(settings_.threads, 2, [&](std::size_t which) {
    const std::vector<Photon>& photons = which == 0 ? traced.caustic : traced.global;
    PhotonMap& map = which == 0 ? maps_.caustic : maps_.global;
    const double first = which == 0 ? caustic_radius_ : global_radius_;
    map = PhotonMap(photons, space_, progressive_radius(first, number.sample), tracer_.settings().flux_unit);
  });
  sent_ = number;
  return maps_;
}

PhotonCounts PhotonSender::take_counts() {
  return std::exchange(counts_, {});
}

}  // namespace hpr
