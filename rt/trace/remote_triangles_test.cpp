#include "rt/trace/remote_triangles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <vector>

#include "cluster/distribution/scene_distribution.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "rt/deferred_shader.h"
#include "rt/test_scene.h"
#include "rt/trace/ray_forwarding.h"
#include "rt/trace/refined_triangles.h"
#include "rt/trace/surfaces.h"
#include "scene/generators/generators.h"
#include "scene/partial_mesh.h"

// A scene of which ranks hold parts shows the bits of a whole one.
namespace hpr {
namespace {

/// Balls with all arrays a mesh may have, one of them in many places and one mirrored, on a wide ground.
Scene balls() {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.7F)));
  Material mapped = test::diffuse(glm::vec3(0.5F));
  mapped.normal_texture.texture = 0;
  scene.textures.emplace_back().image = Image<Rgba8>({4, 4}, Rgba8{140, 120, 250, 255});
  const std::uint32_t bumpy = test::add_material(scene, mapped);
  Mesh ball = test::sphere(0.5, 40, bumpy);
  for (const glm::vec3& p : ball.positions) {
    ball.uvs[0].emplace_back(p.x, p.y);
    ball.uvs[1].emplace_back(p.z, p.x);
    ball.colors.emplace_back(0.5F + 0.5F * p.x, 0.5F, 0.5F, 1.0F);
    ball.tangents.emplace_back(1.0F, 0.0F, 0.0F, p.y < 0.0F ? -1.0F : 1.0F);
  }
  const std::uint32_t shared = test::add_mesh(scene, ball);
  for (int i = 0; i < 6; ++i) {
    glm::dmat4 there(1.0);
    there[3] = {-3.0 + 1.1 * i, 0.5, -0.3 * i, 1.0};
    if (i == 4) there[0].x = -1.5;
    test::place_mesh(scene, shared, there);
  }
  for (int i = 0; i < 4; ++i) {
    Mesh own = ball;
    own.material = i % 2 == 0 ? white : bumpy;
    glm::dmat4 there(1.3);
    there[3] = {2.0 * i - 3.0, 0.8, 3.0, 1.0};
    test::place_mesh(scene, test::add_mesh(scene, own), there);
  }
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1e5, 0, 1e5}, {2e5, 0, 0}, {0, 0, -2e5}, white)));
  finish_scene(scene);
  return scene;
}

/// Collective. The scene as its ranks hold it.
Scene shared_out(Communicator& comm, const Scene& whole) {
  Scene scene = distribute_scene(comm, [&] {
    LoadedScene loaded(whole);
    loaded.in_parts = true;
    return loaded;
  });
  if (comm.size() == 1) return scene;
  const auto mine = count_refined_parts(scene, RaySpace(scene), scene.parts[static_cast<std::size_t>(comm.rank())]);
  std::vector<RefinementCount> counts;
  for (const auto& of_rank : all_gather_lists(comm, std::span(mine))) {
    counts.insert(counts.end(), of_rank.begin(), of_rank.end());
  }
  scene.refined = refined_by_counts(scene, counts);
  return scene;
}

template <typename Value>
bool same_bits(const Value& a, const Value& b) {
  return std::memcmp(&a, &b, sizeof(Value)) == 0;
}

void expect_same(const SurfacePoint& a, const SurfacePoint& b, std::uint32_t id) {
  EXPECT_TRUE(same_bits(a.position, b.position) && same_bits(a.geometric_normal, b.geometric_normal) &&
              same_bits(a.shading_normal, b.shading_normal) && same_bits(a.lift, b.lift) &&
              same_bits(a.offset, b.offset))
      << id;
  EXPECT_TRUE(same_bits(a.uv, b.uv) && same_bits(a.color, b.color) && same_bits(a.tangent, b.tangent) &&
              same_bits(a.bitangent, b.bitangent))
      << id;
  EXPECT_TRUE(a.surface == b.surface && a.material == b.material && a.layer == b.layer && a.inside == b.inside) << id;
}

TEST(RemoteTriangles, SurfacesAreMetAsInAWholeScene) {
  const Scene whole = balls();
  const RaySpace space(whole.bounds);
  const Surfaces expected(whole, space);
  for (const int ranks : {2, 3, 5}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      const Scene scene = shared_out(comm, whole);
      EXPECT_EQ(scene.refined, refined_instances(whole, space));
      RayForwarding others(comm, scene, space, scene.parts[static_cast<std::size_t>(comm.rank())]);
      const Surfaces surfaces(scene, space, true, &others);
      ASSERT_TRUE(surfaces.are_shared_out());
      others.for_each(2, 4, [&](std::size_t job) {
        std::mt19937 random(static_cast<unsigned int>(job));
        std::vector<std::uint32_t> ids(300);
        for (std::uint32_t& id : ids) id = static_cast<std::uint32_t>(random() % whole.triangles);
        ids[7] = kNoSurface;
        if (job != 3) surfaces.prefetch(ids);  // without, one is asked for after the other
        if (job == 3) ids.resize(20);
        WorldTriangle here;
        WorldTriangle there;
        std::size_t remote = 0;
        for (const std::uint32_t id : ids) {
          if (id == kNoSurface) continue;
          surfaces.load(id, here);
          expected.load(id, there);
          if (here.remote) ++remote;
          const glm::dvec3 aim = there.v0 + 0.3 * there.e1 + 0.3 * there.e2;
          const glm::dvec3 origin = aim + glm::dvec3(0.3, 2.0, 0.4);
          const SurfacePoint met = surfaces.meet(here, origin, aim - origin);
          expect_same(met, expected.meet(there, origin, aim - origin), id);
          EXPECT_EQ(surfaces.coplanar_tolerance(here, met.offset), expected.coplanar_tolerance(there, met.offset));
        }
        EXPECT_GT(remote, 0U);
      });
    });
  }
}

TEST(RemoteTriangles, OldOnesMakeRoom) {
  RemoteTriangles triangles;
  triangles.set_capacity(10'000);
  const auto mesh = std::make_shared<const Mesh>();
  constexpr std::uint32_t kMany = 1'000'000;
  for (std::uint32_t id = 0; id < kMany; ++id) triangles.add(id, mesh);
  EXPECT_TRUE(triangles.find(kMany - 1));
  EXPECT_FALSE(triangles.find(0));
  EXPECT_LT(mesh.use_count(), 22'000);
  EXPECT_GT(mesh.use_count(), 9'000);
}

TEST(RemoteTriangles, EverySurfaceHasAnOwner) {
  const std::array<std::vector<SurfaceRange>, 3> parts{{{{0, 5}, {20, 30}}, {{5, 20}}, {{30, 31}}}};
  const SurfaceOwners owners(parts);
  EXPECT_EQ(owners.holder_of(0), 0U);
  EXPECT_EQ(owners.holder_of(4), 0U);
  EXPECT_EQ(owners.holder_of(5), 1U);
  EXPECT_EQ(owners.holder_of(19), 1U);
  EXPECT_EQ(owners.holder_of(29), 0U);
  EXPECT_EQ(owners.holder_of(30), 2U);
}

}  // namespace
}  // namespace hpr
