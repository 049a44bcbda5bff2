#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/error.h"
#include "scene/load_scene.h"

// Compressed scenes of other programs against their uncompressed twins: the same triangles in the world.
// usage: compressed_scenes_test SCENES, unless $HPR_SCENES names another folder. Leaves with 77 where there is none.

namespace hpr {
namespace {

using Triangle = std::array<glm::dvec3, 3>;

/// All triangles that are drawn.
std::vector<Triangle> triangles_of(const Scene& scene) {
  std::vector<Triangle> triangles;
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.meshes[instance.mesh];
    for (const glm::uvec3& corners : mesh.triangles) {
      Triangle& triangle = triangles.emplace_back();
      for (int c = 0; c < 3; ++c) {
        triangle[static_cast<std::size_t>(c)] =
            glm::dvec3(instance.to_world * glm::dvec4(mesh.positions[corners[c]], 1.0));
      }
    }
  }
  return triangles;
}

glm::dvec3 centroid(const Triangle& triangle) {
  return (triangle[0] + triangle[1] + triangle[2]) / 3.0;
}

/// The distance of the corners, from whichever corner the second triangle begins.
double distance(const Triangle& a, const Triangle& b) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t turn = 0; turn < 3; ++turn) {
    double most = 0.0;
    for (std::size_t c = 0; c < 3; ++c) most = std::max(most, glm::distance(a[c], b[(c + turn) % 3]));
    best = std::min(best, most);
  }
  return best;
}

/// Finds triangles by their centroids, each once.
class TriangleFinder {
 public:
  TriangleFinder(const std::vector<Triangle>& triangles, double tolerance)
      : triangles_(triangles), used_(triangles.size(), false), tolerance_(tolerance), cell_(4.0 * tolerance) {
    for (std::size_t i = 0; i < triangles.size(); ++i) cells_[key(cell_of(centroid(triangles[i])))].push_back(i);
  }

  /// Whether a triangle within the tolerance is left.
  bool take(const Triangle& triangle) {
    const std::array<std::int64_t, 3> at = cell_of(centroid(triangle));
    double best = tolerance_;
    std::size_t found = triangles_.size();
    for (std::int64_t i = 0; i < 27; ++i) {
      const auto cell = cells_.find(key({at[0] + i % 3 - 1, at[1] + i / 3 % 3 - 1, at[2] + i / 9 - 1}));
      if (cell == cells_.end()) continue;
      for (const std::size_t candidate : cell->second) {
        const double apart = used_[candidate] ? best * 2.0 + 1.0 : distance(triangles_[candidate], triangle);
        if (apart > best) continue;
        best = apart;
        found = candidate;
      }
    }
    if (found == triangles_.size()) return false;
    used_[found] = true;
    max_distance_ = std::max(max_distance_, best);
    return true;
  }

  [[nodiscard]] double max_distance() const { return max_distance_; }

 private:
  [[nodiscard]] std::array<std::int64_t, 3> cell_of(const glm::dvec3& p) const {
    return {std::llround(p.x / cell_), std::llround(p.y / cell_), std::llround(p.z / cell_)};
  }
  static std::uint64_t key(const std::array<std::int64_t, 3>& cell) {
    std::uint64_t hash = 0;
    for (const std::int64_t axis : cell) hash = (hash ^ static_cast<std::uint64_t>(axis)) * 0x9E3779B97F4A7C15U;
    return hash;
  }

  const std::vector<Triangle>& triangles_;
  std::vector<bool> used_;
  double tolerance_;
  double cell_;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> cells_;
  double max_distance_ = 0.0;
};

double diagonal_of(const std::vector<Triangle>& triangles) {
  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high(-low);
  for (const Triangle& triangle : triangles) {
    for (const glm::dvec3& p : triangle) {
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
  }
  return glm::distance(low, high);
}

/// Prints what differs; `tolerance` is a share of the scene's diagonal.
bool are_same(const std::filesystem::path& plain, const std::filesystem::path& packed, double tolerance) {
  const std::vector<Triangle> expected = triangles_of(load_scene(plain.string()));
  const std::vector<Triangle> found = triangles_of(load_scene(packed.string()));
  const std::string names = fmt::format("{} and {}", packed.filename().string(), plain.filename().string());
  if (expected.size() != found.size()) {
    fmt::print("failed: {}: {} and {} triangles\n", names, found.size(), expected.size());
    return false;
  }
  const double diagonal = diagonal_of(expected);
  TriangleFinder finder(expected, tolerance * diagonal);
  const auto missing = std::ranges::count_if(found, [&](const Triangle& triangle) { return !finder.take(triangle); });
  fmt::print("{}{}: {} triangles, {} without a twin, corners at most {:.3g} of the diagonal apart\n",
             missing > 0 ? "failed: " : "", names, found.size(), missing, finder.max_distance() / diagonal);
  return missing == 0;
}

/// A box around the origin whose sides are 1.
bool is_unit_box(const std::filesystem::path& path) {
  const std::vector<Triangle> triangles = triangles_of(load_scene(path.string()));
  bool good = triangles.size() == 12;
  for (const Triangle& triangle : triangles) {
    for (const glm::dvec3& p : triangle) {
      for (int axis = 0; axis < 3; ++axis) good = good && std::abs(std::abs(p[axis]) - 0.5) < 1e-4;
    }
    const double area = glm::length(glm::cross(triangle[1] - triangle[0], triangle[2] - triangle[0])) / 2.0;
    good = good && std::abs(area - 0.5) < 1e-3;
  }
  fmt::print("{}{}: {} triangles\n", good ? "" : "failed: ", path.filename().string(), triangles.size());
  return good;
}

int run(const std::filesystem::path& scenes) {
  if (!std::filesystem::exists(scenes / "suzanne" / "suzi.glb")) {
    fmt::print("skipped: there is no {}/suzanne; name the scenes' folder in HPR_SCENES\n", scenes.string());
    return 77;
  }
  const auto suzanne = scenes / "suzanne";
  // Positions of 14 bits: half a step an axis is 5.3e-5 of the diagonal at most.
  constexpr double kQuantized = 1e-4;
  constexpr double kRounded = 1e-6;
  bool good = is_unit_box(scenes / "draco-box" / "BoxDraco.gltf");
  good &= is_unit_box(scenes / "meshopt-box" / "BoxMeshopt.glb");
  good &= are_same(suzanne / "suzi.glb", suzanne / "suzi-draco.glb", kQuantized);
  good &= are_same(suzanne / "suzi.glb", suzanne / "suzi-meshopt.glb", kQuantized);
  good &= are_same(suzanne / "suzi.glb", suzanne / "suzi-quantize.glb", kQuantized);
  good &= are_same(scenes / "carbon-sphere" / "carbon-sphere-plain.glb", scenes / "carbon-sphere" / "carbon-sphere.glb",
                   kRounded);
  good &= are_same(scenes / "apartment" / "dream-apartment-plain.glb", scenes / "apartment" / "dream-apartment.glb",
                   kRounded);
  return good ? 0 : 1;
}

}  // namespace
}  // namespace hpr

int main(int argc, char** argv) {
  const char* const named = std::getenv("HPR_SCENES");  // NOLINT(concurrency-mt-unsafe): no thread is running
  if (named == nullptr && argc < 2) return 77;
  try {
    return hpr::run(named != nullptr ? named : argv[1]);
  } catch (const hpr::Error& error) {
    fmt::print("failed: {}\n", error.what());
    return 1;
  }
}
