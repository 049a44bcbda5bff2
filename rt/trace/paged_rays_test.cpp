#include "rt/trace/paged_rays.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "cluster/distribution/scene_distribution.h"
#include "cluster/transport/local_communicator.h"
#include "rt/test_rays.h"
#include "rt/test_scene.h"
#include "rt/trace/ray_forwarding.h"
#include "rt/trace/refined_triangles.h"
#include "scene/pages/part_pages.h"
#include "scene/partial_mesh.h"
#include "scene/scene.h"

// A rank that has a part of its part in memory gives the bits of one that has the whole scene.
namespace hpr {
namespace {

using test::random_rays;

/// Balls over a floor, of which some share a mesh; a lamp and a veil, which all ranks hold.
Scene balls() {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.7F)));
  const std::uint32_t lamp = test::add_material(scene, test::glowing(glm::vec3(6.0F)));
  Material thin = test::diffuse({0.9F, 0.3F, 0.2F});
  thin.base_color.a = 0.4F;
  thin.alpha_mode = AlphaMode::Blend;
  const std::uint32_t veil = test::add_material(scene, thin);
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}, white)));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, 3, -1}, {2, 0, 0}, {0, 0, 2}, lamp)));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-2, 0.2F, 0.8F}, {4, 0, 0}, {0, 0.6F, 0}, veil)));
  const std::uint32_t shared = test::add_mesh(scene, test::sphere(0.3, 24, white));
  for (int i = 0; i < 10; ++i) {
    const std::uint32_t ball = i < 4 ? shared : test::add_mesh(scene, test::sphere(0.3, 24, white));
    glm::dmat4 there(1.0);
    there[3] = {-2.0 + 0.45 * i, 0.3 + 0.1 * (i % 3), -1.0 + 0.3 * (i % 4), 1.0};
    test::place_mesh(scene, ball, there);
  }
  finish_scene(scene);
  return scene;
}

/// This rank's part of that scene in pages, not all of which are in memory.
Scene paged_balls(Communicator& comm) {
  const Scene whole = balls();
  Scene scene = distribute_scene(comm, [&] {
    LoadedScene loaded(balls());
    loaded.in_parts = loaded.in_pages = true;
    std::uint64_t held = 0;
    for (const Mesh& mesh : whole.meshes) held += is_held_by_all(whole, mesh) ? memory_of(mesh) : 0;
    // A little for what is known of meshes whose triangles are elsewhere.
    loaded.memory_limit = 4096 + held + (memory_of(whole) - held) * 2 / (3 * static_cast<std::uint64_t>(comm.size()));
    return loaded;
  });
  scene.refined = refined_instances(whole, RaySpace(whole));
  return scene;
}

TEST(PagedRays, MeetWhatTheyMeetInAWholeScene) {
  const Scene scene = balls();
  const RaySpace space(scene);
  const RayScene whole(scene, space, 1);
  for (const int ranks : {1, 2, 3}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      Scene paged = paged_balls(comm);
      ASSERT_TRUE(paged.part_pages);
      const PartPages& pages = *paged.part_pages;
      ASSERT_GE(pages.size(), 3U);
      ASSERT_LT(pages.max_resident(), pages.size());
      RayForwarding others(comm, paged, space);
      RayScene none(paged, space, 1, std::span<const SurfaceRange>());
      none.share(others, {{0, paged.triangles}});
      const std::uint64_t loads = pages.loads();
      none.for_each(2, static_cast<std::size_t>(3 + comm.rank()), [&](std::size_t job) {
        const std::vector<std::uint32_t> met =
            test::expect_same_hits(none, whole, random_rays(500, static_cast<unsigned int>(job) * 100U + 1U));
        others.fetch_triangles(met, 0);
        for (const std::uint32_t id : met) {
          if (id == kNoSurface) continue;
          const SurfaceLocation at = locate_surface(scene, id);
          const Mesh& mesh = scene.mesh_of(scene.instances[at.instance]);
          if (is_held_by_all(scene, mesh)) continue;
          const auto alone = others.triangle(id);
          for (int corner = 0; corner < 3; ++corner) {
            ASSERT_EQ(alone->positions[static_cast<std::size_t>(corner)],
                      mesh.positions[mesh.triangle(at.triangle)[corner]]);
          }
        }
      });
      EXPECT_GT(pages.loads(), loads);
      const PagedRays* const rays_of_pages = others.pages();
      ASSERT_NE(rays_of_pages, nullptr);
      EXPECT_LE(rays_of_pages->ray_scenes(), pages.max_resident());
      // In each round those first that are in memory: no page is brought twice.
      EXPECT_LE(pages.loads() - loads, others.counts().rounds * (pages.size() - pages.max_resident()) + 1);
      for (const Mesh& mesh : paged.meshes) EXPECT_EQ(mesh.partial != nullptr, mesh.triangles.empty());
    });
  }
}

}  // namespace
}  // namespace hpr
