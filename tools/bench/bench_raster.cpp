#include "tools/bench/bench_raster.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "core/parallel.h"
#include "raster/gl.h"
#include "raster/rasterizer.h"
#include "scene/view.h"
#include "tools/bench/bench.h"
#include "tools/sweep.h"

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

constexpr Size kFrame{1920, 1080};
constexpr int kFrames = 15;

View view_of(const Scene& scene) {
  const Camera camera = look_at({0.3, 0.4, 3.2}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.7);
  return make_view(camera, kFrame, scene.bounds);
}

BenchRow bench_sphere(GlContext& context, std::uint32_t rows, std::uint32_t columns, int threads) {
  Scene scene;
  scene.meshes.push_back(displaced_sphere(rows, columns));
  scene.instances.push_back({});
  finish_scene(scene);
  const View view = view_of(scene);
  TileLayer<Key> layer(FrameLayout({kFrame}));
  Rasterizer rasterizer(context, scene, std::array{SurfaceRange{0, scene.triangles}}, threads);
  const Mesh& mesh = scene.meshes.front();
  const glm::mat4 matrix(clip_from_world(view, {0.0, 0.0, 0.0}));
  BareGl bare(context, mesh.positions, mesh.triangles, matrix, kFrame);

  const auto draw = [&] { rasterizer.draw(view, 0, std::array{view.block}, layer); };
  // Two frames to warm up: shaders are compiled at the first draw. Clearing the layer is not part of either side.
  const std::vector<double> medians = median_times({draw, [&] { bare.frame(); }, [&] { layer.clear(); }}, {2, kFrames});
  check_gl(context.gl(), "measuring");
  return {fmt::format("keys of {} triangles, {}x{}", scene.triangles, kFrame.width, kFrame.height), medians[0],
          medians[1], "ms", medians[1] / medians[0]};
}

/// A frame of keys (cull, draw, read back, pack) against the barest GL loop: one glDrawElements of the same mesh into
/// the same formats, glReadPixels of both, glFinish. A displaced sphere of about 250 000 and 1 000 000 triangles at
/// 1920x1080, both sides in turn, medians in ms. Takes some seconds.
std::vector<BenchRow> bench_raster(GlContext& context, int threads) {
  context.make_current();
  return {bench_sphere(context, 354, 354, threads), bench_sphere(context, 708, 708, threads)};
}

class BenchRasterCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "raster"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a frame with raster only against a bare GL loop of the same mesh and readback";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "one JSON document"); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const int threads = globals.threads > 0 ? globals.threads : usable_cores();
    const auto context =
        make_gl_context({.backend = globals.backend, .device = globals.device, .local_rank = 0, .threads = threads});
    print_bench(bench_raster(*context, threads), context->description(), json_);
    return ExitCode::Done;
  }

 private:
  bool json_ = false;
};

}  // namespace

BareGl::BareGl(GlContext& context, std::span<const glm::vec3> positions, std::span<const glm::uvec3> triangles,
               const glm::mat4& clip_from_world, Size size)
    : context_(context),
      size_(size),
      program_(make_program(context, kVertexShader, kFragmentShader)),
      positions_(make_buffer(context)),
      indices_(make_buffer(context)),
      vertex_array_(make_vertex_array(context)),
      ids_buffer_(make_renderbuffer(context)),
      depth_buffer_(make_renderbuffer(context)),
      framebuffer_(make_framebuffer(context)),
      ids_(size.area()),
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
  gl.NamedRenderbufferStorage(ids_buffer_.name(), GL_R32UI, size.width, size.height);
  gl.NamedRenderbufferStorage(depth_buffer_.name(), GL_DEPTH_COMPONENT32F, size.width, size.height);
  gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, ids_buffer_.name());
  gl.NamedFramebufferRenderbuffer(framebuffer_.name(), GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_buffer_.name());
  for (std::size_t i = 0; i < 16; ++i)
    matrix_.at(i) = clip_from_world[static_cast<int>(i / 4)][static_cast<int>(i % 4)];
}

void BareGl::frame() {
  const GlFunctions& gl = context_.gl();
  constexpr GLuint kNothing[4] = {0, 0, 0, 0};
  constexpr GLfloat kFarDepth = 0.0F;
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
  gl.Viewport(0, 0, size_.width, size_.height);
  gl.Disable(GL_SCISSOR_TEST);
  gl.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  gl.Enable(GL_DEPTH_TEST);
  gl.DepthFunc(GL_GREATER);
  gl.ClearBufferuiv(GL_COLOR, 0, kNothing);
  gl.ClearBufferfv(GL_DEPTH, 0, &kFarDepth);
  gl.UseProgram(program_.name());
  gl.UniformMatrix4fv(0, 1, GL_FALSE, matrix_.data());
  gl.BindVertexArray(vertex_array_.name());
  gl.DrawElements(GL_TRIANGLES, index_count_, GL_UNSIGNED_INT, nullptr);
  gl.ReadPixels(0, 0, size_.width, size_.height, GL_DEPTH_COMPONENT, GL_FLOAT, depths_.data());
  gl.ReadPixels(0, 0, size_.width, size_.height, GL_RED_INTEGER, GL_UNSIGNED_INT, ids_.data());
  gl.Finish();
}

std::unique_ptr<Command> make_bench_raster_command() {
  return std::make_unique<BenchRasterCommand>();
}

}  // namespace hpr
