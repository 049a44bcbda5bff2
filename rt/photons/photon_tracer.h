#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "rt/deferred_shader.h"
#include "rt/lights/light_sampler.h"
#include "rt/materials/bsdf.h"
#include "rt/photons/adjoint_bsdf.h"
#include "rt/photons/photon_map.h"
#include "rt/ray_counts.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

struct PhotonSettings {
  double glossy_cutoff = 0.25;  ///< specular lobes smoother than it are followed from the eye (photon_query.h)
  bool caustics_only = false;   ///< photons end where they would cease to be caustic ones
  int max_bounces = 1024;       ///< roulette ends paths long before, but for scenes that absorb less than 1 %
  int threads = 1;
  double flux_unit = 1.0;      ///< W, a power of two: kept fluxes are floats and reach from 2^-126 to 2^127 of it
  std::uint64_t max_kept = 0;  ///< by one call of trace(); 0: any number
};

struct PhotonCounts {
  std::uint64_t sent = 0;
  std::uint64_t caustic = 0;  ///< photons kept
  std::uint64_t global = 0;
  std::uint64_t rays = 0;
  std::uint64_t invalid = 0;  ///< of the rays, those Embree could not bear
  std::uint64_t cut = 0;      ///< photons that ended among surfaces of partial coverage, see kMaxPassed
  std::uint64_t lost = 0;     ///< photons still under way after so many bounces, or no longer finite

  PhotonCounts& operator+=(const PhotonCounts& other);
  bool operator==(const PhotonCounts&) const = default;
};

/// Photons that have arrived, by photon sent, then by bounce.
struct TracedPhotons {
  std::vector<Photon> caustic;  ///< met only followed lobes on their way from the light
  std::vector<Photon> global;   ///< all others
  PhotonCounts counts;          ///< of what this rank traced
};

/// Photons [first, first + count).
struct PhotonRange {
  std::uint64_t first = 0;
  std::uint64_t count = 0;

  bool operator==(const PhotonRange&) const = default;
};

/// The part of `all` that a rank traces: parts follow one another in order of rank.
[[nodiscard]] PhotonRange share_of_rank(const PhotonRange& all, int rank, int ranks);

/// Where photons come from: LightSampler::emit.
using PhotonSource = std::function<std::optional<PhotonStart>(double u_choice, const glm::dvec2& u_place,
                                                              const glm::dvec2& u_direction)>;

/// A photon of a range that was kept.
struct KeptPhoton {
  std::uint32_t photon = 0;  ///< of the range, from 0
  bool caustic = false;      ///< see TracedPhotons
  Photon stored;
};

/// Photons that a device is to trace.
struct PhotonsToTrace {
  std::uint64_t stream = 0;  ///< photon_stream()
  PhotonRange range;         ///< up to PhotonDevice::max_photons()
  double fraction = 1.0;     ///< of its light's flux that each carries
  const PhotonSettings& settings;
  const std::function<bool()>& is_overtaken;  ///< asked now and then: the rest means nothing then; may be empty
};

/// What a device made of them.
struct DevicePhotons {
  std::vector<KeptPhoton> kept;           ///< by photon, then by bounce
  PhotonCounts counts;                    ///< but for the photons kept
  std::vector<std::uint32_t> unfinished;  ///< photons of the range, in order, that the CPU is to trace: nothing of them
                                          ///< is in the rest
};

/// Traces photons in the CPU's stead, by the steps and random numbers of PhotonTracer.
class PhotonDevice {
 public:
  PhotonDevice() = default;
  virtual ~PhotonDevice() = default;
  PhotonDevice(const PhotonDevice&) = delete;
  PhotonDevice& operator=(const PhotonDevice&) = delete;

  /// How many it traces at once.
  [[nodiscard]] virtual std::uint64_t max_photons() const = 0;
  [[nodiscard]] virtual DevicePhotons trace(const PhotonsToTrace& wanted) = 0;
  /// How long the device was at its steps since the last call: always the same steps.
  [[nodiscard]] virtual std::vector<PassTime> take_times() = 0;
};

/// Traces photons through the scene and stores them where paths from the eye will query them: at every arrival on a
/// surface with a lobe that those do not follow, except straight from the light (Jensen, "Global Illumination using
/// Photon Maps", 1996, with the partition of photon_query.h). Light that passes a surface of partial coverage still
/// comes straight from its light; light that glass lets through does not.
///
/// A photon depends on the key and its index only; threads, ranks and ranges change no bit.
class PhotonTracer {
 public:
  /// All that is referred to must outlive this.
  PhotonTracer(const Scene& scene, const Surfaces& surfaces, const RaySpace& space, const RayScene& rays,
               PhotonSource source, const PhotonSettings& settings)
      : scene_(scene),
        surfaces_(surfaces),
        space_(space),
        rays_(rays),
        source_(std::move(source)),
        settings_(settings),
        has_coverage_(has_coverage(scene)) {}

  [[nodiscard]] const PhotonSettings& settings() const { return settings_; }
  /// Settings of the next trace().
  void set_flux_unit(double watts) { settings_.flux_unit = watts; }
  void set_max_kept(std::uint64_t photons) { settings_.max_kept = photons; }
  /// From here on `device`, which must outlive this, traces what it can; null: nothing.
  void trace_on(PhotonDevice* device) { device_ = device; }

