#pragma once

#include <array>
#include <cstdint>
#include <functional>

namespace hpr {

/// Linear light in [0, 1] to one of 256 levels, as a formula has it, without its powers.
class LevelTable {
 public:
  /// `level`: what a light is shown as, in [0, 1]; must rise with it.
  explicit LevelTable(const std::function<double(float light)>& level);

  /// The level of `light`, rounded; below 0 and NaN that of 0, above 1 that of 1.
  [[nodiscard]] std::uint8_t operator()(float light) const;

 private:
  static constexpr int kSteps = 1024;

  std::array<float, 257> least_{};  ///< light from which on the level is at least this
  std::array<std::uint8_t, kSteps + 1> start_{};
};

}  // namespace hpr
