#include "raster/rasterizer.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include "core/bytes.h"
#include "core/error.h"
#include "core/timing.h"
#include "raster/chunk_triangles.h"
#include "raster/geometry.h"
#include "raster/gl.h"
#include "raster/key_target.h"

namespace hpr {
namespace {

constexpr std::string_view kVertexShader = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 1) in uint first_surface;   // per command
layout(location = 2) in mat4 clip_from_mesh;  // per command
layout(location = 6) in uint triangle;        // whose last corner, the provoking one, this is
invariant gl_Position;
flat out uint surface;
void main() {
  gl_Position = clip_from_mesh * vec4(position, 1.0);
  surface = first_surface + triangle;
}
)";

// The complement is what the low half of a key holds, so that 0 is left for "nothing".
constexpr std::string_view kFragmentShader = R"(#version 450 core
flat in uint surface;
layout(location = 0) out uint word;
void main() { word = ~surface; }
)";

// The same with depths rounded as quantized_depth does: LOST_BITS is set before it.
constexpr std::string_view kQuantizingFragmentShader = R"(
flat in uint surface;
layout(location = 0) out uint word;
void main() {
  word = ~surface;
  const uint half_step = (1u << LOST_BITS) >> 1;
  gl_FragDepth = uintBitsToFloat((floatBitsToUint(gl_FragCoord.z) + half_step) >> LOST_BITS << LOST_BITS);
}
)";

/// Which shader draws depths of a format.
GlObject make_program_for(GlContext& context, DepthFormat format) {
  if (format == DepthFormat::Float32) return make_program(context, kVertexShader, kFragmentShader);
  return make_program(
      context, kVertexShader,
      fmt::format("#version 450 core\n#define LOST_BITS {}{}", lost_bits(format), kQuantizingFragmentShader));
}

constexpr GLuint kVertices = 0;  // vertex buffer bindings
constexpr GLuint kRecords = 1;

template <typename T>
void upload(const GlFunctions& gl, const GlObject& buffer, const std::vector<T>& data, GLenum usage) {
  gl.NamedBufferData(buffer.name(), static_cast<GLsizeiptr>(data.size() * sizeof(T)), data.data(), usage);
}

/// A random number in [-1, 1), equal on every machine: a 32-bit linear congruential generator (Numerical Recipes) and
/// exact steps.
float next(std::uint32_t& state) {
  state = state * 1664525U + 1013904223U;
  return static_cast<float>(state >> 8U) / 8388608.0F - 1.0F;
}

/// 400 triangles from sub-pixel to larger than the screen, some through the near plane.
Scene fixed_scene() {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  std::uint32_t state = 1;
  for (std::uint32_t triangle = 0; triangle < 400; ++triangle) {
    const float scale = 4.0F / static_cast<float>(1U << (triangle % 10U));
    // Braces: the order of the three calls must not be the compiler's choice.
    const glm::vec3 center{next(state), next(state), next(state)};
    for (int corner = 0; corner < 3; ++corner) {
      mesh.positions.push_back(center + scale * glm::vec3{next(state), next(state), next(state)});
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
    mesh.triangles.push_back(glm::uvec3(0U, 1U, 2U) + 3U * triangle);
  }
  scene.instances.push_back({});
  finish_scene(scene);
  return scene;
}

}  // namespace

class Rasterizer::Implementation {
 public:
  Implementation(GlContext& context, const Scene& scene, std::span<const SurfaceRange> objects, int threads,
                 Culling culling)
      : context_(current(context)),
        scene_(scene),
        threads_(threads),
        culling_(culling),
        program_(make_program_for(context, format_)),
        vertices_(make_buffer(context)),
        indices_(make_buffer(context)),
        records_(make_buffer(context)),
        commands_(make_buffer(context)),
        vertex_array_(make_vertex_array(context)),
        target_(context) {
    describe_vertices(context_.gl());
    load(collect_geometry(scene, objects));
  }

  void load(Geometry geometry) {
    geometry_ = std::move(geometry);
    context_.make_current();
    const GlFunctions& gl = context_.gl();
    upload(gl, vertices_, geometry_.vertices, GL_STATIC_DRAW);
    upload(gl, indices_, geometry_.triangles, GL_STATIC_DRAW);
    check_gl(gl, "uploading the scene");
    // From here on only boxes are needed of it.
    std::vector<Vertex>().swap(geometry_.vertices);  // assigning {} would keep the memory
    std::vector<glm::uvec3>().swap(geometry_.triangles);
  }

