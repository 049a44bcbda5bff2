#include "image/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "image/filter.h"

namespace hpr {
namespace {

/// Welford's recurrence: sums of squares would lose the spread of small values around a large mean.
class Spread {
 public:
  void add(double value) {
    const double off = value - mean_;
    mean_ += off / ++count_;
    squares_ += off * (value - mean_);
  }
  [[nodiscard]] double error_of_mean() const {
    return count_ < 2.0 ? std::numeric_limits<double>::quiet_NaN() : std::sqrt(squares_ / (count_ - 1.0) / count_);
  }

 private:
  double count_ = 0.0;
  double mean_ = 0.0;
  double squares_ = 0.0;
};

constexpr int kChannels = 3;
constexpr int kRadius = 5;

std::vector<double> gaussian_window() {
  std::vector<double> weights;
  for (int x = -kRadius; x <= kRadius; ++x) weights.push_back(std::exp(-0.5 * x * x / (1.5 * 1.5)));
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// Which of `count` pixels is seen at `index` when they are mirrored at both ends: ..1 0 | 0 1 2 | 2 1..
int reflected_index(int index, int count) {
  const int turn = ((index % (2 * count)) + 2 * count) % (2 * count);
  return turn < count ? turn : 2 * count - 1 - turn;
}

/// One channel of the pixels of `rect`, which may reach beyond the picture.
Image<double> channel_of(std::span<const float> picture, Size size, const Rect& rect, int channel) {
  Image<double> plane({rect.width(), rect.height()});
  for (int y = rect.y0; y < rect.y1; ++y) {
    const std::size_t row =
        static_cast<std::size_t>(reflected_index(y, size.height)) * static_cast<std::size_t>(size.width);
    for (int x = rect.x0; x < rect.x1; ++x) {
      const std::size_t pixel = row + static_cast<std::size_t>(reflected_index(x, size.width));
      const float value = picture[pixel * kChannels + static_cast<std::size_t>(channel)];
      plane.at(x - rect.x0, y - rect.y0) = static_cast<double>(value);
    }
  }
  return plane;
}

/// The sum of the index over the windows that lie whole in both planes.
double sum_over_windows(const Image<double>& a, const Image<double>& b, std::span<const double> window) {
  constexpr double kLuminance = 0.01 * 0.01;
  constexpr double kContrast = 0.03 * 0.03;
  const auto mean_of = [&](auto value) {
    Image<double> plane(a.size());
    for (std::size_t i = 0; i < plane.pixels().size(); ++i) plane.pixels()[i] = value(a.pixels()[i], b.pixels()[i]);
    return filter_columns(filter_rows(plane, window), window);
  };
  const Image<double> mean_a = mean_of([](double va, double) { return va; });
  const Image<double> mean_b = mean_of([](double, double vb) { return vb; });
  const Image<double> mean_squares = mean_of([](double va, double vb) { return va * va + vb * vb; });
  const Image<double> mean_product = mean_of([](double va, double vb) { return va * vb; });
  double sum = 0.0;
  for (std::size_t i = 0; i < mean_a.pixels().size(); ++i) {
    const double product = mean_a.pixels()[i] * mean_b.pixels()[i];
    const double squares = mean_a.pixels()[i] * mean_a.pixels()[i] + mean_b.pixels()[i] * mean_b.pixels()[i];
    const double covariance = mean_product.pixels()[i] - product;
    const double variances = mean_squares.pixels()[i] - squares;
    sum += (2.0 * product + kLuminance) * (2.0 * covariance + kContrast) /
           ((squares + kLuminance) * (variances + kContrast));
  }
  return sum;
}

}  // namespace

double difference_of(double a, double b) {
  if (a == b || (std::isnan(a) && std::isnan(b))) return 0.0;
  return std::isnan(a) || std::isnan(b) ? std::numeric_limits<double>::infinity() : a - b;
}

Difference summarize_differences(std::span<const double> differences, std::size_t channels) {
  HPR_CHECK(channels > 0 && differences.size() % channels == 0);
  Difference result;
  result.pixels = differences.size() / channels;
  double squares = 0.0;
  double sum = 0.0;
  Spread of_pixels;
  for (std::size_t pixel = 0; pixel < result.pixels; ++pixel) {
    double largest = 0.0;
    double pixel_sum = 0.0;
    for (const double difference : differences.subspan(pixel * channels, channels)) {
      squares += difference * difference;
      pixel_sum += difference;
      largest = std::max(largest, std::abs(difference));
    }
    if (largest > 0.0) ++result.differing;
    if (largest > result.max) {
      result.max = largest;
      result.worst = pixel;
    }
    sum += pixel_sum;
    of_pixels.add(pixel_sum / static_cast<double>(channels));
  }
  const double values = std::max<double>(1.0, static_cast<double>(differences.size()));
  result.rmse = std::sqrt(squares / values);
  result.mean = sum / values;
  result.mean_error = of_pixels.error_of_mean();
  result.psnr = result.rmse > 0.0 ? -20.0 * std::log10(result.rmse) : std::numeric_limits<double>::infinity();
  return result;
}

Difference compare_values(std::span<const float> image, std::span<const float> reference, std::size_t channels) {
  HPR_CHECK(image.size() == reference.size());
  std::vector<double> differences(image.size());
  std::ranges::transform(image, reference, differences.begin(), difference_of);
  return summarize_differences(differences, channels);
}

RelativeError relative_error(std::span<const float> image, std::span<const float> reference, std::size_t channels) {
  HPR_CHECK(channels > 0 && image.size() == reference.size() && image.size() % channels == 0);
  if (image.empty()) return {};
  if (!all_finite(image) || !all_finite(reference)) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    return {kNone, kNone};
  }
  std::vector<double> errors(image.size() / channels);
  for (std::size_t pixel = 0; pixel < errors.size(); ++pixel) {
    double brightness = 0.0;
    double squares = 0.0;
    for (std::size_t i = pixel * channels; i < (pixel + 1) * channels; ++i) {
      const double difference = static_cast<double>(image[i]) - static_cast<double>(reference[i]);
      brightness += static_cast<double>(reference[i]);
      squares += difference * difference;
    }
    const auto count = static_cast<double>(channels);
    brightness /= count;
    errors[pixel] = squares / count / (brightness * brightness + 0.01);
  }
  const auto mean_of = [](auto first, auto last) {
    return std::accumulate(first, last, 0.0) / static_cast<double>(last - first);
  };
  RelativeError result;
  result.all = mean_of(errors.begin(), errors.end());
  const auto kept = errors.end() - static_cast<std::ptrdiff_t>(errors.size() / 1000);
  if (kept != errors.end()) std::nth_element(errors.begin(), kept, errors.end());
  result.trimmed = mean_of(errors.begin(), kept);
  return result;
}

bool all_finite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

double ssim(std::span<const float> image, std::span<const float> reference, Size size, int threads) {
  HPR_CHECK(image.size() == size.area() * kChannels && reference.size() == image.size());
  if (size.area() == 0) return 1.0;
  if (!all_finite(image) || !all_finite(reference)) return std::numeric_limits<double>::quiet_NaN();

  const bool fits = std::min(size.width, size.height) > 2 * kRadius;
  const int margin = fits ? kRadius : 0;
  const Rect centres{margin, margin, size.width - margin, size.height - margin};
  const std::vector<double> window = gaussian_window();
  std::vector<double> sums(band_count(centres.height()));
  parallel_for(threads, sums.size(), [&](std::size_t band) {
    const int top = centres.y0 + static_cast<int>(band) * kBandRows;
    const int bottom = std::min(top + kBandRows, centres.y1);
    const Rect seen{centres.x0 - kRadius, top - kRadius, centres.x1 + kRadius, bottom + kRadius};
    for (int channel = 0; channel < kChannels; ++channel) {
      sums[band] +=
          sum_over_windows(channel_of(image, size, seen, channel), channel_of(reference, size, seen, channel), window);
    }
  });
  const double sum = std::accumulate(sums.begin(), sums.end(), 0.0);
  return std::min(1.0, sum / static_cast<double>(centres.area() * kChannels));  // rounding may take it past
}

}  // namespace hpr
