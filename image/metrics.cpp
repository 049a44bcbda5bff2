#include "image/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace hpr {

Difference compare_values(std::span<const float> image, std::span<const float> reference, std::size_t channels) {
  HPR_CHECK(channels > 0 && image.size() == reference.size() && image.size() % channels == 0);
  Difference result;
  result.pixels = image.size() / channels;
  double squares = 0.0;
  double sum = 0.0;
  for (std::size_t pixel = 0; pixel < result.pixels; ++pixel) {
    bool differs = false;
    for (std::size_t i = pixel * channels; i < (pixel + 1) * channels; ++i) {
      const double a = image[i];
      const double b = reference[i];
      if (a == b || (std::isnan(a) && std::isnan(b))) continue;
      differs = true;
      const double difference = std::isnan(a) || std::isnan(b) ? std::numeric_limits<double>::infinity() : a - b;
      squares += difference * difference;
      sum += difference;
      result.max = std::max(result.max, std::abs(difference));
    }
    if (differs) ++result.differing;
  }
  const double values = std::max<double>(1.0, static_cast<double>(image.size()));
  result.rmse = std::sqrt(squares / values);
  result.mean = sum / values;
  result.psnr = result.rmse > 0.0 ? -20.0 * std::log10(result.rmse) : std::numeric_limits<double>::infinity();
  return result;
}

}  // namespace hpr
