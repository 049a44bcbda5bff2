// KHR_mesh_quantization: every type that it allows is read as the number it stands for.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "scene/gltf/random_models.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::Elements;
using test::load;
using test::random_model;
using test::refusal;

struct ComponentType {
  int id = 5126;
  bool normalized = false;
};

/// Random elements of a type, `width` components each, and the floats that they stand for.
struct Quantized {
  Elements packed;
  Elements plain;
};

template <typename Component>
Quantized random_values(test::Random& random, std::size_t count, std::size_t width, ComponentType type) {
  std::vector<Component> values(count * width);
  std::vector<float> floats;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = static_cast<Component>(random());
    if (i < 2) values[i] = i == 0 ? std::numeric_limits<Component>::min() : std::numeric_limits<Component>::max();
    const auto whole = static_cast<float>(values[i]);
    const auto most = static_cast<float>(std::numeric_limits<Component>::max());
    floats.push_back(type.normalized ? std::max(whole / most, -1.0F) : whole);
  }
  return {test::elements_of(values, width, type.id, type.normalized), test::floats_of(floats, width)};
}

Quantized random_values(test::Random& random, std::size_t count, std::size_t width, ComponentType type) {
  switch (type.id) {
    case 5120:
      return random_values<std::int8_t>(random, count, width, type);
    case 5121:
      return random_values<std::uint8_t>(random, count, width, type);
    case 5122:
      return random_values<std::int16_t>(random, count, width, type);
    default:
      return random_values<std::uint16_t>(random, count, width, type);
  }
}

/// Elements at multiples of four bytes, as attributes have to be.
std::size_t add_aligned(test::ModelWriter& writer, const Elements& elements) {
  const std::size_t size = elements.element_bytes();
  const std::size_t stride = (size + 3) / 4 * 4;
  std::vector<std::byte> content(elements.count() * stride, std::byte{0xEE});
  for (std::size_t i = 0; i < elements.count(); ++i)
    std::copy_n(elements.bytes.begin() + static_cast<std::ptrdiff_t>(i * size), size,
                content.begin() + static_cast<std::ptrdiff_t>(i * stride));
  const std::size_t accessor = writer.add_accessor(elements, elements.count());
  const std::size_t view = writer.add_view(content);
  writer.json["bufferViews"][view]["byteStride"] = stride;
  writer.json["accessors"][accessor]["bufferView"] = view;
  return accessor;
}

/// Where values of a kind stand: an attribute, or that of a morph target.
struct Slot {
  std::string name;
  bool target = false;
};

void put(test::ModelWriter& writer, const Slot& slot, std::size_t accessor) {
  Json& primitive = writer.primitive(0);
  if (!slot.target) {
    primitive["attributes"][slot.name] = accessor;
    if (slot.name == "POSITION") {
      writer.json["accessors"][accessor]["min"] = Json::array({-1e5, -1e5, -1e5});
      writer.json["accessors"][accessor]["max"] = Json::array({1e5, 1e5, 1e5});
    }
    return;
  }
  primitive["targets"] = Json::array({Json{{slot.name, accessor}}});
  writer.json["meshes"][0]["weights"] = Json::array({0.25});
}

template <typename Vector>
void expect_equal(const std::vector<Vector>& a, const std::vector<Vector>& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int axis = 0; axis < Vector::length(); ++axis) ASSERT_EQ(a[i][axis], b[i][axis]) << what << " " << i;
}

