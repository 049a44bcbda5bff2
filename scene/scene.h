#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/bytes.h"
#include "image/color.h"
#include "image/image.h"
#include "scene/bounds.h"
#include "scene/partial_mesh.h"
#include "scene/texels.h"

/// What is drawn, as plain data, independent of how. Right-handed, y up, metres; colours are linear with sRGB
/// primaries.
namespace hpr {

enum class Wrap : std::uint8_t { Repeat, MirroredRepeat, ClampToEdge };

class PartPages;

struct Texture {
  std::string name;
  Texels image;  ///< whether it means sRGB or linear values depends on who refers to it
  Wrap wrap_s = Wrap::Repeat;
  Wrap wrap_t = Wrap::Repeat;
  bool nearest = false;  ///< magnification filter; bilinear otherwise
};

/// A texture as a material uses it.
struct TextureRef {
  std::int32_t texture = -1;  ///< index into Scene::textures; -1: none
  std::uint32_t uv_set = 0;   ///< which of the mesh's texture coordinates
  /// KHR_texture_transform: uv' = (a u + c v + e, b u + d v + f) stored as {a, b, c, d, e, f}.
  std::array<float, 6> transform{1, 0, 0, 1, 0, 0};

  [[nodiscard]] bool present() const { return texture >= 0; }
  bool operator==(const TextureRef&) const = default;
};

enum class AlphaMode : std::uint8_t { Opaque, Mask, Blend };

/// What few materials have: KHR_materials_specular, _clearcoat, _sheen, _anisotropy, _iridescence, _dispersion and
/// _diffuse_transmission. The defaults change nothing.
struct MaterialExtensions {
  float specular = 1.0F;              ///< factor of the dielectric's reflection at every angle
  TextureRef specular_texture;        ///< linear, in A
  glm::vec3 specular_color{1.0F};     ///< factor of its reflection looked at straight; may exceed 1
  TextureRef specular_color_texture;  ///< sRGB
  float clearcoat = 0.0F;
  TextureRef clearcoat_texture;  ///< linear, in R
  float clearcoat_roughness = 0.0F;
  TextureRef clearcoat_roughness_texture;  ///< linear, in G
  TextureRef clearcoat_normal_texture;     ///< linear, as Material::normal_texture; without one the coat is smooth
  float clearcoat_normal_scale = 1.0F;
  glm::vec3 sheen_color{0.0F};
  TextureRef sheen_color_texture;  ///< sRGB
  float sheen_roughness = 0.0F;
  TextureRef sheen_roughness_texture;        ///< linear, in A
  float anisotropy = 0.0F;                   ///< strength: how much rougher the surface is along its direction
  float anisotropy_rotation_radians = 0.0F;  ///< of that direction, counterclockwise from the tangent
  TextureRef anisotropy_texture;             ///< linear: direction in R and G, strength in B
  float iridescence = 0.0F;
  TextureRef iridescence_texture;  ///< linear, in R
  float iridescence_ior = 1.3F;
  float iridescence_min_nm = 100.0F;         ///< thickness of the film where its texture is 0
  float iridescence_max_nm = 400.0F;         ///< and where it is 1, or there is none
  TextureRef iridescence_thickness_texture;  ///< linear, in G
  float dispersion = 0.0F;                   ///< 20 over the Abbe number
  float diffuse_transmission = 0.0F;         ///< share of the diffuse light that is let through
  TextureRef diffuse_transmission_texture;   ///< linear, in A
  glm::vec3 diffuse_transmission_color{1.0F};
  TextureRef diffuse_transmission_color_texture;  ///< sRGB

  bool operator==(const MaterialExtensions&) const = default;

