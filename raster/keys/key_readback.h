#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "image/image.h"
#include "raster/gl.h"
#include "raster/keys/drawn_keys.h"
#include "raster/keys/key_target.h"

namespace hpr {

/// By which route keys come from a KeyTarget into memory.
enum class KeyRoute : std::uint8_t {
  Pixels,  ///< glReadPixels of both halves, into a buffer that stays mapped
  Shader,  ///< a compute shader joins the halves, tile by tile, and GL copies the keys into such a buffer
};

[[nodiscard]] std::vector<KeyRoute> all_key_routes();
/// For people and tests.
[[nodiscard]] std::string_view route_name(KeyRoute route);
/// The faster one: Shader, but Pixels where the CPU draws, whose shaders are slower than its copies.
[[nodiscard]] KeyRoute fastest_route(const GlContext& context);

/// Brings keys into memory. Every route gives the same keys, to the bit. Both calls expect the context to be current.
class KeyReadback {
 public:
  KeyReadback() = default;
  KeyReadback(const KeyReadback&) = delete;
  KeyReadback& operator=(const KeyReadback&) = delete;
  virtual ~KeyReadback() = default;

  /// Asks for `pixels`, not empty, of a view of `view` pixels, as they are once GL has done what it was sent before.
  virtual void start(const KeyTarget& target, Size view, const Rect& pixels) = 0;
  /// What was asked for, once it is there; it stays until the next start(). Throws Error (Hang) after kGlWaitLimit.
  [[nodiscard]] virtual DrawnKeys finish() = 0;
};

[[nodiscard]] std::unique_ptr<KeyReadback> make_key_readback(KeyRoute route, GlContext& context);

}  // namespace hpr
