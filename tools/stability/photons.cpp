#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "rt/lights/light_sampler.h"
#include "rt/photons/photon_map.h"
#include "rt/photons/photon_tracer.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/generators/generators.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

// Photons, from none to more than 32 bits count: who sends them changes no bit, their light adds up to what was sent,
// and long sums lose no more than the order of their terms allows.
namespace hpr::stability {
namespace {

constexpr std::uint64_t kSlice = 1U << 15U;

/// The cube [-1, 1]^3 from inside, white, with a light of `power` watts in its middle.
Scene white_room(double power) {
  Scene scene;
  Mesh room;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      glm::dvec3 corner(-1.0);
      glm::dvec3 a(0.0);
      glm::dvec3 b(0.0);
      corner[axis] = side;
      a[(axis + 1) % 3] = 2.0;
      b[(axis + 2) % 3] = 2.0;
      const Mesh wall = side < 0.0 ? parallelogram(corner, a, b) : parallelogram(corner, b, a);
      const auto first = static_cast<std::uint32_t>(room.positions.size());
      room.positions.insert(room.positions.end(), wall.positions.begin(), wall.positions.end());
      room.normals.insert(room.normals.end(), wall.normals.begin(), wall.normals.end());
      for (const glm::uvec3& triangle : wall.triangles) room.triangles.push_back(triangle + first);
    }
  }
  add_placed(scene, std::move(room), diffuse(), glm::dmat4(1.0));
  Light light;
  light.intensity = glm::vec3(static_cast<float>(power / (4.0 * std::numbers::pi)));
  scene.lights = {light};
  finish_scene(scene);
  return scene;
}

/// All that photons of a scene need.
class PhotonRoom {
 public:
  explicit PhotonRoom(Scene scene)
      : scene_(std::move(scene)),
        space_(scene_.bounds),
        surfaces_(scene_, space_),
        rays_(scene_, space_, 1),
        lights_(scene_) {}

  [[nodiscard]] TracedPhotons trace(const PhotonRange& range, std::uint64_t pass_photons,
                                    const PhotonSettings& settings) const {
    const PhotonTracer tracer(
        scene_, surfaces_, space_, rays_,
        [this](double choice, const glm::dvec2& position, const glm::dvec2& direction) {
          return lights_.emit(choice, position, direction);
        },
        settings);
    return tracer.trace({}, range, pass_photons);
  }
  /// Watts in one channel, exactly.
  [[nodiscard]] double power() const {
    return 4.0 * std::numbers::pi * static_cast<double>(scene_.lights.front().intensity.r);
  }

 private:
  Scene scene_;
  RaySpace space_;
  Surfaces surfaces_;
  RayScene rays_;
  LightSampler lights_;
};

/// How far the light of photons [first, first + kSlice) of `all`, each kept once, is from their share of `power`.
double power_lost(double power, std::uint64_t first, std::uint64_t all, int threads) {
  const PhotonRoom room(white_room(power));
  PhotonSettings once;
  once.max_bounces = 1;  // a white wall scatters everything; the photon is kept where it arrives next, and ends
  once.threads = threads;
  const TracedPhotons traced = room.trace({first, kSlice}, all, once);
  double sum = 0.0;
  for (const Photon& photon : traced.global) sum += static_cast<double>(photon.flux[0]);
  const double sent = room.power() * (static_cast<double>(kSlice) / static_cast<double>(all));
  return sent > 0.0 ? std::abs(sum - sent) / sent : std::numeric_limits<double>::infinity();
}

StabilityFinding power(int threads) {
  StabilityFinding kept =
      make_finding("photons/power", "32768 photons out of 32768 .. 1e8 .. 2^40, each kept once",
                   kFloatRounding + 16.0 * kDoubleRounding, "relative",
                   "a photon's flux is rounded to float once; white walls in a closed room lose nothing");
  kept.curve.x = "photons of a pass";
  for (const std::uint64_t all :
       {kSlice, std::uint64_t{1'000'000}, std::uint64_t{100'000'000}, std::uint64_t{1} << 40U}) {
    double lost = 0.0;
    for (const std::uint64_t first : {std::uint64_t{0}, all / 2, all - kSlice})
      lost = worse(lost, power_lost(1.0, first, all, threads));
    add_point(kept, static_cast<double>(all), lost);
  }
  return kept;
}

