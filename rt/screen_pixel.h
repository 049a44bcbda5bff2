#pragma once

#include <compare>
#include <cstdint>

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

}  // namespace hpr
