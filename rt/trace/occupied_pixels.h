#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/tiles.h"
#include "rt/trace/ray_scene.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// What a scene's meshes fill, in the meshes' own coordinates: a few thousand boxes, each about the triangles whose
/// middles lie in one cell of a grid.
struct MeshBoxes {
  explicit MeshBoxes(const Scene& scene);

  [[nodiscard]] std::span<const Bounds> of(std::uint32_t mesh) const {
    return std::span(boxes).subspan(first[mesh], first[mesh + 1] - first[mesh]);
  }

  std::vector<Bounds> boxes;
  std::vector<std::size_t> first;  ///< per mesh, and one past the last
};

/// Where on a screen a ray of any of some views, which differ by their jitter only, may meet a surface that `rays`
/// holds: most pictures have much of mere background. Allows for what rounding may do to rays.
class OccupiedPixels {
 public:
  OccupiedPixels(const Scene& scene, const RayScene& rays, const MeshBoxes& boxes, std::span<const View> views,
                 const FrameLayout& layout, std::size_t screen);

  /// Sets `mask`, [kTileSide][kTileSide], to 1 at those pixels of a tile of that screen, which lies at `rect`, and to
  /// 0 elsewhere. Returns whether there are any.
  [[nodiscard]] bool mark(std::size_t tile, const Rect& rect, std::span<std::uint8_t> mask) const;

 private:
  void add(const Rect& pixels, const FrameLayout& layout, std::size_t screen);

  std::size_t first_tile_;
  bool everywhere_;
  std::vector<std::vector<Rect>> seen_;  ///< per tile: pixels of the screen
};

}  // namespace hpr
