#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <random>
#include <utility>

#include "core/file.h"
#include "core/json.h"
#include "scene/load_scene.h"
#include "tools/stability/cases.h"

namespace hpr::stability {
namespace {

/// The placement of one triangle below a chain of nodes, as the loader composes it.
glm::dmat4 placed_below(Json nodes) {
  for (std::size_t i = 0; i + 1 < nodes.size(); ++i) nodes[i]["children"] = Json::array({i + 1});
  nodes.elements().back()["mesh"] = 0;
  // The corners are (0, 0, 0), (1, 0, 0) and (0, 1, 0).
  Json document = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
      "buffers": [{"uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
                   "byteLength": 36}],
      "bufferViews": [{"buffer": 0, "byteLength": 36}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                     "min": [0, 0, 0], "max": [1, 1, 0]}]})");
  document["nodes"] = std::move(nodes);
  const TemporaryFile file;
  std::ofstream(file.path()) << document.dump();
  return load_scene(file.path().string()).instances.at(0).to_world;
}

double farthest_from_identity(const glm::dmat4& matrix) {
  double farthest = 0.0;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      farthest = std::max(farthest, std::abs(matrix[column][row] - (column == row ? 1.0 : 0.0)));
    }
  }
  return farthest;
}

StabilityFinding scales_that_cancel() {
  StabilityFinding finding;
  finding.name = "nodes/scale-and-back";
  finding.parameter = "a node scaled by 10^-k below one scaled by 10^k, k = 1 .. 6";
  finding.unit = "largest error of the composed matrix";
  finding.limit = 3.0 * 0x1p-53;
  finding.why = "The two factors round to double, and so does their product.";
  finding.curve.x = "outer scale";
  for (int power = 1; power <= 6; ++power) {
    const double factor = std::pow(10.0, power);
    const auto scaled = [](double by) { return Json{{"scale", Json::array({by, by, by})}}; };
    const Json nodes = Json::array({scaled(factor), scaled(1.0 / factor)});
    const Json turned = Json::array({scaled(1.0 / factor), scaled(factor)});
    const double error =
        std::max(farthest_from_identity(placed_below(nodes)), farthest_from_identity(placed_below(turned)));
    finding.curve.points.emplace_back(factor, error);
    finding.measured = std::max(finding.measured, error);
  }
  return finding;
}

StabilityFinding rotations_that_cancel() {
  StabilityFinding finding;
  finding.name = "nodes/rotations";
  finding.parameter = "10 .. 1000 nested rotations that multiply to none";
  finding.unit = "largest error of the composed matrix";
  // Per node: 10 roundings of a quaternion's matrix and 6 of the product, each of entries up to 1.
  const auto bound = [](int count) { return 16.0 * count * 0x1p-53; };
  finding.limit = bound(1000);
  finding.why = "16 roundings of 2^-53 a node.";
  finding.curve.x = "nodes";
  std::mt19937_64 random(1);
  for (const int count : {10, 30, 100, 300, 1000}) {
    std::vector<Json> there;
    std::vector<Json> back;
    for (int i = 0; i < count / 2; ++i) {
      glm::dvec4 q;
      for (int k = 0; k < 4; ++k) q[k] = static_cast<double>(random() >> 11U) * 0x1p-52 - 1.0;
      q = glm::normalize(q);
      there.push_back(Json{{"rotation", Json::array({q.x, q.y, q.z, q.w})}});
      back.push_back(Json{{"rotation", Json::array({-q.x, -q.y, -q.z, q.w})}});
    }
    there.insert(there.end(), back.rbegin(), back.rend());
    const double drift = farthest_from_identity(placed_below(Json(there)));
    finding.curve.points.emplace_back(count, drift);
    finding.curve.expected.emplace_back(count, bound(count));
    finding.measured = std::max(finding.measured, drift);
  }
  return finding;
}

}  // namespace

std::vector<StabilityFinding> nodes(const Globals& /*globals*/) {
  return {scales_that_cancel(), rotations_that_cancel()};
}

}  // namespace hpr::stability
