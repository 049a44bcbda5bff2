#include "rt/ray_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/matrix.hpp>
#include <limits>

#include "core/check.h"
#include "core/error.h"
#include "rt/embree_compat.h"

namespace hpr {
namespace {

constexpr std::size_t kWidth = 16;
/// Embree's own limit is the square root of the largest float; past it (or at NaN) builds with assertions abort.
constexpr float kFarthest = 1.8e18F;
constexpr double kMostDistortion = 16.0;

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
    throw Error(ExitCode::NoDevice,
                fmt::format("cannot build the ray scene: Embree error {}: {}", static_cast<int>(code_), text_.data()),
                "give the process more memory, or render without ray passes: --passes none");
  }

 private:
  std::atomic<bool> noted_ = false;
  RTCError code_ = RTC_ERROR_NONE;
  std::array<char, 256> text_{};
};

struct TriangleData {
  float* vertices;           ///< [count][3]
  std::uint32_t* triangles;  ///< [count][3]
};

OwnedGeometry new_triangles(RTCDevice device, std::size_t vertices, std::size_t triangles, TriangleData& data) {
  OwnedGeometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  data.vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0,
                                                              RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices));
  data.triangles = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), triangles));
  return geometry;
}

bool tracable(const float* p) {
  return std::abs(p[0]) < kFarthest && std::abs(p[1]) < kFarthest && std::abs(p[2]) < kFarthest;
}

/// Fills one geometry; place(position) gives ray-space coordinates. Triangles out of float's reach keep their number
/// but lose their extent, so that primitive ids stay surface ids. Returns how many.
template <typename Place>
std::uint64_t fill(const Mesh& mesh, TriangleData data, Place&& place) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const glm::dvec3 p = place(mesh.positions[i]);
    for (int axis = 0; axis < 3; ++axis)
      data.vertices[3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(p[axis]);
  }
  std::uint64_t skipped = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const glm::uvec3& t = mesh.triangles[i];
    const bool usable = tracable(data.vertices + 3 * std::size_t{t.x}) &&
                        tracable(data.vertices + 3 * std::size_t{t.y}) &&
                        tracable(data.vertices + 3 * std::size_t{t.z});
    if (!usable) ++skipped;
    for (int corner = 0; corner < 3; ++corner) {
      data.triangles[3 * i + static_cast<std::size_t>(corner)] = usable ? t[corner] : t.x;
    }
  }
  return skipped;
}

RTCSceneFlags scene_flags() {
  // Fast mode leaks 5.5 % of the rays aimed at shared edges, robust mode none.
  return static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | embree::kFilterFlag);
}

/// What the tie filter knows of the sixteen rays in flight. The Embree context comes first: the filter is handed its
/// address.
struct Closest {
  embree::Context context;
  const std::uint32_t* first_surfaces;
  std::array<float, kWidth> distance;
  std::array<std::uint32_t, kWidth> surface;
};

/// Robust traversal offers candidates at the distance already found as well; of those the lowest surface id stays.
void keep_lowest_surface(const RTCFilterFunctionNArguments* arguments) {
  auto& closest = *reinterpret_cast<Closest*>(arguments->context);
  for (unsigned int i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const unsigned int lane = RTCRayN_id(arguments->ray, arguments->N, i);
    const unsigned int outer = RTCHitN_instID(arguments->hit, arguments->N, i, 0);
    const unsigned int instance =
        outer != RTC_INVALID_GEOMETRY_ID ? outer : RTCHitN_geomID(arguments->hit, arguments->N, i);
    const std::uint32_t surface = closest.first_surfaces[instance] + RTCHitN_primID(arguments->hit, arguments->N, i);
    const float distance = RTCRayN_tfar(arguments->ray, arguments->N, i);
    if (distance == closest.distance[lane] && surface >= closest.surface[lane]) {
      arguments->valid[i] = 0;
    } else {
      closest.distance[lane] = distance;
      closest.surface[lane] = surface;
    }
  }
}

}  // namespace

struct RayScene::Embree {
  Failure failure;
  OwnedDevice device;
  std::vector<OwnedScene> shared;  ///< per mesh; empty where the mesh is in `top` itself
  OwnedScene top;
  std::vector<std::uint32_t> first_surfaces;  ///< per instance
  std::uint64_t skipped = 0;

