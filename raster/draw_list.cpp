#include "raster/draw_list.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <span>

#include "core/parallel.h"

namespace hpr {
namespace {

/// Rounding of the matrix to float, four products and three sums, and an interpolation between two such results at each
/// of six clip planes: less than 32 times half a float's step, of the largest magnitude involved. Twice that is taken.
constexpr double kFloatError = 64.0 / 16777216.0;

/// Pixels by which GL's snapping to sub-pixels and its viewport transform in float may move a vertex, and more.
constexpr double kPixelMargin = 1.0;

glm::dvec4 row_of(const glm::dmat4& matrix, int row) {
  return {matrix[0][row], matrix[1][row], matrix[2][row], matrix[3][row]};
}

struct CenterHalf {
  glm::dvec4 center{0.0, 0.0, 0.0, 1.0};
  glm::dvec4 half{0.0};
  glm::dvec4 largest{0.0, 0.0, 0.0, 1.0};  ///< |position| at most, and 1
};

CenterHalf center_half(const Box& box) {
  const glm::dvec3 low(box.low);
  const glm::dvec3 high(box.high);
  return {glm::dvec4(0.5 * (low + high), 1.0), glm::dvec4(0.5 * (high - low), 0.0),
          glm::dvec4(glm::max(glm::abs(low), glm::abs(high)), 1.0)};
}

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

std::array<float, 16> rounded(const glm::dmat4& matrix) {
  std::array<float, 16> result{};
  for (std::size_t i = 0; i < 16; ++i) {
    result.at(i) = static_cast<float>(matrix[static_cast<int>(i / 4)][static_cast<int>(i % 4)]);
  }
  return result;
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

/// Whether merged ranges have any surface of [first, last).
bool meets(const std::vector<SurfaceRange>& ranges, std::uint32_t first, std::uint32_t last) {
  const auto range =
      std::ranges::upper_bound(ranges, first, {}, [](const SurfaceRange& candidate) { return candidate.last; });
  return range != ranges.end() && range->first < last;
}

void cull_piece(const Geometry& geometry, const Piece& piece, const Culler& culler, const Rect& part, Culling culling,
                const std::vector<SurfaceRange>* only, std::uint32_t first_surface, Batch& batch) {
  const bool cull = culling == Culling::Chunks;
  if (cull && culler.outside(piece.box)) return;
  const bool all = !cull || culler.inside(piece.box);
  if (!cull) batch.pixels = part;
  const bool by_chunk = !all || only != nullptr;  // of a piece of which not all is drawn
  if (!by_chunk && !contains(batch.pixels, part)) batch.pixels = joined(batch.pixels, culler.pixels(piece.box));
  for (const Chunk& chunk : std::span(geometry.chunks).subspan(piece.first_chunk, piece.chunks)) {
    const std::uint32_t first = std::max(chunk.first, piece.first);
    const std::uint32_t last = std::min(chunk.first + chunk.count, piece.last);
    if (only != nullptr && !meets(*only, first_surface + first, first_surface + last)) continue;
    if (!all && culler.outside(chunk.box)) continue;
    if (by_chunk && !contains(batch.pixels, part)) batch.pixels = joined(batch.pixels, culler.pixels(chunk.box));
    append(batch, {piece.instance, first, last, chunk.slot + (first - chunk.first)});
    batch.triangles += last - first;
    ++batch.chunks;
  }
}

Winding winding_of(const Scene& scene, const Instance& instance) {
  if (shows_both_sides(scene.materials[scene.mesh_of(instance).material])) return Winding::Any;
  return is_mirrored(instance) ? Winding::Clockwise : Winding::Counterclockwise;
}

/// Adds the last command of the list to its spans.
void append_span(DrawList& list, Winding winding) {
  if (list.spans.empty() || list.spans.back().winding != winding) {
    list.spans.push_back({winding, list.commands.size() - 1, 0});
  }
  ++list.spans.back().count;
}

}  // namespace

Culler::Culler(const glm::dmat4& clip_from_mesh, const View& view, const Rect& part)
    : part_(part), size_(view.size()), near_(view.orthographic ? 0.0 : view.near_distance), matrix_(clip_from_mesh) {
  const glm::dvec4 x = row_of(matrix_, 0);
  const glm::dvec4 y = row_of(matrix_, 1);
  const glm::dvec4 z = row_of(matrix_, 2);
  const glm::dvec4 w = row_of(matrix_, 3);
  for (int row = 0; row < 4; ++row)
    row_error_[static_cast<std::size_t>(row)] = kFloatError * glm::abs(row_of(matrix_, row));

  // The part's edges in normalized device coordinates, a margin further out; y points up there.
  const double left = 2.0 * (part.x0 - kPixelMargin) / size_.width - 1.0;
  const double right = 2.0 * (part.x1 + kPixelMargin) / size_.width - 1.0;
  const double top = 1.0 - 2.0 * (part.y0 - kPixelMargin) / size_.height;
  const double bottom = 1.0 - 2.0 * (part.y1 + kPixelMargin) / size_.height;
  planes_ = {x - left * w, right * w - x, y - bottom * w, top * w - y, w - z, z};
  const auto error_of = [&](std::size_t row, double edge) { return row_error_[row] + std::abs(edge) * row_error_[3]; };
  error_ = {error_of(0, left), error_of(0, right), error_of(1, bottom),
            error_of(1, top),  error_of(2, 1.0),   error_of(2, 0.0)};
}

bool Culler::outside(const Box& box) const {
  const CenterHalf b = center_half(box);
  bool outside_part = false;
  for (std::size_t i = 0; i < kPlanes; ++i) {
    const double most = glm::dot(planes_[i], b.center) + glm::dot(glm::abs(planes_[i]), b.half);
    if (most >= -glm::dot(error_[i], b.largest)) continue;
    if (i >= kNear) return true;  // GL drops it whole, wherever it lies
    outside_part = true;
  }
  return outside_part && !near_breaks_down(box);
}

bool Culler::inside(const Box& box) const {
  const CenterHalf b = center_half(box);
  for (std::size_t i = 0; i < kPlanes; ++i) {
    const double min_distance = glm::dot(planes_[i], b.center) - glm::dot(glm::abs(planes_[i]), b.half);
    if (!(min_distance > glm::dot(error_[i], b.largest))) return false;
  }
  return true;
}

bool Culler::near_breaks_down(const Box& box) const {
  if (near_ == 0.0) return false;
  const CenterHalf b = center_half(box);
  const double min_distance = glm::dot(planes_[kNear], b.center) - glm::dot(glm::abs(planes_[kNear]), b.half);
  const double error = glm::dot(row_error_[3], b.largest);
  return min_distance <= error && error >= 0.25 * near_;
}

Rect Culler::pixels(const Box& box) const {
  const CenterHalf b = center_half(box);
  const double near_min = glm::dot(planes_[kNear], b.center) - glm::dot(glm::abs(planes_[kNear]), b.half);
  if (near_ != 0.0 && !(near_min > glm::dot(error_[kNear], b.largest))) return part_;

  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double w_min = kInfinity;
  glm::dvec2 low(kInfinity);
  glm::dvec2 high(-kInfinity);
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 sign((corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0,
                          (corner & 4) != 0 ? 1.0 : -1.0, 0.0);
    const glm::dvec4 clip = matrix_ * (b.center + sign * b.half);
    w_min = std::min(w_min, clip.w);
    const glm::dvec2 ndc(clip.x / clip.w, clip.y / clip.w);
    low = glm::min(low, ndc);
    high = glm::max(high, ndc);
  }
  const glm::dvec2 max_abs = glm::max(glm::abs(low), glm::abs(high));
  const glm::dvec2 rounding(glm::dot(row_error_[0], b.largest), glm::dot(row_error_[1], b.largest));
  const double w_error = glm::dot(row_error_[3], b.largest);
  if (!(w_error < 0.5 * w_min)) return part_;
  const glm::dvec2 slack = 2.0 * (rounding + max_abs * w_error) / w_min;
  low -= slack;
  high += slack;

  const auto pixel = [](double value, int from, int to) {
    return static_cast<int>(std::clamp(value, static_cast<double>(from), static_cast<double>(to)));
  };
  const double half_width = 0.5 * size_.width;
  const double half_height = 0.5 * size_.height;
  return {pixel(std::floor((low.x + 1.0) * half_width - kPixelMargin), part_.x0, part_.x1),
          pixel(std::floor((1.0 - high.y) * half_height - kPixelMargin), part_.y0, part_.y1),
          pixel(std::ceil((high.x + 1.0) * half_width + kPixelMargin), part_.x0, part_.x1),
          pixel(std::ceil((1.0 - low.y) * half_height + kPixelMargin), part_.y0, part_.y1)};
}

namespace {

/// The matrix of an instance for vertices in mesh coordinates. Everything is taken relative to the eye in double before
/// it is rounded, so that a large common offset of scene and eye costs nothing.
glm::dmat4 clip_from_mesh(const Instance& instance, const glm::dmat4& clip_from_eye_relative, const glm::dvec3& eye) {
  glm::dmat4 to_eye_relative = instance.to_world;
  to_eye_relative[3] -= glm::dvec4(eye, 0.0);
  return clip_from_eye_relative * to_eye_relative;
}

bool drawable(const glm::dmat4& matrix) {
  constexpr double kMaxElement = 1e30;  // leaves room for the product with a position
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      if (!(std::abs(matrix[column][row]) < kMaxElement)) return false;
    }
  }
  return true;
}

}  // namespace

