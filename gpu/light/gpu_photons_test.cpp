#include "gpu/light/gpu_photons.h"

#include <hpr/shaders/gathered_photons.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "rt/lights/light_sampler.h"
#include "rt/passes/path_vertex.h"
#include "rt/photons/photon_query.h"
#include "rt/photons/test_photons.h"

namespace hpr {
namespace {

using GpuPhotonsTest = test::OnGpu;
constexpr std::uint32_t kMaps = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// As in reflection_terms.glsl.
struct GpuReflectionTerms {
  explicit GpuReflectionTerms(const ReflectionTerms& terms)
      : vectors{terms.view, terms.normal, terms.geometric_normal, terms.diffuse, terms.tint},
        numbers{terms.edge_on,  terms.normal_view, terms.view_smith, terms.alpha2,
                terms.metallic, terms.f0,          terms.rise,       terms.eta},
        specular(terms.specular ? 1 : 0) {}

  std::array<glm::vec3, 5> vectors;
  std::array<float, 8> numbers;
  std::uint32_t specular;
};

/// As gathered_photons.comp reads them.
struct Query {
  glm::dvec3 position;
  glm::dvec3 geometric_normal;
  glm::dvec3 shading_normal;
  glm::dvec3 previous_position;
  double previous_pdf;
  double gather_reach;
  double radius;
  GpuReflectionTerms terms;
  std::uint32_t layer;
  std::uint32_t which;
  std::uint32_t gathers;
  std::uint32_t padding;
};
static_assert(sizeof(Query) == 232);

/// As gathered_photons.comp writes them.
struct Answer {
  glm::dvec3 light;
  std::uint32_t found;
  std::uint32_t done;
};

/// A room with a glass ball and a mirror that make caustics, and a veil whose photons have layers of their own.
Scene lit_room() {
  Scene scene;
  Material veil = test::diffuse(glm::vec3(0.9F, 0.8F, 0.4F));
  veil.alpha_mode = AlphaMode::Blend;
  veil.base_color.a = 0.6F;
  test::add_room(scene, test::add_material(scene, test::diffuse(glm::vec3(0.7F, 0.5F, 0.3F))));
  const auto add = [&](const Mesh& mesh) { test::place_mesh(scene, test::add_mesh(scene, mesh)); };
  add(test::quad({-0.3F, 0.95F, -0.3F}, {0.6F, 0, 0}, {0, 0, 0.6F},
                 test::add_material(scene, test::glowing(glm::vec3(20.0F)))));
  add(test::sphere(0.35, 16, test::add_material(scene, test::clear_glass())));
  add(test::quad({-0.9F, -0.9F, -0.9F}, {1.8F, 0, 0}, {0, 1.8F, 0.3F}, test::add_material(scene, test::mirror(0.9F))));
  add(test::quad({-0.9F, -0.97F, -0.5F}, {0, 0, 1.2F}, {1.2F, 0, 0}, test::add_material(scene, veil)));
  return scene;
}

struct LitRoom : test::PhotonRoom {
  LitRoom() : PhotonRoom(lit_room()), lights(scene) {}

  LightSampler lights;
};

/// A place on a surface, as the CPU and as a device see it.
struct Gather {
  PathVertex vertex{SurfacePoint{}};
  std::uint32_t which = 0;
  double radius = 0.0;
  double glossy_cutoff = 0.0;
  bool gathers = false;

  [[nodiscard]] Query query() const {
    const Bsdf& bsdf = vertex.bsdf;
    const auto shows = [&](Lobe lobe) { return !is_followed(bsdf, lobe, glossy_cutoff) && bsdf.present(lobe); };
    return {vertex.surface.position,
            vertex.surface.geometric_normal,
            vertex.material.normal,
            vertex.previous_position,
            vertex.previous_pdf,
            vertex.gather_reach,
            radius,
            GpuReflectionTerms(bsdf.reflection_terms(shows(Lobe::Diffuse), shows(Lobe::Reflection))),
            vertex.surface.layer,
            which,
            gathers ? 1U : 0U,
            0};
  }
};

/// Places of all kinds about the photons of some maps.
class Gathers {
 public:
  Gathers(const PhotonMaps& maps, std::uint64_t seed)
      : maps_{&maps.caustic, &maps.global, &maps.sparse[0], &maps.sparse[1]}, random_(seed) {}

