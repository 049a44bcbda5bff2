#pragma once

#include <xmmintrin.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "rt/trace/ray_build.h"
#include "scene/scene.h"

struct RTCSceneTy;

namespace hpr {

/// One unit in the last place of a float near 1: what a coordinate may lose on its way into Embree.
inline constexpr double kFloatStep = 1.1920928955078125e-7;

/// How many such steps of what rounding acts on a ray's origin is moved off its surface. Measured over object radii of
/// 1e-9 to 1e9 and offsets of the centre up to 1e4 radii: no surface hits itself (Embree's triangle test needs about
/// three).
inline constexpr double kOriginSteps = 4.0;

/// The float coordinates rays are traced in: world metres relative to the scene's detail_center, scaled by a power of
/// two so that the farthest coordinate of the scene lies in [1, 2). Both steps are done in double; the scale is exact,
/// so a scene scaled by a power of two gives the same bits.
struct RaySpace {
  glm::dvec3 origin{0.0};
  double scale = 1.0;
  double radius = 1.0;  ///< how far the scene reaches by the largest coordinate, in ray space: [1, 2)

  RaySpace() = default;
  explicit RaySpace(const Scene& scene) : RaySpace(scene.bounds, scene.detail_center) {}
  explicit RaySpace(const Bounds& bounds) : RaySpace(bounds, 0.5 * bounds.high + 0.5 * bounds.low) {}
  RaySpace(const Bounds& bounds, const glm::dvec3& center) {
    glm::dvec3 reach = 0.5 * bounds.high - 0.5 * bounds.low;
    if (center != 0.5 * bounds.high + 0.5 * bounds.low) reach = glm::max(bounds.high - center, center - bounds.low);
    const double extent = std::max({reach.x, reach.y, reach.z});
    if (!std::isfinite(extent)) return;
    origin = center;
    if (!(extent > 0.0)) return;
    scale = std::ldexp(1.0, std::clamp(-std::ilogb(extent), -1000, 1000));
    radius = extent * scale;
  }

  [[nodiscard]] glm::dvec3 from_world(const glm::dvec3& world) const { return (world - origin) * scale; }

  /// Metres, with a margin: what rounding a place's coordinates may move it by, seldom as much.
  [[nodiscard]] double rounding_at(const glm::dvec3& world) const {
    const glm::dvec3 from_origin = glm::abs(world - origin);
    return kOriginSteps * kFloatStep * std::max({from_origin.x, from_origin.y, from_origin.z});
  }
};

/// Denormal numbers read and written as zero while it lives, as Embree advises; the thread's own mode returns after.
class DenormalsAsZero {
 public:
  DenormalsAsZero() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040U); }
  ~DenormalsAsZero() { _mm_setcsr(before_); }
  DenormalsAsZero(const DenormalsAsZero&) = delete;
  DenormalsAsZero& operator=(const DenormalsAsZero&) = delete;

 private:
  unsigned int before_;
};

inline constexpr std::uint32_t kNoSurface = 0xFFFFFFFFU;

/// Embree's own limit is the square root of the largest float; past it (or at NaN) builds with assertions abort.
inline constexpr float kMaxRayDistance = 1.8e18F;

/// Which faces of single-sided materials (shows_both_sides) a ray meets: both, as light does, or those an eye sees.
enum class Faces : std::uint32_t { Both, Front };

/// What is asked of other ranks, rays of all kinds and triangles alike.
enum class RayKind : std::uint16_t {
  Primary,    ///< what the eye sees
  Bounce,     ///< from a surface along one of its lobes
  Shadow,     ///< what hides a light
  Occlusion,  ///< what is near
  Photon,
  Triangles,  ///< of surfaces that another rank holds
};
inline constexpr std::size_t kRayKinds = 6;

/// What rays are for. Of those that wait for other ranks or for a core, later generations go first.
struct RayPurpose {
  RayKind kind = RayKind::Primary;
  std::uint16_t generation = 0;  ///< bounces before, from the eye or a lamp
};

/// Rays side by side, one array per coordinate, in ray space. Directions have unit length.
class RayBatch {
 public:
  struct Ray {
    std::array<float, 3> origin{};
    std::array<float, 3> direction{};
    float reach = 0.0F;
    Faces faces = Faces::Both;
  };

