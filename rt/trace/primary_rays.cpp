#include "rt/trace/primary_rays.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <mutex>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "rt/trace/embree_compat.h"
#include "rt/trace/occupied_pixels.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/refined_triangles.h"
#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

/// A triangle's key where a ray meets it.
struct PlacedKey {
  Key key = kNoKey;         ///< kNoKey before the near plane and past the far one
  double along_axis = 0.0;  ///< metres from the eye along the view's axis
};

/// The key of triangle `primitive` of an Embree geometry, for a ray of `view` known to meet it: in double, from the
/// triangle and the ray alone, so that every rank gets the same.
PlacedKey key_along(const Scene& scene, const RaySpace& space, const View& view, const Ray& ray,
                    const RayGeometry& geometry, std::uint32_t primitive) {
  const Instance& instance = scene.instances[geometry.instance];
  const Mesh& mesh = scene.mesh_of(instance);
  const glm::uvec3& corners = mesh.triangle(geometry.first_triangle + primitive);
  // Edges as differences of the mesh's own coordinates, and all of it relative to the eye: far places cost no digits.
  const glm::dmat3 linear(instance.to_world);
  const glm::dvec3 p0(mesh.positions[corners.x]);
  const glm::dvec3 e1 = linear * (glm::dvec3(mesh.positions[corners.y]) - p0);
  const glm::dvec3 e2 = linear * (glm::dvec3(mesh.positions[corners.z]) - p0);
  const glm::dvec3 v0 = linear * p0 + (glm::dvec3(instance.to_world[3]) - view.eye);

  // Moeller and Trumbore 1997, from the ray's origin.
  const glm::dvec3 from_v0 = (ray.origin - view.eye) - v0;
  const glm::dvec3 p = glm::cross(ray.direction, e2);
  const glm::dvec3 q = glm::cross(from_v0, e1);
  const double determinant = glm::dot(e1, p);
  const glm::dvec2 met(glm::dot(from_v0, p) / determinant, glm::dot(ray.direction, q) / determinant);
  const glm::dvec3 from_origin = view.eye - space.origin;
  const bool is_refined = geometry.triangles != nullptr;
  const glm::dvec2 at =
      is_refined ? onto_refined(space, met, {v0 + from_origin, e1, e2, ray.origin - space.origin, ray.direction})
                 : onto_triangle(met.x, met.y);
  const double along_axis = -glm::dot(v0 + at.x * e1 + at.y * e2, view.axes[2]);

  const auto depth = static_cast<float>(reversed_depth(view, along_axis));
  if (!(depth > 0.0F) || !(depth <= 1.0F)) return {kNoKey, along_axis};
  return {make_key(depth, geometry.first_surface + primitive), along_axis};
}

using embree::kWidth;
// Pixels of a packet.
constexpr int kPacketWidth = 4;
constexpr int kPacketHeight = static_cast<int>(kWidth) / kPacketWidth;

// Packets that go down Embree's tree together, and the side of the square of pixels they fill.
constexpr std::size_t kPackets = 8;
constexpr int kSide = 8;
constexpr std::size_t kLanes = kPackets * kWidth;

/// Twice what the distance of a hit, in ray space, may be wrong by.
constexpr float kSlack = 1.0F / 1024.0F;

/// Rays need not start farther than this from the middle of ray space, of which the scene fills [-2, 2]^3 at most.
constexpr double kAround = 4.0;

/// The rays in flight, and the surfaces found so far. The Embree context comes first: the filter is handed its
/// address.
struct Search {
  embree::Context context;
  const Scene* scene;
  RaySpace space;
  std::span<const RayGeometry> geometries;
  const View* view;
  bool through = false;  ///< look at every surface along the rays: none hides another
  /// Candidates whose distances, in ray space, differ by less are compared by their exact depths. Twice the largest
  /// step of a key's depth more than kSlack; then the hit with the largest key is never passed over: any other one that
  /// Embree finds at distance t, with the larger exact one, lies less than this before it.
  float slack = kSlack;
  std::uint64_t weighed = 0;

  std::array<Ray, kLanes> ray;              ///< world
  std::array<double, kLanes> scale{};       ///< from the ray's own parameter to distances in ray space
  std::array<double, kLanes> start{};       ///< distance in ray space at which the traced ray begins
  std::array<float, kLanes> reach{};        ///< below 0: not traced
  std::array<float, kLanes> weigh_below{};  ///< nearer candidates may lie before the near plane

