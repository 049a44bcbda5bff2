#include "engine/display/exposure.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <vector>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "engine/frame.h"
#include "engine/session.h"

namespace hpr {
namespace {

constexpr int kMantissaBits = 23;
constexpr int kBinBits = 3;
static_assert(1 << kBinBits == LuminanceHistogram::kBinsPerStop);
constexpr int kExponentBias = 127;

/// Of display primaries, IEC 61966-2-1.
float luminance(const Rgb& color) {
  return 0.2126F * color.r + 0.7152F * color.g + 0.0722F * color.b;
}

/// Those of a view's pixels that none of the screens it is joined to has, by the view's corner.
Rect own_pixels(const View& view) {
  if (!view.joined_part) return {0, 0, view.block.width(), view.block.height()};
  const Rect& own = view.joined_part->pixels;
  return {own.x0 - view.block.x0, own.y0 - view.block.y0, own.x1 - view.block.x0, own.y1 - view.block.y0};
}

/// The logarithm of the middle of a bin.
double stops_of(std::size_t bin) {
  const auto stop = static_cast<int>(bin) / LuminanceHistogram::kBinsPerStop;
  const auto part = static_cast<double>(bin % LuminanceHistogram::kBinsPerStop) + 0.5;
  return static_cast<double>(LuminanceHistogram::kMinStop + stop) +
         std::log2(1.0 + part / LuminanceHistogram::kBinsPerStop);
}

}  // namespace

void LuminanceHistogram::add(const Rgb& radiance) {
  const float value = luminance(radiance);
  if (!(value >= std::ldexp(1.0F, kMinStop))) return;
  // The exponent and the first bits of the mantissa count eighths of a factor of two.
  constexpr auto kFirst = std::uint32_t{kExponentBias + kMinStop} << kBinBits;
  const std::uint32_t bin = (std::bit_cast<std::uint32_t>(value) >> (kMantissaBits - kBinBits)) - kFirst;
  ++bins_[std::min<std::size_t>(bin, kBins - 1)];
}

LuminanceHistogram& LuminanceHistogram::operator+=(const LuminanceHistogram& other) {
  for (std::size_t i = 0; i < kBins; ++i) bins_[i] += other.bins_[i];
  return *this;
}

std::uint64_t LuminanceHistogram::pixels() const {
  return std::accumulate(bins_.begin(), bins_.end(), std::uint64_t{0});
}

std::optional<double> LuminanceHistogram::mean_stops() const {
  const std::uint64_t all = pixels();
  if (all == 0) return std::nullopt;
  const std::uint64_t cut = all / 20;
  double sum = 0.0;
  std::uint64_t before = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    const std::uint64_t first = std::max(before, cut);
    before += bins_[i];
    const std::uint64_t end = std::min(before, all - cut);
    if (end > first) sum += static_cast<double>(end - first) * stops_of(i);
  }
  return sum / static_cast<double>(all - 2 * cut);
}

double automatic_exposure(const LuminanceHistogram& histogram) {
  const std::optional<double> mean = histogram.mean_stops();
  if (!mean) return 0.0;
  const double grey = std::log2(0.18);
  return std::clamp(*mean, grey - kDarkStops, grey + kBrightStops) - *mean;
}

LuminanceHistogram measure_luminance(Session& session, const Frame& frame, std::span<const View> views) {
  const trace::Span span("measure luminance");
  const FrameLayout& layout = frame.radiance.layout();
  HPR_CHECK(views.size() == layout.screens());
  const TileLayer<float>* const alpha = frame.alpha();
  std::vector<LuminanceHistogram> of_tiles(frame.owned.size());
  parallel_for(session.threads(), frame.owned.size(), [&](std::size_t i) {
    const TilePlace location = layout.place(frame.owned[i]);
    const Rect counted = intersection(location.pixels, own_pixels(views[location.screen]));
    const std::span<const Rgb> pixels = frame.radiance.tile(frame.owned[i]);
    for (int y = counted.y0 - location.pixels.y0; y < counted.y1 - location.pixels.y0; ++y) {
      for (int x = counted.x0 - location.pixels.x0; x < counted.x1 - location.pixels.x0; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
        of_tiles[i].add(alpha == nullptr ? pixels[pixel]
                                         : unassociated(pixels[pixel], alpha->tile(frame.owned[i])[pixel]));
      }
    }
  });
  LuminanceHistogram mine;
  for (const LuminanceHistogram& of_tile : of_tiles) mine += of_tile;
  LuminanceHistogram all;
  for (const LuminanceHistogram& of_rank : all_gather_value(session.comm(), mine)) all += of_rank;
  return all;
}

DisplayTransform transform_for(Session& session, const Frame& frame, std::span<const View> views,
                               const DisplaySettings& settings) {
  if (settings.exposure_stops) return fixed_transform(settings);
  return {automatic_exposure(measure_luminance(session, frame, views)), settings.tone};
}

double SmoothExposure::next(double wanted_stops) {
  constexpr double kRate = 0.1;
  constexpr double kSeen = 1.0 / 256.0;  // stops; less is a fraction of a level
  const double before = stops_.value_or(wanted_stops);
  const double step = wanted_stops - before;
  stops_ = std::abs(step) < kSeen ? wanted_stops : before + kRate * step;
  return *stops_;
}

}  // namespace hpr
