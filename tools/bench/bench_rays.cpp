#include "tools/bench/bench_rays.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <span>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/options/render_options.h"
#include "core/error.h"
#include "core/text.h"
#include "image/tiles.h"
#include "rt/passes/pass_list.h"
#include "rt/trace/embree_compat.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/view.h"
#include "tools/bench/bench.h"
#include "tools/bench/bench_device.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

constexpr int kTries = 5;
constexpr std::size_t kWidth = 16;
constexpr std::size_t kBatch = kTilePixels;  // rays a pass traces at once
constexpr std::size_t kStretch = 4 * kBatch;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// In ray space.
struct BenchRay {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0};
  double max_distance = kInfinity;
};

enum class Query { Closest, Occluded };

struct RaySet {
  RayPattern pattern;
  Query query;
  embree::Rays kind;
  std::vector<BenchRay> rays;
};

/// Answers of either side, summed so that no work can be left out.
using Hits = std::uint64_t;

class OurRays {
 public:
  OurRays(const RayScene& scene, const RaySet& set) : scene_(scene), set_(set), hits_(kBatch), blocked_(kBatch) {}

  Hits trace(std::size_t begin, std::size_t end) {
    Hits sum = 0;
    for (std::size_t first = begin; first < end; first += kBatch) {
      batch_.clear();
      const std::size_t count = std::min(kBatch, end - first);
      for (const BenchRay& ray : std::span(set_.rays).subspan(first, count)) {
        batch_.push(ray.origin, ray.direction, ray.max_distance);
      }
      if (set_.query == Query::Closest) {
        const std::span<std::uint32_t> hits(hits_.data(), count);
        (void)scene_.closest(batch_, hits, set_.kind == embree::Rays::Coherent ? Coherence::High : Coherence::Low);
        for (const std::uint32_t hit : hits) sum += hit != kNoSurface ? 1U : 0U;
      } else {
        const std::span<std::uint8_t> blocked(blocked_.data(), count);
        (void)scene_.occluded(batch_, blocked);
        for (const std::uint8_t hidden : blocked) sum += hidden;
      }
    }
    return sum;
  }

 private:
  const RayScene& scene_;
  const RaySet& set_;
  RayBatch batch_;
  std::vector<std::uint32_t> hits_;
  std::vector<std::uint8_t> blocked_;
};

/// The floor: Embree alone.
class BareRays {
 public:
  BareRays(const RayScene& scene, const RaySet& set)
      : scene_(scene), set_(set), packets_((set.rays.size() + kWidth - 1) / kWidth), valid_(packets_.size()) {
    for (std::size_t i = 0; i < packets_.size() * kWidth; ++i) {
      const bool used = i < set.rays.size();
      const BenchRay& ray = set.rays[used ? i : set.rays.size() - 1];
      const std::size_t lane = i % kWidth;
      RTCRay16& to = packets_[i / kWidth];
      to.org_x[lane] = static_cast<float>(ray.origin.x);
      to.org_y[lane] = static_cast<float>(ray.origin.y);
      to.org_z[lane] = static_cast<float>(ray.origin.z);
      to.dir_x[lane] = static_cast<float>(ray.direction.x);
      to.dir_y[lane] = static_cast<float>(ray.direction.y);
      to.dir_z[lane] = static_cast<float>(ray.direction.z);
      to.tnear[lane] = 0.0F;
      to.tfar[lane] = used ? static_cast<float>(ray.max_distance) : -1.0F;
      to.time[lane] = 0.0F;
      to.mask[lane] = 0xFFFFFFFFU;
      to.id[lane] = 0;
      to.flags[lane] = 0;
      valid_[i / kWidth].lanes[lane] = used ? -1 : 0;
    }
  }

  Hits trace(std::size_t begin, std::size_t end) {
    embree::Context context;
    embree::start(context, set_.kind);
    Hits sum = 0;
    for (std::size_t i = begin / kWidth; i * kWidth < end; ++i) {
      const int* const valid = valid_[i].lanes.data();
      if (set_.query == Query::Closest) {
        RTCRayHit16 packet;
        packet.ray = packets_[i];
        std::ranges::fill(packet.hit.geomID, RTC_INVALID_GEOMETRY_ID);
        std::ranges::fill(packet.hit.instID[0], RTC_INVALID_GEOMETRY_ID);
        embree::intersect(valid, scene_.embree(), context, nullptr, packet);
        for (const unsigned int id : packet.hit.geomID) sum += id != RTC_INVALID_GEOMETRY_ID ? 1U : 0U;
      } else {
        RTCRay16 packet = packets_[i];
        embree::occluded(valid, scene_.embree(), context, packet);
        for (std::size_t lane = 0; lane < kWidth; ++lane) {
          sum += valid[lane] != 0 && packet.tfar[lane] < 0.0F ? 1U : 0U;
        }
      }
    }
    return sum;
  }