  Gather make() {
    Gather gather;
    gather.which = static_cast<std::uint32_t>(random_() % (std::size_t{2} * kMaps));  // past the last: all maps
    const PhotonMap& map = *maps_.at(gather.which % kMaps);
    gather.radius = std::array{0.0, 0.3, one(), 1.0, 1.0, 1.0, 1.25}.at(random_() % 7) * map.radius();
    gather.glossy_cutoff = std::array{0.0, 0.3, 1.0}.at(random_() % 3);
    gather.gathers = coin();
    PathVertex& vertex = gather.vertex;
    set_surface(map, vertex.surface);
    set_material(vertex);
    vertex.previous_position = vertex.surface.position + 3.0 * one() * unit();
    vertex.previous_pdf = coin() ? 0.0 : std::exp(8.0 * one() - 4.0);
    vertex.gather_reach = coin() ? kInfinity : one();
    const double odd = std::array{std::nan(""), kInfinity, 1e300, -1e12}.at(random_() % 4);
    const int axis = static_cast<int>(random_() % 3);
    if (random_() % 100 == 0) vertex.surface.position[axis] = odd;
    if (random_() % 100 == 0) vertex.surface.geometric_normal[axis] = std::nan("");
    return gather;
  }

 private:
  double one() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }
  bool coin() { return random_() % 2 == 0; }
  glm::dvec3 unit() {
    std::normal_distribution<double> normal;
    return glm::normalize(glm::dvec3(normal(random_), normal(random_), normal(random_)));
  }
  glm::dvec3 unit_about(const glm::dvec3& axis) {
    const glm::dvec3 direction = unit();
    return glm::dot(direction, axis) < 0.0 ? -direction : direction;
  }

  /// Near a photon, at the border of a cell, or anywhere: in the room and beyond.
  void set_surface(const PhotonMap& map, SurfacePoint& surface) {
    const RaySpace& space = map.space();
    const PhotonCells cells = map.cells();
    surface.position = space.origin + 1.2 * (2.0 * glm::dvec3(one(), one(), one()) - 1.0) / space.scale;
    surface.geometric_normal = unit();
    if (map.size() > 0 && random_() % 8 != 0) {
      const PhotonPlace& photon = cells.positions[random_() % cells.positions.size()];
      const glm::dvec3 at(photon.position[0], photon.position[1], photon.position[2]);
      surface.position = space.origin + at / space.scale;
      if (coin()) surface.position += 0.7 * map.radius() * one() * unit();
      surface.layer = static_cast<std::uint8_t>(photon.facing >> 24U);
      if (random_() % 10 == 0) ++surface.layer;
      // Photons of walls face one of the axes; others face anywhere.
      int axis = 0;
      for (int other = 1; other < 3; ++other) {
        if (std::abs(at[other]) > std::abs(at[axis])) axis = other;
      }
      glm::dvec3 wall(0.0);
      wall[axis] = at[axis] < 0.0 ? 1.0 : -1.0;
      if (surface.layer != 0) wall = {0.0, 1.0, 0.0};
      surface.geometric_normal = coin() ? wall : glm::normalize(wall + 0.3 * unit());
    }
    if (random_() % 4 == 0 && map.size() > 0) {
      const double width = 1.0 / cells.per_unit;
      const glm::dvec3 border = glm::round(space.from_world(surface.position) / width) * width;
      const int axis = static_cast<int>(random_() % 3);
      surface.position[axis] = (space.origin + border / space.scale)[axis];
    }
    surface.to_viewer = unit_about(surface.geometric_normal);
    surface.shading_normal = surface.geometric_normal;
    surface.inside = coin();
  }

