#include "rt/passes/pixel_sums.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "rt/passes/path_vertex.h"

namespace hpr {
namespace {

Rgb to_rgb(const glm::dvec3& sum) {
  return {static_cast<float>(sum.r), static_cast<float>(sum.g), static_cast<float>(sum.b)};
}

bool is_finite(const Rgb& color) {
  if (std::isfinite(color.r + color.g + color.b)) return true;  // what is not finite makes the sum so
  return std::isfinite(color.r) && std::isfinite(color.g) && std::isfinite(color.b);
}

/// Calls `body` with each pixel of the tile that is lit.
template <typename Body>
void each_lit(const TileJob& job, const Body& body) {
  for (int y = job.rows.first; y < job.end_row(); ++y) {
    for (int x = 0; x < job.rect.width(); ++x) {
      const auto pixel = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
      if (job.wants(pixel)) body(pixel);
    }
  }
}

/// The pixels of the job's rows of a tile; past a screen's lower edge, those below its last row too.
template <typename Pixel>
std::span<Pixel> rows_of(const TileJob& job, std::span<Pixel> tile) {
  const auto first = static_cast<std::size_t>(job.rows.first) * kTileSide;
  const auto end =
      job.end_row() == job.rect.height() ? kTilePixels : static_cast<std::size_t>(job.rows.end) * kTileSide;
  return tile.subspan(first, end - first);
}

/// Counts a pixel whose radiance is no finite number, unless a neighbor that the screen is joined to counts it.
void count_not_finite(const TileJob& job, std::size_t pixel, RayCounts& counts) {
  const auto x = static_cast<int>(pixel % kTileSide);
  const auto y = static_cast<int>(pixel / kTileSide);
  const std::optional<ScreenPixel> own = own_pixel(*job.view, job.rect.x0 + x, job.rect.y0 + y);
  if (!own) return;
  ++counts.not_finite;
  counts.first_not_finite = std::min(counts.first_not_finite, *own);
}

/// Sets the sums of so many pixels, tile after tile, to 0 where they are wanted, everywhere when the mask is empty, and
/// those of the pixels of margins that follow.
template <typename Sum>
void clear_sums(std::vector<Sum>& sums, std::size_t pixels, std::size_t margins, std::span<const std::uint8_t> wanted) {
  if (wanted.empty()) {
    sums.assign(pixels + margins, Sum(0.0));
    return;
  }
  sums.resize(pixels + margins);
  std::fill(sums.begin() + static_cast<std::ptrdiff_t>(pixels), sums.end(), Sum(0.0));
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    if (wanted[pixel % kTilePixels] != 0) sums[pixel] = Sum(0.0);
  }
}

/// A tile's pixels, the job's rows of which are 0 unless a mask leaves some as they are.
template <typename Pixel>
std::span<Pixel> cleared(const TileJob& job, std::size_t tile, TileLayer<Pixel>& layer) {
  const std::span<Pixel> pixels = layer.tile(tile);
  if (job.wanted.empty()) std::ranges::fill(rows_of(job, pixels), Pixel{});
  return pixels;
}

}  // namespace

void PixelSums::clear(const TileJob& job, std::size_t tile, std::span<const ShadedSample> samples,
                      const WantedSums& wants) {
  const LightOutput& output = samples.front().output;  // all want the same
  wants_components = wants.all_components ||
                     std::ranges::any_of(output.components, [](const auto* layer) { return layer != nullptr; });
  wants_diffuse = wants.diffuse;
  wants_cost = wants.cost || output.cost != nullptr;
  wants_coverage = output.coverage != nullptr;
  const std::span<const std::uint8_t> wanted = job.wanted;
  const std::size_t pixels = (samples.size() + (wants.diffuse ? 1 : 0)) * kTilePixels;
  const std::size_t margins = wants.margins * kTilePixels;
  clear_sums(radiance, pixels, margins, wanted);
  if (wants_diffuse) clear_sums(diffuse, pixels, margins, wanted);
  for (std::size_t i = 0; wants_components && i < kComponents; ++i) {
    clear_sums(components.at(i), pixels, margins, wanted);
    if (wants_diffuse) clear_sums(diffuse_components.at(i), pixels, margins, wanted);
  }
  if (wants_diffuse) distance.assign(pixels + margins, std::numeric_limits<float>::infinity());
  if (wants_cost) cost.assign(pixels + margins, 0.0F);
  if (wants_coverage) clear_sums(uncovered, pixels, margins, wanted);
  for (const ShadedSample& sample : samples) {
    for (TileLayer<Rgb>* layer : {sample.output.normal, sample.output.albedo}) {
      if (layer != nullptr) std::ranges::fill(rows_of(job, layer->tile(tile)), Rgb{});
    }
  }
}

