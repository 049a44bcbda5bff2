#include "raster/keys/key_drawer.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string_view>

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

/// One after the other, as surfaces of equal depth are told apart by their order.
void draw_span(const GlFunctions& gl, const DrawSpan& span) {
  if (span.winding == Winding::Any) {
    gl.Disable(GL_CULL_FACE);
  } else {
    gl.Enable(GL_CULL_FACE);
    gl.FrontFace(span.winding == Winding::Clockwise ? GL_CW : GL_CCW);
  }
  // NOLINTNEXTLINE(performance-no-int-to-ptr): GL takes offsets as pointers
  const auto* const first = reinterpret_cast<const void*>(span.first * sizeof(DrawCommand));
  gl.MultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, first, static_cast<GLsizei>(span.count),
                               sizeof(DrawCommand));
}

}  // namespace

KeyDrawer::KeyDrawer(GlContext& context, const GlObject& vertices, const GlObject& indices, KeyRoute route)
    : context_(context),
      vertices_(vertices),
      indices_(indices),
      program_(make_program_for(context, format_)),
      records_(make_buffer(context)),
      commands_(make_buffer(context)),
      vertex_array_(make_vertex_array(context)),
      target_(context),
      readback_(make_key_readback(route, context)) {
  describe_vertices();
}

void KeyDrawer::describe_vertices() {
  const GlFunctions& gl = context_.gl();
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
void KeyDrawer::set_state() const {
  const GlFunctions& gl = context_.gl();
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

void KeyDrawer::begin(DepthFormat format) {
  context_.make_current();
  if (format != format_) {
    format_ = format;
    program_ = make_program_for(context_, format);
  }
  if (!stale_) return;
  // What other contexts put into a buffer is certain to be seen by arrays that are made after that.
  vertex_array_ = make_vertex_array(context_);
  describe_vertices();
  stale_ = false;
}

void KeyDrawer::start(const View& view, const DrawList& list) {
  const GlFunctions& gl = context_.gl();
  target_.begin(view.size(), list.pixels);
  set_state();
  upload(gl, records_, list.records, GL_STREAM_DRAW);
  upload(gl, commands_, list.commands, GL_STREAM_DRAW);
  for (const DrawSpan& span : list.spans) draw_span(gl, span);
  drawn_.emplace(context_);
  // A GPU has all its work at once. A software GL does it within this very call, and is to be timed step by step.
  if (!context_.software()) readback_->start(target_, view.size(), list.pixels);
}

void KeyDrawer::wait() {
  drawn_->wait("drawing");
  drawn_.reset();
}

DrawnKeys KeyDrawer::finish(const View& view, const DrawList& list) {
  if (context_.software()) readback_->start(target_, view.size(), list.pixels);
  return readback_->finish();
}

}  // namespace hpr
