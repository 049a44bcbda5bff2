#include <fmt/format.h>

#include <bit>
#include <glm/gtc/matrix_transform.hpp>
#include <mutex>
#include <utility>

#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr std::uint32_t kQuads = 64;
constexpr Size kSize{256, 192};

/// Quad i of 64 that overlap: its corners lie on borders between the pixels of a view of slope 1 and kSize, a metre
/// away.
struct Corners {
  glm::vec2 low;
  glm::vec2 high;
};
Corners corners_of(std::uint32_t i) {
  const auto pixels = [](std::uint32_t count) { return static_cast<float>(count) / 128.0F; };
  const glm::vec2 low(-1.0F + pixels(i * 37 % 128), -0.75F + pixels(i * 53 % 96));
  return {low, low + glm::vec2(pixels(96 + i % 32), pixels(64 + i % 32))};
}

/// A quad as a grid of cells, each cut along one of its diagonals: different i are cut differently.
Mesh gridded(std::uint32_t i) {
  const std::uint32_t n = 1 + i % 7;
  const auto [low, high] = corners_of(i);
  Mesh mesh;
  for (std::uint32_t row = 0; row <= n; ++row) {
    for (std::uint32_t column = 0; column <= n; ++column) {
      const glm::vec2 fraction = glm::vec2(static_cast<float>(column), static_cast<float>(row)) / static_cast<float>(n);
      mesh.positions.emplace_back(low + fraction * (high - low), 0.0F);
    }
  }
  for (std::uint32_t row = 0; row < n; ++row) {
    for (std::uint32_t column = 0; column < n; ++column) {
      const std::uint32_t a = row * (n + 1) + column;
      const std::uint32_t b = a + n + 1;
      if ((i / 7) % 2 == 0) {
        mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, b + 1}, {a, b + 1, b}});
      } else {
        mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, b}, {a + 1, b + 1, b}});
      }
    }
  }
  return mesh;
}

glm::dmat4 at_distance(double distance) {
  return glm::translate(glm::dmat4(1.0), {0.0, 0.0, -distance});
}

enum class Kind { OneMesh, MeshEach, CutDifferently, UlpsApart };
constexpr std::array<std::pair<Kind, const char*>, 4> kKinds{{{Kind::OneMesh, "one mesh"},
                                                              {Kind::MeshEach, "a mesh each"},
                                                              {Kind::CutDifferently, "cut differently"},
                                                              {Kind::UlpsApart, "0, 1, 2, 4 ulps apart"}}};

struct Quads {
  Scene scene;
  std::vector<SurfaceRange> surfaces;  ///< per quad
};

Quads make_quads(Kind kind) {
  Quads quads;
  Mesh all;
  for (std::uint32_t i = 0; i < kQuads; ++i) {
    const auto [low, high] = corners_of(i);
    Mesh mesh = kind == Kind::CutDifferently ? gridded(i) : rectangle(low, high);
    if (kind == Kind::OneMesh) {
      const auto first = static_cast<std::uint32_t>(all.positions.size());
      all.positions.insert(all.positions.end(), mesh.positions.begin(), mesh.positions.end());
      for (const glm::uvec3& triangle : mesh.triangles) all.triangles.push_back(triangle + first);
      continue;
    }
    glm::dmat4 to_world = at_distance(1.0);
    if (kind == Kind::CutDifferently) {  // askew, so that depths are interpolated
      to_world = glm::rotate(to_world, 0.7, glm::dvec3(0.48, 0.6, 0.64));
    } else if (kind == Kind::UlpsApart) {
      constexpr std::array<std::uint32_t, 4> kUlps{4, 1, 0, 2};
      const std::uint32_t bits = std::bit_cast<std::uint32_t>(1.0F) + kUlps.at(i % 4);
      to_world = at_distance(std::bit_cast<float>(bits));
    }
    add(quads.scene, std::move(mesh), to_world);
  }
  if (kind == Kind::OneMesh) add(quads.scene, std::move(all), at_distance(1.0));
  finish_scene(quads.scene);
  std::uint32_t first = 0;
  for (std::uint32_t i = 0; i < kQuads; ++i) {
    const auto count = kind == Kind::OneMesh ? 2U : static_cast<std::uint32_t>(quads.scene.meshes[i].triangles.size());
    quads.surfaces.push_back({first, first + count});
    first += count;
  }
  return quads;
}

/// One layer per rank: the quads dealt out in turn, from the first rank on or from the last.
std::vector<TileLayer<Key>> draw_parts(Drawer& drawer, const Quads& quads, const View& view, int ranks,
                                       bool backwards) {
  std::vector<std::vector<SurfaceRange>> parts(static_cast<std::size_t>(ranks));
  for (std::size_t i = 0; i < quads.surfaces.size(); ++i) {
    const std::size_t rank = i % parts.size();
    parts[backwards ? parts.size() - 1 - rank : rank].push_back(quads.surfaces[i]);
  }
  std::vector<TileLayer<Key>> layers;
  layers.reserve(parts.size());
  for (const auto& part : parts) layers.push_back(drawer.draw(quads.scene, view, part));
  return layers;
}