bool fits_floats(const glm::dvec3& light) {
  return is_finite(to_rgb(light));
}

void PixelSums::store(const TileJob& job, std::size_t tile, const LightOutput& output, RayCounts& counts) const {
  const auto start = [&](auto* layer) { return cleared(job, tile, *layer); };
  const auto colors = start(output.radiance);
  const std::size_t first = job.first_pixel;
  each_lit(job, [&](std::size_t i) {
    const Rgb color = to_rgb(radiance[first + i]);
    colors[i] = is_finite(color) ? color : Rgb{};
    if (!is_finite(color)) count_not_finite(job, i, counts);
  });
  for (std::size_t part = 0; part < kComponents; ++part) {
    if (output.components.at(part) == nullptr) continue;
    const auto pixels = start(output.components.at(part));
    each_lit(job, [&](std::size_t i) {
      const Rgb color = to_rgb(components[part][first + i]);
      if (is_finite(color) && is_finite(to_rgb(radiance[first + i]))) pixels[i] = color;
    });
  }
  if (output.cost != nullptr) {
    const auto pixels = start(output.cost);
    each_lit(job, [&](std::size_t i) { pixels[i] = cost[first + i]; });
  }
  if (output.coverage != nullptr) {
    const auto pixels = start(output.coverage);
    each_lit(job, [&](std::size_t i) { pixels[i] = static_cast<float>(1.0 - uncovered[first + i]); });
  }
}

void store_shaded(const TileJob& job, std::size_t tile, std::span<const glm::vec4> pixels, const LightOutput& output,
                  RayCounts& counts) {
  const std::span<Rgb> colors = cleared(job, tile, *output.radiance);
  each_lit(job, [&](std::size_t i) {
    const Rgb color{pixels[i].r, pixels[i].g, pixels[i].b};
    colors[i] = is_finite(color) ? color : Rgb{};
    if (!is_finite(color)) count_not_finite(job, i, counts);
  });
  if (output.coverage == nullptr) return;
  const std::span<float> covered = cleared(job, tile, *output.coverage);
  each_lit(job, [&](std::size_t i) { covered[i] = pixels[i].a; });
}

void add_first_surfaces(const std::vector<PathVertex>& points, std::size_t tile, const LightOutput& output) {
  for (TileLayer<Rgb>* layer : {output.normal, output.albedo}) {
    if (layer == nullptr) continue;
    const auto pixels = layer->tile(tile);
    for (const PathVertex& point : points) {
      const glm::dvec3 value = layer == output.normal ? point.material.normal : point.material.base_color;
      const Rgb part = to_rgb(point.coverage * value);
      Rgb& sum = pixels[point.pixel % kTilePixels];
      sum = {sum.r + part.r, sum.g + part.g, sum.b + part.b};
    }
  }
}

void set_active(const LightOutput& output, std::size_t tile) {
  const auto activate = [&](auto* layer) {
    if (layer != nullptr) layer->set_active(tile);
  };
  activate(output.radiance);
  for (TileLayer<Rgb>* layer : output.components) activate(layer);
  activate(output.normal);
  activate(output.albedo);
  activate(output.cost);
  activate(output.coverage);
}

}  // namespace hpr
