#pragma once

/// Transcendental functions made of IEEE additions and multiplications only: the same bits with every compiler and C
/// library, which std::sin and its kin do not promise. For generated scenes, whose hash must agree between machines.
namespace hpr::portable {

/// Sine and cosine of `turns` full turns (one turn = 2 pi radians); absolute error below 1e-15 for |turns| < 1e6.
[[nodiscard]] double sin_turns(double turns);
[[nodiscard]] double cos_turns(double turns);

/// 2 to the power of `x`; relative error below 1e-15 for |x| < 1000.
[[nodiscard]] double exp2(double x);

}  // namespace hpr::portable