 private:
  struct alignas(64) Lanes {
    std::array<int, kWidth> lanes;
  };
  const RayScene& scene_;
  const RaySet& set_;
  std::vector<RTCRay16> packets_;
  std::vector<Lanes> valid_;
};

/// Both sides in turn, a stretch of the rays at a time; each side's best on every stretch counts.
BenchRow compare(const RayScene& scene, const RaySet& set) {
  OurRays ours(scene, set);
  BareRays bare(scene, set);
  double our_ms = 0.0;
  double floor_ms = 0.0;
  for (std::size_t begin = 0; begin < set.rays.size(); begin += kStretch) {
    const std::size_t end = std::min(begin + kStretch, set.rays.size());
    double our_best = kInfinity;
    double floor_best = kInfinity;
    for (int i = 0; i < kTries; ++i) {
      const double start = thread_ms();
      const Hits our_hits = ours.trace(begin, end);
      const double between = thread_ms();
      const Hits expected = bare.trace(begin, end);
      our_best = std::min(our_best, between - start);
      floor_best = std::min(floor_best, thread_ms() - between);
      if (our_hits != expected) {
        throw Error(ExitCode::CheckFailed, fmt::format("{} rays: {} met something, but {} in Embree alone",
                                                       name_of(set.pattern), our_hits, expected));
      }
    }
    our_ms += our_best;
    floor_ms += floor_best;
  }
  const double rate = static_cast<double>(set.rays.size()) * 1e-3;  // a thousand per ms is a million per second
  return {std::string(name_of(set.pattern)), rate / our_ms, rate / floor_ms, "M/s", floor_ms / our_ms};
}

/// What primary rays meet, and the rays that go on from there, in the order of the primary ones.
std::vector<RaySet> make_sets(const Scene& scene, const RayScene& rays, const View& view) {
  const RaySpace& space = rays.space();
  std::vector<RaySet> sets{{RayPattern::Primary, Query::Closest, embree::Rays::Coherent, {}},
                           {RayPattern::Shadow, Query::Occluded, embree::Rays::Incoherent, {}},
                           {RayPattern::Mirror, Query::Closest, embree::Rays::Incoherent, {}},
                           {RayPattern::Diffuse, Query::Closest, embree::Rays::Incoherent, {}}};
  RayBatch batch;
  std::vector<Ray> view_rays;
  const Size size = view.size();
  for (int i = 0; i < size.width * size.height; ++i) {
    // Squares of four by four, square after square in a row of them.
    const int x = i / 16 % (size.width / 4) * 4 + i % 4;
    const int y = i / (size.width * 4) * 4 + i / 4 % 4;
    const Ray ray = view_ray(view, x + 0.5, y + 0.5);
    view_rays.push_back(ray);
    sets[0].rays.push_back({space.from_world(ray.origin), glm::normalize(ray.direction), kInfinity});
    batch.push(sets[0].rays.back().origin, sets[0].rays.back().direction, kInfinity);
  }
  std::vector<std::uint32_t> hits(batch.size());
  (void)rays.closest(batch, hits);

  const Surfaces surfaces(scene, space);
  const glm::dvec3 light = scene.lights.empty() ? view.eye + view.axes[1] : scene.lights.front().position;
  WorldTriangle triangle;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (hits[i] == kNoSurface) continue;
    surfaces.load(hits[i], triangle);
    const SurfacePoint point = surfaces.meet(triangle, view_rays[i].origin, view_rays[i].direction);
    const glm::dvec3& normal = point.geometric_normal;
    const glm::dvec3 origin = space.from_world(point.position + point.offset * normal);
    const glm::dvec3 to_light = space.from_world(light) - origin;
    const double distance = glm::length(to_light);
    if (glm::dot(to_light, normal) > 0.0) sets[1].rays.push_back({origin, to_light / distance, 0.999 * distance});
    sets[2].rays.push_back({origin, glm::reflect(-point.to_viewer, normal), kInfinity});
    // A point on the unit sphere about the normal's tip: distributed as the cosine.
    const double turn = 2.0 * std::numbers::pi * std::fmod(0.6180339887498949 * static_cast<double>(i), 1.0);
    const double z = 1.0 - 2.0 * std::fmod(0.7548776662466927 * static_cast<double>(i), 1.0);
    const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
    const glm::dvec3 diffuse = normal * 1.0000001 + glm::dvec3(r * std::cos(turn), r * std::sin(turn), z);
    sets[3].rays.push_back({origin, glm::normalize(diffuse), kInfinity});
  }
  return sets;
}

