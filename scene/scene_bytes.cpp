#include <algorithm>
#include <cereal/archives/binary.hpp>
#include <cereal/types/array.hpp>
#include <cereal/types/optional.hpp>
#include <cereal/types/string.hpp>
#include <cereal/types/variant.hpp>
#include <cereal/types/vector.hpp>
#include <functional>
#include <istream>
#include <ostream>
#include <streambuf>

#include "core/bytes.h"
#include "scene/mesh_reader.h"
#include "scene/scene.h"

// Every struct of scene.h, field by field: what stands here is what reaches the other ranks and what the content hash
// sees; node names reach the ranks alone.
namespace glm {

template <typename Archive, length_t N, typename T, qualifier Q>
void serialize(Archive& archive, vec<N, T, Q>& v) {
  for (length_t i = 0; i < N; ++i) archive(v[i]);
}
template <typename Archive, length_t C, length_t R, typename T, qualifier Q>
void serialize(Archive& archive, mat<C, R, T, Q>& m) {
  for (length_t i = 0; i < C; ++i) archive(m[i]);
}

}  // namespace glm

namespace hpr {

/// Vectors of plain values go in one piece, not element by element.
template <typename Archive, typename Value>
void bulk(Archive& archive, std::vector<Value>& values) {
  static_assert(std::is_trivially_copyable_v<Value>);
  auto count = static_cast<cereal::size_type>(values.size());
  archive(count);
  values.resize(static_cast<std::size_t>(count));
  archive(cereal::binary_data(values.data(), values.size() * sizeof(Value)));
}

template <typename Archive>
void serialize(Archive& archive, Rgb& c) {
  archive(c.r, c.g, c.b);
}
template <typename Archive>
void serialize(Archive& archive, Size& s) {
  archive(s.width, s.height);
}
template <typename Archive, typename Pixel>
void serialize(Archive& archive, Image<Pixel>& image) {
  Size size = image.size();
  archive(size);
  if (size != image.size()) image = Image<Pixel>(size);
  archive(cereal::binary_data(image.pixels().data(), image.pixels().size_bytes()));
}
template <typename Archive>
void serialize(Archive& archive, Rgba8& c) {
  archive(c.r, c.g, c.b, c.a);
}
template <typename Archive>
void serialize(Archive& archive, TexelFacts& f) {
  archive(f.least, f.largest, f.content);
}
/// Without its texels.
template <typename Archive>
void serialize(Archive& archive, Texture& t) {
  archive(t.name, t.wrap_s, t.wrap_t, t.nearest);
}
template <typename Archive>
void serialize(Archive& archive, TextureRef& t) {
  archive(t.texture, t.uv_set, t.transform);
}
template <typename Archive>
void serialize(Archive& archive, MaterialExtensions& e) {
  archive(e.specular, e.specular_texture, e.specular_color, e.specular_color_texture, e.clearcoat, e.clearcoat_texture,
          e.clearcoat_roughness, e.clearcoat_roughness_texture, e.clearcoat_normal_texture, e.clearcoat_normal_scale,
          e.sheen_color, e.sheen_color_texture, e.sheen_roughness, e.sheen_roughness_texture, e.anisotropy,
          e.anisotropy_rotation_radians, e.anisotropy_texture, e.iridescence, e.iridescence_texture, e.iridescence_ior,
          e.iridescence_min_nm, e.iridescence_max_nm, e.iridescence_thickness_texture, e.dispersion,
          e.diffuse_transmission, e.diffuse_transmission_texture, e.diffuse_transmission_color,
          e.diffuse_transmission_color_texture);
}
template <typename Archive>
void serialize(Archive& archive, Material& m) {
  archive(m.name, m.base_color, m.base_color_texture, m.metallic, m.roughness, m.metallic_roughness_texture, m.emissive,
          m.emissive_texture, m.normal_texture, m.normal_scale, m.occlusion_texture, m.occlusion_strength,
          m.transmission, m.transmission_texture, m.ior, m.thickness, m.attenuation_color, m.attenuation_distance,
          m.alpha_mode, m.alpha_cutoff, m.double_sided, m.unlit);
}
template <typename Archive>
void serialize(Archive& archive, Mesh& m) {
  archive(m.name, m.material);
  bulk(archive, m.positions);
  bulk(archive, m.normals);
  bulk(archive, m.uvs[0]);
  bulk(archive, m.uvs[1]);
  bulk(archive, m.colors);
  bulk(archive, m.tangents);
  bulk(archive, m.triangles);
}
template <typename Archive>
void serialize(Archive& archive, Instance& i) {
  archive(i.mesh, i.to_world, i.first_surface);
}
template <typename Archive>
void serialize(Archive& archive, Light& l) {
  archive(l.name, l.type, l.position, l.direction, l.intensity, l.range, l.inner_cone_radians, l.outer_cone_radians,
          l.radius, l.angular_radius_radians);
}
template <typename Archive>
void serialize(Archive& archive, Environment& e) {
  archive(e.image, e.rotation_radians, e.scale);
}
template <typename Archive>
void serialize(Archive& archive, PerspectiveLens& l) {
  archive(l.vertical_fov_radians, l.near_distance);
}
template <typename Archive>
void serialize(Archive& archive, OrthographicLens& l) {
  archive(l.half_width, l.half_height, l.near_distance, l.far_distance);
}
template <typename Archive>
void serialize(Archive& archive, Camera& c) {
  archive(c.name, c.eye, c.axes, c.lens);
}
template <typename Archive>
void serialize(Archive& archive, Bounds& b) {
  archive(b.low, b.high);
}
template <typename Archive>
void serialize(Archive& archive, SurfaceRange& r) {
  archive(r.first, r.last);
}
template <typename Archive>
void serialize(Archive& archive, PartialMesh::Run& r) {
  archive(r.first, r.last, r.at);
}
/// Without its chunks.
template <typename Archive>
void serialize(Archive& archive, PartialMesh& s) {
  archive(s.runs, s.triangles, s.bounds, s.reach, s.longest_edge, s.bytes, s.content);
}
/// Without its meshes and texels.
template <typename Archive>
void serialize(Archive& archive, Scene& s) {
  archive(s.name, s.materials, s.textures, s.instances, s.lights, s.cameras, s.background, s.environment, s.warnings,
          s.triangles, s.bounds, s.detail_center);
}

namespace {

class VectorSink final : public std::streambuf {
 public:
  std::vector<std::byte> bytes;

