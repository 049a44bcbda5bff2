#pragma once

#include <cstddef>
#include <functional>

namespace hpr {

/// The cores this process may run on: its affinity mask, which launchers and containers make smaller than the machine.
[[nodiscard]] int usable_cores();

/// Calls body(i) for i in [0, count), by up to `threads` threads (the caller is one of them), in any order; returns
/// when all are done. Rethrows the first exception a call left. Bodies must not call parallel_for: one level, one
/// budget. The other threads belong to the caller: they sleep until its next loop, and end with it.
void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body);

}  // namespace hpr
