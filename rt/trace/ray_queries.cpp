#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "rt/trace/embree_compat.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/travelling_rays.h"

// What a ray scene answers: packet by packet, from RayBatch to Embree and back.
namespace hpr {
namespace {

using embree::kWidth;

/// What the tie filter knows of the rays in flight. The Embree context comes first: the filter is handed its
/// address.
struct Closest {
  embree::Context context;
  const RayGeometry* geometries;
  std::array<float, kWidth> distance;
  std::array<std::uint32_t, kWidth> surface;
  std::array<std::uint32_t, kWidth> instance;
  const Passed* passed;  ///< by lane; null: none has passed anything
};

/// Two triangles that share an edge put a ray's distance to it at most about this far apart, relative to the larger of
/// it and the scene, whose size is about 1 in ray space.
constexpr float kSameEdge = 8 * std::numeric_limits<float>::epsilon();

/// Whether the ray has that behind it already.
bool was_met(const Passed& passed, std::uint32_t surface, std::uint32_t instance, float distance) {
  if (passed.surface == kNoSurface) return false;
  if (instance == passed.instance) {
    return surface == passed.surface || distance <= passed.distance + kSameEdge * std::max(passed.distance, 1.0F);
  }
  return distance < passed.distance || (distance == passed.distance && surface < passed.surface);
}

/// Robust traversal offers candidates at the distance already found as well; of those the lowest surface id stays.
void keep_lowest_surface(const RTCFilterFunctionNArguments* arguments) {
  auto& closest = *reinterpret_cast<Closest*>(arguments->context);
  for (unsigned int i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const unsigned int lane = RTCRayN_id(arguments->ray, arguments->N, i);
    const unsigned int outer = RTCHitN_instID(arguments->hit, arguments->N, i, 0);
    const unsigned int geometry =
        outer != RTC_INVALID_GEOMETRY_ID ? outer : RTCHitN_geomID(arguments->hit, arguments->N, i);
    const RayGeometry& shown = closest.geometries[geometry];
    const std::uint32_t surface = shown.first_surface + RTCHitN_primID(arguments->hit, arguments->N, i);
    const float distance = RTCRayN_tfar(arguments->ray, arguments->N, i);
    const bool later = distance == closest.distance[lane] && surface >= closest.surface[lane];
    if (later || (closest.passed != nullptr && was_met(closest.passed[lane], surface, shown.instance, distance))) {
      arguments->valid[i] = 0;
    } else {
      closest.distance[lane] = distance;
      closest.surface[lane] = surface;
      closest.instance[lane] = shown.instance;
    }
  }
}

}  // namespace

namespace {

/// What is the same in every packet.
void prepare(embree::RayPacket& rays) {
  for (std::size_t i = 0; i < kWidth; ++i) {
    rays.tnear[i] = 0.0F;
    rays.time[i] = 0.0F;
    rays.mask[i] = 0xFFFFFFFFU;
    rays.id[i] = static_cast<unsigned int>(i);
    rays.flags[i] = 0;
  }
}

/// Sets valid[i] to -1 where Embree may see ray i and to 0 elsewhere; returns whether it may see all. Without a branch,
/// so that the compiler handles several lanes at once. Comparisons with NaN are false, so NaN fails here too.
template <typename Packet>
bool validate(const Packet& packet, int* valid) {
  int all = -1;
  for (std::size_t i = 0; i < kWidth; ++i) {
    const float dx = std::abs(packet.direction[0][i]);
    const float dy = std::abs(packet.direction[1][i]);
    const float dz = std::abs(packet.direction[2][i]);
    const int near = static_cast<int>(std::abs(packet.origin[0][i]) < kFarthestRay) &
                     static_cast<int>(std::abs(packet.origin[1][i]) < kFarthestRay) &
                     static_cast<int>(std::abs(packet.origin[2][i]) < kFarthestRay);
    const int finite =
        static_cast<int>(dx < kFarthestRay) & static_cast<int>(dy < kFarthestRay) & static_cast<int>(dz < kFarthestRay);
    const int directed = static_cast<int>(dx > 0.0F) | static_cast<int>(dy > 0.0F) | static_cast<int>(dz > 0.0F);
    valid[i] = -(near & finite & directed & static_cast<int>(packet.reach[i] >= 0.0F));
    all &= valid[i];
  }
  return all != 0;
}

/// Copies a packet into Embree's form and marks with -1 the lanes Embree may see; returns how many of the first `count`
/// it may not.
template <typename Packet>
std::uint64_t load(const Packet& packet, std::size_t count, embree::RayPacket& rays, int* valid) {
  static_assert(sizeof packet.reach == kWidth * sizeof(float));
  std::memcpy(rays.org_x, packet.origin, sizeof packet.origin);
  static_assert(offsetof(embree::RayPacket, org_z) == 2 * sizeof(rays.org_x));
  std::memcpy(rays.dir_x, packet.direction, sizeof packet.direction);
  static_assert(offsetof(embree::RayPacket, dir_z) - offsetof(embree::RayPacket, dir_x) == 2 * sizeof(rays.dir_x));
  std::memcpy(rays.tfar, packet.reach, sizeof packet.reach);
  if (validate(packet, valid) && count == kWidth) return 0;
  std::uint64_t invalid = 0;
  for (std::size_t i = 0; i < kWidth; ++i) {
    if (valid[i] != 0 && i < count) continue;
    // The mask alone does not do: where Embree has no native packet of this width it goes by tnear <= tfar instead, and
    // its assertions look at every lane. So these hold a harmless ray that ends before it begins.
    rays.org_x[i] = rays.org_y[i] = rays.org_z[i] = 0.0F;
    rays.dir_x[i] = rays.dir_y[i] = rays.dir_z[i] = 1.0F;
    rays.tfar[i] = -1.0F;
    valid[i] = 0;
    invalid += i < count ? 1U : 0U;
  }
  return invalid;
}

}  // namespace

bool is_bearable(const RayBatch::Ray& ray) {
  bool directed = false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float part = std::abs(ray.direction[axis]);
    if (!(std::abs(ray.origin[axis]) < kFarthestRay) || !(part < kFarthestRay)) return false;
    directed = directed || part > 0.0F;
  }
  return directed && ray.reach >= 0.0F;
}