 protected:
  std::streamsize xsputn(const char* text, std::streamsize count) override {
    const auto added = std::as_bytes(std::span(text, static_cast<std::size_t>(count)));
    bytes.insert(bytes.end(), added.begin(), added.end());
    return count;
  }
  int_type overflow(int_type c) override {
    bytes.push_back(static_cast<std::byte>(c));
    return c;
  }
};

class BufferSink final : public std::streambuf {
 public:
  explicit BufferSink(ByteBuffer& buffer) : buffer_(buffer) {}

 protected:
  std::streamsize xsputn(const char* text, std::streamsize count) override {
    buffer_.append(std::as_bytes(std::span(text, static_cast<std::size_t>(count))));
    return count;
  }
  int_type overflow(int_type c) override {
    buffer_.extend(1)[0] = static_cast<std::byte>(c);
    return c;
  }

 private:
  ByteBuffer& buffer_;
};

class HashSink final : public std::streambuf {
 public:
  ContentHash hash;

 protected:
  std::streamsize xsputn(const char* text, std::streamsize count) override {
    hash.add(std::as_bytes(std::span(text, static_cast<std::size_t>(count))));
    return count;
  }
};

class SpanSource final : public std::streambuf {
 public:
  explicit SpanSource(std::span<const std::byte> bytes) {
    char* const start = const_cast<char*>(reinterpret_cast<const char*>(bytes.data()));  // only ever read
    setg(start, start, start + bytes.size());
  }
};

/// The material of each of its extensions stands before them: scenes without any add nothing to their hash.
void save_extensions(const Scene& scene, cereal::BinaryOutputArchive& archive) {
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    if (!scene.materials[i].extensions) continue;
    MaterialExtensions values = *scene.materials[i].extensions;
    archive(static_cast<std::uint64_t>(i), values);
  }
}

void load_extensions(Scene& scene, cereal::BinaryInputArchive& archive) {
  std::uint64_t count = 0;
  archive(count);
  for (; count > 0; --count) {
    std::uint64_t material = 0;
    MaterialExtensions values;
    archive(material, values);
    scene.materials[material].extensions = std::make_shared<const MaterialExtensions>(values);
  }
}

/// Where the texels of a texture stand in a scene's bytes.
enum class TexelLocation : std::uint8_t { Here, Earlier, Elsewhere };

/// Texels that several textures have are written once; of those that are elsewhere only what is known.
void save_texels(const Scene& scene, cereal::BinaryOutputArchive& archive) {
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    const Texels& texels = scene.textures[i].image;
    Size size = texels.size();
    TexelFacts facts = texels.facts();
    archive(size, facts);
    const auto end = scene.textures.begin() + static_cast<std::ptrdiff_t>(i);
    const auto first =
        std::find_if(scene.textures.begin(), end, [&](const Texture& other) { return other.image.is_same(texels); });
    if (!texels.is_reachable()) {
      archive(TexelLocation::Elsewhere);
    } else if (first != end) {
      archive(TexelLocation::Earlier, static_cast<std::uint64_t>(first - scene.textures.begin()));
    } else {
      archive(TexelLocation::Here, cereal::binary_data(texels.pixels().data(), texels.size_bytes()));
    }
  }
}

