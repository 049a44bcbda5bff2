#include "rt/trace/occupied_pixels.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <iterator>
#include <limits>
#include <optional>

#include "scene/scene.h"

namespace hpr {
namespace {

/// By how much rounding may move what a ray meets, generously, in ray space: places are below 8 there, instances
/// enlarge errors at most sixteen times (ray_scene.cpp), and slivers are met somewhat beside where they are.
constexpr double kRounding = 1.0 / 2048.0;
/// Past this many boxes looking at each costs more than rays that miss.
constexpr std::size_t kMaxBoxes = 200'000;
/// About so many are made of a scene's surfaces, of no fewer triangles each on average.
constexpr std::size_t kBoxes = 2048;
constexpr std::size_t kMinTriangles = 64;

/// Homogeneous coordinates of the screen's pixels as a linear function of places: x / w and y / w are pixels.
struct PixelMap {
  glm::dvec4 x, y, w;  ///< rows

  PixelMap(const View& view, const glm::dmat4& to_world) {
    glm::dmat4 from_eye = to_world;
    from_eye[3] -= glm::dvec4(view.eye, 0.0);
    const glm::dmat4 rows = glm::transpose(clip_from_world(view, view.eye) * from_eye);
    const Size size = view.size();
    w = rows[3];
    x = 0.5 * size.width * (w + rows[0]);
    y = 0.5 * size.height * (w - rows[1]);
  }
};

/// By how much moving a place by `metres` changes each of them.
struct PixelSlack {
  double x, y, w;

  PixelSlack(const PixelMap& of_world, double metres)
      : x(metres * glm::length(glm::dvec3(of_world.x))),
        y(metres * glm::length(glm::dvec3(of_world.y))),
        w(metres * glm::length(glm::dvec3(of_world.w))) {}
};

/// By how much other views' pixels lie beside those of the first.
struct Shifts {
  glm::dvec2 least{0.0};
  glm::dvec2 most{0.0};

  explicit Shifts(std::span<const View> views) {
    for (const View& view : views) {
      const glm::dvec2 shift = views.front().jitter - view.jitter;
      least = glm::min(least, shift);
      most = glm::max(most, shift);
    }
  }
};

/// The pixels whose centres a box may be seen at, unless it reaches behind the near plane.
std::optional<Rect> pixels_of(const View& view, const Shifts& shifts, const PixelMap& map, const PixelSlack& slack,
                              const Bounds& box) {
  glm::dvec2 low(std::numeric_limits<double>::infinity());
  glm::dvec2 high(-std::numeric_limits<double>::infinity());
  const double nearest = view.orthographic ? 0.5 : 0.5 * view.near_distance;
  unsigned int behind = 0;
  bool reaches_behind = false;
  for (unsigned int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 position((corner & 1U) != 0 ? box.high.x : box.low.x, (corner & 2U) != 0 ? box.high.y : box.low.y,
                              (corner & 4U) != 0 ? box.high.z : box.low.z, 1.0);
    const double w = glm::dot(map.w, position);
    if (w + slack.w < nearest) ++behind;
    reaches_behind = reaches_behind || !(w - slack.w >= nearest);
    if (reaches_behind) continue;
    const glm::dvec2 pixel(glm::dot(map.x, position) / w, glm::dot(map.y, position) / w);
    const glm::dvec2 moved = (glm::dvec2(slack.x, slack.y) + glm::abs(pixel) * slack.w) / (w - slack.w);
    low = glm::min(low, pixel - moved);
    high = glm::max(high, pixel + moved);
  }
  if (behind == 8) return Rect{};
  if (reaches_behind) return std::nullopt;
  low += shifts.least;
  high += shifts.most;
  if (!std::isfinite(low.x + low.y + high.x + high.y)) return std::nullopt;
  const auto within = [](double value, int limit) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(limit)));
  };
  // Pixel i has its centre at i + 0.5; a hundredth more for what is reckoned here.
  const Size size = view.size();
  return Rect{within(low.x - 0.51, size.width), within(low.y - 0.51, size.height), within(high.x + 0.51, size.width),
              within(high.y + 0.51, size.height)};
}

/// Cells of a grid over a box, cubes: the box's own surface would be in about `wanted` of them.
class Cells {
 public:
  Cells(const Bounds& box, std::size_t wanted) : low_(box.low) {
    const glm::dvec3 size = box.high - box.low;
    const double area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    const double most = std::max(static_cast<double>(wanted), 1.0);
    const double side = std::max(std::sqrt(area / most), std::max({size.x, size.y, size.z}) / most);
    for (int axis = 0; axis < 3; ++axis) {
      if (!(side > 0.0) || !(size[axis] > 0.0)) continue;
      per_metre_[axis] = 1.0 / side;
      count_[axis] = static_cast<std::uint32_t>(size[axis] / side) + 1;
    }
  }

