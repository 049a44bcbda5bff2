#pragma once

#include <cstddef>
#include <span>

#include "image/key.h"

/// Runs of quantized keys as they are sent: sent_bytes(format) bytes each, the surface before the depth, the lowest
/// byte first.
namespace hpr {

/// Writes `keys` to `bytes`, which has room for them.
void narrow_keys(std::span<const Key> keys, DepthFormat format, std::byte* bytes);

/// Reads as many keys as `keys` has room for.
void widen_keys(const std::byte* bytes, DepthFormat format, std::span<Key> keys);

}  // namespace hpr