std::optional<glm::dmat4> drawable_matrix(const Instance& instance, const glm::dmat4& clip_from_eye_relative,
                                          const glm::dvec3& eye) {
  const glm::dmat4 matrix = clip_from_mesh(instance, clip_from_eye_relative, eye);
  return drawable(matrix) ? std::optional(matrix) : std::nullopt;
}

DrawList make_draw_list(const Scene& scene, const Geometry& geometry, std::span<const Piece> pieces, const View& view,
                        const Rect& part, Culling culling, int threads, const std::vector<SurfaceRange>* only) {
  const glm::dmat4 from_eye_relative = clip_from_world(view, view.eye);

  constexpr std::size_t kBatchPieces = 64;
  std::vector<Batch> batches((pieces.size() + kBatchPieces - 1) / kBatchPieces);
  const auto cull_batch = [&](std::size_t index) {
    const std::size_t first = index * kBatchPieces;
    const std::size_t count = std::min(kBatchPieces, pieces.size() - first);
    for (const Piece& piece : pieces.subspan(first, count)) {
      const std::uint32_t first_surface = scene.instances[piece.instance].first_surface;
      if (only != nullptr && !meets(*only, first_surface + piece.first, first_surface + piece.last)) continue;
      const auto matrix = drawable_matrix(scene.instances[piece.instance], from_eye_relative, view.eye);
      if (!matrix) continue;
      cull_piece(geometry, piece, Culler(*matrix, view, part), part, culling, only, first_surface, batches[index]);
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
  for (const Piece& piece : pieces) {
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
    const Instance& instance = scene.instances[run.instance];
    list.records.push_back(
        {rounded(clip_from_mesh(instance, from_eye_relative, view.eye)), instance.first_surface, {}});
    append_span(list, winding_of(scene, instance));
  }
  return list;
}

std::vector<DrawList> split_list(DrawList list, std::size_t count) {
  const std::uint64_t triangles = list.triangles_drawn;
  count = std::min<std::size_t>(count, triangles);
  std::vector<DrawList> lists;
  if (count <= 1) {
    lists.push_back(std::move(list));
    return lists;
  }
  lists.resize(count);
  std::uint64_t done = 0;
  for (const DrawSpan& span : list.spans) {
    for (std::size_t i = span.first; i < span.first + span.count; ++i) {
      DrawCommand rest = list.commands[i];
      while (rest.count > 0) {
        const std::uint64_t number = done * count / triangles;  // of the list that the next triangle is in
        const std::uint64_t end = ((number + 1) * triangles + count - 1) / count;
        DrawList& part = lists[number];
        DrawCommand command = rest;
        command.count = static_cast<std::uint32_t>(std::min<std::uint64_t>(rest.count, 3 * (end - done)));
        command.base_instance = static_cast<std::uint32_t>(part.records.size());
        part.commands.push_back(command);
        part.records.push_back(list.records[rest.base_instance]);
        append_span(part, span.winding);
        done += command.count / 3;
        rest.first_index += command.count;
        rest.count -= command.count;
      }
    }
  }
  for (DrawList& part : lists) part.pixels = list.pixels;
  lists.front().triangles_drawn = list.triangles_drawn;
  lists.front().triangles_culled = list.triangles_culled;
  lists.front().chunks_drawn = list.chunks_drawn;
  lists.front().chunks_culled = list.chunks_culled;
  return lists;
}

}  // namespace hpr
