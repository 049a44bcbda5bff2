#include "image/convolve.h"

#include <algorithm>
#include <array>

namespace hpr {
namespace {

/// out[x] = sum over i of weights[i] in[x + i * step]
template <typename Real>
void weighted_sums(std::span<const Real> in, std::size_t step, std::span<const Real> weights, std::span<Real> out) {
  HPR_CHECK(in.size() >= out.size() + (weights.size() - 1) * step);
  // The sums of a block stay in registers while the weights pass by.
  constexpr std::size_t kBlock = 16;
  std::size_t x = 0;
  for (; x + kBlock <= out.size(); x += kBlock) {
    std::array<Real, kBlock> sums{};
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const Real* const from = &in[x + i * step];
      for (std::size_t lane = 0; lane < kBlock; ++lane) sums[lane] += weights[i] * from[lane];
    }
    std::ranges::copy(sums, out.begin() + static_cast<std::ptrdiff_t>(x));
  }
  for (; x < out.size(); ++x) {
    Real sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] * in[x + i * step];
    out[x] = sum;
  }
}

}  // namespace

template <typename Real>
Image<Real> filter_rows(const Image<Real>& in, std::span<const Real> weights) {
  const int width = in.width() - static_cast<int>(weights.size()) + 1;
  HPR_CHECK(!weights.empty() && width > 0);
  Image<Real> out({width, in.height()});
  for (int y = 0; y < in.height(); ++y) weighted_sums<Real>(in.row(y), 1, weights, out.row(y));
  return out;
}

template <typename Real>
Image<Real> filter_columns(const Image<Real>& in, std::span<const Real> weights) {
  const int height = in.height() - static_cast<int>(weights.size()) + 1;
  HPR_CHECK(!weights.empty() && height > 0);
  Image<Real> out({in.width(), height});
  const auto width = static_cast<std::size_t>(in.width());
  for (int y = 0; y < height; ++y) {
    const std::span<const Real> below = in.pixels().subspan(static_cast<std::size_t>(y) * width);
    weighted_sums<Real>(below, width, weights, out.row(y));
  }
  return out;
}

template Image<float> filter_rows(const Image<float>&, std::span<const float>);
template Image<float> filter_columns(const Image<float>&, std::span<const float>);
template Image<double> filter_rows(const Image<double>&, std::span<const double>);
template Image<double> filter_columns(const Image<double>&, std::span<const double>);

}  // namespace hpr