void load_texels(Scene& scene, cereal::BinaryInputArchive& archive) {
  for (Texture& texture : scene.textures) {
    Size size;
    TexelFacts facts;
    TexelLocation location = TexelLocation::Here;
    archive(size, facts, location);
    if (location == TexelLocation::Elsewhere) {
      texture.image = Texels(size, facts);
    } else if (location == TexelLocation::Earlier) {
      std::uint64_t first = 0;
      archive(first);
      texture.image = scene.textures.at(first).image;
    } else {
      Image<Rgba8> image(size);
      archive(cereal::binary_data(image.pixels().data(), image.pixels().size_bytes()));
      texture.image = std::move(image);
    }
  }
}

void save_mesh(const Mesh& mesh, cereal::BinaryOutputArchive& archive) {
  archive(const_cast<Mesh&>(mesh), mesh.partial != nullptr);  // an output archive only reads
  if (mesh.partial) archive(const_cast<PartialMesh&>(*mesh.partial));
}

void load_mesh(Mesh& mesh, cereal::BinaryInputArchive& archive) {
  bool is_shared_out = false;
  archive(mesh, is_shared_out);
  if (!is_shared_out) return;
  PartialMesh partial;
  archive(partial);
  mesh.partial = std::make_shared<const PartialMesh>(std::move(partial));
}

std::vector<std::byte> bytes_of(const std::function<void(cereal::BinaryOutputArchive&)>& save) {
  VectorSink sink;
  std::ostream stream(&sink);
  cereal::BinaryOutputArchive archive(stream);
  save(archive);
  return std::move(sink.bytes);
}

std::uint64_t hash_of(const std::function<void(cereal::BinaryOutputArchive&)>& save) {
  HashSink sink;
  std::ostream stream(&sink);
  cereal::BinaryOutputArchive archive(stream);
  save(archive);
  return sink.hash.value();
}

}  // namespace

// One serialize() both reads and writes; an output archive only reads.