  std::array<bool, kLanes> found{};
  std::array<bool, kLanes> misled{};  ///< something that proved no hit may have hidden a hit
  std::array<float, kLanes> distance{};
  std::array<RayGeometry, kLanes> geometry{};
  std::array<std::uint32_t, kLanes> primitive{};
  std::array<Key, kLanes> key{};  ///< kNoKey: not reckoned yet
};

/// How far apart, in ray space, two surfaces of the scene may lie at most along a ray and have the same depth in keys.
double largest_depth_step(const View& view, const RaySpace& space) {
  constexpr double kHalfUlp = 0x1p-24;  // of depths up to 1
  if (view.orthographic) return kHalfUlp * (view.far_distance - view.near_distance) * space.scale;
  return 2.0 * kHalfUlp * (glm::length(space.from_world(view.eye)) + kAround);
}

const glm::uvec3& corners_of(const Search& search, std::size_t lane) {
  const RayGeometry& geometry = search.geometry[lane];
  const Mesh& mesh = search.scene->mesh_of(search.scene->instances[geometry.instance]);
  return mesh.triangle(geometry.first_triangle + search.primitive[lane]);
}

/// The key of a triangle at a lane's pixel; kNoKey where it lies before the near plane, past the far one, or not at
/// about `distance`.
Key exact_key(const Search& search, std::size_t lane, const RayGeometry& geometry, std::uint32_t primitive,
              float distance) {
  const PlacedKey met = key_along(*search.scene, search.space, *search.view, search.ray[lane], geometry, primitive);
  const double expected = met.along_axis * search.scale[lane] - search.start[lane];
  const bool near = std::abs(static_cast<double>(distance) - expected) <= 0.5 * static_cast<double>(kSlack);
  return near ? met.key : kNoKey;
}

/// Decides between two candidates whose distances say too little. Returns whether the new one stays.
bool weigh(Search& search, std::size_t lane, const RayGeometry& geometry, std::uint32_t primitive, float distance) {
  ++search.weighed;
  const Key key = exact_key(search, lane, geometry, primitive, distance);
  if (key == kNoKey) return false;
  if (search.found[lane] && search.key[lane] == kNoKey) {
    search.key[lane] = exact_key(search, lane, search.geometry[lane], search.primitive[lane], search.distance[lane]);
    if (search.key[lane] == kNoKey) search.misled[lane] = true;
  }
  const float before = search.found[lane] ? search.distance[lane] : std::numeric_limits<float>::infinity();
  if (!search.found[lane] || key > search.key[lane]) {
    search.geometry[lane] = geometry;
    search.primitive[lane] = primitive;
    search.key[lane] = key;
    search.distance[lane] = distance;
    search.found[lane] = true;
  }
  return distance < before;
}

/// Embree offers candidates in any order; those at most a slack behind the nearest are still of interest.
void keep_largest_key(const RTCFilterFunctionNArguments* arguments) {
  auto& search = *reinterpret_cast<Search*>(arguments->context);
  for (unsigned int i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const std::size_t lane = RTCRayN_id(arguments->ray, arguments->N, i);
    const unsigned int outer = RTCHitN_instID(arguments->hit, arguments->N, i, 0);
    const RayGeometry& geometry =
        search.geometries[outer != RTC_INVALID_GEOMETRY_ID ? outer : RTCHitN_geomID(arguments->hit, arguments->N, i)];
    if (embree::is_behind(*arguments, i, geometry.behind)) {
      arguments->valid[i] = 0;
      continue;
    }
    const std::uint32_t primitive = geometry.triangle_of(RTCHitN_primID(arguments->hit, arguments->N, i));
    float& limit = RTCRayN_tfar(arguments->ray, arguments->N, i);
    const float distance = limit;
    const float gap = search.found[lane] ? distance - search.distance[lane] : -std::numeric_limits<float>::infinity();
    bool nearest = gap < -search.slack;
    if (search.through || distance < search.weigh_below[lane] || std::abs(gap) <= search.slack) {
      nearest = weigh(search, lane, geometry, primitive, distance);
    } else if (nearest) {
      search.found[lane] = true;
      search.distance[lane] = distance;
      search.geometry[lane] = geometry;
      search.primitive[lane] = primitive;
      search.key[lane] = kNoKey;
      __builtin_prefetch(&corners_of(search, lane));
    }
    if (nearest && !search.through) {
      limit = std::min(distance + search.slack, search.reach[lane]);
    } else {
      arguments->valid[i] = 0;
    }
  }
}