  /// All textures, present or not.
  [[nodiscard]] std::array<const TextureRef*, 12> textures() const {
    return {&specular_texture,
            &specular_color_texture,
            &clearcoat_texture,
            &clearcoat_roughness_texture,
            &clearcoat_normal_texture,
            &sheen_color_texture,
            &sheen_roughness_texture,
            &anisotropy_texture,
            &iridescence_texture,
            &iridescence_thickness_texture,
            &diffuse_transmission_texture,
            &diffuse_transmission_color_texture};
  }
};

/// glTF 2.0 metallic-roughness (specification, appendix B), with KHR_materials_transmission, _volume, _ior, _unlit,
/// _emissive_strength.
struct Material {
  std::string name;
  glm::vec4 base_color{1.0F};
  TextureRef base_color_texture;  ///< sRGB
  float metallic = 1.0F;
  float roughness = 1.0F;
  TextureRef metallic_roughness_texture;  ///< linear: roughness in G, metallic in B
  glm::vec3 emissive{0.0F};               ///< radiance, strength multiplied in
  TextureRef emissive_texture;            ///< sRGB
  TextureRef normal_texture;              ///< linear: a normal in the tangent frame, [0, 1] standing for [-1, 1]
  float normal_scale = 1.0F;              ///< of its x and y
  TextureRef occlusion_texture;           ///< linear: in R, the fraction of ambient light that arrives
  float occlusion_strength = 1.0F;        ///< 0: the texture has no effect
  float transmission = 0.0F;
  TextureRef transmission_texture;  ///< linear, in R
  float ior = 1.5F;
  /// Above 0, the surface bounds a volume; else it is a thin sheet. Rays find out themselves how thick the volume is.
  float thickness = 0.0F;
  /// What is left of white light after `attenuation_distance` metres of the volume.
  glm::vec3 attenuation_color{1.0F};
  float attenuation_distance = std::numeric_limits<float>::infinity();
  AlphaMode alpha_mode = AlphaMode::Opaque;
  float alpha_cutoff = 0.5F;
  /// Where false, who looks from behind looks through (see shows_both_sides). glTF's own default is false.
  bool double_sided = true;
  bool unlit = false;                                    ///< shows its base colour, whatever the light
  std::shared_ptr<const MaterialExtensions> extensions;  ///< null: none; copies share it
};

/// Whether a material is seen from behind its faces too. The wall of a volume always is: KHR_materials_volume gives
/// `doubleSided` no effect there, and who looks out of glass looks at its faces from behind.
[[nodiscard]] inline bool shows_both_sides(const Material& material) {
  return material.double_sided || material.thickness > 0.0F;
}

/// What the triangles of a mesh stand for.
enum class MeshKind : std::uint8_t {
  Triangles,
  Points,  ///< triangle {i, i, i} is point i; no normals; not seen before shape_points_and_lines
  Lines,   ///< triangle {i, j, j} is the segment from i to j; no normals; not seen before that either
};

/// Triangles of one material in their own coordinates. All vertex data are finite, all indices in range.
struct Mesh {
  std::string name;
  MeshKind kind = MeshKind::Triangles;
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;             ///< unit length, one per position
  std::array<std::vector<glm::vec2>, 2> uvs;  ///< per set: one per position, or none at all
  std::vector<glm::vec4> colors;              ///< linear RGBA in [0, 1], one per position, or none at all
  /// One per position, or none at all: the direction of growing u, of unit length (zero where unknown), and the sign w
  /// with which w normal x tangent is the direction of falling v.
  std::vector<glm::vec4> tangents;
  std::vector<glm::uvec3> triangles;  ///< may be degenerate
  std::uint32_t material = 0;         ///< index into Scene::materials, always valid
  /// Where its triangles are shared out among ranks: the arrays have those that are here. Null: all are.
  std::shared_ptr<const PartialMesh> partial;

