#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <glm/geometric.hpp>
#include <string>

#include "core/error.h"
#include "core/json.h"
#include "image/image_io.h"
#include "scene/generators/generators.h"
#include "scene/gltf/gltf.h"

namespace hpr {
namespace {

struct Parts {
  Json json;
  std::vector<std::byte> buffer;
};

std::uint32_t word_at(const std::vector<std::byte>& bytes, std::size_t offset) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof(word));
  return word;
}

/// The two chunks of a .glb file whose container is well formed.
Parts parts_of(const std::vector<std::byte>& glb) {
  EXPECT_EQ(word_at(glb, 0), 0x46546C67U);
  EXPECT_EQ(word_at(glb, 4), 2U);
  EXPECT_EQ(word_at(glb, 8), glb.size());
  const std::size_t json_bytes = word_at(glb, 12);
  EXPECT_EQ(word_at(glb, 16), 0x4E4F534AU);
  EXPECT_EQ(json_bytes % 4, 0U);
  const char* const text = reinterpret_cast<const char*>(glb.data()) + 20;
  Parts parts{Json::parse({text, json_bytes}), {}};
  if (20 + json_bytes < glb.size()) {
    EXPECT_EQ(word_at(glb, 24 + json_bytes), 0x004E4942U);
    EXPECT_EQ(28 + json_bytes + word_at(glb, 20 + json_bytes), glb.size());
    parts.buffer.assign(glb.begin() + static_cast<std::ptrdiff_t>(28 + json_bytes), glb.end());
  }
  return parts;
}

template <typename Value>
std::vector<Value> values_of(const Parts& parts, std::size_t accessor, std::size_t values_each = 1) {
  const auto& a = parts.json["accessors"][accessor];
  const auto& view = parts.json["bufferViews"][a["bufferView"].get<std::size_t>()];
  std::vector<Value> values(a["count"].get<std::size_t>() / values_each);
  EXPECT_EQ(view["byteLength"].get<std::size_t>(), values.size() * sizeof(Value));
  EXPECT_LE(view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>(), parts.buffer.size());
  std::memcpy(values.data(), parts.buffer.data() + view["byteOffset"].get<std::size_t>(),
              values.size() * sizeof(Value));
  return values;
}

TEST(GltfWriter, KeepsEveryMeshAndMatrixToTheBit) {
  const Scene scene = generate_scene("gallery?s=1&k=1&cases=1");
  const Parts parts = parts_of(encode_glb(scene));
  ASSERT_EQ(parts.json["meshes"].size(), scene.meshes.size());
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const Mesh& mesh = scene.meshes[i];
    const auto& primitive = parts.json["meshes"][i]["primitives"][0];
    const auto& attributes = primitive["attributes"];
    EXPECT_EQ(values_of<glm::vec3>(parts, attributes["POSITION"].get<std::size_t>()), mesh.positions);
    EXPECT_EQ(values_of<glm::vec3>(parts, attributes["NORMAL"].get<std::size_t>()), mesh.normals);
    EXPECT_EQ(attributes.contains("TEXCOORD_0"), !mesh.uvs[0].empty());
    if (!mesh.uvs[0].empty()) {
      EXPECT_EQ(values_of<glm::vec2>(parts, attributes["TEXCOORD_0"].get<std::size_t>()), mesh.uvs[0]);
    }
    EXPECT_EQ(values_of<glm::uvec3>(parts, primitive["indices"].get<std::size_t>(), 3), mesh.triangles);
    EXPECT_EQ(primitive["material"].get<std::uint32_t>(), mesh.material);
  }
  ASSERT_EQ(parts.json["nodes"].size(), scene.instances.size() + scene.lights.size() + scene.cameras.size());
  EXPECT_EQ(parts.json["scenes"][0]["nodes"].size(), parts.json["nodes"].size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const auto& node = parts.json["nodes"][i];
    EXPECT_EQ(node["mesh"].get<std::uint32_t>(), scene.instances[i].mesh);
    glm::dmat4 matrix(1.0);
    if (node.contains("matrix")) {
      for (int k = 0; k < 16; ++k) matrix[k / 4][k % 4] = node["matrix"][static_cast<std::size_t>(k)].get<double>();
    }
    EXPECT_EQ(matrix, scene.instances[i].to_world);
  }
}