  void start(int threads);
  void add_shared_mesh(const Mesh& mesh, OwnedScene& scene);
  void add_instance(const Instance& instance, unsigned int id, RTCScene shared_mesh, const RaySpace& space);
  void add_triangles(const Mesh& mesh, const Instance& instance, unsigned int id, const RaySpace& space);
};

void RayScene::Embree::start(int threads) {
  // One instruction set on all ranks: distances differ between AVX2 and AVX-512 in the last bit.
  const char* const isa = __builtin_cpu_supports("avx2") ? ",isa=avx2" : "";
  device = OwnedDevice(rtcNewDevice(fmt::format("threads={},set_affinity=0{}", std::max(threads, 1), isa).c_str()));
  if (device.get() == nullptr) {
    const RTCError error = rtcGetDeviceError(nullptr);
    if (error == RTC_ERROR_OUT_OF_MEMORY)
      throw Error(ExitCode::Limit, "out of memory in Embree", "use fewer ranks or a smaller scene");
    throw Error(ExitCode::NoDevice, fmt::format("cannot start Embree: error {}", static_cast<int>(error)),
                "render without ray passes: --passes none");
  }
  rtcSetDeviceErrorFunction(device.get(), &Failure::note, &failure);
}

void RayScene::Embree::add_shared_mesh(const Mesh& mesh, OwnedScene& scene) {
  TriangleData data{};
  const OwnedGeometry geometry = new_triangles(device.get(), mesh.positions.size(), mesh.triangles.size(), data);
  failure.check();
  skipped += fill(mesh, data, [](const glm::vec3& p) { return glm::dvec3(p); });
  rtcCommitGeometry(geometry.get());
  scene = OwnedScene(rtcNewScene(device.get()));
  rtcSetSceneFlags(scene.get(), scene_flags());
  rtcAttachGeometryByID(scene.get(), geometry.get(), 0);
  rtcCommitScene(scene.get());
  failure.check();
}