/// 20 models of random vertices whose values at `slot` are of `type`, and those of the floats they stand for.
void expect_read_as_floats(const Slot& slot, std::size_t width, ComponentType type) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(::testing::Message() << slot.name << " target " << slot.target << " component type " << type.id
                                      << " normalized " << type.normalized << " seed " << seed);
    test::RandomModel model = random_model(seed * 3);
    model.repeats_first = false;
    auto& attributes = model.primitives[0].attributes;
    const std::size_t count = attributes["POSITION"].count();
    test::Random random(seed);
    attributes["NORMAL"] = test::floats_of(test::random_directions(random, count, false), 3);
    attributes["TANGENT"] = test::floats_of(test::random_directions(random, count, true), 4);
    attributes["TEXCOORD_0"] = test::floats_of(std::vector<float>(count * 2, 0.25F), 2);
    const Quantized values = random_values(random, count, width, type);

    test::ModelWriter plain = write_plain(model);
    test::ModelWriter packed = plain;
    put(plain, slot, add_aligned(plain, values.plain));
    put(packed, slot, add_aligned(packed, values.packed));
    packed.require("KHR_mesh_quantization");
    const Scene a = load(plain.gltf());
    const Scene b = load(packed.gltf());
    EXPECT_EQ(a.warnings, b.warnings);
    ASSERT_EQ(a.meshes.size(), b.meshes.size());
    expect_equal(a.meshes[0].positions, b.meshes[0].positions, "positions");
    expect_equal(a.meshes[0].normals, b.meshes[0].normals, "normals");
    expect_equal(a.meshes[0].tangents, b.meshes[0].tangents, "tangents");
    expect_equal(a.meshes[0].uvs[0], b.meshes[0].uvs[0], "uvs");
    expect_equal(a.meshes[0].triangles, b.meshes[0].triangles, "triangles");
    if (::testing::Test::HasFatalFailure()) return;
  }
}

constexpr std::array<ComponentType, 8> kAll{{{5120, false},
                                             {5120, true},
                                             {5121, false},
                                             {5121, true},
                                             {5122, false},
                                             {5122, true},
                                             {5123, false},
                                             {5123, true}}};

TEST(GltfQuantization, PositionsOfEveryType) {
  for (const ComponentType type : kAll) expect_read_as_floats({"POSITION"}, 3, type);
}

TEST(GltfQuantization, NormalsAndTangentsOfEveryType) {
  for (const ComponentType type : {ComponentType{5120, true}, ComponentType{5122, true}}) {
    expect_read_as_floats({"NORMAL"}, 3, type);
    expect_read_as_floats({"TANGENT"}, 4, type);
  }
}

TEST(GltfQuantization, TextureCoordinatesOfEveryType) {
  for (const ComponentType type : kAll) expect_read_as_floats({"TEXCOORD_0"}, 2, type);
}

TEST(GltfQuantization, MorphTargetsOfEveryType) {
  for (const int id : {5120, 5122}) {
    expect_read_as_floats({"POSITION", true}, 3, {id, false});
    expect_read_as_floats({"POSITION", true}, 3, {id, true});
    expect_read_as_floats({"NORMAL", true}, 3, {id, true});
    expect_read_as_floats({"TANGENT", true}, 3, {id, true});
  }
  for (const ComponentType type : kAll) expect_read_as_floats({"TEXCOORD_0", true}, 2, type);
}

TEST(GltfQuantization, TypesThatItDoesNotAllowAreRefusedOrWarnedOf) {
  const auto with = [](const std::string& name, std::size_t width, ComponentType type, bool declared) {
    test::ModelWriter writer = write_plain(random_model(0));
    const auto count = writer.json["accessors"][0]["count"].get<std::size_t>();
    const Elements elements{type.id, width, type.normalized,
                            std::vector<std::byte>(count * width * (type.id == 5125 ? 4 : 2), std::byte{1})};
    put(writer, {name}, add_aligned(writer, elements));
    if (declared) writer.require("KHR_mesh_quantization");
    return writer.gltf();
  };
  EXPECT_EQ(refusal(with("POSITION", 3, {5125, false}, true)).code, ExitCode::BadInput);
  EXPECT_EQ(refusal(with("NORMAL", 3, {5125, false}, true)).code, ExitCode::BadInput);
  EXPECT_EQ(refusal(with("TEXCOORD_0", 2, {5125, false}, true)).code, ExitCode::BadInput);
  EXPECT_TRUE(test::warns_of(load(with("POSITION", 3, {5122, false}, false)), "KHR_mesh_quantization"));
  EXPECT_FALSE(test::warns_of(load(with("POSITION", 3, {5122, false}, true)), "KHR_mesh_quantization"));
  EXPECT_TRUE(test::warns_of(load(with("NORMAL", 3, {5122, false}, true)), "NORMAL"));
}

}  // namespace
}  // namespace hpr
