#include "tools/bench/bench_raster.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <span>
#include <string_view>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "core/parallel.h"
#include "raster/gl.h"
#include "raster/rasterizer.h"
#include "scene/view.h"
#include "tools/bench/bench.h"
#include "tools/bench/bench_device.h"
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

/// A sphere's keys against the fastest route of the bare loop, then each route against that one.
std::vector<BenchRow> bench_sphere(GlContext& context, const GpuDevice* device, std::uint32_t rows,
                                   std::uint32_t columns, int threads) {
  Scene scene;
  scene.meshes.push_back(displaced_sphere(rows, columns));
  scene.instances.push_back({});
  finish_scene(scene);
  const View view = view_of(scene);
  TileLayer<Key> layer(FrameLayout({kFrame}));
  Rasterizer rasterizer(context, scene, std::array{SurfaceRange{0, scene.triangles}}, threads);
  const Mesh& mesh = scene.meshes.front();
  const glm::mat4 matrix(clip_from_world(view, {0.0, 0.0, 0.0}));

  std::vector<std::unique_ptr<BareGl>> bare;
  std::vector<std::function<void()>> sides{[&] { rasterizer.draw(view, 0, std::array{view.block}, layer); },
                                           [&] { layer.clear(); }};
  for (const KeyRoute route : all_key_routes()) {
    context.make_current();
    bare.push_back(std::make_unique<BareGl>(context, mesh.positions, mesh.triangles, matrix, kFrame, route));
    sides.emplace_back([&loop = *bare.back()] { (void)loop.frame(); });
  }
  // Two frames to warm up: shaders are compiled at the first draw. Clearing the layer is not part of either side.
  const std::vector<double> medians = median_times(sides, {2, kFrames});
  check_gl(context.gl(), "measuring");
  const double floor = std::ranges::min(std::span(medians).subspan(2));
  std::vector<BenchRow> table{{fmt::format("keys of {} triangles, {}x{}", scene.triangles, kFrame.width, kFrame.height),
                               medians[0], floor, "ms", floor / medians[0]}};
  for (std::size_t i = 0; i < bare.size(); ++i) {
    const double ms = medians[2 + i];
    table.push_back({fmt::format("bare, read by {}", route_name(all_key_routes()[i])), ms, floor, "ms", floor / ms});
  }
  if (device != nullptr)
    std::ranges::copy(bench_device_keys(*device, scene, view, threads, medians[0]), std::back_inserter(table));
  return table;
}

/// A frame of keys (cull, draw, read back, pack) against the barest GL loop: one glDrawElements of the same mesh into
/// the same formats, brought into memory by the fastest of all routes. A displaced sphere of about 250 000 and
/// 1 000 000 triangles at 1920x1080, all sides in turn, medians in ms. Takes some seconds.
/// With a device its keys of the same view too, against OpenGL's.
std::vector<BenchRow> bench_raster(GlContext& context, const GpuDevice* device, int threads) {
  context.make_current();
  std::vector<BenchRow> rows = bench_sphere(context, device, 354, 354, threads);
  std::ranges::copy(bench_sphere(context, device, 708, 708, threads), std::back_inserter(rows));
  return rows;
}

class BenchRasterCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "raster"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a frame with raster only against a bare GL loop of the same mesh, read by the fastest route; with "
           "--backend vulkan a device's keys too";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "one JSON document"); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const int threads = globals.threads > 0 ? globals.threads : usable_cores();
    const std::unique_ptr<GpuDevice> device = measures_device(globals) ? device_of(globals) : nullptr;
    const auto context = make_gl_context(gl_options(globals, threads));
    print_bench(bench_raster(*context, device.get(), threads), context->description(), json_);
    return ExitCode::Done;
  }

 private:
  bool json_ = false;
};

}  // namespace

BareGl::BareGl(GlContext& context, std::span<const glm::vec3> positions, std::span<const glm::uvec3> triangles,
               const glm::mat4& clip_from_world, Size size, KeyRoute route)
    : context_(context),
      size_(size),
      program_(make_program(context, kVertexShader, kFragmentShader)),
      positions_(make_buffer(context)),
      indices_(make_buffer(context)),
      vertex_array_(make_vertex_array(context)),
      target_(context),
      readback_(make_key_readback(route, context)),
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
  for (std::size_t i = 0; i < 16; ++i)
    matrix_.at(i) = clip_from_world[static_cast<int>(i / 4)][static_cast<int>(i % 4)];
}

DrawnKeys BareGl::frame() {
  context_.make_current();
  const GlFunctions& gl = context_.gl();
  const Rect all{0, 0, size_.width, size_.height};
  target_.begin(size_, all);
  gl.Disable(GL_CULL_FACE);
  gl.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  gl.Enable(GL_DEPTH_TEST);
  gl.DepthFunc(GL_GREATER);
  gl.UseProgram(program_.name());
  gl.UniformMatrix4fv(0, 1, GL_FALSE, matrix_.data());
  gl.BindVertexArray(vertex_array_.name());
  gl.DrawElements(GL_TRIANGLES, index_count_, GL_UNSIGNED_INT, nullptr);
  readback_->start(target_, size_, all);
  return readback_->finish();
}

std::unique_ptr<Command> make_bench_raster_command() {
  return std::make_unique<BenchRasterCommand>();
}

}  // namespace hpr