  void set_material(PathVertex& vertex) {
    SurfacePoint& surface = vertex.surface;
    if (coin()) {
      const glm::dvec3 leaning = glm::normalize(surface.geometric_normal + 0.5 * unit());
      if (glm::dot(leaning, surface.to_viewer) > 0.0) surface.shading_normal = leaning;
    }
    MaterialPoint& material = vertex.material;
    material.base_color = {one(), one(), one()};
    material.metallic = std::array{0.0, 1.0, one()}.at(random_() % 3);
    material.roughness = std::max(one(), 0.05);
    material.transmission = random_() % 3 == 0 ? one() : 0.0;
    material.ior = std::array{1.0, 0.0, 1.5, 1.0 + one()}.at(random_() % 4);
    material.solid = coin();
    material.unlit = random_() % 50 == 0;
    material.normal = surface.facing_normal();
    vertex.bsdf = Bsdf(material, surface);
  }

  std::array<const PhotonMap*, kMaps> maps_;
  std::mt19937_64 random_;
};

/// What the photon pass makes of one vertex.
glm::dvec3 light_by_pass(const LitRoom& room, const PhotonMaps& maps, const Gather& gather) {
  const RaySettings settings{.glossy_cutoff = gather.glossy_cutoff};
  const LightContext context{.scene = room.scene,
                             .surfaces = room.surfaces,
                             .rays = nullptr,
                             .lights = room.lights,
                             .settings = settings,
                             .gathers = gather.gathers,
                             .photons = &maps};
  Wavefront wave;
  wave.vertices.push_back(gather.vertex);
  RayBuffers buffers;
  PixelSums sums;
  sums.radiance.resize(1, glm::dvec3(0.0));
  std::vector<PathVertex> next;
  make_photon_pass()->scatter(context, wave, buffers, sums, next);
  return sums.radiance[0];
}

/// What the CPU makes of a place: the answer that a device owes. Through all maps it counts no photons.
Answer expected_answer(const LitRoom& room, const PhotonMaps& maps, const Gather& gather) {
  if (gather.which >= kMaps) return {light_by_pass(room, maps, gather), 0, 1};
  const std::array<const PhotonMap*, kMaps> each{&maps.caustic, &maps.global, &maps.sparse[0], &maps.sparse[1]};
  const PhotonMap& map = *each.at(gather.which);
  const SurfacePoint& surface = gather.vertex.surface;
  FoundPhotons found;
  map.find(surface.position, surface.geometric_normal, surface.layer, gather.radius, found);
  const auto count = static_cast<std::uint32_t>(found.count);
  return {gather_photons(map, gather.radius, surface, gather.vertex.bsdf, gather.vertex.material.normal,
                         gather.glossy_cutoff, found),
          count, 1};
}

struct Compared {
  std::size_t lit = 0;
  std::size_t lit_by_all = 0;    ///< of them, by all maps of a path
  std::size_t lit_in_layer = 0;  ///< of them, on layers other than 0
};

/// Has a device and the CPU gather light at `count` places.
Compared compare(const GpuDevice& device, const LitRoom& room, const PhotonMaps& maps, GpuPhotons& photons,
                 std::size_t count) {
  photons.put(maps);
  Gathers gathers(maps, count);
  std::vector<Gather> all(count);
  std::vector<Query> queries;
  for (Gather& each : all) {
    each = gathers.make();
    queries.push_back(each.query());
  }
  const std::vector<Answer> answers =
      test::map_on_gpu<Answer>(device, gathered_photons, std::span<const Query>(queries), photons.address());
  Compared compared;
  for (std::size_t i = 0; i < count; ++i) {
    const Answer expected = expected_answer(room, maps, all[i]);
    EXPECT_EQ(answers[i].done, expected.done) << i;
    EXPECT_EQ(answers[i].found, expected.found) << i;
    // Off by 3e-7 where thousands of photons count: the CPU adds them up in single precision.
    const double brightest = brightness(expected.light);
    const double error = brightness(glm::abs(answers[i].light - expected.light));
    EXPECT_LE(error, 1e-5 * brightest) << i << ", map " << all[i].which;
    if (!(brightest > 0.0)) continue;
    ++compared.lit;
    if (all[i].which >= kMaps) ++compared.lit_by_all;
    if (all[i].vertex.surface.layer != 0) ++compared.lit_in_layer;
  }
  return compared;
}

struct BuilderCase {
  std::uint32_t sent = 0;
  PhotonUse use = PhotonUse::Direct;
};

TEST_F(GpuPhotonsTest, BringTheLightOfTheCpuWhereverItIsGathered) {
  const LitRoom room;
  GpuPhotons photons(device());
  // More, fewer, more again: the memory stays, or grows. Of the fewest most lie where few do.
  for (const auto& [sent, use] :
       {BuilderCase{10'000, PhotonUse::Direct}, {1'000, PhotonUse::Gathered}, {30'000, PhotonUse::Gathered}}) {
    const RaySettings settings{.photons = sent, .global_photons = true, .photons_gathered = 30};
    PhotonMapBuilder builder(room.scene, room.surfaces, room.space, room.rays, room.lights, settings, use);
    const PhotonMaps& maps = builder.build({}, nullptr);
    ASSERT_GT(maps.caustic.size(), sent / 10);
    ASSERT_GT(maps.global.size(), sent);
    ASSERT_EQ(maps.sparse[1].size() > 10, use == PhotonUse::Gathered);
    const Compared compared = compare(device(), room, maps, photons, 20'000);
    EXPECT_GT(compared.lit, 4'000U);
    EXPECT_GT(compared.lit_by_all, 2'000U);
    EXPECT_GT(compared.lit_in_layer, 700U);
  }
}

TEST_F(GpuPhotonsTest, BringItFromTheWholeSceneAndFromVeryNear) {
  const LitRoom room;
  GpuPhotons photons(device());
  const TracedPhotons traced = room.trace(test::glowing_room(), 500);
  PhotonMaps maps;
  maps.caustic = PhotonMap(traced.global, room.space, 5.0, 0x1p-3);
  maps.global = PhotonMap(traced.global, room.space, 1e-4, 0x1p10);
  maps.sparse[0] = PhotonMap(traced.caustic, room.space, 1e-30);
  maps.sparse[1] = PhotonMap(traced.global, room.space, 0.4);
  maps.footprint = 0.2;
  const Compared compared = compare(device(), room, maps, photons, 20'000);
  EXPECT_GT(compared.lit, 7'000U);
  const Compared none = compare(device(), room, {}, photons, 200);
  EXPECT_EQ(none.lit, 0U);
}

TEST_F(GpuPhotonsTest, AreAllFoundOrTheDeviceIsKnownToHaveGivenUp) {
  const LitRoom room;
  std::vector<Photon> all(70'000);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].facing = pack_facing({0.0, 1.0, 0.0});
    all[i].direction = pack_direction({0.0, 1.0, 0.0});
    all[i].flux = {1.0F, static_cast<float>(i % 7), 0.5F};
  }
  PhotonMaps maps;
  maps.caustic = PhotonMap(all, room.space, 0.1);
  Gather gather;
  gather.which = kMaps;
  gather.gathers = true;  // of the caustic map alone: no other loop ends too early and shows it
  SurfacePoint& surface = gather.vertex.surface;
  surface.position = room.space.origin;
  surface.to_viewer = surface.geometric_normal = surface.shading_normal = {0.0, 1.0, 0.0};
  gather.vertex.material.normal = surface.shading_normal;
  gather.vertex.bsdf = Bsdf(gather.vertex.material, surface);
  GpuPhotons photons(device());
  photons.put(maps);
  const Query query = gather.query();
  const auto answers =
      test::map_on_gpu<Answer>(device(), gathered_photons, std::span<const Query>(&query, 1), photons.address());
  const glm::dvec3 expected = light_by_pass(room, maps, gather);
  ASSERT_GT(brightness(expected), 0.0);
  if (answers[0].done == 0) {
    EXPECT_TRUE(device().info().software);
  } else {
    EXPECT_LE(brightness(glm::abs(answers[0].light - expected)), 1e-3 * brightness(expected));
  }
}

}  // namespace
}  // namespace hpr
