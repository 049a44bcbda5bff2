#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/passes/first_points.h"
#include "rt/passes/pass.h"

namespace hpr {

/// Light of the first surface that is worked out for one pixel of each 2 x 2 block of a tile, the lender, and spread to
/// those of its block that see the like: the same material, turned and placed alike, about as bright. All others work
/// out their own. Blocks begin at even pixels of the screen, which tiles and raster blocks do too, and no light leaves
/// its tile: so nothing depends on how tiles are spread. From sample to sample another pixel of the block lends.
class SharedLight {
 public:
  /// Starts a tile. `shared`: see shared_components.
  void start(ComponentSet shared, const LightContext& context, const TileJob& job);

  /// Decides who borrows among the first generation of points of some rows, whole blocks of them: those have
  /// PathPoint::borrows set and follow no ray of a shared pass.
  void choose(std::vector<PathPoint>& points, int first_row);

  /// When all light of the tile is worked out: adds to each borrower the mean of the lenders about it that see the
  /// like as near, each made up for how much of such light the two surfaces scatter.
  void spread(PixelSums& sums) const;

 private:
  /// What tells whether two pixels see the like.
  struct Seen {
    glm::dvec3 position{0.0};
    glm::dvec3 normal{0.0};  ///< the one shaded with
    std::uint32_t material = 0;
    std::uint32_t pixel = 0;
    std::array<glm::vec3, kComponents> weights{};  ///< about the share of such light that reaches the eye
  };
  static constexpr std::uint16_t kNobody = 0xFFFF;

  /// Lenders next to a borrower that see the like.
  struct Lenders {
    std::array<const Seen*, 4> at{};
    std::size_t count = 0;
  };

  [[nodiscard]] Seen look_at(const PathPoint& point) const;
  [[nodiscard]] bool alike(const Seen& lender, const Seen& borrower) const;
  void borrow(const Seen& lender, PathPoint& point);
  [[nodiscard]] Lenders lenders_about(const Seen& borrower) const;

  ComponentSet shared_ = 0;
  double glossy_cutoff_ = 0.0;
  int lender_x_ = 0;  ///< in its block
  int lender_y_ = 0;
  glm::dvec3 eye_{0.0};
  std::vector<std::uint16_t> lender_of_;  ///< per block: index into lenders_, or kNobody
  std::vector<Seen> lenders_;
  std::vector<Seen> borrowers_;
};

}  // namespace hpr