void RayScene::Embree::add_instance(const Instance& instance, unsigned int id, RTCScene shared_mesh,
                                    const RaySpace& space) {
  std::array<float, 12> matrix{};  // column by column
  const glm::dvec3 place = space.from_world(glm::dvec3(instance.to_world[3]));
  for (int column = 0; column < 4; ++column) {
    const glm::dvec3 values = column < 3 ? glm::dvec3(instance.to_world[column]) * space.scale : place;
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

void RayScene::Embree::add_triangles(const Mesh& mesh, const Instance& instance, unsigned int id,
                                     const RaySpace& space) {
  TriangleData data{};
  const OwnedGeometry geometry = new_triangles(device.get(), mesh.positions.size(), mesh.triangles.size(), data);
  failure.check();
  skipped += fill(mesh, data, [&](const glm::vec3& p) { return space.from_world(world_position(instance, p)); });
  rtcCommitGeometry(geometry.get());
  rtcAttachGeometryByID(top.get(), geometry.get(), id);
}

RayScene::RayScene(const Scene& scene, const RaySpace& space, int threads) : embree_(std::make_unique<Embree>()) {
  embree_->start(threads);
  embree_->top = OwnedScene(rtcNewScene(embree_->device.get()));
  rtcSetSceneFlags(embree_->top.get(), scene_flags());
  embree_->shared.resize(scene.meshes.size());
  const std::vector<std::uint8_t> is_shared = shared_instances(scene);
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Mesh& mesh = scene.mesh_of(instance);
    embree_->first_surfaces.push_back(instance.first_surface);
    if (mesh.triangles.empty()) continue;
    const auto id = static_cast<unsigned int>(i);
    if (is_shared[i] != 0) {
      OwnedScene& shared_mesh = embree_->shared[instance.mesh];
      if (shared_mesh.get() == nullptr) embree_->add_shared_mesh(mesh, shared_mesh);
      embree_->add_instance(instance, id, shared_mesh.get(), space);
    } else {
      embree_->add_triangles(mesh, instance, id, space);
    }
  }
  rtcCommitScene(embree_->top.get());
  embree_->failure.check();
}

RayScene::~RayScene() = default;

std::uint64_t RayScene::skipped_triangles() const {
  return embree_->skipped;
}

void RayBatch::push(const glm::dvec3& origin, const glm::dvec3& direction, double reach) {
  const std::size_t lane = size_ % kWidth;
  if (size_ / kWidth == packets_.size()) packets_.emplace_back();
  Packet& packet = packets_[size_ / kWidth];
  for (int axis = 0; axis < 3; ++axis) {
    packet.origin[axis][lane] = static_cast<float>(origin[axis]);
    packet.direction[axis][lane] = static_cast<float>(direction[axis]);
  }
  packet.reach[lane] = static_cast<float>(reach);
  ++size_;
}

namespace {

/// Copies a packet into Embree's form and marks with -1 the lanes Embree may see; returns how many of the first `count`
/// it may not.
template <typename Packet>
std::uint64_t load(const Packet& packet, std::size_t count, RTCRay16& rays, int* valid) {
  std::memcpy(rays.org_x, packet.origin, sizeof packet.origin);
  static_assert(offsetof(RTCRay16, org_z) == 2 * sizeof(rays.org_x));
  std::memcpy(rays.dir_x, packet.direction, sizeof packet.direction);
  static_assert(offsetof(RTCRay16, dir_z) - offsetof(RTCRay16, dir_x) == 2 * sizeof(rays.dir_x));
  std::memcpy(rays.tfar, packet.reach, sizeof packet.reach);
  int usable_lanes = 0;
  for (std::size_t i = 0; i < kWidth; ++i) {
    float largest = 0.0F;
    bool ordered = true;
    for (int axis = 0; axis < 3; ++axis) {
      // Comparisons with NaN are false, so NaN fails here too.
      ordered &= std::abs(packet.origin[axis][i]) < kFarthest && std::abs(packet.direction[axis][i]) < kFarthest;
      largest = std::max(largest, std::abs(packet.direction[axis][i]));
    }
    const bool usable = i < count && ordered && largest > 0.0F && packet.reach[i] >= 0.0F;
    valid[i] = usable ? -1 : 0;
    usable_lanes += usable ? 1 : 0;
    if (!usable) {
      // The mask alone does not do: where Embree has no native packet of this width it goes by tnear <= tfar instead,
      // and its assertions look at every lane. So these hold a harmless ray that ends before it begins.
      rays.org_x[i] = rays.org_y[i] = rays.org_z[i] = 0.0F;
      rays.dir_x[i] = rays.dir_y[i] = rays.dir_z[i] = 1.0F;
      rays.tfar[i] = -1.0F;
    }
    rays.tnear[i] = 0.0F;
    rays.time[i] = 0.0F;
    rays.mask[i] = 0xFFFFFFFFU;
    rays.id[i] = static_cast<unsigned int>(i);
    rays.flags[i] = 0;
  }
  return count - static_cast<std::uint64_t>(usable_lanes);
}

}  // namespace

std::uint64_t RayScene::occluded(const RayBatch& rays, std::span<std::uint8_t> blocked) const {
  HPR_CHECK(blocked.size() == rays.size());
  embree::Context context;
  embree::start(context);
  RTCRay16 packet;
  alignas(64) std::array<int, kWidth> valid;
  std::uint64_t invalid = 0;
  for (std::size_t first = 0; first < rays.size(); first += kWidth) {
    const std::size_t count = std::min(kWidth, rays.size() - first);
    invalid += load(rays.packets_[first / kWidth], count, packet, valid.data());
    embree::occluded16(valid.data(), embree_->top.get(), context, packet);
    // Embree marks a blocked ray by a negative tfar.
    for (std::size_t i = 0; i < count; ++i) blocked[first + i] = valid[i] != 0 && packet.tfar[i] < 0.0F ? 1 : 0;
  }
  return invalid;
}

std::uint64_t RayScene::closest(const RayBatch& rays, std::span<std::uint32_t> surfaces) const {
  HPR_CHECK(surfaces.size() == rays.size());
  Closest closest;
  embree::start(closest.context);
  closest.first_surfaces = embree_->first_surfaces.data();
  RTCRayHit16 packet;
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
    embree::intersect16(valid.data(), embree_->top.get(), closest.context, &keep_lowest_surface, packet);
    std::copy_n(closest.surface.begin(), count, surfaces.begin() + static_cast<std::ptrdiff_t>(first));
  }
  return invalid;
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
    shared[i] = uses[instance.mesh] > 1 && distortion(glm::dmat3(instance.to_world)) <= kMostDistortion ? 1 : 0;
  }
  return shared;
}

}  // namespace hpr
