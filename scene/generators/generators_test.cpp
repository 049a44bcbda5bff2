#include "scene/generators/generators.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <map>
#include <set>
#include <span>

#include "core/error.h"
#include "scene/load_scene.h"
#include "scene/points_lines.h"
#include "scene/requirements.h"
#include "scene/scene_test_tools.h"

namespace hpr {
namespace {

ExitCode code_of(const std::string& text) {
  try {
    (void)generate_scene(text);
  } catch (const Error& error) {
    EXPECT_FALSE(error.hint().empty()) << text;
    return error.code();
  }
  return ExitCode::Done;
}

TEST(Generated, EverySceneIsFiniteNamedAndTheSameTwice) {
  for (const Generator& generator : all_generators()) {
    SCOPED_TRACE(generator.name);
    const GeneratorOptions options = options_for_triangles(generator, 20'000);
    Scene scene = generator.make(options);
    const std::uint64_t hash = content_hash(scene);
    const View view = make_view(scene.cameras.at(0), {640, 360}, scene.bounds);
    shape_points_and_lines(scene, {}, std::span(&view, 1), SceneLimits().memory_bytes);
    EXPECT_EQ(scene.name, generator.name);
    EXPECT_GT(scene.triangles, 0U);
    EXPECT_TRUE(gives_light(scene));
    ASSERT_FALSE(scene.cameras.empty());
    EXPECT_EQ(scene.cameras.front().name, "main");
    std::set<std::string> names;
    for (const Camera& camera : scene.cameras) EXPECT_TRUE(names.insert(camera.name).second) << camera.name;
    for (const Mesh& mesh : scene.meshes) {
      EXPECT_EQ(test::first_flaw(mesh), "") << mesh.name;
      EXPECT_LT(mesh.material, scene.materials.size());
      EXPECT_FALSE(mesh.name.empty());
    }
    EXPECT_EQ(content_hash(generator.make(options)), hash);
  }
}

TEST(Generated, ScenesDoNotChangeSilently) {
  // Whoever changes a scene on purpose changes its hash here, and every picture that was made of it before.
  const std::map<std::string, std::uint64_t> hashes{
      {"gallery", 0x5b367ec2a87d586c}, {"extensions", 0x0f4f0775ec9dad85}, {"sphereflake", 0x9490203de3766382},
      {"tetra", 0x4a77963b48f15f34},   {"cornell", 0xfe71096e357cbfbb},    {"asteroids", 0xd66000b0b4f8b0e9},
      {"cloud", 0xec144b4a5388afbd}};
  EXPECT_EQ(hashes.size(), all_generators().size());
  for (const Generator& generator : all_generators()) {
    ASSERT_TRUE(hashes.contains(generator.name)) << generator.name;
    EXPECT_EQ(content_hash(generator.make({})), hashes.at(generator.name)) << generator.name;
  }
}

TEST(Generated, WrongNamesOptionsAndValuesAreUsageErrors) {
  for (const char* text : {"galery", "", "gallery?", "gallery?s", "gallery?=2", "gallery?size=2", "gallery?s=0",
                           "gallery?s=99", "gallery?s=two", "gallery?s=2&s=2", "gallery?s=", "gallery?s=2.5",
                           "cornell?variant=mirorr", "tetra?s=13", "asteroids?count=99999999999"}) {
    if (std::string(text) == "gallery?") continue;  // an empty list of options is a list
    EXPECT_EQ(code_of(text), ExitCode::Usage) << text;
  }
  try {
    (void)generate_scene("tetr?s=3");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.hint().find("did you mean 'tetra'?"), std::string::npos) << error.hint();
  }
  try {
    (void)generate_scene("asteroids?coutn=3");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.hint().find("did you mean 'count'?"), std::string::npos) << error.hint();
  }
}

TEST(Generated, EveryDescribedOptionIsRead) {
  for (const Generator& generator : all_generators()) {
    for (const auto& [key, description] : generator.options) {
      EXPECT_THROW((void)generator.make({{key, "no value at all"}}), Error) << generator.name << " " << key;
    }
  }
}

TEST(Generated, SizesComeNearTheTrianglesAskedFor) {
  for (const char* name : {"gallery", "sphereflake", "asteroids"}) {
    const Generator& generator = find_generator(name);
    for (const std::uint64_t wanted : {60'000U, 200'000U, 500'000U}) {
      const GeneratorOptions options = options_for_triangles(generator, wanted);
      const std::uint64_t got = generator.make(options).triangles;
      EXPECT_NEAR(static_cast<double>(got) / static_cast<double>(wanted), 1.0, 0.25) << name << " " << wanted;
      EXPECT_EQ(options_for_triangles(generator, got), options) << "the count is known without making the scene";
    }
  }
  EXPECT_EQ(options_for_triangles(find_generator("tetra"), 70'000).at("s"), "8");
  EXPECT_TRUE(options_for_triangles(find_generator("cornell"), 70'000).empty());
}

TEST(Sphereflake, HasTheSpheresAndFirstPositionsOfItsDescription) {
  std::size_t count = 1;
  for (int size = 0; size <= 4; ++size, count = 9 * count + 1) EXPECT_EQ(sphereflake(size).size(), count);

  const std::vector<FlakeSphere> spheres = sphereflake(4);
  const auto near = [&](std::size_t i, const glm::dvec3& p) { return glm::distance(spheres[i].center, p) < 1e-6; };
  EXPECT_TRUE(near(1, {0.643951, 0.172546, 0.0}));
  EXPECT_TRUE(near(7, {0.272166, 0.272166, 0.544331}));
  EXPECT_DOUBLE_EQ(spheres[1].radius, 1.0 / 6.0);
  for (const FlakeSphere& s : spheres) {
    EXPECT_LE(glm::length(s.center) + s.radius, 1.0 + 1e-12) << "all fit into the unit sphere";
    EXPECT_NEAR(glm::length(s.axis), 1.0, 1e-12);
  }
  // Sphere i has the children 9 i + 1 .. 9 i + 9: they touch it.
  for (std::size_t i = 0; i < 820; ++i) {
    for (std::size_t child = 9 * i + 1; child <= 9 * i + 9; ++child) {
      EXPECT_NEAR(glm::distance(spheres[child].center, spheres[i].center), spheres[child].radius + spheres[i].radius,
                  1e-12);
    }
  }
}

TEST(Sphereflake, IsOneSphereInstancedAboveItsSquare) {
  const Scene scene = generate_scene("sphereflake?s=2&n=3");
  EXPECT_EQ(scene.triangles, 91U * 108U + 2U);
  EXPECT_EQ(scene.instances.size(), 92U);
  EXPECT_EQ(scene.meshes.size(), 2U);
  EXPECT_EQ(scene.lights.size(), 3U);
  EXPECT_EQ(scene.meshes[0].normals[0], glm::vec3(0, 1, 0));
  const glm::dvec3 eye = scene.cameras[0].eye;
  EXPECT_EQ(eye, glm::dvec3(2.1, 1.7, 1.3)) << "z is up there, y is up here";
}

TEST(Tetra, HasFourToThePowerOfItsSizeTrianglesHoweverItIsInstanced) {
  std::uint32_t count = 4;
  for (int size = 1; size <= 9; ++size, count *= 4) {
    const Scene scene = generate_scene("tetra?s=" + std::to_string(size));
    EXPECT_EQ(scene.triangles, count);
    EXPECT_EQ(scene.instances.size(), size <= 8 ? 1U : 4U);
    EXPECT_EQ(scene.bounds.low, glm::dvec3(-1.0));
    EXPECT_EQ(scene.bounds.high, glm::dvec3(1.0));
  }
}

TEST(Cornell, FacesInwardsAndKeepsItsPublishedCounts) {
  const Scene scene = generate_scene("cornell?lamp=coplanar");
  EXPECT_EQ(scene.triangles, 32U);
  EXPECT_EQ(generate_scene("cornell").triangles, 38U) << "the ceiling with a hole is four quads";
  EXPECT_EQ(generate_scene("cornell?variant=glass").triangles, 28U + 20U * 1024U);
  const glm::dvec3 center(0.278, 0.25, 0.28);
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    if (mesh.name.find("block") != std::string::npos) continue;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      EXPECT_GT(glm::dot(glm::dvec3(mesh.normals[i]), center - glm::dvec3(mesh.positions[i])), 0.0) << mesh.name;
    }
  }
  // The red wall is on the left of the picture, the green one on the right.
  const glm::dvec3 right = scene.cameras[0].axes[0];
  const auto side = [&](const char* name) {
    const auto mesh = std::ranges::find(scene.meshes, name, &Mesh::name);
    return glm::dot(right, glm::dvec3(mesh->positions[0]) - scene.cameras[0].eye);
  };
  EXPECT_LT(side("left"), 0.0);
  EXPECT_GT(side("right"), 0.0);
}

TEST(Cornell, HasNoHoleAroundTheLamp) {
  const Scene scene = generate_scene("cornell");
  double area = 0.0;
  for (const Mesh& mesh : scene.meshes) {
    if (mesh.name != "ceiling" && mesh.name != "lamp") continue;
    for (const glm::uvec3& t : mesh.triangles) {
      const glm::dvec3 a(mesh.positions[t.x]);
      const glm::dvec3 cross = glm::cross(glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a);
      EXPECT_LT(cross.y, 0.0);
      area += 0.5 * glm::length(cross);
    }
  }
  EXPECT_NEAR(area, 0.556 * 0.5592, 1e-7);
}

TEST(Gallery, HasTheTrianglesOfItsFormula) {
  // Room, mirrors, panels, plinths and paintings 328; then spheres, icospheres, knots, vases.
  EXPECT_EQ(generate_scene("gallery?s=1&k=2&n=3").triangles,
            328U + 4 * 108 * 10 + 8 * 320 + 4 * 16384 + 4 * (64 * 16 - 32));
  EXPECT_EQ(generate_scene("gallery?s=1&k=2&n=3&cases=4").triangles,
            328U + 240 + 4 * 108 * 10 + 8 * 320 + 4 * 16384 + 4 * (64 * 16 - 32));
  const Scene scene = generate_scene("gallery");
  EXPECT_GE(scene.triangles, 100'000U);
  EXPECT_LE(scene.triangles, 200'000U);
  EXPECT_EQ(scene.lights.size(), 4U);
  EXPECT_TRUE(generate_scene("gallery?lights=0&s=1&k=0").lights.empty());
}

TEST(Gallery, LiesWhollyInsideItsHall) {
  const Scene scene = generate_scene("gallery?s=1&k=1");
  EXPECT_EQ(scene.bounds.low, glm::dvec3(-24, 0, -6));
  EXPECT_EQ(scene.bounds.high, glm::dvec3(24, 6, 6));
  for (const Camera& camera : scene.cameras) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GT(camera.eye[axis], scene.bounds.low[axis]) << camera.name;
      EXPECT_LT(camera.eye[axis], scene.bounds.high[axis]) << camera.name;
    }
  }
}

TEST(Gallery, HangsTwentyFourPaintingsThatDoNotOverlap) {
  const Scene scene = generate_scene("gallery?s=1&k=0");
  std::vector<glm::dvec3> positions;
  for (const Instance& instance : scene.instances) {
    const Material& material = scene.materials[scene.mesh_of(instance).material];
    if (!material.base_color_texture.present() || material.name == "floor") continue;
    const glm::dvec3 here(instance.to_world[3]);
    for (const glm::dvec3& there : positions) {
      EXPECT_TRUE(here.z != there.z || std::abs(here.x - there.x) >= 1.6 || std::abs(here.y - there.y) >= 1.0);
    }
    EXPECT_TRUE(std::abs(here.x) > 8.8 || here.y > 4.3 + 0.5) << "before a mirror";
    positions.push_back(here);
  }
  EXPECT_EQ(positions.size(), 24U);
}

TEST(Asteroids, HaveTheCountsOfTheirSizesAndStayInTheirBelt) {
  const Scene scene = generate_scene("asteroids");
  EXPECT_EQ(scene.triangles, 102'400U);
  EXPECT_EQ(scene.instances.size(), 80U);
  EXPECT_EQ(generate_scene("asteroids?k=4&count=200").triangles, 1'024'000U);
  std::set<float> metallic;
  for (const Instance& instance : scene.instances) {
    const glm::dvec3 center(instance.to_world[3]);
    const double radius = std::hypot(center.x, center.z);
    EXPECT_GE(radius, 60.0);
    EXPECT_LE(radius, 140.0);
    EXPECT_LE(std::abs(center.y), 10.0);
    const double size = glm::length(glm::dvec3(instance.to_world[0]));
    EXPECT_GE(size, 0.15 - 1e-12);
    EXPECT_LE(size, 3.0);
    const double determinant = glm::determinant(glm::dmat3(instance.to_world));
    EXPECT_NEAR(determinant / (size * size * size), 1.0, 1e-12) << "a rotation, not a reflection";
  }
  for (const Mesh& mesh : scene.meshes) {
    for (const glm::vec3& p : mesh.positions) {
      EXPECT_GE(glm::length(p), 0.4F - 1e-5F);
      EXPECT_LE(glm::length(p), 1.8F + 1e-5F);
    }
  }
}

TEST(Asteroids, DifferFromRockToRockAndSeedToSeed) {
  const Scene one = generate_scene("asteroids?k=2&count=16");
  EXPECT_NE(one.meshes[0].positions, one.meshes[1].positions);
  EXPECT_NE(content_hash(one), content_hash(generate_scene("asteroids?k=2&count=16&seed=2")));
}

TEST(Cloud, HasItsPointsAboutTheKnotAndItsLines) {
  const Scene scene = generate_scene("cloud?count=500");
  std::map<std::string, const Mesh*> meshes;
  for (const Mesh& mesh : scene.meshes) meshes[mesh.name] = &mesh;
  const Mesh& cloud = *meshes.at("cloud");
  EXPECT_EQ(cloud.kind, MeshKind::Points);
  EXPECT_EQ(cloud.triangles.size(), 500U);
  EXPECT_EQ(cloud.colors.size(), 500U);
  for (const glm::vec3& p : cloud.positions) {
    double nearest = 1e9;
    const std::vector<glm::vec3>& center = meshes.at("center line")->positions;
    for (const glm::vec3& c : center) nearest = std::min<double>(nearest, glm::distance(p, c));
    EXPECT_NEAR(nearest, 0.16, 0.02);
  }
  EXPECT_EQ(meshes.at("box")->triangles.size(), 12U);
  EXPECT_EQ(meshes.at("grid")->triangles.size(), 34U);
  EXPECT_EQ(meshes.at("center line")->triangles.size(), 240U);
  EXPECT_NE(content_hash(scene), content_hash(generate_scene("cloud?count=500&seed=2")));
  EXPECT_EQ(options_for_triangles(find_generator("cloud"), 89'000).at("count"), "10000");
}

}  // namespace
}  // namespace hpr
