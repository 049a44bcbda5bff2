#pragma once

#include <compare>
#include <cstdint>
#include <glm/vec2.hpp>

namespace hpr {

/// A pixel of a screen, counted from its upper left corner.
struct ScreenPixel {
  std::uint32_t screen = 0xFFFFFFFFU;
  std::int32_t y = 0;
  std::int32_t x = 0;

  // NOLINTNEXTLINE(modernize-use-nullptr): the check takes the 0 that orderings are compared with for a pointer
  auto operator<=>(const ScreenPixel&) const = default;
};
/// None: behind all others.
inline constexpr ScreenPixel kNoPixel{};

/// One sample's random numbers: an Owen-scrambled Sobol' sequence in two dimensions, padded with freshly scrambled and
/// shuffled copies for every further pair (Burley, "Practical Hash-based Owen Scrambling", JCGT 2020). A number depends
/// on the stream, the sample's index and how many numbers were drawn before; on nothing else.
class Sampler {
 public:
  Sampler() = default;
  /// `stream` says whose numbers these are (see pixel_stream); `index` is the sample: those of one stream are spread
  /// evenly together.
  Sampler(std::uint64_t stream, std::uint32_t index) : stream_(stream), index_(index) {}

  /// In [0, 1), on a grid of 2^-32.
  [[nodiscard]] double one();
  [[nodiscard]] glm::dvec2 two();

  /// Pairs of one sequence in four dimensions (Sobol'; direction numbers of Joe and Kuo, "Constructing Sobol Sequences
  /// with Better Two-Dimensional Projections", 2008), scrambled by stream: where in the pixel a sample lies, and what
  /// chance decides next. Who integrates over both has them spread evenly together, which copies of two dimensions are
  /// not. Of the second pair a path uses one at the most where choices follow one another; alternatives may each have
  /// theirs.
  [[nodiscard]] glm::dvec2 two_of_pixel();
  [[nodiscard]] glm::dvec2 two_with_pixel();

  /// A sampler for one of the ways a path goes on from here, whose numbers have nothing to do with those drawn here.
  [[nodiscard]] Sampler branch(std::uint32_t which) const;
  /// As it was before the first draw.
  [[nodiscard]] Sampler restarted() const { return {stream_, index_}; }

 private:
  [[nodiscard]] std::uint64_t next_key();

  std::uint64_t stream_ = 0;
  std::uint32_t index_ = 0;
  std::uint32_t drawn_ = 0;
};

/// What decides after so many bounces from the eye: at the first surface spread evenly together with the places in the
/// pixel.
[[nodiscard]] inline glm::dvec2 next_two(Sampler& sampler, int bounces) {
  return bounces == 0 ? sampler.two_with_pixel() : sampler.two();
}

/// Whether a path passes a surface of partial coverage: drawn only where it is partial.
[[nodiscard]] inline bool passes_by_chance(double coverage, Sampler& sampler) {
  return coverage < 1.0 && !(sampler.one() < coverage);
}

/// What all randomness of a frame starts from.
struct RandomKey {
  std::uint64_t seed = 1;
  std::uint64_t frame = 0;

  bool operator==(const RandomKey&) const = default;
};

/// Which of a frame's samples is taken: each draws random numbers of its own, and those of one frame are spread evenly.
struct SampleNumber {
  std::uint64_t frame = 0;
  std::uint32_t sample = 0;

  bool operator==(const SampleNumber&) const = default;
};

/// What the streams of a frame's pixels are made from.
[[nodiscard]] std::uint64_t frame_stream(const RandomKey& key);

/// The stream of a pixel: x and y count from the upper left corner of its whole screen, so that neither tiles, nor
/// blocks, nor ranks change it.
[[nodiscard]] std::uint64_t pixel_stream(const RandomKey& key, std::uint32_t screen, int x, int y);

/// The stream of a photon, which is one sample of it.
[[nodiscard]] std::uint64_t photon_stream(const RandomKey& key);

}  // namespace hpr
