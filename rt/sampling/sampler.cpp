#include "rt/sampling/sampler.h"

#include <array>
#include <bit>
#include <cstddef>

namespace hpr {
namespace {

/// Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014: the finaliser of SplitMix64.
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

std::uint32_t reversed_bits(std::uint32_t x) {
  x = __builtin_bswap32(x);
  x = ((x & 0x0F0F0F0FU) << 4U) | ((x >> 4U) & 0x0F0F0F0FU);
  x = ((x & 0x33333333U) << 2U) | ((x >> 2U) & 0x33333333U);
  return ((x & 0x55555555U) << 1U) | ((x >> 1U) & 0x55555555U);
}

/// A nested uniform scramble of a number whose bits stand reversed: each bit is flipped by a hash of those below it.
/// The permutation is Laine and Karras's with the constants Vegdahl found to be better.
std::uint32_t scrambled_reversed(std::uint32_t x, std::uint32_t seed) {
  x ^= x * 0x3D20ADEAU;
  x += seed;
  x *= (seed >> 16U) | 1U;
  x ^= x * 0x05526C56U;
  x ^= x * 0x53A22864U;
  return x;
}

/// Sobol's second dimension with its bits reversed: its generator matrix is Pascal's triangle modulo 2, and i choose j
/// is odd where the bits of j are among those of i (Lucas), so bit j is the sum of all bits whose number holds j's.
std::uint32_t sobol_second_reversed(std::uint32_t index) {
  index ^= (index >> 1U) & 0x55555555U;
  index ^= (index >> 2U) & 0x33333333U;
  index ^= (index >> 4U) & 0x0F0F0F0FU;
  index ^= (index >> 8U) & 0x00FF00FFU;
  return index ^ (index >> 16U);
}

/// A dimension's generator matrix, its bits reversed: column k says which bits of the number bit k of the index flips.
using ReversedMatrix = std::array<std::uint32_t, 32>;

/// The generator matrix of the primitive polynomial of `degree` with the inner coefficients `inner`, from its first
/// direction numbers.
constexpr ReversedMatrix matrix_of(unsigned int degree, std::uint32_t inner, std::array<std::uint32_t, 3> first) {
  std::array<std::uint32_t, 32> m{};
  ReversedMatrix columns{};
  for (unsigned int k = 0; k < 32; ++k) {
    if (k < degree) {
      m.at(k) = first.at(k);
    } else {
      m.at(k) = m.at(k - degree) ^ (m.at(k - degree) << degree);
      for (unsigned int i = 1; i < degree; ++i) {
        if ((inner >> (degree - 1 - i) & 1U) != 0) m.at(k) ^= m.at(k - i) << i;
      }
    }
    // Bit j of m_k stands for 2^(j - k - 1) of the unit interval: reversed, that is bit k - j.
    for (unsigned int j = 0; j <= k; ++j) columns.at(k) |= (m.at(k) >> j & 1U) << (k - j);
  }
  return columns;
}

constexpr ReversedMatrix kThird = matrix_of(2, 1, {1, 3, 0});
constexpr ReversedMatrix kFourth = matrix_of(3, 1, {1, 3, 1});

std::uint32_t sobol_reversed(const ReversedMatrix& matrix, std::uint32_t index) {
  std::uint32_t number = 0;
  for (; index != 0; index &= index - 1) number ^= matrix[static_cast<std::size_t>(std::countr_zero(index))];
  return number;
}

constexpr double kStep = 1.0 / 4294967296.0;

/// Where the index goes in the order of points of this draw.
std::uint32_t shuffled(std::uint32_t index, std::uint64_t key) {
  return reversed_bits(scrambled_reversed(reversed_bits(index), static_cast<std::uint32_t>(key)));
}

double scrambled(std::uint32_t reversed, std::uint32_t seed) {
  return reversed_bits(scrambled_reversed(reversed, seed)) * kStep;
}

/// Two dimensions of a number of the sequence, each scrambled in its own way.
glm::dvec2 scrambled(std::uint32_t reversed_x, std::uint32_t reversed_y, std::uint64_t key) {
  return {scrambled(reversed_x, static_cast<std::uint32_t>(key >> 32U)),
          scrambled(reversed_y, static_cast<std::uint32_t>(mixed(key)))};
}

constexpr std::uint64_t kPixelOrder = 0x5851F42DU;

/// What two_with_pixel() scrambles.
struct SecondPair {
  std::uint32_t index;
  std::uint32_t third;
  std::uint32_t fourth;

  explicit SecondPair(std::uint32_t of_index)
      : index(of_index),
        third(sobol_reversed(kThird, shuffled(index, kPixelOrder))),
        fourth(sobol_reversed(kFourth, shuffled(index, kPixelOrder))) {}
};

}  // namespace

// Sobol's first dimension is the index with its bits reversed.
double Sampler::one() {
  const std::uint64_t key = next_key();
  return scrambled(shuffled(index_, key), static_cast<std::uint32_t>(key >> 32U));
}

glm::dvec2 Sampler::two() {
  const std::uint64_t key = next_key();
  const std::uint32_t index = shuffled(index_, key);
  return scrambled(index, sobol_second_reversed(index), key);
}

// One order for both pairs, so that they belong together; none in which every other sample lies in the same half of the
// pixel, as whoever compares even samples with odd ones would take that for noise.
glm::dvec2 Sampler::two_of_pixel() {
  const std::uint32_t index = shuffled(index_, kPixelOrder);
  return scrambled(index, sobol_second_reversed(index), next_key());
}

glm::dvec2 Sampler::two_with_pixel() {
  // Before it is scrambled, a sample's pair is the same for all pixels.
  static thread_local SecondPair last(0);
  if (last.index != index_) last = SecondPair(index_);
  return scrambled(last.third, last.fourth, next_key());
}

std::uint64_t Sampler::next_key() {
  return mixed(stream_ + 0x632BE59BD9B4E019U * ++drawn_);
}

Sampler Sampler::branch(std::uint32_t which) const {
  return {mixed(stream_ ^ mixed((std::uint64_t{which} << 32U) + drawn_ + 1)), index_};
}

std::uint64_t frame_stream(const RandomKey& key) {
  return mixed(mixed(key.seed) ^ key.frame);
}

std::uint64_t pixel_stream(const RandomKey& key, std::uint32_t screen, int x, int y) {
  const std::uint64_t position =
      (static_cast<std::uint64_t>(static_cast<std::uint32_t>(y)) << 32U) | static_cast<std::uint32_t>(x);
  return mixed(mixed(frame_stream(key) ^ (std::uint64_t{screen} + 1)) ^ position);
}

std::uint64_t photon_stream(const RandomKey& key) {
  return mixed(frame_stream(key));
}

}  // namespace hpr
