#pragma once

#include <cstdint>
#include <optional>

#include "cluster/transport/communicator.h"
#include "rt/lights/light_set.h"
#include "rt/photons/photon_map.h"
#include "rt/photons/photon_tracer.h"
#include "rt/ray_settings.h"

namespace hpr {

/// The photons of one sample, ready to be gathered.
struct PhotonMaps {
  PhotonMap caustic;
  PhotonMap global;
};

/// Makes the photon maps of one sample after the other: every sample sends photons of its own, and their radius shrinks
/// from sample to sample, so that the mean of many has neither noise nor blur (Knaus and Zwicker, "Progressive Photon
/// Mapping: A Probabilistic Approach", 2011).
class PhotonSender {
 public:
  /// All that is referred to must outlive this. `rays` holds the whole scene.
  PhotonSender(const Scene& scene, const Surfaces& surfaces, const RaySpace& space, const RayScene& rays,
               const LightSet& lights, const RaySettings& settings);

  /// The maps of a sample; kept until another sample is asked for, or forget(). With a communicator, collective: its
  /// ranks share the work, and each gets all photons.
  const PhotonMaps& send(const SampleNumber& number, Communicator* comm);

  /// The next maps are made anew, with the radii of before.
  void forget() { sent_.reset(); }

  /// Of this rank, since the last call.
  [[nodiscard]] PhotonCounts take_counts();

 private:
  void settle(Communicator& comm);
  [[nodiscard]] TracedPhotons trace(const SampleNumber& number, Communicator* comm);
  void choose_radii(const TracedPhotons& first);

  RaySpace space_;
  RaySettings settings_;
  bool settled_ = false;  ///< what depends on the other ranks
  PhotonTracer tracer_;
  std::optional<SampleNumber> sent_;
  double caustic_radius_ = 0.0;  ///< metres, of a frame's first sample; 0: not chosen yet
  double global_radius_ = 0.0;
  PhotonMaps maps_;
  PhotonCounts counts_;
};

}  // namespace hpr