StabilityFinding faint(int threads) {
  StabilityFinding kept = make_finding("photons/faint", "a photon's flux from 1 down to 1e-37 of its unit",
                                       kFloatRounding + 16.0 * kDoubleRounding, "relative",
                                       "above 2^-126 of its unit a float rounds by 2^-24 of itself");
  kept.curve.x = "flux of a photon, in its unit";
  const auto lost = [&](double flux) { return power_lost(flux * static_cast<double>(kSlice), 0, kSlice, threads); };
  for (const double flux : {1e-37, 1e-30, 1e-20, 1e-10, 1.0}) {
    add_point(kept, flux, lost(flux));
  }
  kept.breaks_at = breaking_point_if_any(1e-37, 1e-46, 0.05, [&](double flux) { return lost(flux) <= kept.limit; });
  return kept;
}

/// By their bits: 0 and -0 are two.
std::size_t differing(const std::vector<Photon>& a, const std::vector<Photon>& b) {
  using Bits = std::array<std::byte, sizeof(Photon)>;
  std::size_t count = std::max(a.size(), b.size()) - std::min(a.size(), b.size());
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    count += std::bit_cast<Bits>(a[i]) == std::bit_cast<Bits>(b[i]) ? 0U : 1U;
  return count;
}

/// Photons of a room with glass, sent by many and by one.
StabilityFinding who_sends() {
  StabilityFinding same =
      make_finding("photons/who-sends", "ranks 1 .. 17, threads 1 .. 3, photons from 0 and across 2^32", 0.0,
                   "differing photons", "a photon depends on its index alone, and order is by index");
  const PhotonRoom room(generate_scene("cornell?variant=glass"));
  constexpr std::uint64_t kPhotons = 10'007;
  for (const std::uint64_t first : {std::uint64_t{0}, (std::uint64_t{1} << 32U) - kPhotons / 2}) {
    const TracedPhotons serial = room.trace({first, kPhotons}, kPhotons, {});
    for (const int ranks : {1, 2, 3, 7, 17}) {
      std::vector<std::size_t> counts(static_cast<std::size_t>(ranks));
      run_local_ranks({.size = ranks, .disorder = first + 5}, [&](Communicator& comm) {
        PhotonSettings settings;
        settings.threads = 1 + comm.rank() % 3;
        TracedPhotons traced =
            room.trace(share_of_rank({first, kPhotons}, comm.rank(), comm.size()), kPhotons, settings);
        share_photons(comm, traced);
        counts[static_cast<std::size_t>(comm.rank())] =
            differing(traced.caustic, serial.caustic) + differing(traced.global, serial.global);
      });
      for (const std::size_t count : counts) same.measured += static_cast<double>(count);
    }
    if (serial.global.empty() || serial.caustic.empty()) same.measured = std::numeric_limits<double>::infinity();
  }
  return same;
}

StabilityFinding split_among_ranks() {
  StabilityFinding whole = make_finding("photons/shares", "0, 1, 1e8, 2^32 + 5, 2^62 photons among 1 .. 1000 ranks",
                                        0.0, "photons sent twice or by nobody", "shares follow one another");
  for (const std::uint64_t count : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{100'000'000},
                                    (std::uint64_t{1} << 32U) + 5, std::uint64_t{1} << 62U}) {
    for (const int ranks : {1, 2, 3, 7, 64, 1000}) {
      const PhotonRange all{7, count};
      std::uint64_t next = all.first;
      for (int rank = 0; rank < ranks; ++rank) {
        const PhotonRange range = share_of_rank(all, rank, ranks);
        whole.measured += range.first == next ? 0.0 : 1.0;
        whole.measured += range.count <= count / static_cast<std::uint64_t>(ranks) + 1 ? 0.0 : 1.0;
        next = range.first + range.count;
      }
      whole.measured += next == all.first + count ? 0.0 : 1.0;
    }
  }
  return whole;
}

