#include "rt/passes/tile_margin.h"

#include <algorithm>
#include <array>

namespace hpr {
namespace {

/// A strip before, along or after a tile in one direction.
struct Span {
  int first = 0;
  int end = 0;
};

/// The spans before, along and after; empty where the screen does not go on, and where another tile of the block
/// follows unless filters go on across tiles.
std::array<Span, 3> spans_of(int first, int end, int block_first, int block_end, int screen, int reach,
                             bool across_tiles) {
  std::array<Span, 3> spans{Span{}, {first, end}, Span{}};
  if (across_tiles || first == 0) spans[0] = {std::max(first - reach, -block_first), first};
  if (across_tiles || end == block_end - block_first) spans[2] = {end, std::min(end + reach, screen - block_first)};
  return spans;
}

/// The rectangles about a tile, row by row, relative to its block.
std::vector<Rect> rects_about(const TileJob& job, int reach, bool across_tiles) {
  const View& view = *job.view;
  const auto columns =
      spans_of(job.rect.x0, job.rect.x1, view.block.x0, view.block.x1, view.screen.width, reach, across_tiles);
  const auto rows =
      spans_of(job.rect.y0, job.rect.y1, view.block.y0, view.block.y1, view.screen.height, reach, across_tiles);
  std::vector<Rect> rects;
  for (const Span& row : rows) {
    for (const Span& column : columns) {
      const Rect rect{column.first, row.first, column.end, row.end};
      if (!rect.empty() && rect != job.rect) rects.push_back(rect);
    }
  }
  return rects;
}

}  // namespace

std::size_t TileMargin::count(const TileJob& job, bool across_tiles) {
  return rects_about(job, 1, across_tiles).size();
}

void TileMargin::find(const LightContext& context, const TileJob& job, int reach, std::uint32_t first_pixel,
                      RayBuffers& buffers) {
  strips_.clear();
  const std::vector<Rect> rects = rects_about(job, reach, context.settings.filter_across_tiles);
  keys_.assign(rects.size() * kTilePixels, kNoKey);
  buffers.requests.clear();
  for (std::size_t i = 0; i < rects.size(); ++i) {
    TileJob& strip = strips_.emplace_back(job);
    strip.rect = rects[i];
    strip.keys = std::span(keys_).subspan(i * kTilePixels, kTilePixels);
    strip.first_pixel = first_pixel + static_cast<std::uint32_t>(i * kTilePixels);
    strip.wanted = {};
    for (int y = 0; y < strip.rect.height(); ++y) {
      for (int x = 0; x < strip.rect.width(); ++x) {
        buffers.requests.push_back(eye_ray(*job.view, strip, x + 0.5, y + 0.5));
      }
    }
  }
  buffers.hits.resize(buffers.requests.size());
  buffers.counts.primary += buffers.requests.size();
  buffers.scratch.batch.purpose = {RayKind::Primary};
  buffers.counts.invalid +=
      context.rays->closest_opaque(buffers.requests, buffers.hits, buffers.scratch, Coherence::High);
  auto hit = buffers.hits.begin();
  for (std::size_t i = 0; i < strips_.size(); ++i) {
    for (int y = 0; y < strips_[i].rect.height(); ++y) {
      for (int x = 0; x < strips_[i].rect.width(); ++x, ++hit) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
        if (*hit != kNoSurface) keys_[i * kTilePixels + pixel] = make_key(1.0F, *hit);  // nobody reads the depth
      }
    }
  }
}

}  // namespace hpr