  /// Of the whole mesh.
  [[nodiscard]] std::uint32_t triangle_count() const {
    return partial ? partial->triangles : static_cast<std::uint32_t>(triangles.size());
  }
  /// Whether triangle `t` of the whole mesh is here, and the vertices of one that is.
  [[nodiscard]] bool holds(std::uint32_t t) const { return !partial || partial->holds(t); }
  [[nodiscard]] const glm::uvec3& triangle(std::uint32_t t) const {
    return triangles[partial ? partial->index_of(t) : t];
  }
};

/// A mesh placed in the world. Triangle t of it has the surface id first_surface + t.
struct Instance {
  std::uint32_t mesh = 0;
  glm::dmat4 to_world{1.0};  ///< affine: last row 0 0 0 1, all finite; may be singular or mirror
  std::uint32_t first_surface = 0;
};

enum class LightType : std::uint8_t {
  Point,
  Directional,
  Spot,
  Headlight,  ///< constant irradiance from beside the eye, wherever it is, casting no shadow: for scenes without lights
};

/// KHR_lights_punctual, to which `extras` may give an extent. Candela and lux are taken as W/sr and W/m^2.
struct Light {
  std::string name;
  LightType type = LightType::Point;
  glm::dvec3 position{0.0};
  glm::vec3 direction{0.0F, 0.0F, -1.0F};  ///< in which the light shines, unit length
  glm::vec3 intensity{1.0F};  ///< colour times intensity: W/sr (point, spot) or W/m^2 (directional, headlight)
  double range = 0.0;         ///< metres; 0: unbounded
  float inner_cone_radians = 0.0F;
  float outer_cone_radians = 0.7853982F;
  /// Metres. Point and spot lights with a radius are spheres of uniform radiance, intensity / (pi radius^2); extras
  /// `radius`.
  double radius = 0.0;
  /// The angular radius of the disc in the sky that a directional light comes from, up to pi/2; extras `angularRadius`.
  float angular_radius_radians = 0.0F;
};

/// Light from all around, infinitely far away. The image's rows go from straight up (+y) to straight down, its columns
/// once around: the central one lies along -z, the columns right of it towards +x.
struct Environment {
  Image<Rgb> image;               ///< radiance, finite and not negative; one pixel: the same everywhere
  double rotation_radians = 0.0;  ///< turns it about +y, counterclockwise as seen from above
  double scale = 1.0;             ///< the image is multiplied by it; not negative
  /// Values of the file that were no finite numbers and were replaced, and the first pixel that had one, row by row.
  /// Known where it was loaded.
  std::uint64_t not_finite = 0;
  std::size_t first_not_finite = 0;

  [[nodiscard]] bool is_constant() const { return image.size().area() == 1; }
};

struct PerspectiveLens {
  double vertical_fov_radians = 0.8;
  double near_distance = 0.0;  ///< metres; 0: chosen by the renderer. The far plane is at infinity.
  double at_distance = 0.0;    ///< metres to what is looked at, which a near plane that is chosen spares; 0: unknown
};
struct OrthographicLens {
  double half_width = 1.0;  ///< metres
  double half_height = 1.0;
  double near_distance = 0.0;
  double far_distance = 100.0;
};

struct Camera {
  std::string name;
  glm::dvec3 eye{0.0};
  glm::dmat3 axes{1.0};  ///< columns: right, up, back; orthonormal
  std::variant<PerspectiveLens, OrthographicLens> lens;
};

/// Surface ids [first, last).
struct SurfaceRange {
  std::uint32_t first = 0;
  std::uint32_t last = 0;

  [[nodiscard]] std::uint32_t count() const { return last - first; }
  bool operator==(const SurfaceRange&) const = default;
};

struct Scene {
  std::string name;
  std::vector<Mesh> meshes;
  std::vector<Material> materials;  ///< never empty once finished
  std::vector<Texture> textures;
  std::shared_ptr<TexelStore> texel_store;  ///< of those whose texels come when they are looked at; null: none do
  std::vector<Instance> instances;          ///< in ascending order of first_surface
  /// The nodes that placed them: one per instance, or none at all. Nothing a picture shows: no part of content_hash.
  std::vector<std::string> node_names;
  /// What environment there is and why, for people: no part of content_hash either.
  std::string environment_note;
  /// What points and lines were made into, for people; empty: there were none.
  std::string shapes_note;
  std::vector<Light> lights;  ///< see gives_light for when the renderer adds a headlight
  std::vector<Camera> cameras;
  Rgb background;  ///< radiance where no surface is and no environment; lights nothing
  std::optional<Environment> environment;
  /// The names of all scenes and variants of materials that the file holds, of which one was loaded. Known where it was
  /// loaded.
  std::vector<std::string> scenes;
  std::vector<std::string> variants;
  std::vector<std::string> warnings;  ///< what was odd but could be drawn
  std::uint64_t not_finite = 0;  ///< values of the file that were no finite numbers and were replaced, as `warnings`
                                 ///< say; known where it was loaded
  std::uint32_t triangles = 0;   ///< of all instances: the number of surface ids
  Bounds bounds;                 ///< of all instances; low == high == 0 when there is nothing
  /// Where single precision is to be finest: the bounds' center, or where small things stand together far from it.
  glm::dvec3 detail_center{0.0};
  /// Of a scene whose meshes are shared out: the surfaces that each part has, and as what is here does not tell, the
  /// instances that are refined (refined_instances) and a camera that sees all of it (framing_camera).
  std::vector<std::vector<SurfaceRange>> parts;
  /// Where parts come from the disk page by page: the surfaces of the pages, as many of each part, in the parts' order;
  /// and those of the part that is here. No part of content_hash.
  std::vector<std::vector<SurfaceRange>> pages;
  std::shared_ptr<PartPages> part_pages;
  std::vector<std::uint8_t> refined;
  std::optional<Camera> framing;

