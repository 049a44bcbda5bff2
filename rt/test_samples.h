#pragma once

namespace hpr::test {

/// Sanitizers make tests of means five times as slow, and what they look for shows in few samples as well: there, such
/// tests take a sixteenth of their samples and allow for four times the noise.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr unsigned kSampleShare = 16;
inline constexpr double kMoreNoise = 4.0;
#else
inline constexpr unsigned kSampleShare = 1;
inline constexpr double kMoreNoise = 1.0;
#endif

}  // namespace hpr::test
