#include "rt/trace/ray_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <forward_list>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <string_view>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "rt/trace/embree_compat.h"
#include "rt/trace/ray_forwarding.h"
#include "rt/trace/refined_triangles.h"
#include "scene/scene.h"

namespace hpr {
namespace {

constexpr double kMaxDistortion = 16.0;

template <typename Handle, void (*release)(Handle)>
class Owned {
 public:
  explicit Owned(Handle handle = nullptr) : handle_(handle) {}
  ~Owned() {
    if (handle_ != nullptr) release(handle_);
  }
  Owned(Owned&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  Owned& operator=(Owned&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  [[nodiscard]] Handle get() const { return handle_; }

 private:
  Handle handle_;
};
using OwnedDevice = Owned<RTCDevice, rtcReleaseDevice>;
using OwnedScene = Owned<RTCScene, rtcReleaseScene>;
using OwnedGeometry = Owned<RTCGeometry, rtcReleaseGeometry>;

Error embree_error(std::string_view doing, RTCError code, std::string_view text) {
  if (code == RTC_ERROR_OUT_OF_MEMORY) {
    return {ExitCode::Limit, fmt::format("cannot {}: out of memory", doing),
            "use more ranks or a smaller scene, or render without rays: --passes none --primary raster"};
  }
  return {ExitCode::NoDevice, fmt::format("cannot {}: Embree error {}: {}", doing, static_cast<int>(code), text),
          "render without rays: --passes none --primary raster"};
}

/// Embree reports through a callback, perhaps from several of its threads and perhaps because memory ran out: it
/// neither throws nor allocates. The first report waits here until the call that brought it has returned.
class Failure {
 public:
  static void note(void* self, RTCError code, const char* text) noexcept {
    auto& failure = *static_cast<Failure*>(self);
    if (failure.noted_.exchange(true)) return;
    failure.code_ = code;
    if (text == nullptr) return;
    const std::size_t length = std::min(std::strlen(text), failure.text_.size() - 1);
    std::copy_n(text, length, failure.text_.begin());
  }

  void check() const {
    if (!noted_) return;
    throw embree_error("build the ray scene", code_, text_.data());
  }

 private:
  std::atomic<bool> noted_ = false;
  RTCError code_ = RTC_ERROR_NONE;
  std::array<char, 256> text_{};
};

/// Counts what Embree allocates, and refuses what goes beyond a limit. Called from several threads.
class Allocation {
 public:
  void limit_to(std::size_t bytes) { limit_ = static_cast<std::int64_t>(bytes); }

  static bool count(void* self, ssize_t bytes, bool /*done*/) noexcept {
    auto& allocation = *static_cast<Allocation*>(self);
    return allocation.bytes_.fetch_add(bytes) + bytes <= allocation.limit_;
  }

 private:
  std::int64_t limit_ = 0;
  std::atomic<std::int64_t> bytes_ = 0;
};

bool tracable(const float* p) {
  return std::abs(p[0]) < kMaxRayDistance && std::abs(p[1]) < kMaxRayDistance && std::abs(p[2]) < kMaxRayDistance;
}

/// Triangles [range.first, range.last) of a mesh, and the vertices they use, numbered anew unless all triangles are
/// meant.
struct MeshPart {
  const Mesh& mesh;
  SurfaceRange range;
  std::vector<std::uint32_t> vertices;    ///< of the mesh; empty: all, in their order
  std::vector<std::uint32_t> part_index;  ///< of a mesh's vertex among those

  MeshPart(const Mesh& of, SurfaceRange triangles) : mesh(of), range(triangles) {
    if (range.count() == mesh.triangles.size()) return;  // all that is here
    constexpr std::uint32_t kNowhere = std::numeric_limits<std::uint32_t>::max();
    part_index.assign(mesh.positions.size(), kNowhere);
    for (std::uint32_t i = range.first; i < range.last; ++i) {
      for (int corner = 0; corner < 3; ++corner) {
        std::uint32_t& vertex = part_index[mesh.triangle(i)[corner]];
        if (vertex != kNowhere) continue;
        vertex = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(mesh.triangle(i)[corner]);
      }
    }
  }

  [[nodiscard]] std::uint32_t triangle_count() const { return range.count(); }
  [[nodiscard]] std::size_t vertex_count() const { return vertices.empty() ? mesh.positions.size() : vertices.size(); }
  [[nodiscard]] const glm::vec3& position(std::size_t i) const {
    return mesh.positions[vertices.empty() ? i : vertices[i]];
  }
  [[nodiscard]] glm::uvec3 triangle(std::uint32_t i) const {
    const glm::uvec3& t = mesh.triangle(range.first + i);
    return vertices.empty() ? t : glm::uvec3(part_index[t.x], part_index[t.y], part_index[t.z]);
  }
};

/// The parts of refined triangles, whose corners are their own.
struct RefinedPart {
  const RefinedTriangles& refined;

  [[nodiscard]] std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(refined.parts.size()); }
  [[nodiscard]] std::size_t vertex_count() const { return 3 * refined.parts.size(); }
  [[nodiscard]] const glm::dvec3& position(std::size_t i) const { return refined.parts[i / 3].at(i % 3); }
  [[nodiscard]] static glm::uvec3 triangle(std::uint32_t i) { return glm::uvec3(3 * i) + glm::uvec3(0, 1, 2); }
};

/// Fills one geometry; where(position) gives ray-space coordinates. Triangles out of float's reach keep their number
/// but lose their extent, so that primitive ids stay surface ids; `skipped` counts them.
template <typename Part, typename Where>
OwnedGeometry make_triangles(RTCDevice device, const Failure& failure, const Part& part, std::uint64_t& skipped,
                             Where&& where) {
  OwnedGeometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* const vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), part.vertex_count()));
  auto* const triangles = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), part.triangle_count()));
  failure.check();
  for (std::size_t i = 0; i < part.vertex_count(); ++i) {
    const glm::dvec3 p = where(part.position(i));
    for (int axis = 0; axis < 3; ++axis) vertices[3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(p[axis]);
  }
  for (std::uint32_t i = 0; i < part.triangle_count(); ++i) {
    const glm::uvec3 t = part.triangle(i);
    const bool usable = tracable(vertices + 3 * std::size_t{t.x}) && tracable(vertices + 3 * std::size_t{t.y}) &&
                        tracable(vertices + 3 * std::size_t{t.z});
    if (!usable) ++skipped;
    for (int corner = 0; corner < 3; ++corner) {
      triangles[3 * std::size_t{i} + static_cast<std::size_t>(corner)] = usable ? t[corner] : t.x;
    }
  }
  rtcCommitGeometry(geometry.get());
  return geometry;
}

