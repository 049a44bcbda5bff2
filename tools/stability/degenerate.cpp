#include <fmt/format.h>

#include <algorithm>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <random>

#include "scene/generators/shapes.h"
#include "tools/stability/cases.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

/// What is mixed into a mesh, one for every ten of its triangles.
enum class Extra {
  Points,    ///< corners twice or thrice
  Doubles,   ///< triangles that are there already
  Segments,  ///< three corners in a line, the third in the middle of an edge
  Needles,   ///< along an edge, a millionth of the triangle high
};

struct Mixed {
  Mesh mesh;
  std::vector<std::uint32_t> source;  ///< per triangle the one of the clean mesh it stands for
};

Mixed mixed(const Mesh& clean, Extra extra) {
  Mixed result{clean, {}};
  result.mesh.triangles.clear();
  result.mesh.normals.clear();
  std::mt19937 random(7);
  const auto add_triangle = [&](const glm::uvec3& triangle, std::uint32_t source) {
    result.mesh.triangles.push_back(triangle);
    result.source.push_back(source);
  };
  for (std::uint32_t i = 0; i < clean.triangles.size(); ++i) {
    const glm::uvec3 t = clean.triangles[i];
    if (random() % 10 == 0) {
      const glm::vec3 a = clean.positions[t.x];
      const glm::vec3 b = clean.positions[t.y];
      const glm::vec3 c = clean.positions[t.z];
      const auto third = static_cast<std::uint32_t>(result.mesh.positions.size());
      if (extra == Extra::Points) {
        add_triangle({t.x, t.y, t.y}, i);
        add_triangle({t.z, t.z, t.z}, i);
      } else if (extra == Extra::Doubles) {
        add_triangle(t, i);
      } else if (extra == Extra::Segments) {
        result.mesh.positions.push_back(0.5F * a + 0.5F * b);
        add_triangle({t.x, t.y, third}, i);
      } else {
        result.mesh.positions.push_back(0.5F * a + 0.5F * b + 1e-6F * (c - a));
        add_triangle({t.x, t.y, third}, i);
      }
    }
    add_triangle(t, i);
  }
  return result;
}

Scene scene_of(Mesh mesh) {
  Scene scene;
  add(scene, std::move(mesh),
      glm::rotate(glm::translate(glm::dmat4(1.0), {0.0, 0.0, -3.0}), 0.7, glm::dvec3(0.48, 0.6, 0.64)));
  finish_scene(scene);
  return scene;
}

}  // namespace

std::vector<StabilityFinding> degenerate(const Globals& globals) {
  Drawer drawer(globals);
  const Mesh clean = shapes::icosphere(5);
  const View view = head_on({512, 512}, 0.4, 0.01);
  const Image<Key> expected = drawer.draw(scene_of(clean), view);
  const auto measure = [&](Extra extra, const char* name, const char* what) {
    const Mixed other = mixed(clean, extra);
    const Image<Key> keys = drawer.draw(scene_of(other.mesh), view);
    StabilityFinding finding;
    finding.name = fmt::format("degenerate/{}", name);
    finding.parameter = fmt::format("a sphere of {} triangles and {} that are {}", clean.triangles.size(),
                                    other.mesh.triangles.size() - clean.triangles.size(), what);
    finding.unit = "share of pixels that show another triangle than without";
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < keys.pixels().size(); ++i) {
      const Key a = keys.pixels()[i];
      const Key b = expected.pixels()[i];
      const bool same = a == kNoKey ? b == kNoKey : b != kNoKey && other.source[key_surface(a)] == key_surface(b);
      wrong += same ? 0U : 1U;
    }
    finding.measured = static_cast<double>(wrong) / static_cast<double>(keys.pixels().size());
    finding.why = "They cover no pixel's centre, or cover it at the very depth of the triangle they stand for.";
    return finding;
  };
  std::vector<StabilityFinding> findings{
      measure(Extra::Points, "points", "points"), measure(Extra::Doubles, "doubles", "there already"),
      measure(Extra::Segments, "segments", "segments"), measure(Extra::Needles, "needles", "needles along edges")};
  for (std::size_t i = 2; i < findings.size(); ++i) {
    // They lie along one edge of ten triangles of three, and reach past it by what their third corner snaps.
    findings[i].limit = edges(expected) / 30.0 * 2.0 * std::numbers::sqrt2 / 256.0;
    findings[i].why = "Their third corner snaps up to sqrt(2)/256 pixel past the edge, which few centres lie on.";
  }
  return findings;
}

}  // namespace hpr::stability