/// One thread's work on a tile.
class TileTracer {
 public:
  /// `views` differ by their jitter only.
  TileTracer(const Scene& scene, const RayScene& rays, std::span<const View> views) : rays_(rays), looks_(views) {
    const View& view = views.front();
    embree::start(search_.context, embree::Rays::Coherent);
    search_.scene = &scene;
    search_.space = rays.space();
    search_.geometries = rays.geometries();
    search_.view = &view;
    stand_at(rays.space().from_world(view.eye));
    search_.slack = static_cast<float>(
        std::min<double>(kSlack + 2.0 * largest_depth_step(view, rays.space()), std::numeric_limits<float>::max()));
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      embree::RayPacket& packet = packets_[lane / kWidth].ray;
      packet.tnear[lane % kWidth] = 0.0F;
      packet.time[lane % kWidth] = 0.0F;
      packet.mask[lane % kWidth] = 0xFFFFFFFFU;
      packet.id[lane % kWidth] = static_cast<unsigned int>(lane);
      packet.flags[lane % kWidth] = 0;
    }
  }

  /// Merges the keys of those of `pixels`, in the tile at (x0, y0), that are set in its `mask`; keys[i] are of view i.
  /// The rays of all views through a pixel lie together, and pixels square by square: they meet about the same.
  void trace(const Rect& pixels, int x0, int y0, std::span<const std::uint8_t> mask,
             std::span<const std::span<Key>> keys) {
    for_squares(pixels, kSide, kSide, [&](const Rect& square) {
      for_squares(square, kPacketWidth, kPacketHeight, [&](const Rect& part) {
        for (int i = 0; i < part.width() * part.height(); ++i) {
          const int column = part.x0 + i % part.width();
          const int row = part.y0 + i / part.width();
          const auto pixel = static_cast<std::uint32_t>((row - y0) * kTileSide + column - x0);
          if (mask[pixel] != 0) add(pixel, column, row, keys);
        }
        // A packet that reaches into two parts is slower than two packets.
        while (lanes_ % kWidth != 0) leave_out(lanes_++);
        if (lanes_ == kLanes) trace(keys);
      });
      if (lanes_ > 0) trace(keys);
    });
  }

  /// A bit per view that shows any surface.
  [[nodiscard]] std::uint64_t seen() const { return seen_; }

  [[nodiscard]] PrimaryRayStats stats() const {
    PrimaryRayStats stats = stats_;
    stats.weighed = search_.weighed;
    return stats;
  }

 private:
  /// The pieces of `pixels` on a grid of that many pixels.
  template <typename Visit>
  static void for_squares(const Rect& pixels, int width, int height, Visit&& visit) {
    for (int y = pixels.y0; y < pixels.y1; y = (y / height + 1) * height) {
      for (int x = pixels.x0; x < pixels.x1; x = (x / width + 1) * width) {
        visit(intersection(Rect{x, y, (x / width + 1) * width, (y / height + 1) * height}, pixels));
      }
    }
  }

  /// Adds the rays of every view through a pixel; they are traced when no lane is free.
  void add(std::uint32_t pixel, int column, int row, std::span<const std::span<Key>> keys) {
    for (std::size_t view = 0; view < looks_.size(); ++view) {
      if (lanes_ == kLanes) trace(keys);
      look_[lanes_] = view;
      pixel_[lanes_] = pixel;
      aim(lanes_++, view_ray(looks_[view], column + 0.5, row + 0.5));
      ++stats_.rays;
    }
  }

  /// The rays added since the last time; full packets of them.
  void trace(std::span<const std::span<Key>> keys) {
    HPR_CHECK(lanes_ % kWidth == 0);
    search_.through = false;
    intersect();
    const std::size_t again = settle();
    if (again > 0) {
      stats_.retraced += again;
      search_.through = true;
      intersect();
    }
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
      if (!search_.found[lane]) continue;
      Key& key = keys[look_[lane]][pixel_[lane]];
      key = std::max(key, search_.key[lane]);
      seen_ |= std::uint64_t{1} << look_[lane];
    }
    lanes_ = 0;
  }

  /// Where rays come from, in ray space.
  void stand_at(const glm::dvec3& eye) {
    eye_ = eye;
    outside_ = glm::length(eye) - kAround;
  }

  /// Ray space's origin and unit direction, moved along the ray as far as nothing can be missed: a start near the scene
  /// keeps digits that a far eye's coordinates would lose.
  void aim(std::size_t lane, const Ray& ray) {
    const RaySpace& space = rays_.space();
    const View& view = *search_.view;
    const double length = glm::length(ray.direction);
    const glm::dvec3 direction = ray.direction * (1.0 / length);
    if (view.orthographic) stand_at(space.from_world(ray.origin));
    const double scale = length * space.scale;
    const double near = view.near_distance * scale;
    const double start = std::max({0.0, near - static_cast<double>(kSlack), outside_});
    const glm::dvec3 origin = eye_ + start * direction;
    const double reach = view.orthographic ? view.far_distance * scale - start + static_cast<double>(kSlack)
                                           : std::numeric_limits<double>::infinity();
    search_.ray[lane] = ray;
    search_.scale[lane] = scale;
    search_.start[lane] = start;
    search_.reach[lane] = static_cast<float>(reach);
    search_.weigh_below[lane] = static_cast<float>(near - start) + kSlack;

    search_.found[lane] = search_.misled[lane] = false;
    search_.key[lane] = kNoKey;

    embree::RayPacket& rays = packets_[lane / kWidth].ray;
    const std::size_t i = lane % kWidth;
    rays.org_x[i] = static_cast<float>(origin.x);
    rays.org_y[i] = static_cast<float>(origin.y);
    rays.org_z[i] = static_cast<float>(origin.z);
    rays.dir_x[i] = static_cast<float>(direction.x);
    rays.dir_y[i] = static_cast<float>(direction.y);
    rays.dir_z[i] = static_cast<float>(direction.z);
    const glm::dvec3 size = glm::abs(origin);
    // Comparisons with NaN are false, so NaN fails here too. A direction of unit length needs no more than that.
    const bool usable = size.x < kMaxRayDistance && size.y < kMaxRayDistance && size.z < kMaxRayDistance &&
                        length > 0.0 && length < kMaxRayDistance && reach >= 0.0;
    if (!usable) {
      leave_out(lane);
      ++stats_.invalid;
    }
  }

  /// A lane that shall find nothing. Embree's assertions look at its ray all the same.
  void leave_out(std::size_t lane) {
    embree::RayPacket& rays = packets_[lane / kWidth].ray;
    const std::size_t i = lane % kWidth;
    rays.org_x[i] = rays.org_y[i] = rays.org_z[i] = 0.0F;
    rays.dir_x[i] = rays.dir_y[i] = rays.dir_z[i] = 1.0F;
    search_.reach[lane] = -1.0F;
    search_.found[lane] = search_.misled[lane] = false;
  }

  void intersect() {
    const std::size_t packets = lanes_ / kWidth;
    for (std::size_t packet = 0; packet < packets; ++packet) {
      for (std::size_t i = 0; i < kWidth; ++i) {
        packets_[packet].ray.tfar[i] = search_.reach[packet * kWidth + i];
        packets_[packet].hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        packets_[packet].hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      }
    }
    embree::intersect(rays_.embree(), search_.context, &keep_largest_key, std::span(packets_).first(packets));
  }

  /// Reckons the keys still missing; leaves in flight, and returns the number of, the lanes to trace once more.
  std::size_t settle() {
    // Triangles of neighbouring pixels lie far apart in memory: all are prefetched before the first is used.
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
      if (!search_.found[lane]) continue;
      const Mesh& mesh = search_.scene->mesh_of(search_.scene->instances[search_.geometry[lane].instance]);
      const glm::uvec3& corners = corners_of(search_, lane);
      for (int corner = 0; corner < 3; ++corner) __builtin_prefetch(&mesh.positions[corners[corner]]);
    }
    std::size_t again = 0;
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
      if (search_.found[lane] && search_.key[lane] == kNoKey) {
        search_.key[lane] =
            exact_key(search_, lane, search_.geometry[lane], search_.primitive[lane], search_.distance[lane]);
        search_.misled[lane] = search_.misled[lane] || search_.key[lane] == kNoKey;
      }
      again += search_.misled[lane] ? 1U : 0U;
    }
    for (std::size_t lane = 0; again > 0 && lane < lanes_; ++lane) {
      if (!search_.misled[lane]) search_.reach[lane] = -1.0F;  // what it has found stays
      if (search_.misled[lane]) search_.found[lane] = false;
    }
    return again;
  }

  const RayScene& rays_;
  std::span<const View> looks_;
  std::uint64_t seen_ = 0;
  glm::dvec3 eye_{0.0};
  double outside_ = 0.0;  ///< how far the eye lies outside of what the scene can fill
  Search search_{};
  std::size_t lanes_ = 0;  ///< in use
  // Where a lane's key goes: to keys[pixel] of a tile, as its view shows it.
  std::array<std::size_t, kLanes> look_{};
  std::array<std::uint32_t, kLanes> pixel_{};
  std::array<embree::HitPacket, kPackets> packets_{};
  PrimaryRayStats stats_;
};