RTCSceneFlags scene_flags() {
  // Fast mode leaks 5.5 % of the rays aimed at shared edges, robust mode none.
  return static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | embree::kFilterFlag);
}

RTCBuildQuality quality_of(const RayBuild& build) {
  if (build.quality == BuildQuality::Low) return RTC_BUILD_QUALITY_LOW;
  return build.quality == BuildQuality::High ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM;
}

}  // namespace

/// A mesh's triangles as several instances may show them.
using SharedPart = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>;  // mesh, first and last triangle

struct RayScene::Embree {
  Failure failure;
  Allocation allocation;  ///< outlives what is freed below
  OwnedDevice device;
  std::map<SharedPart, OwnedScene> shared;
  OwnedScene top;
  std::vector<RayGeometry> geometries;
  std::forward_list<RefinedTriangles> refined;  ///< whose numbers geometries refer to
  std::uint64_t skipped = 0;
  RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;

  void start(int threads, const RayBuild& build);
  [[nodiscard]] OwnedScene new_scene() const;
  RTCScene shared_part(const Scene& scene, const InstanceRange& part);
  void add_instance(const Instance& instance, unsigned int id, RTCScene shared_mesh, const RaySpace& space);
  void add_triangles(const Scene& scene, const InstanceRange& part, unsigned int id, const RaySpace& space);
  void add_refined(const Scene& scene, const InstanceRange& part, unsigned int id, const RaySpace& space);
};