  [[nodiscard]] std::size_t count() const { return std::size_t{count_.x} * count_.y * count_.z; }
  [[nodiscard]] std::size_t of(const glm::dvec3& position) const {
    const glm::dvec3 at = (position - low_) * per_metre_;
    std::size_t cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const auto along = static_cast<std::uint32_t>(std::max(0.0, at[axis]));
      cell = cell * count_[axis] + std::min(along, count_[axis] - 1);
    }
    return cell;
  }

 private:
  glm::dvec3 low_;
  glm::dvec3 per_metre_{0.0};
  glm::uvec3 count_{1U};
};

}  // namespace

MeshBoxes::MeshBoxes(const Scene& scene) : first{0} {
  const std::size_t each = std::max(kMinTriangles, static_cast<std::size_t>(scene.triangles) / kBoxes);
  for (const Mesh& mesh : scene.meshes) {
    const Cells cells(mesh_bounds(mesh), std::min(mesh.triangles.size() / each, kBoxes));
    std::vector<Bounds> filled(cells.count(), empty_bounds());
    for (const glm::uvec3& triangle : mesh.triangles) {
      const Bounds box = bounds_of(mesh, std::span(&triangle, 1));
      Bounds& cell = filled[cells.of(0.5 * (box.low + box.high))];
      cell = united(cell, box);
    }
    std::ranges::copy_if(filled, std::back_inserter(boxes), [](const Bounds& box) { return box.low.x <= box.high.x; });
    first.push_back(boxes.size());
  }
}

OccupiedPixels::OccupiedPixels(const Scene& scene, const RayScene& rays, const MeshBoxes& boxes,
                               std::span<const View> views, const FrameLayout& layout, std::size_t screen)
    : first_tile_(layout.tiles_of(screen).first), everywhere_(views.front().points.has_value()) {
  std::size_t count = 0;
  for (const RayGeometry& geometry : rays.geometries()) {
    count += boxes.of(scene.instances[geometry.instance].mesh).size();
  }
  everywhere_ = everywhere_ || count > kMaxBoxes;
  if (everywhere_) return;
  seen_.resize(layout.tiles_of(screen).count);
  const View& view = views.front();
  const Shifts shifts(views);
  const PixelSlack slack(PixelMap(view, glm::dmat4(1.0)), kRounding / rays.space().scale);
  for (const RayGeometry& geometry : rays.geometries()) {
    const Instance& instance = scene.instances[geometry.instance];
    const PixelMap map(view, instance.to_world);
    for (const Bounds& box : boxes.of(instance.mesh)) {
      const std::optional<Rect> pixels = pixels_of(view, shifts, map, slack, box);
      if (!pixels) {
        everywhere_ = true;
        return;
      }
      add(*pixels, layout, screen);
    }
  }
}

void OccupiedPixels::add(const Rect& pixels, const FrameLayout& layout, std::size_t screen) {
  for (int y = pixels.y0 / kTileSide * kTileSide; y < pixels.y1; y += kTileSide) {
    for (int x = pixels.x0 / kTileSide * kTileSide; x < pixels.x1; x += kTileSide) {
      std::vector<Rect>& seen = seen_[layout.tile_at(screen, x, y) - first_tile_];
      const Size size = layout.size(screen);
      const Rect tile{x, y, std::min(x + kTileSide, size.width), std::min(y + kTileSide, size.height)};
      const Rect part = intersection(pixels, tile);
      if (part.empty()) continue;
      // Once all of a tile is seen, nothing more need be known of it.
      if (!seen.empty() && seen.front() == tile) continue;
      if (part == tile) seen.clear();
      seen.push_back(part);
    }
  }
}

bool OccupiedPixels::mark(std::size_t tile, const Rect& rect, std::span<std::uint8_t> mask) const {
  std::ranges::fill(mask, static_cast<std::uint8_t>(everywhere_ ? 1 : 0));
  if (everywhere_) return true;
  const std::vector<Rect>& seen = seen_[tile - first_tile_];
  for (const Rect& part : seen) {
    for (int y = part.y0; y < part.y1; ++y) {
      const auto row = mask.begin() + static_cast<std::ptrdiff_t>(y - rect.y0) * kTileSide;
      std::fill(row + (part.x0 - rect.x0), row + (part.x1 - rect.x0), std::uint8_t{1});
    }
  }
  return !seen.empty();
}

}  // namespace hpr