TEST(GltfWriter, KeepsTexturesMaterialsLightsAndCameras) {
  const Scene scene = generate_scene("gallery?s=1&k=0");
  const Parts parts = parts_of(encode_glb(scene));
  ASSERT_EQ(parts.json["textures"].size(), scene.textures.size());
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    const auto& image = parts.json["images"][parts.json["textures"][i]["source"].get<std::size_t>()];
    const auto& view = parts.json["bufferViews"][image["bufferView"].get<std::size_t>()];
    const auto bytes =
        std::span(parts.buffer).subspan(view["byteOffset"].get<std::size_t>(), view["byteLength"].get<std::size_t>());
    EXPECT_EQ(decode_image(bytes, "texture", {}), scene.textures[i].image);
  }
  const auto material_named = [&](const char* name) {
    const auto& all = parts.json["materials"].elements();
    return *std::ranges::find_if(all, [&](const Json& m) { return m["name"] == name; });
  };
  const auto panel = material_named("panel");
  const auto strength = panel["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"].get<double>();
  EXPECT_EQ(panel["emissiveFactor"][0].get<double>() * strength, 12.0);
  EXPECT_LE(panel["emissiveFactor"][0].get<double>(), 1.0);
  EXPECT_EQ(material_named("glass")["extensions"]["KHR_materials_transmission"]["transmissionFactor"], 1.0);
  EXPECT_EQ(parts.json["samplers"][0]["magFilter"], 9728) << "the floor's checker has sharp edges";

  const auto& lights = parts.json["extensions"]["KHR_lights_punctual"]["lights"];
  ASSERT_EQ(lights.size(), scene.lights.size());
  EXPECT_EQ(static_cast<float>(lights[0]["color"][0].get<double>() * lights[0]["intensity"].get<double>()),
            scene.lights[0].intensity.r);
  ASSERT_EQ(parts.json["cameras"].size(), scene.cameras.size());
  EXPECT_EQ(parts.json["cameras"][0]["name"], "main");
  EXPECT_EQ(parts.json["cameras"][0]["perspective"]["yfov"].get<double>(),
            std::get<PerspectiveLens>(scene.cameras[0].lens).vertical_fov_radians);
  EXPECT_GT(parts.json["cameras"][0]["perspective"]["znear"].get<double>(), 0.0);
  const auto used = parts.json["extensionsUsed"].get<std::vector<std::string>>();
  for (const char* extension :
       {"KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_transmission"}) {
    EXPECT_NE(std::ranges::find(used, extension), used.end()) << extension;
  }
}

TEST(GltfWriter, WritesWhatFewScenesHave) {
  Scene scene;
  Texture texture;
  texture.image = Image<Rgba8>({1, 1}, {1, 2, 3, 4});
  texture.wrap_s = Wrap::ClampToEdge;
  texture.wrap_t = Wrap::MirroredRepeat;
  scene.textures.push_back(texture);
  Material material;
  material.ior = 1.33F;
  material.alpha_mode = AlphaMode::Mask;
  material.double_sided = true;
  material.emissive = glm::vec3(0.1F, 0.7F, 0.3F);
  material.base_color_texture = {0, 1, {0.0F, -2.0F, 3.0F, 0.0F, 0.25F, 0.5F}};  // turned by 90 degrees
  scene.materials.push_back(material);
  scene.meshes.emplace_back();  // no triangles, so no place in the file
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.uvs[1].assign(3, {0, 0});
  mesh.triangles = {{0, 1, 2}};
  scene.meshes.push_back(mesh);
  scene.instances.resize(2);
  scene.instances[1].mesh = 1;
  Light spot;
  spot.type = LightType::Spot;
  spot.direction = glm::vec3(0, -1, 0);
  spot.position = {1, 2, 3};
  Light headlight;
  headlight.type = LightType::Headlight;
  scene.lights = {headlight, spot};
  scene.cameras.emplace_back();
  scene.cameras[0].lens = OrthographicLens{};
  scene.name = "caf\xE9";  // Latin-1, not UTF-8
  finish_scene(scene);

  const Parts parts = parts_of(encode_glb(scene));
  EXPECT_EQ(parts.json["meshes"].size(), 1U);
  EXPECT_EQ(parts.json["nodes"][0]["mesh"], 0);
  const auto& written = parts.json["materials"][0];
  EXPECT_EQ(written["alphaMode"], "MASK");
  EXPECT_EQ(written["doubleSided"], true);
  EXPECT_FLOAT_EQ(written["emissiveFactor"][1].get<float>(), 0.7F);
  EXPECT_FALSE(written["extensions"].contains("KHR_materials_emissive_strength"));
  const auto& info = written["pbrMetallicRoughness"]["baseColorTexture"];
  EXPECT_EQ(info["texCoord"], 1);
  const auto& transform = info["extensions"]["KHR_texture_transform"];
  EXPECT_NEAR(transform["rotation"].get<double>(), 1.5707963267948966, 1e-12);
  EXPECT_NEAR(transform["scale"][0].get<double>(), 2.0, 1e-12);
  EXPECT_NEAR(transform["scale"][1].get<double>(), 3.0, 1e-12);
  EXPECT_EQ(transform["offset"][0], 0.25);
  EXPECT_EQ(parts.json["samplers"][0]["wrapS"], 33071);
  EXPECT_EQ(parts.json["samplers"][0]["wrapT"], 33648);
  ASSERT_EQ(parts.json["extensions"]["KHR_lights_punctual"]["lights"].size(), 1U) << "headlights are left out";
  const auto& node = parts.json["nodes"][1];
  EXPECT_NEAR(node["matrix"][9].get<double>(), 1.0, 1e-12) << "the spot's -z points down";
  EXPECT_EQ(node["matrix"][13], 2.0);
  EXPECT_EQ(parts.json["cameras"][0]["type"], "orthographic");
}

TEST(GltfWriter, WritesAnEmptySceneAsAValidFile) {
  Scene scene;
  finish_scene(scene);
  const Parts parts = parts_of(encode_glb(scene));
  EXPECT_TRUE(parts.buffer.empty());
  EXPECT_FALSE(parts.json.contains("buffers"));
  EXPECT_EQ(parts.json["asset"]["version"], "2.0");
  EXPECT_FALSE(parts.json["scenes"][0].contains("nodes"));
}

}  // namespace
}  // namespace hpr
