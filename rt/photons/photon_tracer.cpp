#include "rt/photons/photon_tracer.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "rt/lights/punctual_light.h"
#include "rt/photons/photon_query.h"
#include "rt/trace/coverage_traversal.h"
#include "rt/trace/ray_scene.h"

namespace hpr {
namespace {

/// Photons traced together, generation by generation: enough to fill packets after most have been absorbed, few enough
/// for the cache.
constexpr std::uint64_t kBlockPhotons = 2048;

/// Bounces before roulette begins: short paths carry most of the light, and all arrive.
constexpr int kFirstBounces = 3;

double sum_of(const glm::dvec3& v) {
  return v.r + v.g + v.b;
}

/// False for no light at all and for what is not a number.
bool carries_light(const glm::dvec3& flux) {
  return sum_of(flux) > 0.0 && std::isfinite(sum_of(flux));
}

template <typename Value>
void append(std::vector<Value>& to, const std::vector<Value>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

void share(Communicator& comm, std::vector<Photon>& photons) {
  const auto parts = all_gather(comm, std::as_bytes(std::span(photons)));
  std::size_t bytes = 0;
  for (const auto& part : parts) bytes += part.size();
  photons.resize(bytes / sizeof(Photon));
  auto* to = reinterpret_cast<std::byte*>(photons.data());
  for (const auto& part : parts) to = std::copy(part.begin(), part.end(), to);
}

}  // namespace

PhotonCounts& PhotonCounts::operator+=(const PhotonCounts& other) {
  sent += other.sent;
  caustic += other.caustic;
  global += other.global;
  rays += other.rays;
  invalid += other.invalid;
  cut += other.cut;
  lost += other.lost;
  return *this;
}

PhotonRange share_of_rank(const PhotonRange& all, int rank, int ranks) {
  const auto size = static_cast<std::uint64_t>(ranks);
  const auto from = [&](std::uint64_t r) { return all.count / size * r + all.count % size * r / size; };
  const auto r = static_cast<std::uint64_t>(rank);
  return {all.first + from(r), from(r + 1) - from(r)};
}

struct PhotonTracer::Flight {
  Sampler sampler;
  glm::dvec3 position{0.0};  ///< world: where it was scattered last
  glm::dvec3 origin{0.0};    ///< ray space: off that surface
  glm::dvec3 direction{0.0};
  glm::dvec3 flux{0.0};
  Media media;             ///< that it flies through
  glm::dvec3 center{0.0};  ///< of its light, and how far that reaches (PhotonStart)
  double range = 0.0;
  std::uint32_t photon = 0;  ///< of the block
  int bounces = 0;
  int passed = 0;        ///< surfaces since then that do not cover all
  Passed last;           ///< the last of the surfaces passed
  bool followed = true;  ///< has met followed lobes only
  bool endless = false;  ///< still comes from without the scene
};

/// Photons under way together and what they left.
struct PhotonTracer::Block {
  std::vector<Flight> flights;
  std::vector<Flight> next;
  std::vector<KeptPhoton> kept;
  RayBatch batch;
  std::vector<std::uint32_t> hits;
  std::vector<Passed> met;  ///< by the same flights
  WorldTriangle triangle;
  TracedPhotons traced;

  /// From the order of generations into that of photons; each one's bounces keep their order.
  void sort() {
    std::ranges::stable_sort(kept, {}, &KeptPhoton::photon);
    store(kept, traced);
  }

  /// Those of both kinds in their order.
  static void store(const std::vector<KeptPhoton>& kept, TracedPhotons& traced) {
    for (const KeptPhoton& one : kept) (one.caustic ? traced.caustic : traced.global).push_back(one.stored);
    traced.counts.caustic = traced.caustic.size();
    traced.counts.global = traced.global.size();
  }
};

namespace {

/// Counts what the threads of a rank keep: memory that is overcommitted ends programs without an error message.
class KeptPhotons {
 public:
  /// 0: any number.
  explicit KeptPhotons(std::uint64_t most) : most_(most) {}