/// What bare Embree takes for a set, best of some tries, and the set in the world, as devices have it.
DeviceRays for_device(std::string_view name, const RayScene& scene, const RaySet& set) {
  const DenormalsAsZero mode;
  const RaySpace& space = scene.space();
  DeviceRays made{name, set.query == Query::Closest ? GpuRayBatch::Query::Closest : GpuRayBatch::Query::AnyHit, {}};
  for (const BenchRay& ray : set.rays) {
    made.rays.push_back({space.origin + ray.origin / space.scale, ray.direction, ray.max_distance / space.scale});
  }
  BareRays bare(scene, set);
  made.embree_ms = kInfinity;
  for (int i = 0; i < kTries; ++i) {
    const double start = thread_ms();
    made.embree_hits = bare.trace(0, set.rays.size());
    made.embree_ms = std::min(made.embree_ms, thread_ms() - start);
  }
  return made;
}

/// Primary rays, and diffuse ones of both queries, on a device.
std::vector<BenchRow> bench_on_device(const GpuDevice& device, const Scene& scene, const RayScene& rays,
                                      const View& view) {
  std::vector<DeviceRays> sets;
  for (RaySet& set : make_sets(scene, rays, view)) {
    if (set.rays.empty()) continue;
    if (set.pattern == RayPattern::Primary) sets.push_back(for_device("primary", rays, set));
    if (set.pattern != RayPattern::Diffuse) continue;
    sets.push_back(for_device("diffuse", rays, set));
    set.query = Query::Occluded;
    sets.push_back(for_device("diffuse, any hit", rays, set));
  }
  std::vector<BenchRow> rows = bench_device_rays(device, scene, sets);
  const std::vector<BenchRow> read = bench_read_back(device);
  rows.insert(rows.end(), read.begin(), read.end());
  return rows;
}

/// bench_rays of a picture of `side` x `side` pixels by the scene's first camera; on a device as well, unless null.
std::vector<BenchRow> bench_picture(const Scene& scene, int side, const RayBuild& build, const GpuDevice* device) {
  const RayScene rays(scene, RaySpace(scene), 1, std::array{SurfaceRange{0, scene.triangles}}, build);
  const Camera camera = scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front();
  const View view = make_view(camera, {side, side}, scene.bounds);
  std::vector<BenchRow> rows = bench_rays(scene, rays, view);
  if (device == nullptr) return rows;
  const std::vector<BenchRow> more = bench_on_device(*device, scene, rays, view);
  rows.insert(rows.end(), more.begin(), more.end());
  return rows;
}

class BenchRaysCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "rays"; }
  [[nodiscard]] std::string_view summary() const override {
    return "rays of one thread as passes trace them, and with --backend vulkan a device's, against a bare Embree loop";
  }

  void declare(const OptionSet& options) override {
    const Option scene = options.option("scene", scene_, "another scene to trace");
    options.option("--triangles", triangles_, "of the largest mesh of the scene made for it")
        .range(std::uint64_t{100}, std::uint64_t{100'000'000})
        .show_default()
        .excludes(scene);
    options.option("--side", side_, "pixels of the square picture, a multiple of 64").range(64, 8192).show_default();
    for (const char* const name : {"embree-quality", "deterministic"}) {
      declare_setting(options, settings_, *find_setting(name));
    }
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const RayBuild build = settings_.frame.rays.build;
    if (side_ % kTileSide != 0) {
      throw Error(ExitCode::Usage, fmt::format("--side {} is no multiple of {}", side_, kTileSide),
                  fmt::format("use --side {}", side_ / kTileSide * kTileSide));
    }
    const Scene scene = scene_.empty() ? ray_bench_scene(triangles_) : load_scene(scene_, globals.scene_limits());
    const std::unique_ptr<GpuDevice> device = measures_device(globals) ? device_of(globals) : nullptr;
    print_bench(bench_picture(scene, side_, build, device.get()), this_machine().cpu, json_);
    return ExitCode::Done;
  }

 private:
  std::string scene_;
  std::uint64_t triangles_ = 1'000'000;
  int side_ = 1024;
  RenderSettings settings_;
  bool json_ = false;
};

}  // namespace

std::vector<BenchRow> bench_rays(const Scene& scene, const RayScene& rays, const View& view) {
  const DenormalsAsZero mode;
  std::vector<BenchRow> rows;
  for (const RaySet& set : make_sets(scene, rays, view)) {
    if (!set.rays.empty()) rows.push_back(compare(rays, set));
  }
  return rows;
}

std::unique_ptr<Command> make_bench_rays_command() {
  return std::make_unique<BenchRaysCommand>();
}

}  // namespace hpr
