#include "raster/draw_list.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/parallel.h"
#include "raster/culling.h"

namespace hpr {
namespace {

Rect joined(const Rect& a, const Rect& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

bool contains(const Rect& outer, const Rect& inner) {
  return inner.empty() ||
         (outer.x0 <= inner.x0 && outer.y0 <= inner.y0 && outer.x1 >= inner.x1 && outer.y1 >= inner.y1);
}

/// Triangles [first, last) of an instance's mesh from one slot of the index buffer on: a command to be.
struct Run {
  std::uint32_t instance = 0;
  std::uint32_t first = 0;
  std::uint32_t last = 0;
  std::uint32_t slot = 0;
};

struct Batch {
  std::vector<Run> runs;
  Rect pixels;
  std::uint64_t triangles = 0;
  std::uint64_t chunks = 0;
};

/// The matrix of an instance for vertices in mesh coordinates. Everything is taken relative to the eye in double before
/// it is rounded, so that a large common offset of scene and eye costs nothing.
glm::dmat4 clip_from_mesh(const Instance& instance, const glm::dmat4& clip_from_eye_relative, const glm::dvec3& eye) {
  glm::dmat4 to_eye_relative = instance.to_world;
  to_eye_relative[3] -= glm::dvec4(eye, 0.0);
  return clip_from_eye_relative * to_eye_relative;
}

std::array<float, 16> rounded(const glm::dmat4& matrix) {
  std::array<float, 16> result{};
  for (std::size_t i = 0; i < 16; ++i) {
    result.at(i) = static_cast<float>(matrix[static_cast<int>(i / 4)][static_cast<int>(i % 4)]);
  }
  return result;
}

bool drawable(const glm::dmat4& matrix) {
  constexpr double kMost = 1e30;  // leaves room for the product with a position
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      if (!(std::abs(matrix[column][row]) < kMost)) return false;
    }
  }
  return true;
}

void append(Batch& batch, const Run& run) {
  Run* const last = batch.runs.empty() ? nullptr : &batch.runs.back();
  if (last != nullptr && last->instance == run.instance && last->last == run.first &&
      last->slot + (last->last - last->first) == run.slot) {
    last->last = run.last;  // neighbours in the mesh stand side by side in the index buffer: one command for both
  } else {
    batch.runs.push_back(run);
  }
}

void cull_piece(const Geometry& geometry, const Piece& piece, const Culler& culler, const Rect& part, Culling culling,
                Batch& batch) {
  const bool cull = culling == Culling::Chunks;
  if (cull && culler.outside(piece.box)) return;
  const bool all = !cull || culler.inside(piece.box);
  if (!cull) batch.pixels = part;
  if (all && !contains(batch.pixels, part)) batch.pixels = joined(batch.pixels, culler.pixels(piece.box));
  for (const Chunk& chunk : std::span(geometry.chunks).subspan(piece.first_chunk, piece.chunks)) {
    if (!all) {
      if (culler.outside(chunk.box)) continue;
      if (!contains(batch.pixels, part)) batch.pixels = joined(batch.pixels, culler.pixels(chunk.box));
    }
    const std::uint32_t first = std::max(chunk.first, piece.first);
    const std::uint32_t last = std::min(chunk.first + chunk.count, piece.last);
    append(batch, {piece.instance, first, last, chunk.slot + (first - chunk.first)});
    batch.triangles += last - first;
    ++batch.chunks;
  }
}

}  // namespace

DrawList make_draw_list(const Scene& scene, const Geometry& geometry, const View& view, const Rect& part,
                        Culling culling, int threads) {
  const glm::dmat4 from_eye_relative = clip_from_world(view, view.eye);
  const auto matrix_of = [&](std::uint32_t instance) {
    return clip_from_mesh(scene.instances[instance], from_eye_relative, view.eye);
  };

  constexpr std::size_t kBatchPieces = 64;
  std::vector<Batch> batches((geometry.pieces.size() + kBatchPieces - 1) / kBatchPieces);
  const auto cull_batch = [&](std::size_t index) {
    const std::size_t first = index * kBatchPieces;
    const std::size_t count = std::min(kBatchPieces, geometry.pieces.size() - first);
    for (const Piece& piece : std::span(geometry.pieces).subspan(first, count)) {
      const glm::dmat4 matrix = matrix_of(piece.instance);
      if (drawable(matrix)) cull_piece(geometry, piece, Culler(matrix, view, part), part, culling, batches[index]);
    }
  };
  // Starting threads costs more than a few batches.
  parallel_for(batches.size() > 8 ? threads : 1, batches.size(), cull_batch);

  Batch all;
  DrawList list;
  for (const Batch& batch : batches) {
    for (const Run& run : batch.runs) append(all, run);
    list.pixels = joined(list.pixels, batch.pixels);
    list.triangles_drawn += batch.triangles;
    list.chunks_drawn += batch.chunks;
  }
  for (const Piece& piece : geometry.pieces) {
    list.triangles_culled += piece.last - piece.first;
    list.chunks_culled += piece.chunks;
  }
  list.triangles_culled -= list.triangles_drawn;
  list.chunks_culled -= list.chunks_drawn;

  list.commands.reserve(all.runs.size());
  list.records.reserve(all.runs.size());
  for (const Run& run : all.runs) {
    const auto record = static_cast<std::uint32_t>(list.records.size());
    list.commands.push_back({(run.last - run.first) * 3, 1, run.slot * 3, 0, record});
    list.records.push_back({rounded(matrix_of(run.instance)), scene.instances[run.instance].first_surface, {}});
  }
  return list;
}

}  // namespace hpr
