#pragma once

#include <cstdint>

namespace hpr {

/// The most memory this process has held at a time since it started, or since reset_peak_memory().
[[nodiscard]] std::uint64_t peak_memory_bytes();

/// Lets peak_memory_bytes() begin anew with what the process holds now. False where the system does not let it.
bool reset_peak_memory();

}  // namespace hpr
