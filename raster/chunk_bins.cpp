#include "raster/chunk_bins.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "core/parallel.h"
#include "raster/draw_list.h"

namespace hpr {
namespace {

/// What a thread found of some pieces.
struct Batch {
  std::vector<std::vector<ChunkRange>> areas;
  std::uint64_t binned = 0;  ///< chunks that stand in some list
};

class Binning {
 public:
  Binning(const Scene& scene, const Geometry& geometry, const View& view, std::span<const std::vector<Rect>> areas)
      : scene_(scene),
        geometry_(geometry),
        view_(view),
        areas_(areas),
        from_eye_relative_(clip_from_world(view, view.eye)) {}

  void bin(const Piece& piece, Batch& batch) const {
    const auto matrix = drawable_matrix(scene_.instances[piece.instance], from_eye_relative_, view_.eye);
    if (!matrix) return;
    const Size size = view_.size();
    const Culler culler(*matrix, view_, {0, 0, size.width, size.height});
    if (culler.outside(piece.box)) return;
    const Rect pixels = culler.pixels(piece.box);
    // A piece that one area at most sees needs no look at its chunks: the owner takes one at each before it draws them.
    if (piece.chunks == 1 || touched(pixels) <= 1) {
      add(pixels, piece.numbers(), batch);
      return;
    }
    std::uint32_t number = piece.number;
    for (const Chunk& chunk : std::span(geometry_.chunks).subspan(piece.first_chunk, piece.chunks)) {
      if (!culler.outside(chunk.box)) add(culler.pixels(chunk.box), {number, number + 1}, batch);
      ++number;
    }
  }

 private:
  [[nodiscard]] bool touches(const Rect& pixels, std::size_t area) const {
    return std::ranges::any_of(areas_[area], [&](const Rect& rect) { return !intersection(rect, pixels).empty(); });
  }

  /// How many areas some pixels lie in.
  [[nodiscard]] std::size_t touched(const Rect& pixels) const {
    std::size_t count = 0;
    for (std::size_t area = 0; area < areas_.size(); ++area) {
      if (touches(pixels, area)) ++count;
    }
    return count;
  }

  void add(const Rect& pixels, const ChunkRange& chunks, Batch& batch) const {
    bool binned = false;
    for (std::size_t area = 0; area < areas_.size(); ++area) {
      if (!touches(pixels, area)) continue;
      append_range(batch.areas[area], chunks);
      binned = true;
    }
    if (binned) batch.binned += chunks.count();
  }

  const Scene& scene_;
  const Geometry& geometry_;
  const View& view_;
  std::span<const std::vector<Rect>> areas_;
  glm::dmat4 from_eye_relative_;
};

}  // namespace

ChunkBins bin_chunks(const Scene& scene, const Geometry& geometry, const ChunkRange& chunks, const View& view,
                     std::span<const std::vector<Rect>> areas, int threads) {
  const std::vector<Piece> pieces = pieces_of(geometry, std::array{chunks});
  const Binning binning(scene, geometry, view, areas);
  constexpr std::size_t kBatchPieces = 256;
  std::vector<Batch> batches((pieces.size() + kBatchPieces - 1) / kBatchPieces);
  // Starting threads costs more than a few batches.
  parallel_for(batches.size() > 4 ? threads : 1, batches.size(), [&](std::size_t index) {
    Batch& batch = batches[index];
    batch.areas.resize(areas.size());
    const std::size_t first = index * kBatchPieces;
    const std::size_t count = std::min(kBatchPieces, pieces.size() - first);
    for (const Piece& piece : std::span(pieces).subspan(first, count)) binning.bin(piece, batch);
  });

  ChunkBins bins{.areas = std::vector<std::vector<ChunkRange>>(areas.size()), .chunks_culled = chunks.count()};
  for (const Batch& batch : batches) {
    for (std::size_t area = 0; area < areas.size(); ++area) {
      for (const ChunkRange& range : batch.areas[area]) append_range(bins.areas[area], range);
    }
    bins.chunks_culled -= batch.binned;
  }
  return bins;
}

}  // namespace hpr
