#include "scene/pages/part_pages.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/bytes.h"
#include "core/error.h"
#include "scene/mesh_reader.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

/// A strip of triangles, each with corners of its own.
Mesh strip(std::uint32_t triangles, float z) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const auto x = static_cast<float>(i);
    mesh.positions.insert(mesh.positions.end(), {{x, 0.0F, z}, {x + 1.0F, 0.0F, z}, {x, 1.0F, z}});
    mesh.normals.insert(mesh.normals.end(), 3, {0.0F, 0.0F, 1.0F});
    mesh.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  return mesh;
}

constexpr std::uint32_t kTriangles = 90;

Scene whole_scene() {
  Scene scene;
  scene.meshes = {strip(kTriangles, 0.0F), strip(kTriangles, 3.0F)};
  scene.instances.resize(2);
  scene.instances[1].mesh = 1;
  finish_scene(scene);
  return scene;
}

/// That scene in three pages: of each mesh the triangles of one third each.
Scene paged_scene(std::size_t resident) {
  const Scene whole = whole_scene();
  Scene scene = whole;
  scene.parts = {{{0, scene.triangles}}};
  scene.part_pages = std::make_shared<PartPages>(0, 3);
  for (std::uint32_t page = 0; page < 3; ++page) {
    const SurfaceRange range{page * kTriangles / 3, (page + 1) * kTriangles / 3};
    scene.pages.push_back({range, {kTriangles + range.first, kTriangles + range.last}});
  }
  for (std::uint32_t mesh = 0; mesh < 2; ++mesh) {
    scene.meshes[mesh] = without_triangles(whole.meshes[mesh]);
    for (std::uint32_t page = 0; page < 3; ++page) {
      const std::vector<SurfaceRange> ranges{scene.pages[page][0]};
      WholeMeshReader reader(&whole.meshes[mesh]);
      PartPieces pieces(reader, ranges, *scene.meshes[mesh].partial);
      while (const std::optional<Mesh> piece = pieces.next()) {
        ByteBuffer bytes;
        append_bytes(*piece, bytes);
        scene.part_pages->add(page, {mesh, pieces.vertices(), pieces.triangles()}, bytes.bytes());
      }
    }
  }
  const std::uint64_t page_bytes = scene.part_pages->bytes_of_largest();
  scene.part_pages->keep_in(resident * page_bytes + page_bytes / 2);
  return scene;
}

TEST(PartPages, ThePageInUseHasItsTrianglesAndNoOther) {
  const Scene whole = whole_scene();
  Scene scene = paged_scene(2);
  for (const std::uint32_t page : {0U, 1U, 2U, 0U, 2U, 1U}) {
    const PageInUse use(scene, page);
    const std::span<const SurfaceRange> own = surfaces_of_page(scene, page);
    for (std::uint32_t id = 0; id < scene.triangles; ++id) {
      const SurfaceLocation at = locate_surface(scene, id);
      const Mesh& mesh = scene.mesh_of(scene.instances[at.instance]);
      const bool is_own = std::ranges::any_of(own, [&](auto range) { return range.first <= id && id < range.last; });
      ASSERT_EQ(mesh.holds(at.triangle), is_own);
      if (!is_own) continue;
      const Mesh& expected = whole.mesh_of(whole.instances[at.instance]);
      for (int corner = 0; corner < 3; ++corner) {
        ASSERT_EQ(mesh.positions[mesh.triangle(at.triangle)[corner]],
                  expected.positions[expected.triangles[at.triangle][corner]]);
      }
    }
  }
  for (const Mesh& mesh : scene.meshes) EXPECT_TRUE(mesh.triangles.empty() && mesh.positions.empty());
}

TEST(PartPages, ThoseUsedLastStayInMemory) {
  Scene scene = paged_scene(2);
  PartPages& pages = *scene.part_pages;
  std::vector<std::size_t> left;
  pages.on_leave([&](std::size_t page) {
    EXPECT_TRUE(pages.is_resident(page));  // still
    left.push_back(page);
  });
  const auto use = [&](std::size_t page) { const PageInUse in_use(scene, page); };
  for (const std::size_t page : {0U, 1U, 0U, 1U, 0U}) use(page);
  EXPECT_EQ(pages.loads(), 2U);
  EXPECT_EQ(pages.nearest_first(), (std::vector<std::size_t>{0, 1, 2}));
  use(2);
  EXPECT_EQ(left, std::vector<std::size_t>{1});
  EXPECT_EQ(pages.nearest_first(), (std::vector<std::size_t>{0, 2, 1}));
  use(0);
  EXPECT_EQ(pages.loads(), 3U);
  // A pass over all of them in that order brings one page, not three.
  for (const std::size_t page : pages.nearest_first()) use(page);
  EXPECT_EQ(pages.loads(), 4U);
}

TEST(PartPages, OnlyAsManyAsMayAreInMemory) {
  Scene scene = paged_scene(1);
  const std::uint64_t page_bytes = memory_of(whole_scene()) / 3;
  for (int round = 0; round < 2; ++round) {
    for (std::size_t page = 0; page < 3; ++page) {
      const PageInUse use(scene, page);
      for (std::size_t other = 0; other < 3; ++other) EXPECT_EQ(scene.part_pages->is_resident(other), other == page);
    }
  }
  EXPECT_EQ(scene.part_pages->loads(), 6U);
  EXPECT_GE(scene.part_pages->memory(), page_bytes * 9 / 10);
  EXPECT_LE(scene.part_pages->memory(), page_bytes * 11 / 10);
}

TEST(PartPages, AsManyAreInMemoryAsThereIsRoomFor) {
  Scene scene = paged_scene(1);
  PartPages& pages = *scene.part_pages;
  const std::uint64_t page_bytes = pages.bytes_of_largest();
  pages.keep_in(0);
  EXPECT_EQ(pages.max_resident(), 1U);
  pages.keep_in(3 * page_bytes - 1);
  EXPECT_EQ(pages.max_resident(), 2U);
  pages.keep_in(100 * page_bytes);
  EXPECT_EQ(pages.max_resident(), 3U);
}

TEST(PartPages, ADiskThatIsFullIsAnErrorThatNamesTheFolder) {
  PartPages pages(0, 1);
  ::rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  ::signal(SIGXFSZ, SIG_IGN);
  const ::rlimit small{4096, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::vector<std::byte> bytes(8192);
  try {
    pages.add(0, {}, bytes);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
    EXPECT_NE(std::string(error.what()).find(temporary_folder().string()), std::string::npos) << error.what();
  }
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
}

}  // namespace
}  // namespace hpr