  [[nodiscard]] const Mesh& mesh_of(const Instance& instance) const { return meshes[instance.mesh]; }
};

/// Whether an instance turns the winding of its triangles round: its matrix has a negative determinant. A front face is
/// wound counterclockwise in the mesh's own coordinates, and so clockwise in the world where this is true.
[[nodiscard]] bool is_mirrored(const Instance& instance);

/// Part of an instance: triangles [range.first, range.last) of its mesh.
struct InstanceRange {
  std::uint32_t instance = 0;
  SurfaceRange range;
};

/// Where a surface id lies.
struct SurfaceLocation {
  std::uint32_t instance = 0;
  std::uint32_t triangle = 0;  ///< of the instance's mesh
};

/// Completes a scene whose meshes, materials and instances are set: adds a default material if there is none, numbers
/// the surfaces, computes `triangles`, `bounds` and `detail_center`. Throws Error (Limit) past 2^32 - 2 triangles.
void finish_scene(Scene& scene);

/// The triangles of a scene's meshes, each once however many instances it has.
[[nodiscard]] std::uint64_t mesh_triangles(const Scene& scene);
/// What a scene's arrays take, in bytes: those that are here, and of a mesh.
[[nodiscard]] std::uint64_t memory_of(const Scene& scene);
[[nodiscard]] std::uint64_t memory_of(const Mesh& mesh);

/// The instance and triangle of a surface id below scene.triangles.
[[nodiscard]] SurfaceLocation locate_surface(const Scene& scene, std::uint32_t surface);

/// The world position of a mesh's vertex, in double.
[[nodiscard]] glm::dvec3 world_position(const Instance& instance, const glm::vec3& position);

/// Area-weighted vertex normals (for meshes without), unit length; {0, 0, 1} where no triangle has an area.
[[nodiscard]] std::vector<glm::vec3> smooth_normals(const std::vector<glm::vec3>& positions,
                                                    const std::vector<glm::uvec3>& triangles);

/// Of the triangles of a mesh, in its own unit.
[[nodiscard]] double longest_edge(const Mesh& mesh);

/// The box of the positions a mesh uses, or some triangles of it, in its own coordinates; empty when there are none.
[[nodiscard]] Bounds mesh_bounds(const Mesh& mesh);
[[nodiscard]] Bounds bounds_of(const Mesh& mesh, std::span<const glm::uvec3> triangles);

/// Merges ranges into sorted, disjoint ones that do not touch, inside [0, end), of the same surfaces. `ranges` may come
/// in any order, overlap and reach past `end`.
[[nodiscard]] std::vector<SurfaceRange> merged_ranges(std::vector<SurfaceRange> ranges, std::uint32_t end);

/// Merged ranges of surface ids cut at the borders of instances, in ascending order.
[[nodiscard]] std::vector<InstanceRange> split_by_instance(const Scene& scene, const std::vector<SurfaceRange>& ranges);

/// What two lists of merged ranges have in common, merged too.
[[nodiscard]] std::vector<SurfaceRange> common_ranges(const std::vector<SurfaceRange>& a,
                                                      const std::vector<SurfaceRange>& b);

/// The surfaces whose materials cover all (or, `alpha_tested`, only part) of what is behind them, as ranges of surface
/// ids.
[[nodiscard]] std::vector<SurfaceRange> covering_surfaces(const Scene& scene, bool alpha_tested);

/// XXH64 over everything that can change a picture; the same on every rank and machine, and whether meshes are whole or
/// shared out. That of a mesh is a part of it.
[[nodiscard]] std::uint64_t content_hash(const Scene& scene);
[[nodiscard]] std::uint64_t content_hash(const Mesh& mesh);

/// A scene as bytes and back, to send to other ranks. `from_bytes` trusts its input.
[[nodiscard]] std::vector<std::byte> to_bytes(const Scene& scene);
[[nodiscard]] Scene scene_from_bytes(std::span<const std::byte> bytes);
void append_bytes(const Mesh& mesh, ByteBuffer& buffer);
[[nodiscard]] Mesh mesh_from_bytes(std::span<const std::byte> bytes);

}  // namespace hpr