void draw_tile(TileTracer& tracer, std::size_t tile, std::span<const Rect> parts, std::span<const std::uint8_t> mask,
               std::span<TileLayer<Key>* const> layers) {
  const trace::Span span("trace tile", "tile", tile);
  const DenormalsAsZero mode;
  const Rect rect = layers.front()->layout().place(tile).pixels;
  if (std::ranges::none_of(parts, [&](const Rect& part) { return !intersection(part, rect).empty(); })) return;
  std::array<std::span<Key>, PrimaryRays::kMaxViews> keys;
  for (std::size_t view = 0; view < layers.size(); ++view) {
    layers[view]->touch(tile);
    keys.at(view) = layers[view]->tile(tile);
  }
  for (const Rect& part : parts) {
    const Rect pixels = intersection(part, rect);
    if (!pixels.empty()) tracer.trace(pixels, rect.x0, rect.y0, mask, std::span(keys).first(layers.size()));
  }
  for (std::size_t view = 0; view < layers.size(); ++view) {
    if ((tracer.seen() >> view & 1U) != 0) layers[view]->set_active(tile);
  }
}

}  // namespace

PrimaryRays::PrimaryRays(const Scene& scene, const RayScene& rays, int threads)
    : scene_(scene), rays_(rays), threads_(threads), boxes_(scene) {}

