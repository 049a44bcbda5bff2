#include "raster/rasterizer.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/bytes.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "raster/chunk_triangles.h"
#include "raster/geometry.h"
#include "raster/gl.h"
#include "raster/keys/key_drawer.h"

namespace hpr {
namespace {

/// A software GL does all its work on triangles, but for their pixels, by one thread of a context: so many triangles,
/// or one for so many pixels, take it about as long as a further context takes to clear, read and merge its pixels.
constexpr std::uint64_t kTrianglesOfContext = 60'000;
constexpr std::uint64_t kPixelsOfTriangle = 40;
/// What the contexts of a rasteriser may take for the pixels of a frame: as drawn, and as read.
constexpr std::size_t kMaxTargetBytes = std::size_t{512} << 20U;
constexpr std::size_t kBytesOfPixel = 16;

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

/// Leaves a context to other threads at its end.
class ReleaseAtEnd {
 public:
  explicit ReleaseAtEnd(GlContext& context) : context_(context) {}
  ~ReleaseAtEnd() { context_.release(); }
  ReleaseAtEnd(const ReleaseAtEnd&) = delete;
  ReleaseAtEnd& operator=(const ReleaseAtEnd&) = delete;

 private:
  GlContext& context_;
};

}  // namespace

class Rasterizer::Implementation {
 public:
  Implementation(GlContext& context, const Scene& scene, std::span<const SurfaceRange> objects, int threads,
                 const RasterOptions& options)
      : context_(current(context)),
        scene_(scene),
        threads_(threads),
        options_(options),
        vertices_(make_buffer(context)),
        indices_(make_buffer(context)) {
    drawers_.push_back(std::make_unique<KeyDrawer>(context, vertices_, indices_, route()));
    load(collect_geometry(scene, objects));
  }

  void load(Geometry geometry) {
    geometry_ = std::move(geometry);
    context_.make_current();
    const GlFunctions& gl = context_.gl();
    upload(gl, vertices_, geometry_.vertices, GL_STATIC_DRAW);
    upload(gl, indices_, geometry_.triangles, GL_STATIC_DRAW);
    check_gl(gl, "uploading the scene");
    if (drawers_.size() > 1) gl.Finish();  // before other contexts read them
    for (const auto& drawer : drawers_) drawer->refresh();
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
    for (const Rect& wanted : parts) {
      const Rect part = intersection(wanted, {0, 0, size.width, size.height});
      if (!part.empty()) draw_part(view, screen, part, pieces, layer, only);
    }
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

  [[nodiscard]] KeyRoute route() const { return options_.route.value_or(fastest_route(context_)); }

  /// How many contexts draw a list, at most.
  [[nodiscard]] std::size_t contexts_for(const View& view, const DrawList& list) const {
    if (!context_.software()) return 1;
    const std::uint64_t pixels = list.pixels.area();
    const std::uint64_t worth = list.triangles_drawn / std::max(kTrianglesOfContext, pixels / kPixelsOfTriangle);
    const std::size_t fit = kMaxTargetBytes / (kBytesOfPixel * view.size().area());
    return std::clamp<std::size_t>(std::min<std::uint64_t>(worth, fit), 1,
                                   static_cast<std::size_t>(std::max(threads_, 1)));
  }

  /// So many drawers, or as many as there are contexts.
  [[nodiscard]] std::size_t add_drawers(std::size_t count) {
    while (drawers_.size() < count) {
      std::unique_ptr<GlContext> context = context_.share();
      if (!context) break;
      context->make_current();
      const ReleaseAtEnd at_end(*context);
      drawers_.push_back(std::make_unique<KeyDrawer>(*context, vertices_, indices_, route()));
      shared_.push_back(std::move(context));
    }
    return std::min(count, drawers_.size());
  }

  /// Returns once it is drawn, with the ms that this took.
  static double draw_list(KeyDrawer& drawer, const View& view, const DrawList& list, DepthFormat format) {
    const Stopwatch watch;
    const trace::Span span("draw triangles");
    drawer.begin(format);
    drawer.start(view, list);
    drawer.wait();
    return watch.ms();
  }

  void draw_part(const View& view, std::size_t screen, const Rect& part, std::span<const Piece> pieces,
                 TileLayer<Key>& layer, const std::vector<SurfaceRange>* only) {
    Stopwatch watch;
    std::optional<trace::Span> span(std::in_place, "cull chunks");
    const auto lap = [&watch](double& ms) {
      ms += watch.ms();
      watch.restart();
    };
    DrawList list = make_draw_list(scene_, geometry_, pieces, view, part, options_.culling, threads_, only);
    stats_.triangles_drawn += list.triangles_drawn;
    stats_.triangles_culled += list.triangles_culled;
    stats_.chunks_drawn += list.chunks_drawn;
    stats_.chunks_culled += list.chunks_culled;
    lap(stats_.cull_ms);
    span.reset();
    if (list.commands.empty() || list.pixels.empty()) return;

    const std::size_t contexts = add_drawers(contexts_for(view, list));
    const std::vector<DrawList> lists = split_list(std::move(list), contexts);
    context_.release();
    std::vector<double> draw_ms(lists.size());
    std::vector<DrawnKeys> drawn(lists.size());
    parallel_for(static_cast<int>(lists.size()), lists.size(), [&](std::size_t i) {
      const ReleaseAtEnd at_end(drawers_[i]->context());
      draw_ms[i] = draw_list(*drawers_[i], view, lists[i], layer.depth_format());
      const trace::Span reading("read keys", "pixels", lists[i].pixels.area());
      drawn[i] = drawers_[i]->finish(view, lists[i]);
      check_gl(drawers_[i]->context().gl(), "drawing");
    });
    const double slowest_ms = std::ranges::max(draw_ms);
    stats_.draw_ms += slowest_ms;
    stats_.read_ms += watch.ms() - slowest_ms;
    watch.restart();
    const Rect& pixels = lists.front().pixels;
    stats_.pixels_read += lists.size() * pixels.area();
    const trace::Span packing("pack keys");
    pack_keys(drawn, pixels, screen, layer, threads_);
    lap(stats_.pack_ms);
  }

  GlContext& context_;
  const Scene& scene_;
  int threads_;
  RasterOptions options_;
  Geometry geometry_;
  GlObject vertices_;
  GlObject indices_;
  std::vector<std::unique_ptr<GlContext>> shared_;   ///< with those buffers; made when they are first needed
  std::vector<std::unique_ptr<KeyDrawer>> drawers_;  ///< the first of context_, then of shared_
  RasterStats stats_;
};

Rasterizer::Rasterizer(GlContext& context, const Scene& scene, std::span<const SurfaceRange> objects, int threads,
                       const RasterOptions& options)
    : implementation_(std::make_unique<Implementation>(context, scene, objects, threads, options)) {}

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