  /// Leaves their purpose as it is.
  void clear() { size_ = 0; }
  [[nodiscard]] std::size_t size() const { return size_; }
  void push(const glm::dvec3& origin, const glm::dvec3& direction, double reach, Faces faces = Faces::Both) {
    const std::size_t lane = size_ % kWidth;
    Packet& packet = next_packet();
    for (int axis = 0; axis < 3; ++axis) {
      packet.origin[axis][lane] = static_cast<float>(origin[axis]);
      packet.direction[axis][lane] = static_cast<float>(direction[axis]);
    }
    packet.reach[lane] = static_cast<float>(reach);
    packet.faces[lane] = faces;
  }
  void push(const Ray& ray) {
    const std::size_t lane = size_ % kWidth;
    Packet& packet = next_packet();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      packet.origin[axis][lane] = ray.origin[axis];
      packet.direction[axis][lane] = ray.direction[axis];
    }
    packet.reach[lane] = ray.reach;
    packet.faces[lane] = ray.faces;
  }
  [[nodiscard]] Ray ray(std::size_t i) const {
    const Packet& packet = packets_[i / kWidth];
    Ray ray;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ray.origin[axis] = packet.origin[axis][i % kWidth];
      ray.direction[axis] = packet.direction[axis][i % kWidth];
    }
    ray.reach = packet.reach[i % kWidth];
    ray.faces = packet.faces[i % kWidth];
    return ray;
  }

  RayPurpose purpose;

 private:
  friend class RayScene;
  static constexpr std::size_t kWidth = 8;
  /// Eight rays as Embree reads them.
  struct alignas(32) Packet {
    float origin[3][kWidth];
    float direction[3][kWidth];
    float reach[kWidth];
    Faces faces[kWidth];
  };

  /// Counts one more ray, which goes there.
  Packet& next_packet() {
    const std::size_t index = size_++ / kWidth;
    if (index == packets_.size()) packets_.emplace_back();
    return packets_[index];
  }

  std::size_t size_ = 0;
  std::vector<Packet> packets_;
};

/// Whether Embree can trace it: finite, with a direction, within kMaxRayDistance.
[[nodiscard]] bool is_traceable(const RayBatch::Ray& ray);

/// Whether rays that share a packet go the same way; a hint that makes Embree quicker where it is right and changes no
/// result.
enum class Coherence { Low, High };

/// What a call keeps while it waits for rays that travel to other ranks: of large ones fewer are under way.
enum class CallMemory { Small, Large };

/// What a ray has met and passed, if it is sent once more from where it began: it then meets what comes next by
/// distance, and by id where distances are equal. So nothing is skipped, however close surfaces lie.
///
/// Triangles of one instance that are met at one distance, but for rounding, are met once: they share the edge there.
struct Passed {
  std::uint32_t surface = kNoSurface;  ///< none yet
  std::uint32_t instance = 0;
  float distance = 0.0F;  ///< ray space
};

/// What one geometry of Embree's scene shows: a run of triangles of an instance, counted by primitive id.
struct RayGeometry {
  std::uint32_t instance = 0;
  std::uint32_t first_triangle = 0;  ///< of the instance's mesh
  std::uint32_t first_surface = 0;
  /// The triangle of each primitive, counted from the first one, where triangles are refined; null: they are
  /// primitives.
  const std::uint32_t* triangles = nullptr;
  /// 0 where both sides of its triangles are shown; else what a ray's direction times Embree's normal is to be
  /// multiplied by to be positive for a ray that meets a triangle from behind.
  float behind = 0.0F;

  [[nodiscard]] std::uint32_t triangle_of(std::uint32_t primitive) const {
    return triangles != nullptr ? triangles[primitive] : primitive;
  }
};

class RayForwarding;