/// All photons at one position: gathering them is the longest sum there can be.
StabilityFinding max_sum(std::uint64_t seed) {
  constexpr std::size_t kMaxPhotons = 1'000'000;
  StabilityFinding sum = make_finding("photons/longest-sum", "1e3 .. 1e6 photons in one place, fluxes over 12 decades",
                                      (kMaxPhotons + 4.0) * kDoubleRounding, "relative",
                                      "one addition each, 2^-53 each: 1e8 photons would lose 1.1e-8");
  sum.curve.x = "photons";
  RandomStream random(seed);
  std::vector<Photon> photons(kMaxPhotons);
  for (Photon& photon : photons) {
    photon.facing = pack_facing({0.0, 0.0, 1.0});
    photon.direction = pack_direction({0.0, 0.0, 1.0});
    photon.flux.fill(static_cast<float>(std::pow(10.0, 12.0 * random.one() - 6.0)));
  }
  const RaySpace space(Bounds{glm::dvec3(-1.0), glm::dvec3(1.0)});
  for (const std::size_t count : {std::size_t{1'000}, std::size_t{10'000}, std::size_t{100'000}, kMaxPhotons}) {
    const PhotonMap map(std::span<const Photon>(photons).first(count), space, 0.5);
    const glm::dvec3 found = map.gather({}, {0.0, 0.0, 1.0}, [](const glm::dvec3&) { return glm::dvec3(1.0); });
    ExactSum exact;
    for (std::size_t i = 0; i < count; ++i) exact.add(photons[i].flux[0]);
    const long double density = 2.0L / (std::numbers::pi_v<long double> * 0.25L);
    const auto error = static_cast<double>(std::abs(found.r / (density * exact.sum) - 1.0L));
    add_point(sum, static_cast<double>(count), error);
    sum.curve.expected.emplace_back(static_cast<double>(count), (static_cast<double>(count) + 4.0) * kDoubleRounding);
  }
  return sum;
}

/// Pictures with hardly a photon.
StabilityFinding few(const Globals& globals) {
  StabilityFinding odd =
      make_finding("photons/none-and-one", "a pass of 1, 2 and 3 photons, and a scene that can send none", 0.0,
                   "pixels", "pixels without a photon about them stay as they are");
  Scene scene = generate_scene("cornell?variant=glass");
  const View view = make_view(scene.cameras.front(), {64, 64}, scene.bounds);
  RaySettings settings;
  settings.threads = threads_of(globals);
  settings.passes = {PassId::Shadow, PassId::Photon};
  settings.global_photons = true;
  for (const std::uint32_t photons : {1U, 2U, 3U}) {
    settings.photons = photons;
    odd.measured += static_cast<double>(lit_picture(scene, view, settings).counts.not_finite);
  }
  // Without lights there is a headlight, which sends no photons.
  for (Material& material : scene.materials) material.emissive = glm::vec3(0.0F);
  scene.lights.clear();
  const LitPicture none = lit_picture(scene, view, settings);
  settings.passes = {PassId::Shadow};
  const LitPicture without = lit_picture(scene, view, settings);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) odd.measured += none.image.at(x, y) == without.image.at(x, y) ? 0.0 : 1.0;
  }
  return odd;
}

std::vector<StabilityFinding> measure_photons(const Globals& globals) {
  const int threads = threads_of(globals);
  return {few(globals), power(threads), faint(threads), who_sends(), split_among_ranks(), max_sum(globals.seed)};
}

}  // namespace

StabilityCase photons_case() {
  return {"photons", "photons from none to more than 32 bits count: senders change no bit, no light is lost",
          measure_photons};
}

}  // namespace hpr::stability