  void add(std::uint64_t count) {
    if (kept_.fetch_add(count) + count <= most_ || most_ == 0) return;
    throw Error(ExitCode::Limit, "the photons of one sample take more memory than this machine has",
                "send fewer in a sample and take more samples (--photons, --spp), or run fewer ranks on a host");
  }

 private:
  std::uint64_t most_;
  std::atomic<std::uint64_t> kept_{0};
};

}  // namespace

TracedPhotons PhotonTracer::trace(const RandomKey& key, const PhotonRange& range, std::uint64_t pass_photons,
                                  const std::function<bool()>& is_overtaken) const {
  const std::uint64_t stream = photon_stream(key);
  const double fraction = 1.0 / static_cast<double>(pass_photons);
  if (device_ != nullptr) return trace_on_device({stream, range, fraction, settings_, is_overtaken});
  const std::uint64_t count = (range.count + kBlockPhotons - 1) / kBlockPhotons;
  std::vector<TracedPhotons> traced(count);
  KeptPhotons kept(settings_.max_kept);
  const auto trace_one = [&](std::size_t i) {
    if (is_overtaken && is_overtaken()) return;
    Block block;
    const std::uint64_t before = i * kBlockPhotons;
    trace_block(stream, {range.first + before, std::min(kBlockPhotons, range.count - before)}, fraction, block);
    block.sort();
    kept.add(block.traced.caustic.size() + block.traced.global.size());
    traced[i] = std::move(block.traced);
  };
  rays_.for_each(settings_.threads, count, trace_one, CallMemory::Small);
  TracedPhotons all;
  for (const TracedPhotons& part : traced) {
    append(all.caustic, part.caustic);
    append(all.global, part.global);
    all.counts += part.counts;
  }
  return all;
}

void PhotonTracer::trace_block(std::uint64_t stream, const PhotonRange& range, double fraction, Block& block) const {
  const DenormalsAsZero mode;
  start(stream, range, fraction, block);
  block.batch.purpose = {RayKind::Photon};
  for (; !block.flights.empty(); ++block.batch.purpose.generation) move(block);
}

/// As many at once as the device takes: what they leave is counted before more are traced.
TracedPhotons PhotonTracer::trace_on_device(const PhotonsToTrace& wanted) const {
  KeptPhotons kept(settings_.max_kept);
  TracedPhotons all;
  PhotonsToTrace some = wanted;
  for (std::uint64_t done = 0; done < wanted.range.count; done += some.range.count) {
    if (wanted.is_overtaken && wanted.is_overtaken()) break;
    some.range = {wanted.range.first + done, std::min(device_->max_photons(), wanted.range.count - done)};
    DevicePhotons found = device_->trace(some);
    finish(some, found);
    kept.add(found.kept.size());
    all.counts += found.counts;
    Block::store(found.kept, all);
  }
  return all;
}

/// What the device left out is traced photon by photon.
void PhotonTracer::finish(const PhotonsToTrace& wanted, DevicePhotons& found) const {
  if (found.unfinished.empty()) return;
  std::vector<DevicePhotons> rest(found.unfinished.size());
  const auto trace_one = [&](std::size_t i) {
    if (wanted.is_overtaken && wanted.is_overtaken()) return;
    Block block;
    trace_block(wanted.stream, {wanted.range.first + found.unfinished[i], 1}, wanted.fraction, block);
    for (KeptPhoton& one : block.kept) one.photon = found.unfinished[i];
    rest[i] = {std::move(block.kept), block.traced.counts, {}};
  };
  rays_.for_each(settings_.threads, rest.size(), trace_one, CallMemory::Small);
  for (const DevicePhotons& one : rest) {
    append(found.kept, one.kept);
    found.counts += one.counts;
  }
  std::ranges::stable_sort(found.kept, {}, &KeptPhoton::photon);
}

void PhotonTracer::start(std::uint64_t stream, const PhotonRange& range, double fraction, Block& block) const {
  for (std::uint64_t i = 0; i < range.count; ++i) {
    const std::uint64_t index = range.first + i;
    Flight flight;
    // The sampler counts to 2^32; a stream of its own follows.
    flight.sampler = Sampler(stream + (index >> 32U), static_cast<std::uint32_t>(index));
    const double u_choice = flight.sampler.one();
    const glm::dvec2 u_place = flight.sampler.two();
    const std::optional<PhotonStart> begin = source_(u_choice, u_place, flight.sampler.two());
    if (!begin) continue;
    ++block.traced.counts.sent;
    flight.flux = begin->flux * fraction;
    if (!carries_light(flight.flux)) continue;
    flight.position = begin->origin;
    flight.direction = begin->direction;
    flight.media = begin->media;
    flight.center = begin->center;
    flight.range = begin->range;
    flight.endless = begin->endless;
    glm::dvec3 origin = begin->origin;
    if (begin->surface != kNoSurface) {
      surfaces_.load(begin->surface, block.triangle);
      const double side = glm::dot(block.triangle.normal, begin->direction) < 0.0 ? -1.0 : 1.0;
      origin += side * std::max(begin->offset, space_.rounding_at(origin)) * block.triangle.normal;
    }
    flight.origin = space_.from_world(origin);
    flight.photon = static_cast<std::uint32_t>(i);
    block.flights.push_back(flight);
  }
}

/// One generation: all flights to the next surface, and on.
void PhotonTracer::move(Block& block) const {
  block.batch.clear();
  block.met.clear();
  for (const Flight& flight : block.flights) {
    block.met.push_back(flight.last);
    block.batch.push(flight.origin, flight.direction, std::numeric_limits<double>::infinity());
  }
  block.hits.resize(block.flights.size());
  block.traced.counts.rays += block.flights.size();
  block.traced.counts.invalid +=
      has_coverage_ ? rays_.closest(block.batch, block.met, block.hits) : rays_.closest(block.batch, block.hits);
  surfaces_.prefetch(block.hits, block.batch.purpose.generation);
  block.next.clear();
  for (std::size_t i = 0; i < block.flights.size(); ++i) {
    if (block.hits[i] == kNoSurface) continue;
    Flight& flight = block.flights[i];
    surfaces_.load(block.hits[i], block.triangle);
    const SurfacePoint surface = surfaces_.meet(block.triangle, flight.position, flight.direction);
    if (arrive(flight, surface, block.met[i], block)) block.next.push_back(flight);
  }
  std::swap(block.flights, block.next);
}

void PhotonTracer::keep(const Flight& flight, const glm::dvec3& flux, const SurfacePoint& surface, Block& block) const {
  const glm::dvec3 at = space_.from_world(surface.position);
  Photon photon;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    photon.position[axis] = static_cast<float>(at[static_cast<int>(axis)]);
    photon.flux[axis] = static_cast<float>(flux[static_cast<int>(axis)] / settings_.flux_unit);
  }
  photon.facing = pack_facing(surface.geometric_normal, surface.layer);
  photon.direction = pack_direction(surface.to_viewer);
  photon.traveled = static_cast<float>(glm::distance(surface.position, flight.position));
  block.kept.push_back({flight.photon, flight.followed, photon});
}

/// Keeps the photon if it is wanted here, and scatters it into the block's next ones; true where it passes instead.
bool PhotonTracer::arrive(Flight& flight, const SurfacePoint& surface, const Passed& met, Block& block) const {
  MaterialPoint material = evaluate_material(scene_, surface);
  const double metres = glm::distance(surface.position, flight.position);
  // As to lights: nothing is taken from endless ways.
  glm::dvec3 flux =
      flight.endless ? flight.flux : flight.flux * transmittance_to(flight.media, surface, material, metres);
  if (flight.bounces == 0) flux *= range_window(glm::distance(surface.position, flight.center), flight.range);
  if (disperses(material)) choose_channel(material, flux, flight.sampler.one());
  const Bsdf bsdf(material, surface, Carried::Flux);
  // Whoever gathers counts as much of the surface as there is: all that falls on it is kept, passing or not.
  if (flight.bounces > 0 && material.alpha > 0.0 && carries_light(flux) &&
      takes_photons(bsdf, settings_.glossy_cutoff)) {
    keep(flight, flux, surface, block);
  }
  if (passes_by_chance(material.alpha, flight.sampler)) {
    const double gained = met.distance - flight.last.distance;
    flight.last = met;
    if (passes_on(flight.passed, material.alpha, gained)) return true;
    ++block.traced.counts.cut;
    return false;
  }
  flight.flux = flux;
  if (!carries_light(flight.flux)) return false;
  if (flight.bounces < settings_.max_bounces) {
    scatter(flight, {surface, material, bsdf, block.triangle}, block);
  } else {
    ++block.traced.counts.lost;
  }
  return false;
}

/// A surface whose shading normal leans towards the light sends on many times what falls on it. It does so by as many
/// photons: bright ones among others would leave the mean of any number of them to chance.
void PhotonTracer::scatter(const Flight& flight, const FluxArrival& at, Block& block) const {
  constexpr double kMaxCopies = 64.0;
  const AdjointBsdf scatters(scene_, surfaces_, at);
  const auto copies = static_cast<std::uint32_t>(std::clamp(scatters.gain(), 1.0, kMaxCopies));
  for (std::uint32_t i = 0; i < copies; ++i) {
    Flight copy = flight;
    copy.flux /= copies;
    if (i > 0) copy.sampler = flight.sampler.branch(i);
    if (send_on(copy, at, scatters)) block.next.push_back(copy);
  }
}

/// Chooses a lobe by what it makes of the photon's flux, then a direction. After the first bounces the photon ends with
/// the chance that its light is absorbed.
bool PhotonTracer::send_on(Flight& flight, const FluxArrival& at, const AdjointBsdf& scatters) const {
  const SurfacePoint& surface = at.surface;
  std::array<double, kLobes.size()> chances{};
  double total = 0.0;
  const std::size_t lobes = at.bsdf.lobes().size();
  for (std::size_t i = 0; i < lobes; ++i) {
    chances[i] = sum_of(flight.flux * scatters.weight(kLobes[i])) / sum_of(flight.flux);
    total += chances[i];
  }
  if (!(total > 0.0) || !std::isfinite(total)) return false;
  const double whole = flight.bounces < kFirstBounces ? total : std::max(total, 1.0);
  double left = flight.sampler.one() * whole;
  std::size_t chosen = 0;
  while (chosen < lobes && left >= chances[chosen]) left -= chances[chosen++];
  if (chosen == lobes) return false;
  const bool follows = is_followed(at.bsdf, kLobes[chosen], settings_.glossy_cutoff);
  if (settings_.caustics_only && !follows) return false;
  const std::optional<BsdfSample> sample = scatters.sample(kLobes[chosen], flight.sampler);
  if (!sample) return false;

  flight.flux *= sample->weight * (whole / chances[chosen]);
  if (!carries_light(flight.flux)) return false;
  flight.followed = flight.followed && follows;
  flight.media = media_towards(flight.media, surface, at.material, sample->direction);
  flight.direction = sample->direction;
  flight.position = surface.position;
  flight.passed = 0;
  flight.last = {};
  flight.endless = false;
  flight.origin = space_.from_world(ray_origin(surface, flight.direction));
  ++flight.bounces;
  return true;
}

void share_photons(Communicator& comm, TracedPhotons& photons) {
  share(comm, photons.caustic);
  share(comm, photons.global);
}

namespace {

/// The power of two below what a photon carries in the mean, so that no scene's light leaves the range of floats.
double flux_unit_of(const LightSampler& lights, const RaySettings& settings) {
  const double each = lights.power() / settings.photons;
  return each > 0.0 && std::isfinite(each) ? std::ldexp(1.0, std::ilogb(each)) : 1.0;
}

/// Photons that a rank's share of this machine's memory holds in all the places they take while maps are made of them.
std::uint64_t max_in_memory(const RaySettings& settings) {
  constexpr std::uint64_t kBytes = 128;
  const auto bytes =
      static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return bytes / (kBytes * static_cast<std::uint64_t>(settings.host_ranks));
}

PhotonSettings tracer_settings(const RaySettings& settings, const LightSampler& lights) {
  PhotonSettings own;
  own.glossy_cutoff = settings.glossy_cutoff;
  own.caustics_only = !settings.global_photons;
  own.threads = settings.threads;
  own.flux_unit = flux_unit_of(lights, settings);
  own.max_kept = std::max<std::uint64_t>(max_in_memory(settings), 1);
  return own;
}

}  // namespace

namespace {

// Photons that a first radius takes in, where they lie about as dense as most of them do.
constexpr double kDense = 50.0;  ///< where one sample is to show no noise
/// Pixels that it spans.
constexpr double kFootprints = 2.0;

/// Light that comes to a surface from within so many radii is too uneven for photons that are gathered.
constexpr double kNearRadii = 2.0;

/// Of what a radius takes in, what is enough for caustics alone: their edges show what wide radii blur, and all other
/// light has more noise.
constexpr double kCausticFraction = 1.0 / 16.0;

/// Photons that are gathered are sparse where a cell so many radii wide holds fewer than kSparse, a fifth of what it
/// holds where most lie, and are looked up from up to so far; sparser ones by cells of the square of that. With fewer
/// to a cell, chance would leave photons dense among sparse ones, and each of them bright.
constexpr double kSparseRadii = 8.0;
constexpr std::uint32_t kSparse = 16;
/// Radians about a ray that gathers, in the first sample: what it blurs the surface that it gathers for does not show.
constexpr double kFootprint = 0.25;

constexpr std::uint32_t kPilotPhotons = 4096;
constexpr double kPilotDense = 12.0;
/// No more are sent for than so many in the footprint; where more are to be gathered, radii are wider.
constexpr double kMaxFilled = 16.0;
constexpr std::uint32_t kMinPhotons = 1000;
constexpr std::uint32_t kMinGathered = 16'384;

}  // namespace

PhotonMapBuilder::PhotonMapBuilder(const Scene& scene, const Surfaces& surfaces, const RaySpace& space,
                                   const RayScene& rays, const LightSampler& lights, const RaySettings& settings,
                                   PhotonUse use)
    : space_(space),
      settings_(settings),
      use_(use),
      tracer_(
          scene, surfaces, space, rays,
          [&lights](double choice, const glm::dvec2& position, const glm::dvec2& direction) {
            return lights.emit(choice, position, direction);
          },
          tracer_settings(settings, lights)) {}

void PhotonMapBuilder::settle(Communicator& comm) {
  if (std::exchange(settled_, true)) return;
  // The power of lights is a sum of sines and cosines, which other machines may round otherwise.
  tracer_.set_flux_unit(all_gather_value(comm, tracer_.settings().flux_unit).front());
  // Every rank gets the photons of all; its own are a share of them.
  const auto ranks = static_cast<std::uint64_t>(comm.size());
  tracer_.set_max_kept(std::max<std::uint64_t>(tracer_.settings().max_kept / ranks, 1));
}

namespace {

/// Traces a rank's photons a few blocks at a time, between which all ranks agree on whether they are still wanted.
/// Photons and their order are those of one go.
std::optional<TracedPhotons> trace_while_wanted(const PhotonTracer& tracer, const RandomKey& key,
                                                const PhotonRange& range, std::uint64_t pass_photons,
                                                Communicator& comm, const std::function<bool()>& is_overtaken) {
  struct Progress {
    bool overtaken = false;
    bool done = false;
  };
  constexpr double kBetween_ms = 100.0;  // agreements: what other ranks trace in vain at most
  const std::uint64_t least = 4 * kBlockPhotons * static_cast<std::uint64_t>(std::max(tracer.settings().threads, 1));
  // One rank has nobody to agree with.
  std::uint64_t count = comm.size() == 1 ? range.count : least;
  PhotonTracer some = tracer;
  TracedPhotons traced;
  for (std::uint64_t first = 0;;) {
    count = std::min(count, range.count - first);
    const Stopwatch watch;
    const TracedPhotons part = some.trace(key, {range.first + first, count}, pass_photons, is_overtaken);
    append(traced.caustic, part.caustic);
    append(traced.global, part.global);
    traced.counts += part.counts;
    if (const std::uint64_t most = tracer.settings().max_kept; most > 0) {
      some.set_max_kept(most - std::min(traced.caustic.size() + traced.global.size(), most - 1));
    }
    first += count;
    const Progress mine{is_overtaken(), first == range.count};
    const std::vector<Progress> all = all_gather_value(comm, mine);
    if (std::ranges::any_of(all, &Progress::overtaken)) return std::nullopt;
    if (std::ranges::all_of(all, &Progress::done)) return traced;
    if (count > 0) {
      const double wanted = static_cast<double>(count) * kBetween_ms / std::max(watch.ms(), 1.0);
      count = std::clamp(static_cast<std::uint64_t>(wanted), least, 4 * count + least);
    }
  }
}

}  // namespace

std::optional<TracedPhotons> PhotonMapBuilder::trace(const SampleNumber& number, Communicator* comm,
                                                     const std::function<bool()>& is_overtaken) {
  const std::uint64_t each = settings_.photons;
  PhotonRange range{each * number.sample, each};
  const RandomKey key{settings_.seed, number.frame};
  if (comm != nullptr) {
    settle(*comm);
    range = share_of_rank(range, comm->rank(), comm->size());
  }
  std::optional<TracedPhotons> traced = comm != nullptr && is_overtaken
                                            ? trace_while_wanted(tracer_, key, range, each, *comm, is_overtaken)
                                            : tracer_.trace(key, range, each);
  if (!traced) return traced;
  counts_ += traced->counts;
  if (comm != nullptr) share_photons(*comm, *traced);
  return traced;
}

/// Sends as many photons as fill the radii that the footprint wants, by what a few of them show of where light goes.
bool PhotonMapBuilder::fit_count(Communicator* comm, const std::function<bool()>& is_overtaken) {
  if (!std::exchange(settings_.fits_photons, false) || !(settings_.photon_footprint > 0.0)) return true;
  const std::uint32_t most = settings_.photons;
  settings_.photons = std::min(most, kPilotPhotons);
  const PhotonCounts counted = counts_;  // a sample's rays are those of every sample
  const std::optional<TracedPhotons> pilot = trace({}, comm, is_overtaken);
  counts_ = counted;
  if (!pilot) {
    settings_.photons = most;
    settings_.fits_photons = true;
    return false;
  }
  // What rays gather is blurred from afar; caustics are looked at.
  const bool gathered = use_ == PhotonUse::Gathered;
  const std::vector<Photon>& seen = gathered ? pilot->caustic : pilot->global;
  const std::uint32_t fewest = std::min(gathered ? kMinGathered : kMinPhotons, most);
  if (seen.empty()) {
    if (gathered) settings_.photons = fewest;
    return true;
  }
  const double wide = first_radius(seen, space_, kPilotDense) / (kFootprints * settings_.photon_footprint);
  const double filled = std::min(settings_.photons_gathered, kMaxFilled);
  const double wanted = settings_.photons * (filled / kPilotDense) * wide * wide;
  settings_.photons =
      static_cast<std::uint32_t>(std::clamp(wanted, static_cast<double>(fewest), static_cast<double>(most)));
  return true;
}

/// `footprint`: metres of a pixel; 0: of no concern. `gathered`: photons that it takes in, at least.
double PhotonMapBuilder::choose_radius(std::span<const Photon> first, double footprint, double gathered) const {
  if (settings_.photon_radius > 0.0) return settings_.photon_radius;
  const double dense = first_radius(first, space_, kDense);
  if (!(settings_.photon_footprint > 0.0)) return dense;
  const double wanted = dense * std::sqrt(gathered / kDense);
  return std::min(std::max(dense, wanted), std::max(kFootprints * footprint, wanted));
}

void PhotonMapBuilder::choose_radii(const TracedPhotons& first) {
  const double gathered = settings_.photons_gathered;
  if (use_ == PhotonUse::Direct) {
    caustic_radius_ = choose_radius(first.caustic, settings_.photon_footprint, gathered);
    global_radius_ = choose_radius(first.global, settings_.photon_footprint, gathered);
  } else {
    caustic_radius_ = choose_radius(first.caustic, settings_.photon_footprint, kCausticFraction * gathered);
    global_radius_ = choose_radius(first.global, 0.0, gathered);
  }
}

const PhotonMaps& PhotonMapBuilder::build(const SampleNumber& number, Communicator* comm) {
  HPR_CHECK(make(number, comm, {}));
  return maps_;
}

bool PhotonMapBuilder::build_while_wanted(const SampleNumber& number, Communicator& comm,
                                          const std::function<bool()>& is_overtaken) {
  return make(number, &comm, is_overtaken);
}

/// Moves the photons that lie where few do to maps of their own. `radius`: in which this sample's others are gathered.
void PhotonMapBuilder::map_sparse(std::vector<Photon>& photons, double radius) {
  maps_.footprint = kFootprint * radius / global_radius_;
  double radii = 1.0;
  std::vector<Photon>* from = &photons;
  std::array<std::vector<Photon>, std::tuple_size_v<decltype(maps_.sparse)>> sparse;
  for (std::vector<Photon>& sparser : sparse) {
    radii *= kSparseRadii;
    // Of the first sample's radius: with the radii of later ones all photons would be sparse.
    sparser = extract_sparse(*from, space_, radii * global_radius_, kSparse);
    from = &sparser;
  }
  for (std::size_t i = sparse.size(); i-- > 0; radii /= kSparseRadii) {
    maps_.sparse.at(i) = PhotonMap(sparse.at(i), space_, radii * radius, tracer_.settings().flux_unit);
  }
}

bool PhotonMapBuilder::make(const SampleNumber& number, Communicator* comm, const std::function<bool()>& is_overtaken) {
  if (built_ == number) return true;
  // Whatever sample comes first, radii are those of the very first one: a run that is resumed gives the same bits.
  const bool chooses = caustic_radius_ == 0.0;
  if (!fit_count(comm, is_overtaken)) return false;
  if (chooses && number != SampleNumber{}) {
    const std::optional<TracedPhotons> first = trace({}, comm, is_overtaken);
    if (!first) return false;
    choose_radii(*first);
  }
  std::optional<TracedPhotons> traced = trace(number, comm, is_overtaken);
  if (!traced) return false;
  if (chooses && number == SampleNumber{}) choose_radii(*traced);
  built_.reset();
  const double caustic = progressive_radius(caustic_radius_, number.sample);
  const double global = progressive_radius(global_radius_, number.sample);
  maps_.near = use_ == PhotonUse::Gathered ? kNearRadii * global : 0.0;
  std::erase_if(traced->global, [&](const Photon& photon) { return photon.traveled < maps_.near; });
  if (use_ == PhotonUse::Gathered) map_sparse(traced->global, global);
  parallel_for(settings_.threads, 2, [&](std::size_t which) {
    const std::vector<Photon>& photons = which == 0 ? traced->caustic : traced->global;
    PhotonMap& map = which == 0 ? maps_.caustic : maps_.global;
    map = PhotonMap(photons, space_, which == 0 ? caustic : global, tracer_.settings().flux_unit);
  });
  built_ = number;
  return true;
}

PhotonCounts PhotonMapBuilder::take_counts() {
  return std::exchange(counts_, {});
}

}  // namespace hpr