/// The scene as Embree holds it: meshes used once go in as world triangles, shared ones as instances of a sub-scene.
///
/// Answers do not depend on thread counts or on which rays share a packet; of surfaces at equal distance the lowest id
/// is found, as in keys. A ray that Embree could not bear (not finite, beyond 1.8e18) misses and is counted.
class RayScene {
 public:
  /// Builds with `threads` threads. The scene may go afterwards. Throws Error (NoDevice) when Embree fails.
  RayScene(const Scene& scene, const RaySpace& space, int threads);
  /// Only the surfaces of `objects`, ranges in any order. Each is met at the same distance as in the whole scene.
  RayScene(const Scene& scene, const RaySpace& space, int threads, std::span<const SurfaceRange> objects,
           const RayBuild& build = {});
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// blocked[i] = 1 where something stands between ray i's origin and its reach. Returns how many rays were invalid.
  [[nodiscard]] std::uint64_t occluded(const RayBatch& rays, std::span<std::uint8_t> blocked) const;

  /// surfaces[i] = the first surface ray i meets, or kNoSurface. Returns how many rays were invalid.
  [[nodiscard]] std::uint64_t closest(const RayBatch& rays, std::span<std::uint32_t> surfaces,
                                      Coherence coherence = Coherence::Low) const;
  /// Finds the first surface of rays that may have passed surfaces before: passed[i] says which, and is set to what ray
  /// i meets now.
  [[nodiscard]] std::uint64_t closest(const RayBatch& rays, std::span<Passed> passed,
                                      std::span<std::uint32_t> surfaces) const;

  /// Declares this one rank's part of a scene of which the other ranks hold the rest: from now on queries answer for
  /// all of it, and may be called inside for_each() only. Collective: ranks call it scene by scene in one order.
  /// `forwarding` outlives this. Where ranks hold their parts in pages this has no surfaces; `surfaces` are those that
  /// all pages together have of it.
  void share(RayForwarding& forwarding, std::vector<SurfaceRange> surfaces = {}, const RayBuild& build = {});
  /// Of one that is shared in pages: what it has of one of them, which is in use (PageInUse). Builds it by `threads`
  /// threads where it is not there.
  [[nodiscard]] const RayScene& of_page(std::size_t page, int threads) const;
  /// Calls body(i) for i in [0, count) by `threads` threads, as parallel_for; collective where the scene is shared.
  void for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body,
                CallMemory memory = CallMemory::Large) const;
  /// Queries of this rank's part alone.
  [[nodiscard]] std::uint64_t occluded_local(const RayBatch& rays, std::span<std::uint8_t> blocked) const;
  [[nodiscard]] std::uint64_t closest_local(const RayBatch& rays, std::span<Passed> passed,
                                            std::span<std::uint32_t> surfaces) const;

  /// Triangles left out because their world positions are beyond what float holds.
  [[nodiscard]] std::uint64_t skipped_triangles() const;

  /// For code in rt/ that calls Embree itself. Geometry ids of its top level index geometries(); where it holds
  /// instances, only instance ids do.
  [[nodiscard]] RTCSceneTy* embree() const;
  [[nodiscard]] std::span<const RayGeometry> geometries() const;
  [[nodiscard]] const RaySpace& space() const { return space_; }

 private:
  std::uint64_t find_closest(const RayBatch& rays, Passed* passed, std::span<std::uint32_t> surfaces,
                             Coherence coherence) const;

  struct Embree;
  RayForwarding* forwarding_ = nullptr;  ///< null: this is the whole scene
  std::uint32_t part_ = 0;               ///< its number there
  RaySpace space_;
  std::unique_ptr<Embree> embree_;
};

/// Of some surfaces, those that this rank's own ray scene is made of: all of them, those of its part, or none where
/// that is in pages.
[[nodiscard]] std::vector<SurfaceRange> surfaces_at_home(const Scene& scene,
                                                         const std::optional<std::vector<SurfaceRange>>& part,
                                                         const std::vector<SurfaceRange>& surfaces);

/// True where Embree holds instance i of the scene as an instance of a shared mesh. Singular and strongly distorting
/// placements are never shared: a ray carried into their coordinates would lose its digits.
[[nodiscard]] std::vector<std::uint8_t> shared_instances(const Scene& scene);

/// How much larger rounding gets when a point is carried into an instance's coordinates and back: the row sum norm of
/// |A| |A^-1|, A its linear part; infinite when singular.
[[nodiscard]] double distortion(const glm::dmat3& linear);

}  // namespace hpr