std::uint64_t RayScene::occluded(const RayBatch& rays, std::span<std::uint8_t> blocked) const {
  return others_ != nullptr ? others_->occluded(part_, rays, blocked) : occluded_here(rays, blocked);
}

std::uint64_t RayScene::occluded_here(const RayBatch& rays, std::span<std::uint8_t> blocked) const {
  HPR_CHECK(blocked.size() == rays.size());
  embree::Context context;
  embree::start(context, embree::Rays::Incoherent);
  embree::RayPacket packet;
  prepare(packet);
  alignas(64) std::array<int, kWidth> valid;
  std::uint64_t invalid = 0;
  for (std::size_t first = 0; first < rays.size(); first += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - first);
    invalid += load(rays.packets_[first / kWidth], count, packet, valid.data());
    embree::occluded(valid.data(), embree(), context, packet);
    // Embree marks a blocked ray by a negative tfar.
    for (std::size_t i = 0; i < count; ++i) blocked[first + i] = valid[i] != 0 && packet.tfar[i] < 0.0F ? 1 : 0;
  }
  return invalid;
}

std::uint64_t RayScene::closest(const RayBatch& rays, std::span<std::uint32_t> surfaces, Coherence coherence) const {
  if (others_ == nullptr) return find_closest(rays, nullptr, surfaces, coherence);
  return others_->closest(part_, rays, {}, surfaces);
}

std::uint64_t RayScene::closest(const RayBatch& rays, std::span<Passed> passed,
                                std::span<std::uint32_t> surfaces) const {
  return others_ != nullptr ? others_->closest(part_, rays, passed, surfaces) : closest_here(rays, passed, surfaces);
}

std::uint64_t RayScene::closest_here(const RayBatch& rays, std::span<Passed> passed,
                                     std::span<std::uint32_t> surfaces) const {
  HPR_CHECK(passed.size() == rays.size());
  return find_closest(rays, passed.data(), surfaces, Coherence::Low);
}

std::uint64_t RayScene::find_closest(const RayBatch& rays, Passed* passed, std::span<std::uint32_t> surfaces,
                                     Coherence coherence) const {
  HPR_CHECK(surfaces.size() == rays.size());
  Closest closest;
  embree::start(closest.context, coherence == Coherence::High ? embree::Rays::Coherent : embree::Rays::Incoherent);
  closest.geometries = geometries().data();
  embree::HitPacket packet;
  prepare(packet.ray);
  alignas(64) std::array<int, kWidth> valid;
  std::uint64_t invalid = 0;
  for (std::size_t first = 0; first < rays.size(); first += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - first);
    invalid += load(rays.packets_[first / kWidth], count, packet.ray, valid.data());
    for (std::size_t i = 0; i < kWidth; ++i) {
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    closest.distance.fill(std::numeric_limits<float>::quiet_NaN());
    closest.surface.fill(kNoSurface);
    closest.passed = passed != nullptr ? passed + first : nullptr;
    if (passed != nullptr) {
      // The filter decides; this only spares it most of what lies before.
      for (std::size_t i = 0; i < count; ++i) packet.ray.tnear[i] = passed[first + i].distance * (1.0F - kSameEdge);
    }
    embree::intersect(valid.data(), embree(), closest.context, &keep_lowest_surface, packet);
    std::copy_n(closest.surface.begin(), count, surfaces.begin() + static_cast<std::ptrdiff_t>(first));
    if (passed == nullptr) continue;
    for (std::size_t i = 0; i < count; ++i) {
      passed[first + i] = {closest.surface[i], closest.instance[i], closest.distance[i]};
    }
  }
  return invalid;
}

}  // namespace hpr
