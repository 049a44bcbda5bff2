#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"
#include "raster/chunk_bins.h"
#include "raster/draw_list.h"
#include "raster/gl_context.h"
#include "raster/keys/key_readback.h"
#include "raster/raster_stats.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// What changes no key.
struct RasterOptions {
  Culling culling = Culling::Chunks;
  std::optional<KeyRoute> route = std::nullopt;  ///< none: fastest_route()
};

/// Draws one rank's part of a scene into keys by OpenGL.
///
/// A screen gives the same keys however its area is cut into parts, however its triangles are distributed to ranks
/// whose layers are merged by maximum, and with any number of threads.
class Rasterizer {
 public:
  /// Uploads the triangles of `objects` once. `scene` and `context` must outlive it. Throws Error: Limit when GL has no
  /// memory for the triangles, NoDevice when it reports another error. `threads`: for culling and packing; GL's own are
  /// set with the context.
  Rasterizer(GlContext& context, const Scene& scene, std::span<const SurfaceRange> objects, int threads,
             const RasterOptions& options = {});
  ~Rasterizer();
  Rasterizer(const Rasterizer&) = delete;
  Rasterizer& operator=(const Rasterizer&) = delete;

  /// Merges (maximum) the keys of `parts` of the layer's `screen` into `layer`; tiles become active where something was
  /// drawn. `view` is as large as that screen and at most kRasterLimit pixels a side; parts are in its pixels and may
  /// reach past it. Depths are rounded to the layer's depth_format() before they are compared, so that the triangles'
  /// dealing changes nothing then either. `only`: merged ranges; chunks without any of these surfaces are left out.
  /// Null: none is. Throws Error as the constructor does.
  void draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer,
            const std::vector<SurfaceRange>* only = nullptr);
  /// Draws some of the chunks, in ascending order; nothing else is culled.
  void draw(const View& view, std::size_t screen, std::span<const Rect> parts, std::span<const ChunkRange> chunks,
            TileLayer<Key>& layer);

  /// Holds other triangles from here on: what other ranks sent. Throws Error as the constructor does.
  void load(Geometry geometry);

  /// All chunks that it holds.
  [[nodiscard]] ChunkRange chunks() const;
  /// Which of some chunks are to be drawn for which areas of a view: see raster/chunk_bins.h. Takes part in no drawing,
  /// and needs no context.
  [[nodiscard]] ChunkBins bin(const View& view, const ChunkRange& chunks,
                              std::span<const std::vector<Rect>> areas) const;

  /// Some of the chunks as triangles: see raster/chunk_triangles.h.
  [[nodiscard]] std::vector<std::byte> pack(std::span<const ChunkRange> chunks) const;

  [[nodiscard]] const RasterStats& stats() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// XXH64 over the keys of one small fixed scene: equal on ranks whose rasterisers draw alike. CPUs without AVX and
/// other drivers differ.
[[nodiscard]] std::uint64_t raster_fingerprint(GlContext& context);

}  // namespace hpr
