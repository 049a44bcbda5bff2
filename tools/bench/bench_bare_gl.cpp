#include "tools/bench/bench_bare_gl.h"

#include <cstddef>
#include <string_view>

#include "raster/gl.h"

namespace hpr {
namespace {

constexpr std::string_view kVertexShader = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 0) uniform mat4 clip_from_world;
void main() { gl_Position = clip_from_world * vec4(position, 1.0); }
)";
constexpr std::string_view kFragmentShader = R"(#version 450 core
layout(location = 0) out uint id;
void main() { id = uint(gl_PrimitiveID) + 1u; }
)";

}  // namespace

BareGl::BareGl(GlContext& context, std::span<const glm::vec3> positions, std::span<const glm::uvec3> triangles,
               const glm::mat4& clip_from_world, Size size)
    : context_(context),
      size_(size),
      program_(make_program(context, kVertexShader, kFragmentShader)),
      positions_(make_buffer(context)),
      indices_(make_buffer(context)),
      vertex_array_(make_vertex_array(context)),
      words_buffer_(make_renderbuffer(context)),
      depth_buffer_(make_renderbuffer(context)),
      framebuffer_(make_framebuffer(context)),
      words_(size.area()),
      depths_(size.area()),
      index_count_(static_cast<GLsizei>(triangles.size() * 3)) {
  const GlFunctions& gl = context_.gl();
  gl.NamedBufferData(positions_.name(), static_cast<GLsizeiptr>(positions.size_bytes()), positions.data(),
                     GL_STATIC_DRAW);
  gl.NamedBufferData(indices_.name(), static_cast<GLsizeiptr>(triangles.size_bytes()), triangles.data(),
                     GL_STATIC_DRAW);
  gl.VertexArrayElementBuffer(vertex_array_.name(), indices_.name());
  gl.VertexArrayVertexBuffer(vertex_array_.name(), 0, positions_.name(), 0, sizeof(glm::vec3));
  gl.VertexArrayAttribFormat(vertex_array_.name(), 0, 3, GL_FLOAT, GL_FALSE, 0);
  gl.EnableVertexArrayAttrib(vertex_array_.name(), 0);
  gl.NamedRenderbufferStorage(words_buffer_.name(), GL_R32UI, size.width, size.height);
  gl.NamedRenderbufferStorage(depth_buffer_.name(), GL_DEPTH_COMPONENT32F, size.width, size.height);
  gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, words_buffer_.name());
  gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_buffer_.name());
  for (std::size_t i = 0; i < 16; ++i)
    matrix_.at(i) = clip_from_world[static_cast<int>(i / 4)][static_cast<int>(i % 4)];
}

void BareGl::frame() {
  const GlFunctions& gl = context_.gl();
  constexpr GLuint kNothing[4] = {0, 0, 0, 0};
  constexpr GLfloat kFarthest = 0.0F;
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
  gl.Viewport(0, 0, size_.width, size_.height);
  gl.Disable(GL_SCISSOR_TEST);
  gl.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  gl.Enable(GL_DEPTH_TEST);
  gl.DepthFunc(GL_GREATER);
  gl.ClearBufferuiv(GL_COLOR, 0, kNothing);
  gl.ClearBufferfv(GL_DEPTH, 0, &kFarthest);
  gl.UseProgram(program_.name());
  gl.UniformMatrix4fv(0, 1, GL_FALSE, matrix_.data());
  gl.BindVertexArray(vertex_array_.name());
  gl.DrawElements(GL_TRIANGLES, index_count_, GL_UNSIGNED_INT, nullptr);
  gl.ReadPixels(0, 0, size_.width, size_.height, GL_DEPTH_COMPONENT, GL_FLOAT, depths_.data());
  gl.ReadPixels(0, 0, size_.width, size_.height, GL_RED_INTEGER, GL_UNSIGNED_INT, words_.data());
  gl.Finish();
}

}  // namespace hpr
