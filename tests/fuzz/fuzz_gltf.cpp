#include <webp/encode.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "core/error.h"
#include "core/log.h"
#include "scene/gltf/random_models.h"
#include "scene/gltf/test_tools.h"
#include "scene/load_scene.h"
#include "tests/fuzz/fuzz.h"

// Scenes of strangers: .glb and .gltf with data URIs, their meshes and pictures compressed or not.
namespace hpr::fuzz {
namespace {

constexpr std::string_view kText = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"mesh":0,"children":[1],"rotation":[0,0,0,1]},{"camera":0,"scale":[1,2,3]},{"skin":0,"mesh":0,"weights":[0.5]}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.7,"znear":0.1,"zfar":100}}],
"skins":[{"joints":[1]}],
"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1],"baseColorTexture":{"index":0,"texCoord":0}},
"alphaMode":"MASK","alphaCutoff":0.4,"extensions":{"KHR_materials_ior":{"ior":1.4}}}],
"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],
"images":[{"uri":"data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg=="}],
"extensionsUsed":["KHR_materials_ior"],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":2,"JOINTS_0":3,"WEIGHTS_0":4},"indices":1,"material":0,"mode":4,
"targets":[{"POSITION":0}]}],"weights":[0]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0],
"sparse":{"count":1,"indices":{"bufferView":1,"componentType":5123},"values":{"bufferView":0}}},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"},{"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"},
{"bufferView":0,"componentType":5121,"count":3,"type":"VEC4"},{"bufferView":0,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
"buffers":[{"byteLength":44,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA="}]})";

void append_u32(Bytes& bytes, std::size_t value) {
  const auto number = static_cast<std::uint32_t>(value);
  const auto part = std::as_bytes(std::span(&number, 1));
  bytes.insert(bytes.end(), part.begin(), part.end());
}

/// The text as the first chunk of a .glb.
Bytes to_glb(std::string_view text) {
  std::string padded(text);
  padded.resize((padded.size() + 3) / 4 * 4, ' ');
  Bytes file = to_bytes("glTF");
  append_u32(file, 2);
  append_u32(file, 12 + 8 + padded.size());
  append_u32(file, padded.size());
  const Bytes type = to_bytes("JSON");
  file.insert(file.end(), type.begin(), type.end());
  const Bytes body = to_bytes(padded);
  file.insert(file.end(), body.begin(), body.end());
  return file;
}

bool is_binary(std::span<const std::byte> input) {
  return input.size() >= 4 && std::memcmp(input.data(), "glTF", 4) == 0;
}

/// A model of few vertices.
test::RandomModel small_model(std::uint32_t seed) {
  test::Random random(seed);
  test::RandomModel model;
  do {
    model.primitives = {test::random_primitive(random, seed % 2 == 0 ? 5123 : 5125)};
  } while (model.primitives[0].indices.size() > 120);
  test::add_random_attributes(random, model.primitives[0]);
  return model;
}

/// The model drawn with a WebP picture of 9 x 7 pixels.
Bytes with_webp(test::ModelWriter writer) {
  constexpr int kWidth = 9;
  constexpr int kHeight = 7;
  std::array<std::uint8_t, std::size_t{kWidth} * kHeight * 4> levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) levels.at(i) = static_cast<std::uint8_t>(i * i);
  std::uint8_t* out = nullptr;
  const std::size_t bytes = WebPEncodeLosslessRGBA(levels.data(), kWidth, kHeight, kWidth * 4, &out);
  const std::size_t view = writer.add_view(std::as_bytes(std::span(out, bytes)));
  WebPFree(out);
  writer.json["images"].push_back({{"bufferView", view}, {"mimeType", "image/webp"}});
  writer.json["textures"].push_back({{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}});
  writer.json["materials"][0]["emissiveTexture"]["index"] = 0;
  return writer.glb();
}

/// The place of the head of the second chunk, or the end.
std::size_t second_chunk(std::span<const std::byte> file) {
  const Bytes type = to_bytes(std::string_view("BIN\0", 4));
  const auto found = std::search(file.begin(), file.end(), type.begin(), type.end());
  const auto at = static_cast<std::size_t>(found - file.begin());
  return found == file.end() || at < 24 ? file.size() : at - 4;
}

}  // namespace

std::vector<Bytes> seeds() {
  std::vector<Bytes> all{to_bytes(kText), to_glb(kText)};
  for (const std::string_view mode : {"\"mode\":0", "\"mode\":2"}) {  // points, a line
    std::string text(kText);
    all.push_back(to_bytes(text.replace(text.find("\"mode\":4"), mode.size(), mode)));
  }
  for (std::uint32_t seed = 0; seed < 4; ++seed) {
    const test::RandomModel model = small_model(seed);
    all.push_back(write_draco(model, {.lossless = seed % 2 == 0, .speed = static_cast<int>(seed) * 3}).glb());
    all.push_back(write_draco(model, {.sequential = true, .lossless = seed % 2 == 0, .speed = 9}).glb());
    all.push_back(with_webp(write_meshopt(model, {.index_mode = seed % 2 == 0 ? "TRIANGLES" : "INDICES",
                                                  .direction_bytes = seed % 3,
                                                  .mantissa_bits = seed % 2 == 0 ? 15 : 0})));
  }
  return all;
}

bool run(std::span<const std::byte> input) {
  static const test::TemporaryFolder folder;
  log::configure(log::Level::Error, "");
  SceneLimits limits;
  limits.memory_bytes = std::uint64_t{256} << 20U;
  limits.image = {.side = 1024, .pixels = 1U << 20U};
  try {
    const std::string text(reinterpret_cast<const char*>(input.data()), input.size());
    (void)load_scene(folder.write(is_binary(input) ? "scene.glb" : "scene.gltf", text).string(), limits);
    return true;
  } catch (const Error& error) {
    if (error.code() == ExitCode::Internal) throw;  // a fault of the program's
    return false;
  }
}

/// Of a .glb the lengths: of the file, its text and what follows the text.
Bytes repaired(Bytes input) {
  constexpr std::size_t kHeads = 20;
  constexpr std::size_t kHead = 8;
  if (input.size() < kHeads || !is_binary(input)) return input;
  const auto put = [&](std::size_t at, std::size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    std::memcpy(input.data() + at, &number, sizeof(number));
  };
  const std::size_t second = second_chunk(input);
  put(8, input.size());
  put(12, second - kHeads);
  if (second < input.size()) put(second, input.size() - second - kHead);
  return input;
}

}  // namespace hpr::fuzz