  void draw(const View& view, std::size_t screen, std::span<const Rect> parts, std::span<const Piece> pieces,
            TileLayer<Key>& layer, const std::vector<SurfaceRange>* only = nullptr) {
    const Size size = view.size();
    HPR_CHECK(size.width <= kRasterLimit && size.height <= kRasterLimit);
    HPR_CHECK(screen < layer.layout().screens() && layer.layout().size(screen) == size);
    HPR_CHECK(view.orthographic ? view.far_distance > view.near_distance : view.near_distance > 0.0);
    stats_ = {};
    context_.make_current();
    if (layer.depth_format() != format_) {
      format_ = layer.depth_format();
      program_ = make_program_for(context_, format_);
    }
    for (const Rect& wanted : parts) {
      const Rect part = intersection(wanted, {0, 0, size.width, size.height});
      if (!part.empty()) draw_part(view, screen, part, pieces, layer, only);
    }
    check_gl(context_.gl(), "drawing");
  }

  [[nodiscard]] ChunkBins bin(const View& view, const ChunkRange& chunks,
                              std::span<const std::vector<Rect>> areas) const {
    return bin_chunks(scene_, geometry_, chunks, view, areas, threads_);
  }

  [[nodiscard]] std::vector<std::byte> pack(std::span<const ChunkRange> chunks) const {
    return pack_triangles(scene_, geometry_, chunks);
  }

  [[nodiscard]] const Geometry& geometry() const { return geometry_; }
  [[nodiscard]] const RasterStats& stats() const { return stats_; }

 private:
  static GlContext& current(GlContext& context) {
    context.make_current();
    return context;
  }

  void describe_vertices(const GlFunctions& gl) {
    const GLuint array = vertex_array_.name();
    gl.VertexArrayElementBuffer(array, indices_.name());
    gl.VertexArrayVertexBuffer(array, kVertices, vertices_.name(), 0, sizeof(Vertex));
    gl.VertexArrayVertexBuffer(array, kRecords, records_.name(), 0, sizeof(DrawRecord));
    gl.VertexArrayBindingDivisor(array, kRecords, 1);
    gl.VertexArrayAttribFormat(array, 0, 3, GL_FLOAT, GL_FALSE, 0);
    gl.VertexArrayAttribIFormat(array, 1, 1, GL_UNSIGNED_INT, offsetof(DrawRecord, first_surface));
    for (GLuint column = 0; column < 4; ++column) {
      gl.VertexArrayAttribFormat(array, 2 + column, 4, GL_FLOAT, GL_FALSE, column * 4 * GLuint{sizeof(float)});
    }
    gl.VertexArrayAttribIFormat(array, 6, 1, GL_UNSIGNED_INT, offsetof(Vertex, triangle));
    for (GLuint attribute = 0; attribute < 7; ++attribute) {
      gl.EnableVertexArrayAttrib(array, attribute);
      gl.VertexArrayAttribBinding(array, attribute, attribute == 0 || attribute == 6 ? kVertices : kRecords);
    }
  }

  /// Everything that others who use the context may have changed.
  void set_state(const GlFunctions& gl) const {
    constexpr std::array<GLenum, 8> kOff{GL_BLEND,  GL_STENCIL_TEST,       GL_POLYGON_OFFSET_FILL, GL_DEPTH_CLAMP,
                                         GL_DITHER, GL_RASTERIZER_DISCARD, GL_PRIMITIVE_RESTART,   GL_COLOR_LOGIC_OP};
    for (const GLenum off : kOff) {
      gl.Disable(off);
    }
    gl.CullFace(GL_BACK);
    gl.PolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    gl.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    gl.DepthRangef(0.0F, 1.0F);
    gl.Enable(GL_DEPTH_TEST);
    // Strictly: at equal depth the surface drawn first stays, which is the one with the lower id.
    gl.DepthFunc(GL_GREATER);
    gl.UseProgram(program_.name());
    gl.BindVertexArray(vertex_array_.name());
    gl.BindBuffer(GL_DRAW_INDIRECT_BUFFER, commands_.name());
  }

