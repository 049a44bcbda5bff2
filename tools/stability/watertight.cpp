#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/generators/shapes.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

// A closed mesh has no gaps. Rays are aimed at the places where two or more triangles meet, from both sides, and every
// crossing is counted as passes walk it: to the first surface, off it by the origin rule, and on.
namespace hpr::stability {
namespace {

constexpr int kLevel = 6;  // 81 920 triangles
constexpr std::uint64_t kRays = 10'000'000;
constexpr std::uint64_t kTrialRays = 250'000;
constexpr std::uint64_t kBlockRays = 4096;
/// The least cosine at which rays meet the ball from outside.
constexpr double kMinCosine = 0.1;
/// In radii of the ball: rays that stay as far from all vertices cannot leak (docs/numerics.md, "Watertight").
constexpr double kClearOfVertices = 4e-5;
/// The radius of the smallest ball, as a fraction of the scene's radius, whose vertices rounded to float still make the
/// same closed surface.
constexpr double kMinBallRadius = 1e-4;

enum class Aim { Edge, Vertex };
enum class From { Inside, Outside };

/// Where a ray goes.
struct Target {
  Aim aim = Aim::Edge;
  From from = From::Inside;
  double beside = 0.0;  ///< radii of the ball by which it is missed, to any side
};

struct Ball {
  double radius = 1.0;
  glm::dvec3 center{0.0};
};

/// What was counted, by what rays aim at.
struct Crossings {
  std::uint64_t rays = 0;
  std::uint64_t leaks = 0;    ///< crossings missed
  std::uint64_t doubles = 0;  ///< crossings counted twice
  std::uint64_t lit = 0;      ///< shadow rays that got through

  [[nodiscard]] std::uint64_t missed() const { return leaks + lit; }
  Crossings& operator+=(const Crossings& other) {
    rays += other.rays;
    leaks += other.leaks;
    doubles += other.doubles;
    lit += other.lit;
    return *this;
  }
};

std::vector<std::pair<std::uint32_t, std::uint32_t>> edges_of(const Mesh& mesh) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const glm::uvec3& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i];
      const std::uint32_t b = t[(i + 1) % 3];
      if (a < b) edges.emplace_back(a, b);  // of a closed mesh each edge is met once each way
    }
  }
  return edges;
}

/// A closed ball in a scene of radius 1 or, alone, as large as the scene.
class BallScene {
 public:
  explicit BallScene(const Ball& ball)
      : ball_(ball),
        mesh_(shapes::icosphere(kLevel)),
        edges_(edges_of(mesh_)),
        scene_(build(ball, mesh_)),
        space_(scene_.bounds),
        surfaces_(scene_, space_),
        rays_(scene_, space_, 1) {}

  /// `rays` of them, shared evenly among all edges or vertices.
  [[nodiscard]] Crossings count(const Target& target, std::uint64_t rays, const Globals& globals) const {
    std::vector<Crossings> blocks((rays + kBlockRays - 1) / kBlockRays);
    parallel_for(threads_of(globals), blocks.size(), [&](std::size_t i) {
      RandomStream random((globals.seed << 32U) + i);
      const std::uint64_t first = i * kBlockRays;
      blocks[i] = count_block(target, {first, std::min(rays, first + kBlockRays), rays}, random);
    });
    Crossings all;
    for (const Crossings& block : blocks) all += block;
    return all;
  }

 private:
  struct Flight {
    glm::dvec3 origin{0.0};
    glm::dvec3 direction{0.0};
  };

  /// Rays [first, last) of `all`.
  struct RayPart {
    std::uint64_t first = 0;
    std::uint64_t last = 0;
    std::uint64_t all = 0;
  };

  static Scene build(const Ball& ball, const Mesh& mesh) {
    Scene scene;
    add_placed(scene, mesh, diffuse(), shapes::placed(ball.center, ball.radius));
    if (ball.radius < 0.1) {  // slips of paper in two corners, further off than any ray goes
      for (const double corner : {-1.0, 1.0}) {
        add_placed(scene, parallelogram(glm::dvec3(corner), {-corner * 1e-3, 0, 0}, {0, -corner * 1e-3, 0}), diffuse(),
                   glm::dmat4(1.0));
      }
    }
    finish_scene(scene);
    return scene;
  }

  /// Place `number` of `all` of those rays are aimed at: neighbours follow one another.
  glm::dvec3 position_of(Aim aim, std::uint64_t number, std::uint64_t all, RandomStream& random) const {
    const auto vertex = [&](std::size_t i) { return world_position(scene_.instances[0], mesh_.positions[i]); };
    if (aim == Aim::Vertex) return vertex(number * mesh_.positions.size() / all);
    const auto& [a, b] = edges_[number * edges_.size() / all];
    return glm::mix(vertex(a), vertex(b), random.one());
  }

  Flight aim_at(const Target& target, const glm::dvec3& position, RandomStream& random) const {
    Flight flight;
    if (target.from == From::Inside) {
      flight.origin = ball_.center + 0.5 * ball_.radius * random.in_ball();
    } else {
      const glm::dvec3 normal = glm::normalize(position - ball_.center);
      glm::dvec3 out = random.on_sphere();
      while (std::abs(glm::dot(out, normal)) < kMinCosine) out = random.on_sphere();
      if (glm::dot(out, normal) < 0.0) out = -out;
      flight.origin = position + ball_.radius * (0.5 + 1.5 * random.one()) * out;
    }
    flight.direction = glm::normalize(position - flight.origin);
    if (target.beside > 0.0) {
      const glm::dvec3 aside = glm::normalize(glm::cross(flight.direction, random.on_sphere()));
      flight.direction = glm::normalize(position + target.beside * ball_.radius * aside - flight.origin);
    }
    return flight;
  }