/// Pixels whose key is not the one drawn by a single rank.
std::size_t composited_differences(const std::vector<TileLayer<Key>>& layers, const std::string& strategy,
                                   const TileLayer<Key>& expected) {
  const std::vector<std::size_t> tiles = all_tiles(expected.layout());
  std::size_t differing = 0;
  std::size_t owned = 0;
  std::mutex mutex;
  run_local_ranks(static_cast<int>(layers.size()), [&](Communicator& comm) {
    TileLayer<Key> layer(expected.layout());
    copy_tiles(layers[static_cast<std::size_t>(comm.rank())], layer, tiles);
    const Composited mine = make_compositor(strategy)->composite(comm, layer, tiles);
    const std::lock_guard lock(mutex);
    owned += mine.tiles.size();
    for (const std::size_t tile : mine.tiles) {
      const auto keys = layer.tile(tile);
      for (std::size_t i = 0; i < keys.size(); ++i) differing += keys[i] == expected.tile(tile)[i] ? 0U : 1U;
    }
  });
  return owned == tiles.size() ? differing : kSize.area();
}

struct Compared {
  std::size_t differing = 0;
  std::size_t composites = 0;
};

Compared compare(Drawer& drawer, const Quads& quads, const View& view, const TileLayer<Key>& expected) {
  Compared result;
  for (const int ranks : {2, 3, 4, 7}) {
    for (const bool backwards : {false, true}) {
      const auto layers = draw_parts(drawer, quads, view, ranks, backwards);
      for (const auto& strategy : all_compositors()) {
        if (!strategy->fits(ranks)) continue;
        result.differing += composited_differences(layers, std::string(strategy->name()), expected);
        ++result.composites;
      }
    }
  }
  const std::array parts{Rect{0, 0, 64, 192}, Rect{64, 0, 256, 64}, Rect{64, 64, 192, 192}, Rect{192, 64, 256, 192}};
  const Image<Key> cut = to_image(drawer.draw_parts(quads.scene, view, parts), 0);
  const Image<Key> whole = to_image(expected, 0);
  for (std::size_t i = 0; i < cut.pixels().size(); ++i) {
    result.differing += cut.pixels()[i] == whole.pixels()[i] ? 0U : 1U;
  }
  return result;
}

/// Pixels that do not show the first of the quads that cover them, all of one depth.
std::size_t broken_ties(const Image<Key>& keys) {
  std::size_t broken = 0;
  for (int y = 0; y < keys.height(); ++y) {
    for (int x = 0; x < keys.width(); ++x) {
      const glm::vec2 at(-1.0F + (static_cast<float>(x) + 0.5F) / 128.0F,
                         0.75F - (static_cast<float>(y) + 0.5F) / 128.0F);
      std::uint32_t first = 0;
      for (; first < kQuads; ++first) {
        const auto [low, high] = corners_of(first);
        if (at.x > low.x && at.x < high.x && at.y > low.y && at.y < high.y) break;
      }
      const Key key = keys.at(x, y);
      const bool right = first == kQuads ? key == kNoKey : key != kNoKey && key_surface(key) / 2 == first;
      broken += right ? 0U : 1U;
    }
  }
  return broken;
}

std::vector<StabilityFinding> measure_coplanar(const Globals& globals) {
  Drawer drawer(globals);
  const View view = head_on(kSize, 1.0, 0.0625);
  std::vector<StabilityFinding> findings;
  StabilityFinding ties;
  for (const auto& [kind, name] : kKinds) {
    const Quads quads = make_quads(kind);
    const TileLayer<Key> expected = drawer.draw(quads.scene, view, std::array{SurfaceRange{0, quads.scene.triangles}});
    const Compared compared = compare(drawer, quads, view, expected);
    StabilityFinding finding =
        make_finding(fmt::format("coplanar/{}", kind == Kind::OneMesh          ? "one-mesh"
                                                : kind == Kind::MeshEach       ? "mesh-each"
                                                : kind == Kind::CutDifferently ? "cut-differently"
                                                                               : "ulps-apart"),
                     fmt::format("{} overlapping quads in one plane, {}: {} composites on 2, 3, 4 and 7 ranks, all "
                                 "strategies, and the screen in parts",
                                 kQuads, name, compared.composites),
                     0.0, "pixels that differ from one rank's",
                     "A triangle's keys do not depend on what else is drawn, and the maximum of keys is exact.");
    finding.measured = static_cast<double>(compared.differing);
    findings.push_back(finding);
    if (kind == Kind::MeshEach) {
      ties = make_finding("coplanar/lowest-id-wins", fmt::format("{} overlapping quads at one depth", kQuads), 0.0,
                          "pixels that show another surface", "Of equal depths the largest key has the lowest id.");
      ties.measured = static_cast<double>(broken_ties(to_image(expected, 0)));
    }
  }
  findings.push_back(ties);
  return findings;
}

}  // namespace

StabilityCase coplanar_case() {
  return {"coplanar", "64 surfaces in one plane: the picture is the same on any ranks, by any strategy",
          measure_coplanar};
}

}  // namespace hpr::stability