void RayScene::Embree::start(int threads, const RayBuild& build) {
  quality = quality_of(build);
  const char* const isa = build.same_instructions && __builtin_cpu_supports("avx2") ? ",isa=avx2" : "";
  device = OwnedDevice(rtcNewDevice(fmt::format("threads={},set_affinity=0{}", std::max(threads, 1), isa).c_str()));
  if (device.get() == nullptr) {
    throw embree_error("start Embree", rtcGetDeviceError(nullptr), "it names no reason");
  }
  rtcSetDeviceErrorFunction(device.get(), &Failure::note, &failure);
  if (build.max_bytes == 0) return;
  allocation.limit_to(build.max_bytes);
  rtcSetDeviceMemoryMonitorFunction(device.get(), &Allocation::count, &allocation);
}

OwnedScene RayScene::Embree::new_scene() const {
  OwnedScene scene(rtcNewScene(device.get()));
  rtcSetSceneFlags(scene.get(), scene_flags());
  rtcSetSceneBuildQuality(scene.get(), quality);
  return scene;
}

RTCScene RayScene::Embree::shared_part(const Scene& scene, const InstanceRange& part) {
  const std::uint32_t mesh = scene.instances[part.instance].mesh;
  OwnedScene& made = shared[{mesh, part.range.first, part.range.last}];
  if (made.get() != nullptr) return made.get();
  const OwnedGeometry geometry = make_triangles(device.get(), failure, MeshPart(scene.meshes[mesh], part.range),
                                                skipped, [](const glm::vec3& p) { return glm::dvec3(p); });
  made = new_scene();
  rtcAttachGeometryByID(made.get(), geometry.get(), 0);
  rtcCommitScene(made.get());
  failure.check();
  return made.get();
}

