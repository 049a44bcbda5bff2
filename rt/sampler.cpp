#include "rt/sampler.h"

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

std::uint32_t scrambled(std::uint32_t x, std::uint32_t seed) {
  return reversed_bits(scrambled_reversed(reversed_bits(x), seed));
}

/// Sobol's second dimension: its generator matrix is Pascal's triangle modulo 2. The first is the reversal of bits.
std::uint32_t sobol_second(std::uint32_t index) {
  std::uint32_t value = 0;
  for (std::uint32_t column = 0x80000000U; index != 0; index >>= 1U, column ^= column >> 1U) {
    if ((index & 1U) != 0) value ^= column;
  }
  return value;
}

constexpr double kStep = 1.0 / 4294967296.0;

}  // namespace

double Sampler::one() {
  return two().x;
}

glm::dvec2 Sampler::two() {
  const std::uint64_t key = mixed(stream_ + 0x632BE59BD9B4E019U * ++drawn_);
  const std::uint64_t more = mixed(key);
  const std::uint32_t place = scrambled(index_, static_cast<std::uint32_t>(key));
  const std::uint32_t x = scrambled(reversed_bits(place), static_cast<std::uint32_t>(key >> 32U));
  const std::uint32_t y = scrambled(sobol_second(place), static_cast<std::uint32_t>(more));
  return {x * kStep, y * kStep};
}

Sampler Sampler::branch(std::uint32_t which) const {
  return {mixed(stream_ ^ mixed((std::uint64_t{which} << 32U) + drawn_ + 1)), index_};
}

std::uint64_t pixel_stream(const RandomKey& key, std::uint32_t screen, int x, int y) {
  const std::uint64_t frame = mixed(mixed(key.seed) ^ key.frame);
  const std::uint64_t place =
      (static_cast<std::uint64_t>(static_cast<std::uint32_t>(y)) << 32U) | static_cast<std::uint32_t>(x);
  return mixed(mixed(frame ^ (std::uint64_t{screen} + 1)) ^ place);
}

std::uint64_t photon_stream(const RandomKey& key) {
  return mixed(mixed(mixed(key.seed) ^ key.frame));
}

}  // namespace hpr