  /// Traces the photons of `range`, one of which carries 1 / `pass_photons` of the light's flux. Successive passes
  /// take successive ranges: the photons of all passes together are spread evenly. Throws Error (Limit) where more are
  /// kept than may be. Once `is_overtaken`, which several threads ask, most of the rest is left out.
  [[nodiscard]] TracedPhotons trace(const RandomKey& key, const PhotonRange& range, std::uint64_t pass_photons,
                                    const std::function<bool()>& is_overtaken = {}) const;

 private:
  struct Flight;
  struct Block;

  [[nodiscard]] TracedPhotons trace_on_device(const PhotonsToTrace& wanted) const;
  void finish(const PhotonsToTrace& wanted, DevicePhotons& found) const;
  void trace_block(std::uint64_t stream, const PhotonRange& range, double fraction, Block& block) const;
  void start(std::uint64_t stream, const PhotonRange& range, double fraction, Block& block) const;
  void move(Block& block) const;
  [[nodiscard]] bool arrive(Flight& flight, const SurfacePoint& surface, const Passed& met, Block& block) const;
  void keep(const Flight& flight, const glm::dvec3& flux, const SurfacePoint& surface, Block& block) const;
  void scatter(const Flight& flight, const FluxArrival& at, Block& block) const;
  [[nodiscard]] bool send_on(Flight& flight, const FluxArrival& at, const AdjointBsdf& scatters) const;

  const Scene& scene_;
  const Surfaces& surfaces_;
  const RaySpace& space_;
  const RayScene& rays_;
  PhotonSource source_;
  PhotonSettings settings_;
  bool has_coverage_;
  PhotonDevice* device_ = nullptr;
};

/// Collective: every rank's photons on every rank, in order of rank. The counts stay this rank's own.
void share_photons(Communicator& comm, TracedPhotons& photons);

/// Where photons of all indirect light are looked up: where the eye sees them, or where rays that gather light from
/// there end; these blur over what their map blurs.
enum class PhotonUse : std::uint8_t { Direct, Gathered };

/// Makes the photon maps of one sample after the other: every sample traces photons of its own, and their radius
/// shrinks from sample to sample, so that the mean of many has neither noise nor blur (Knaus and Zwicker, "Progressive
/// Photon Mapping: A Probabilistic Approach", 2011).
///
/// Where the settings know what a pixel covers, radii begin at two pixels: within them light that things keep off a
/// surface, or that ends at its edge, is missing, and wide ones show as dark rims. As many photons are sent as that
/// takes. Where they are too few, wider radii take in at least four of them, and so do those of photons that are
/// gathered; beside these caustics have radii that take in a sixteenth of that.
class PhotonMapBuilder {
 public:
  /// All that is referred to must outlive this. `rays` holds the whole scene.
  PhotonMapBuilder(const Scene& scene, const Surfaces& surfaces, const RaySpace& space, const RayScene& rays,
                   const LightSampler& lights, const RaySettings& settings, PhotonUse use = PhotonUse::Direct);

  /// The maps of a sample; kept until another sample is built, or discard(). With a communicator, collective: its
  /// ranks share the work, and each gets all photons.
  const PhotonMaps& build(const SampleNumber& number, Communicator* comm);

  /// As build(), but false on all ranks where `is_overtaken` (null: never) on any of them before its photons were
  /// traced: then the maps are made anew when next asked for. Ranks agree every tenth of a second or so.
  [[nodiscard]] bool build_while_wanted(const SampleNumber& number, Communicator& comm,
                                        const std::function<bool()>& is_overtaken);

  /// See PhotonTracer.
  void trace_on(PhotonDevice* device) { tracer_.trace_on(device); }

  /// The next maps are made anew, with the radii of before.
  void discard() { built_.reset(); }

  /// The counts of this rank since the last call.
  [[nodiscard]] PhotonCounts take_counts();

 private:
  void settle(Communicator& comm);
  /// Of these three, null functions and ranks without a communicator are never overtaken. Nothing where they are.
  [[nodiscard]] std::optional<TracedPhotons> trace(const SampleNumber& number, Communicator* comm,
                                                   const std::function<bool()>& is_overtaken);
  [[nodiscard]] bool make(const SampleNumber& number, Communicator* comm, const std::function<bool()>& is_overtaken);
  [[nodiscard]] bool fit_count(Communicator* comm, const std::function<bool()>& is_overtaken);
  [[nodiscard]] double choose_radius(std::span<const Photon> first, double footprint, double gathered) const;
  void map_sparse(std::vector<Photon>& photons, double radius);
  void choose_radii(const TracedPhotons& first);

  RaySpace space_;
  RaySettings settings_;
  PhotonUse use_;
  bool settled_ = false;  ///< what depends on the other ranks
  PhotonTracer tracer_;
  std::optional<SampleNumber> built_;
  double caustic_radius_ = 0.0;  ///< metres, of a frame's first sample; 0: not chosen yet
  double global_radius_ = 0.0;
  PhotonMaps maps_;
  PhotonCounts counts_;
};

}  // namespace hpr
