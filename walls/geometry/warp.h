#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "image/color.h"
#include "image/image.h"
#include "scene/position_map.h"

namespace hpr {

struct WarpMesh;

/// A file a wall names.
struct WarpFile {
  std::string path;           ///< as written in the wall file; empty: none
  std::uint64_t content = 0;  ///< XXH64 of its bytes

  bool operator==(const WarpFile&) const = default;
};

/// How a screen differs from a flat, evenly bright rectangle, as a calibration found it. Files hold for the whole
/// upright picture, whatever their own sizes; of a screen that shows two pictures side by side or above each other, for
/// each of them.
struct ScreenWarp {
  WarpFile mesh;
  WarpFile blend;
  WarpFile black;
  /// What they hold; null where there is no such file. `points` and `grid` both are of `mesh`: one of them at most.
  std::shared_ptr<const PositionMap> points = {};  ///< wall space
  std::shared_ptr<const WarpMesh> grid = {};
  std::shared_ptr<const Image<Rgb>> light = {};  ///< of `blend`: factors in linear light, in [0, 1]
  std::shared_ptr<const Image<Rgb>> floor = {};  ///< of `black`: linear light in [0, 1] that is shown at least

  [[nodiscard]] bool any() const { return !mesh.path.empty() || !blend.path.empty() || !black.path.empty(); }
  bool operator==(const ScreenWarp& other) const {
    return mesh == other.mesh && blend == other.blend && black == other.black;
  }
};

}  // namespace hpr