void append_bytes(const Mesh& mesh, ByteBuffer& buffer) {
  constexpr std::size_t kBeside = 4096;  // the name and sizes
  const std::size_t runs = mesh.partial ? mesh.partial->runs.size() * sizeof(PartialMesh::Run) : 0;
  buffer.reserve(buffer.size() + memory_of(mesh) + runs + kBeside);
  BufferSink sink(buffer);
  std::ostream stream(&sink);
  cereal::BinaryOutputArchive archive(stream);
  save_mesh(mesh, archive);
}

Mesh mesh_from_bytes(std::span<const std::byte> bytes) {
  SpanSource source(bytes);
  std::istream stream(&source);
  cereal::BinaryInputArchive archive(stream);
  Mesh mesh;
  load_mesh(mesh, archive);
  return mesh;
}

std::vector<std::byte> to_bytes(const Scene& scene) {
  return bytes_of([&](cereal::BinaryOutputArchive& archive) {
    archive(scene.node_names, scene.environment_note, scene.shapes_note, scene.parts, scene.pages,
            const_cast<Scene&>(scene));
    archive(static_cast<std::uint64_t>(scene.meshes.size()));
    for (const Mesh& mesh : scene.meshes) save_mesh(mesh, archive);
    const auto extended = [](const Material& material) { return material.extensions != nullptr; };
    archive(static_cast<std::uint64_t>(std::ranges::count_if(scene.materials, extended)));
    save_extensions(scene, archive);
    save_texels(scene, archive);
  });
}

Scene scene_from_bytes(std::span<const std::byte> bytes) {
  SpanSource source(bytes);
  std::istream stream(&source);
  cereal::BinaryInputArchive archive(stream);
  Scene scene;
  std::uint64_t meshes = 0;
  archive(scene.node_names, scene.environment_note, scene.shapes_note, scene.parts, scene.pages, scene, meshes);
  scene.meshes.resize(meshes);
  for (Mesh& mesh : scene.meshes) load_mesh(mesh, archive);
  load_extensions(scene, archive);
  load_texels(scene, archive);
  return scene;
}

std::uint64_t content_hash(const Mesh& mesh) {
  if (mesh.partial) return mesh.partial->content;
  return hash_of([&](cereal::BinaryOutputArchive& archive) { archive(const_cast<Mesh&>(mesh)); });
}

std::uint64_t content_hash(MeshReader& mesh) {
  return hash_of([&](cereal::BinaryOutputArchive& archive) {
    constexpr std::uint32_t kPiece = 1U << 16U;
    archive(mesh.name, mesh.material);
    std::vector<float> values;
    for (const VertexArray array : kVertexArrays) {
      const std::uint32_t count = mesh.has(array) ? mesh.vertices() : 0;
      archive(cereal::size_type{count});
      for (std::uint32_t first = 0; first < count; first += std::min(kPiece, count - first)) {
        mesh.read(array, first, first + std::min(kPiece, count - first), values);
        archive(cereal::binary_data(values.data(), values.size() * sizeof(float)));
      }
    }
    const std::uint32_t count = mesh.triangles();
    archive(cereal::size_type{count});
    std::vector<glm::uvec3> triangles;
    for (std::uint32_t first = 0; first < count; first += std::min(kPiece, count - first)) {
      mesh.read_triangles(first, first + std::min(kPiece, count - first), triangles);
      archive(cereal::binary_data(triangles.data(), triangles.size() * sizeof(glm::uvec3)));
    }
  });
}

std::uint64_t content_hash(const Scene& scene) {
  return hash_of([&](cereal::BinaryOutputArchive& archive) {
    for (const Mesh& mesh : scene.meshes) archive(content_hash(mesh));
    archive(const_cast<Scene&>(scene));
    save_extensions(scene, archive);
    for (const Texture& texture : scene.textures) {
      Size size = texture.image.size();
      archive(size, texture.image.facts().content);
    }
  });
}

}  // namespace hpr