void PrimaryRays::draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer) {
  draw(std::span(&view, 1), screen, parts, std::array{&layer});
}

void PrimaryRays::draw(std::span<const View> views, std::size_t screen, std::span<const Rect> parts,
                       std::span<TileLayer<Key>* const> layers, const PixelMask* wanted) {
  HPR_CHECK(!views.empty() && views.size() <= kMaxViews && views.size() == layers.size());
  const View& view = views.front();
  const FrameLayout& layout = layers.front()->layout();
  HPR_CHECK(screen < layout.screens() && layout.size(screen) == view.size());
  HPR_CHECK(view.orthographic ? view.far_distance > view.near_distance : view.near_distance > 0.0);
  stats_ = {};
  costs_.clear();
  if (rays_.geometries().empty()) return;
  const TileRun run = layout.tiles_of(screen);
  const OccupiedPixels occupied(scene_, rays_, boxes_, views, layout, screen);
  std::mutex mutex;
  parallel_for(threads_, run.count, [&](std::size_t i) {
    const CpuStopwatch watch;
    std::array<std::uint8_t, kTilePixels> mask;
    const std::size_t tile = run.first + i;
    if (!occupied.mark(tile, layout.place(tile).pixels, mask)) return;
    const std::span<const std::uint8_t> asked = mask_of(wanted, tile);
    if (!asked.empty()) std::ranges::transform(mask, asked, mask.begin(), std::bit_and<>());
    if (std::ranges::find(mask, std::uint8_t{1}) == mask.end()) return;
    TileTracer tracer(scene_, rays_, views);
    draw_tile(tracer, tile, parts, mask, layers);
    const std::lock_guard lock(mutex);
    stats_ += tracer.stats();
    costs_.push_back({tile, watch.ms()});
  });
}

}  // namespace hpr
