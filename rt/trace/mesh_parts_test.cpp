#include <gtest/gtest.h>

#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

TEST(MeshParts, AreWhatSharesAPlace) {
  Mesh mesh;
  // Two squares one above the other; the first one's triangles have vertices of their own at its diagonal.
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0},
                    {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  mesh.triangles = {{6, 7, 8}, {0, 1, 2}, {6, 8, 9}, {3, 4, 5}};
  EXPECT_EQ(parts_of(mesh), (std::vector<std::uint32_t>{0, 1, 0, 1}));
  mesh.triangles.push_back({5, 9, 4});
  EXPECT_EQ(parts_of(mesh), (std::vector<std::uint32_t>{0, 0, 0, 0, 0}));
  EXPECT_TRUE(parts_of(Mesh{}).empty());
}

}  // namespace
}  // namespace hpr