  /// One after the other, as surfaces of equal depth are told apart by their order.
  static void draw_span(const GlFunctions& gl, const DrawSpan& span) {
    if (span.winding == Winding::Any) {
      gl.Disable(GL_CULL_FACE);
    } else {
      gl.Enable(GL_CULL_FACE);
      gl.FrontFace(span.winding == Winding::Clockwise ? GL_CW : GL_CCW);
    }
    gl.MultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT,
                                 reinterpret_cast<const void*>(span.first * sizeof(DrawCommand)),
                                 static_cast<GLsizei>(span.count), sizeof(DrawCommand));
  }

  void draw_part(const View& view, std::size_t screen, const Rect& part, std::span<const Piece> pieces,
                 TileLayer<Key>& layer, const std::vector<SurfaceRange>* only) {
    Stopwatch watch;
    const auto lap = [&watch](double& ms) {
      ms += watch.ms();
      watch.restart();
    };
    const DrawList list = make_draw_list(scene_, geometry_, pieces, view, part, culling_, threads_, only);
    stats_.triangles_drawn += list.triangles_drawn;
    stats_.triangles_culled += list.triangles_culled;
    stats_.chunks_drawn += list.chunks_drawn;
    stats_.chunks_culled += list.chunks_culled;
    lap(stats_.cull_ms);
    if (list.commands.empty() || list.pixels.empty()) return;

    const GlFunctions& gl = context_.gl();
    target_.begin(view.size(), list.pixels);
    set_state(gl);
    upload(gl, records_, list.records, GL_STREAM_DRAW);
    upload(gl, commands_, list.commands, GL_STREAM_DRAW);
    for (const DrawSpan& span : list.spans) draw_span(gl, span);
    gl.Finish();
    lap(stats_.draw_ms);
    target_.read(view.size(), list.pixels);
    stats_.pixels_read += list.pixels.area();
    lap(stats_.read_ms);
    pack_keys(target_.depths(), target_.words(), list.pixels, screen, layer, threads_);
    lap(stats_.pack_ms);
  }

  GlContext& context_;
  const Scene& scene_;
  int threads_;
  Culling culling_;
  Geometry geometry_;
  DepthFormat format_ = DepthFormat::Float32;
  GlObject program_;
  GlObject vertices_;
  GlObject indices_;
  GlObject records_;
  GlObject commands_;
  GlObject vertex_array_;
  KeyTarget target_;
  RasterStats stats_;
};

Rasterizer::Rasterizer(GlContext& context, const Scene& scene, std::span<const SurfaceRange> objects, int threads,
                       Culling culling)
    : implementation_(std::make_unique<Implementation>(context, scene, objects, threads, culling)) {}

Rasterizer::~Rasterizer() = default;

void Rasterizer::draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer,
                      const std::vector<SurfaceRange>* only) {
  implementation_->draw(view, screen, parts, implementation_->geometry().pieces, layer, only);
}

void Rasterizer::draw(const View& view, std::size_t screen, std::span<const Rect> parts,
                      std::span<const ChunkRange> chunks, TileLayer<Key>& layer) {
  implementation_->draw(view, screen, parts, pieces_of(implementation_->geometry(), chunks), layer);
}

void Rasterizer::load(Geometry geometry) {
  implementation_->load(std::move(geometry));
}

ChunkRange Rasterizer::chunks() const {
  return implementation_->geometry().numbers();
}

ChunkBins Rasterizer::bin(const View& view, const ChunkRange& chunks, std::span<const std::vector<Rect>> areas) const {
  return implementation_->bin(view, chunks, areas);
}

std::vector<std::byte> Rasterizer::pack(std::span<const ChunkRange> chunks) const {
  return implementation_->pack(chunks);
}

const RasterStats& Rasterizer::stats() const {
  return implementation_->stats();
}

std::uint64_t raster_fingerprint(GlContext& context) {
  const Scene scene = fixed_scene();
  View view;
  view.eye = {0.125, 0.25, 1.75};
  view.left = -0.75;
  view.right = 0.625;
  view.bottom = -0.5;
  view.top = 0.625;
  view.screen = {150, 130};
  view.block = {0, 0, 150, 130};
  TileLayer<Key> layer(FrameLayout({view.screen}));
  Rasterizer rasterizer(context, scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  rasterizer.draw(view, 0, std::array{view.block}, layer);
  const Image<Key> image = to_image(layer, 0);
  return xxh64(std::as_bytes(image.pixels()));
}

}  // namespace hpr
