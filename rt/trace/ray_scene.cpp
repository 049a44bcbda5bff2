#include "rt/trace/ray_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "rt/trace/embree_compat.h"
#include "rt/trace/travelling_rays.h"
#include "scene/scene.h"

namespace hpr {
namespace {

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

bool tracable(const float* p) {
  return std::abs(p[0]) < kFarthestRay && std::abs(p[1]) < kFarthestRay && std::abs(p[2]) < kFarthestRay;
}

/// Triangles [range.first, range.last) of a mesh, and the vertices they use, numbered anew unless all triangles are
/// meant.
struct MeshPart {
  const Mesh& mesh;
  SurfaceRange range;
  std::vector<std::uint32_t> vertices;  ///< of the mesh; empty: all, in their order
  std::vector<std::uint32_t> place;     ///< of a mesh's vertex among those

  MeshPart(const Mesh& of, SurfaceRange triangles) : mesh(of), range(triangles) {
    if (range.count() == mesh.triangles.size()) return;
    constexpr std::uint32_t kNowhere = std::numeric_limits<std::uint32_t>::max();
    place.assign(mesh.positions.size(), kNowhere);
    for (std::uint32_t i = range.first; i < range.last; ++i) {
      for (int corner = 0; corner < 3; ++corner) {
        std::uint32_t& vertex = place[mesh.triangles[i][corner]];
        if (vertex != kNowhere) continue;
        vertex = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(mesh.triangles[i][corner]);
      }
    }
  }

  [[nodiscard]] std::size_t vertex_count() const { return vertices.empty() ? mesh.positions.size() : vertices.size(); }
  [[nodiscard]] const glm::vec3& position(std::size_t i) const {
    return mesh.positions[vertices.empty() ? i : vertices[i]];
  }
  [[nodiscard]] glm::uvec3 triangle(std::uint32_t i) const {
    const glm::uvec3& t = mesh.triangles[range.first + i];
    return vertices.empty() ? t : glm::uvec3(place[t.x], place[t.y], place[t.z]);
  }
};

/// Fills one geometry; where(position) gives ray-space coordinates. Triangles out of float's reach keep their number
/// but lose their extent, so that primitive ids stay surface ids; `skipped` counts them.
template <typename Where>
OwnedGeometry make_triangles(RTCDevice device, const Failure& failure, const MeshPart& part, std::uint64_t& skipped,
                             Where&& where) {
  OwnedGeometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* const vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), part.vertex_count()));
  auto* const triangles = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), part.range.count()));
  failure.check();
  for (std::size_t i = 0; i < part.vertex_count(); ++i) {
    const glm::dvec3 p = where(part.position(i));
    for (int axis = 0; axis < 3; ++axis) vertices[3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(p[axis]);
  }
  for (std::uint32_t i = 0; i < part.range.count(); ++i) {
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
  OwnedDevice device;
  std::map<SharedPart, OwnedScene> shared;
  OwnedScene top;
  std::vector<RayGeometry> geometries;
  std::uint64_t skipped = 0;
  RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;

  void start(int threads, const RayBuild& build);
  [[nodiscard]] OwnedScene new_scene() const;
  RTCScene shared_part(const Scene& scene, const InstanceRange& part);
  void add_instance(const Instance& instance, unsigned int id, RTCScene shared_mesh, const RaySpace& space);
  void add_triangles(const Scene& scene, const InstanceRange& part, unsigned int id, const RaySpace& space);
};

void RayScene::Embree::start(int threads, const RayBuild& build) {
  quality = quality_of(build);
  const char* const isa = build.same_instructions && __builtin_cpu_supports("avx2") ? ",isa=avx2" : "";
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

void RayScene::Embree::add_triangles(const Scene& scene, const InstanceRange& part, unsigned int id,
                                     const RaySpace& space) {
  const Instance& instance = scene.instances[part.instance];
  const OwnedGeometry geometry =
      make_triangles(device.get(), failure, MeshPart(scene.mesh_of(instance), part.range), skipped,
                     [&](const glm::vec3& p) { return space.from_world(world_position(instance, p)); });
  rtcAttachGeometryByID(top.get(), geometry.get(), id);
}

RayScene::RayScene(const Scene& scene, const RaySpace& space, int threads)
    : RayScene(scene, space, threads, std::array{SurfaceRange{0, scene.triangles}}) {}

RayScene::RayScene(const Scene& scene, const RaySpace& space, int threads, std::span<const SurfaceRange> objects,
                   const RayBuild& build)
    : space_(space), embree_(std::make_unique<Embree>()) {
  embree_->start(threads, build);
  embree_->top = embree_->new_scene();
  // By the whole scene, whatever the share: an instance is traced by the same numbers on every rank.
  const std::vector<std::uint8_t> is_shared = shared_instances(scene);
  for (const InstanceRange& part :
       split_by_instance(scene, merged_ranges({objects.begin(), objects.end()}, scene.triangles))) {
    const Instance& instance = scene.instances[part.instance];
    const auto id = static_cast<unsigned int>(embree_->geometries.size());
    embree_->geometries.push_back({part.instance, part.range.first, instance.first_surface + part.range.first});
    if (is_shared[part.instance] != 0) {
      embree_->add_instance(instance, id, embree_->shared_part(scene, part), space);
    } else {
      embree_->add_triangles(scene, part, id, space);
    }
  }
  rtcCommitScene(embree_->top.get());
  embree_->failure.check();
}

RayScene::~RayScene() {
  if (others_ != nullptr) others_->remove(part_);
}

void RayScene::share(TravellingRays& others) {
  HPR_CHECK(others_ == nullptr);
  part_ = others.add(*this);
  others_ = &others;
}

void RayScene::for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body) const {
  if (others_ != nullptr) {
    others_->for_each(threads, count, body);
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
    shared[i] = uses[instance.mesh] > 1 && distortion(glm::dmat3(instance.to_world)) <= kMostDistortion ? 1 : 0;
  }
  return shared;
}

}  // namespace hpr