void RayScene::Embree::add_instance(const Instance& instance, unsigned int id, RTCScene shared_mesh,
                                    const RaySpace& space) {
  std::array<float, 12> matrix{};  // column by column
  const glm::dvec3 position = space.from_world(glm::dvec3(instance.to_world[3]));
  for (int column = 0; column < 4; ++column) {
    const glm::dvec3 values = column < 3 ? glm::dvec3(instance.to_world[column]) * space.scale : position;
    for (int row = 0; row < 3; ++row) {
      matrix[3 * static_cast<std::size_t>(column) + static_cast<std::size_t>(row)] = static_cast<float>(values[row]);
    }
  }
  const OwnedGeometry geometry(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
  rtcSetGeometryInstancedScene(geometry.get(), shared_mesh);
  rtcSetGeometryTransform(geometry.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix.data());
  rtcCommitGeometry(geometry.get());
  rtcAttachGeometryByID(top.get(), geometry.get(), id);
}

void RayScene::Embree::add_triangles(const Scene& scene, const InstanceRange& part, unsigned int id,
                                     const RaySpace& space) {
  const Instance& instance = scene.instances[part.instance];
  const OwnedGeometry geometry =
      make_triangles(device.get(), failure, MeshPart(scene.mesh_of(instance), part.range), skipped,
                     [&](const glm::vec3& p) { return space.from_world(world_position(instance, p)); });
  rtcAttachGeometryByID(top.get(), geometry.get(), id);
}

void RayScene::Embree::add_refined(const Scene& scene, const InstanceRange& part, unsigned int id,
                                   const RaySpace& space) {
  RefinedTriangles& parts = refined.emplace_front(refine(scene, scene.instances[part.instance], part.range, space));
  const OwnedGeometry geometry =
      make_triangles(device.get(), failure, RefinedPart{parts}, skipped, [](const glm::dvec3& p) { return p; });
  rtcAttachGeometryByID(top.get(), geometry.get(), id);
  parts.parts = {};
  geometries[id].triangles = parts.triangle_of.data();
}

namespace {

/// See RayGeometry::behind. Instances are tested in their meshes' own coordinates, where nothing is mirrored.
float behind(const Scene& scene, const Instance& instance, bool is_instanced) {
  if (shows_both_sides(scene.materials[scene.mesh_of(instance).material])) return 0.0F;
  return !is_instanced && is_mirrored(instance) ? -1.0F : 1.0F;
}

}  // namespace

RayScene::RayScene(const Scene& scene, const RaySpace& space, int threads)
    : RayScene(scene, space, threads, std::array{SurfaceRange{0, scene.triangles}}) {}

RayScene::RayScene(const Scene& scene, const RaySpace& space, int threads, std::span<const SurfaceRange> objects,
                   const RayBuild& build)
    : space_(space), embree_(std::make_unique<Embree>()) {
  embree_->start(threads, build);
  embree_->top = embree_->new_scene();
  // By the whole scene, whatever the share: an instance is traced by the same numbers on every rank.
  const std::vector<std::uint8_t> is_shared = shared_instances(scene);
  const std::vector<std::uint8_t> is_refined = refined_instances(scene, space);
  for (const InstanceRange& part :
       split_by_instance(scene, merged_ranges({objects.begin(), objects.end()}, scene.triangles))) {
    const Instance& instance = scene.instances[part.instance];
    const auto id = static_cast<unsigned int>(embree_->geometries.size());
    const bool is_instanced = is_shared[part.instance] != 0 && is_refined[part.instance] == 0;
    embree_->geometries.push_back({part.instance, part.range.first, instance.first_surface + part.range.first, nullptr,
                                   behind(scene, instance, is_instanced)});
    if (is_instanced) {
      embree_->add_instance(instance, id, embree_->shared_part(scene, part), space);
    } else if (is_refined[part.instance] != 0) {
      embree_->add_refined(scene, part, id, space);
    } else {
      embree_->add_triangles(scene, part, id, space);
    }
  }
  rtcCommitScene(embree_->top.get());
  embree_->failure.check();
}

std::vector<SurfaceRange> surfaces_at_home(const Scene& scene, const std::optional<std::vector<SurfaceRange>>& part,
                                           const std::vector<SurfaceRange>& surfaces) {
  if (scene.part_pages) return {};
  return part ? common_ranges(merged_ranges(*part, scene.triangles), surfaces) : surfaces;
}

RayScene::~RayScene() {
  if (forwarding_ != nullptr) forwarding_->remove(part_);
}

void RayScene::share(RayForwarding& forwarding, std::vector<SurfaceRange> surfaces, const RayBuild& build) {
  HPR_CHECK(forwarding_ == nullptr);
  part_ = forwarding.add(*this, std::move(surfaces), build);
  forwarding_ = &forwarding;
}

const RayScene& RayScene::of_page(std::size_t page, int threads) const {
  HPR_CHECK(forwarding_ != nullptr);
  return forwarding_->pages()->ray_scene(page, part_, threads);
}

void RayScene::for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body,
                        CallMemory memory) const {
  if (forwarding_ != nullptr) {
    forwarding_->for_each(threads, count, body, memory);
  } else {
    parallel_for(threads, count, body);
  }
}

std::uint64_t RayScene::skipped_triangles() const {
  return embree_->skipped;
}

RTCSceneTy* RayScene::embree() const {
  return embree_->top.get();
}

std::span<const RayGeometry> RayScene::geometries() const {
  return embree_->geometries;
}

double distortion(const glm::dmat3& linear) {
  const glm::dmat3 inverse = glm::inverse(linear);
  double worst = 0.0;
  for (int row = 0; row < 3; ++row) {
    double sum = 0.0;
    for (int column = 0; column < 3; ++column) {
      for (int k = 0; k < 3; ++k) sum += std::abs(linear[k][row]) * std::abs(inverse[column][k]);
    }
    if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
    worst = std::max(worst, sum);
  }
  return worst;
}