  Crossings count_block(const Target& target, const RayPart& part, RandomStream& random) const {
    const double reach = 6.0 * ball_.radius * space_.scale;
    const int expected = target.from == From::Inside ? 1 : 2;
    const std::uint64_t rays = part.last - part.first;
    Crossings crossings;
    crossings.rays = rays;
    std::vector<Flight> flights;
    RayBatch batch;
    for (std::uint64_t i = part.first; i < part.last; ++i) {
      const glm::dvec3 position = position_of(target.aim, i, part.all, random);
      const Flight& flight = flights.emplace_back(aim_at(target, position, random));
      batch.push(space_.from_world(flight.origin), flight.direction, reach);
    }
    std::vector<std::uint8_t> blocked(rays);
    crossings.lit += rays_.occluded(batch, blocked);
    crossings.lit += static_cast<std::uint64_t>(std::ranges::count(blocked, 0));
    std::vector<std::uint32_t> hits;
    WorldTriangle triangle;
    for (int crossing = 0; crossing <= expected && !flights.empty(); ++crossing) {
      hits.resize(flights.size());
      crossings.leaks += rays_.closest(batch, hits);
      batch.clear();
      std::size_t left = 0;
      for (std::size_t i = 0; i < flights.size(); ++i) {
        if (hits[i] == kNoSurface) {
          crossings.leaks += crossing < expected ? 1U : 0U;
          continue;
        }
        if (crossing == expected) {
          ++crossings.doubles;
          continue;
        }
        surfaces_.load(hits[i], triangle);
        const SurfacePoint point = surfaces_.meet(triangle, flights[i].origin, flights[i].direction);
        Flight& on = flights[left++];
        on = {ray_origin(point, flights[i].direction), flights[i].direction};
        batch.push(space_.from_world(on.origin), on.direction, reach);
      }
      flights.resize(left);
    }
    return crossings;
  }

  Ball ball_;
  Mesh mesh_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges_;
  Scene scene_;
  RaySpace space_;
  Surfaces surfaces_;
  RayScene rays_;
};

/// Crossings that rays of `aim` miss or pass by unblocked, from both sides.
Crossings both_sides(const BallScene& scene, Aim aim, double beside, std::uint64_t rays, const Globals& globals) {
  Crossings all = scene.count({aim, From::Inside, beside}, rays / 2, globals);
  all += scene.count({aim, From::Outside, beside}, rays / 2, globals);
  return all;
}

/// Where a ball of one scene radius would be hidden in a scene by so much smaller.
BallScene small_ball(double radius) {
  return BallScene({radius, {0.7, -0.6, 0.5}});
}

std::vector<StabilityFinding> measure_watertight(const Globals& globals) {
  const BallScene scene(Ball{});
  const Crossings edges = both_sides(scene, Aim::Edge, 0.0, kRays / 2, globals);
  const Crossings vertices = both_sides(scene, Aim::Vertex, kClearOfVertices, kRays / 2, globals);

  const std::string both = "5e6 rays from inside and outside, closed icosphere of 81 920 triangles";
  StabilityFinding at_edges =
      make_finding("watertight/edges", both + ", aimed at shared edges", 0.0, "1",
                   "both triangles of an edge find the same number for it: one of them takes a ray");
  at_edges.measured = static_cast<double>(edges.missed());
  at_edges.curve.x = "radius of the ball, in radii of the scene";
  const auto missed_by_size = [&](double radius) {
    const Crossings small = both_sides(small_ball(radius), Aim::Edge, 0.0, kTrialRays, globals);
    return static_cast<double>(small.missed()) / static_cast<double>(kTrialRays);
  };
  for (const double radius : {1e-6, 1e-5, kMinBallRadius, 1e-2}) {
    const double missed = missed_by_size(radius);
    if (radius >= kMinBallRadius) at_edges.measured += missed * static_cast<double>(kTrialRays);
    at_edges.curve.points.emplace_back(radius, missed);
  }
  at_edges.breaks_at =
      breaking_point_if_any(kMinBallRadius, 1e-7, 0.2, [&](double r) { return missed_by_size(r) == 0.0; });

  StabilityFinding at_vertices = make_finding("watertight/vertices", both + ", past vertices at 4e-5 radii", 0.0, "1",
                                              "only next to a vertex may rounding let every triangle refuse a ray");
  at_vertices.measured = static_cast<double>(vertices.missed());
  at_vertices.curve.x = "distance of the rays from vertices, in radii";
  const auto missed_beside = [&](double beside) {
    const Crossings near = both_sides(scene, Aim::Vertex, beside, kTrialRays, globals);
    return static_cast<double>(near.missed()) / static_cast<double>(kTrialRays);
  };
  for (const double beside : {1e-9, 1e-8, 3e-8, 1e-7, 3e-7, 1e-6}) {
    at_vertices.curve.points.emplace_back(beside, missed_beside(beside));
  }
  at_vertices.breaks_at =
      breaking_point_if_any(kClearOfVertices, 1e-9, 0.2, [&](double d) { return missed_beside(d) == 0.0; });

  StabilityFinding doubles = make_finding("watertight/double-hits", "the same 1e7 rays", 0.0, "1",
                                          "a ray that leaves a surface by the origin rule does not meet it again");
  doubles.measured = static_cast<double>(edges.doubles + vertices.doubles);
  return {at_edges, at_vertices, doubles};
}

}  // namespace

StabilityCase watertight_case() {
  return {"watertight", "rays aimed at shared edges and vertices of a closed mesh: none gets through",
          measure_watertight};
}

}  // namespace hpr::stability
