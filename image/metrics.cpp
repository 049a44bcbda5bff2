#include "image/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "core/error.h"

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

}  // namespace hpr