std::vector<std::uint8_t> shared_instances(const Scene& scene) {
  std::vector<std::uint32_t> uses(scene.meshes.size(), 0);
  for (const Instance& instance : scene.instances) ++uses[instance.mesh];
  std::vector<std::uint8_t> shared(scene.instances.size(), 0);
  for (std::size_t i = 0; i < shared.size(); ++i) {
    const Instance& instance = scene.instances[i];
    shared[i] = uses[instance.mesh] > 1 && distortion(glm::dmat3(instance.to_world)) <= kMaxDistortion ? 1 : 0;
  }
  return shared;
}

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
  const Faces* faces;    ///< by lane
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

/// Traversal leaves out boxes that begin beyond the distance found, which rounding may have made shorter than that of a
/// surface that is met at the same distance. So it goes on a little past what was found, and this decides: the nearest
/// stays, and of those at one distance that of the lowest surface id, whatever the tree.
void keep_lowest_surface(const RTCFilterFunctionNArguments* arguments) {
  auto& closest = *reinterpret_cast<Closest*>(arguments->context);
  for (unsigned int i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const unsigned int lane = RTCRayN_id(arguments->ray, arguments->N, i);
    const unsigned int outer = RTCHitN_instID(arguments->hit, arguments->N, i, 0);
    const unsigned int geometry =
        outer != RTC_INVALID_GEOMETRY_ID ? outer : RTCHitN_geomID(arguments->hit, arguments->N, i);
    const RayGeometry& shown = closest.geometries[geometry];
    if (closest.faces[lane] == Faces::Front && embree::is_behind(*arguments, i, shown.behind)) {
      arguments->valid[i] = 0;
      continue;
    }
    const std::uint32_t surface =
        shown.first_surface + shown.triangle_of(RTCHitN_primID(arguments->hit, arguments->N, i));
    const float distance = RTCRayN_tfar(arguments->ray, arguments->N, i);
    const bool later =
        distance > closest.distance[lane] || (distance == closest.distance[lane] && surface >= closest.surface[lane]);
    if (later || (closest.passed != nullptr && was_met(closest.passed[lane], surface, shown.instance, distance))) {
      arguments->valid[i] = 0;
    } else {
      closest.distance[lane] = distance;
      closest.surface[lane] = surface;
      closest.instance[lane] = shown.instance;
      RTCRayN_tfar(arguments->ray, arguments->N, i) = distance + kSameEdge * std::max(distance, 1.0F);
    }
  }
}

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
    const int near = static_cast<int>(std::abs(packet.origin[0][i]) < kMaxRayDistance) &
                     static_cast<int>(std::abs(packet.origin[1][i]) < kMaxRayDistance) &
                     static_cast<int>(std::abs(packet.origin[2][i]) < kMaxRayDistance);
    const int finite = static_cast<int>(dx < kMaxRayDistance) & static_cast<int>(dy < kMaxRayDistance) &
                       static_cast<int>(dz < kMaxRayDistance);
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

bool is_traceable(const RayBatch::Ray& ray) {
  bool directed = false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float part = std::abs(ray.direction[axis]);
    if (!(std::abs(ray.origin[axis]) < kMaxRayDistance) || !(part < kMaxRayDistance)) return false;
    directed = directed || part > 0.0F;
  }
  return directed && ray.reach >= 0.0F;
}

std::uint64_t RayScene::occluded(const RayBatch& rays, std::span<std::uint8_t> blocked) const {
  return forwarding_ != nullptr ? forwarding_->occluded(part_, rays, blocked) : occluded_local(rays, blocked);
}

std::uint64_t RayScene::occluded_local(const RayBatch& rays, std::span<std::uint8_t> blocked) const {
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
  if (forwarding_ == nullptr) return find_closest(rays, nullptr, surfaces, coherence);
  return forwarding_->closest(part_, rays, {}, surfaces);
}

std::uint64_t RayScene::closest(const RayBatch& rays, std::span<Passed> passed,
                                std::span<std::uint32_t> surfaces) const {
  return forwarding_ != nullptr ? forwarding_->closest(part_, rays, passed, surfaces)
                                : closest_local(rays, passed, surfaces);
}

std::uint64_t RayScene::closest_local(const RayBatch& rays, std::span<Passed> passed,
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
    closest.faces = rays.packets_[first / kWidth].faces;
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
