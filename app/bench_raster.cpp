#include "app/bench_raster.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "app/bench_scene.h"
#include "app/bench_times.h"
#include "core/stopwatch.h"
#include "raster/gl_functions.h"
#include "raster/gl_objects.h"
#include "raster/rasterizer.h"
#include "scene/view.h"

namespace hpr {
namespace {

constexpr Size kFrame{1920, 1080};
constexpr int kFrames = 15;

View view_of(const Scene& scene) {
  const Camera camera = look_at({0.3, 0.4, 3.2}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.7);
  return make_view(camera, kFrame, scene.bounds);
}

/// The floor: nothing but what GL itself needs to bring ids and depths into memory.
class BareLoop {
 public:
  BareLoop(GlContext& context, const Scene& scene, const View& view)
      : context_(context),
        program_(make_program(context, kVertexShader, kFragmentShader)),
        positions_(make_buffer(context)),
        indices_(make_buffer(context)),
        vertex_array_(make_vertex_array(context)),
        words_buffer_(make_renderbuffer(context)),
        depth_buffer_(make_renderbuffer(context)),
        framebuffer_(make_framebuffer(context)),
        words_(kFrame.area()),
        depths_(kFrame.area()) {
    const GlFunctions& gl = context_.gl();
    const Mesh& mesh = scene.meshes.front();
    index_count_ = static_cast<GLsizei>(mesh.triangles.size() * 3);
    gl.NamedBufferData(positions_.name(), static_cast<GLsizeiptr>(mesh.positions.size() * sizeof(glm::vec3)),
                       mesh.positions.data(), GL_STATIC_DRAW);
    gl.NamedBufferData(indices_.name(), static_cast<GLsizeiptr>(mesh.triangles.size() * sizeof(glm::uvec3)),
                       mesh.triangles.data(), GL_STATIC_DRAW);
    gl.VertexArrayElementBuffer(vertex_array_.name(), indices_.name());
    gl.VertexArrayVertexBuffer(vertex_array_.name(), 0, positions_.name(), 0, sizeof(glm::vec3));
    gl.VertexArrayAttribFormat(vertex_array_.name(), 0, 3, GL_FLOAT, GL_FALSE, 0);
    gl.EnableVertexArrayAttrib(vertex_array_.name(), 0);
    gl.NamedRenderbufferStorage(words_buffer_.name(), GL_R32UI, kFrame.width, kFrame.height);
    gl.NamedRenderbufferStorage(depth_buffer_.name(), GL_DEPTH_COMPONENT32F, kFrame.width, kFrame.height);
    gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, words_buffer_.name());
    gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_buffer_.name());
    const glm::mat4 matrix(clip_from_world(view, {0.0, 0.0, 0.0}));
    for (std::size_t i = 0; i < 16; ++i) matrix_.at(i) = matrix[static_cast<int>(i / 4)][static_cast<int>(i % 4)];
  }

  void frame() {
    const GlFunctions& gl = context_.gl();
    constexpr GLuint kNothing[4] = {0, 0, 0, 0};
    constexpr GLfloat kFarthest = 0.0F;
    gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
    gl.Viewport(0, 0, kFrame.width, kFrame.height);
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
    gl.ReadPixels(0, 0, kFrame.width, kFrame.height, GL_DEPTH_COMPONENT, GL_FLOAT, depths_.data());
    gl.ReadPixels(0, 0, kFrame.width, kFrame.height, GL_RED_INTEGER, GL_UNSIGNED_INT, words_.data());
    gl.Finish();
  }

 private:
  static constexpr std::string_view kVertexShader = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 0) uniform mat4 clip_from_world;
void main() { gl_Position = clip_from_world * vec4(position, 1.0); }
)";
  static constexpr std::string_view kFragmentShader = R"(#version 450 core
layout(location = 0) out uint id;
void main() { id = uint(gl_PrimitiveID) + 1u; }
)";

  GlContext& context_;
  GlObject program_;
  GlObject positions_;
  GlObject indices_;
  GlObject vertex_array_;
  GlObject words_buffer_;
  GlObject depth_buffer_;
  GlObject framebuffer_;
  std::vector<std::uint32_t> words_;
  std::vector<float> depths_;
  std::array<float, 16> matrix_{};
  GLsizei index_count_ = 0;
};

BenchRow bench_sphere(GlContext& context, std::uint32_t rows, std::uint32_t columns, int threads) {
  Scene scene;
  scene.meshes.push_back(displaced_sphere(rows, columns));
  scene.instances.push_back({});
  finish_scene(scene);
  const View view = view_of(scene);
  TileLayer<Key> layer(FrameLayout({kFrame}));
  Rasterizer rasterizer(context, scene, std::array{SurfaceRange{0, scene.triangles}}, threads);
  BareLoop bare(context, scene, view);

  std::vector<double> ours;
  std::vector<double> floor;
  for (int frame = -2; frame < kFrames; ++frame) {  // two to warm up: shaders are compiled at the first draw
    layer.clear();
    Stopwatch watch;
    rasterizer.draw(view, 0, std::array{view.block}, layer);
    const double our_ms = watch.ms();
    watch.restart();
    bare.frame();
    const double bare_ms = watch.ms();
    if (frame < 0) continue;
    ours.push_back(our_ms);
    floor.push_back(bare_ms);
  }
  check_gl(context.gl(), "measuring");
  const double our_ms = median(ours);
  const double floor_ms = median(floor);
  return {fmt::format("keys of {} triangles, {}x{}", scene.triangles, kFrame.width, kFrame.height), our_ms, floor_ms,
          "ms", floor_ms / our_ms};
}

}  // namespace

std::vector<BenchRow> bench_raster(GlContext& context, int threads) {
  context.make_current();
  return {bench_sphere(context, 354, 354, threads), bench_sphere(context, 708, 708, threads)};
}

}  // namespace hpr
