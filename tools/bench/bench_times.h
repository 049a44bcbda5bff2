#pragma once

#include <vector>

namespace hpr {

/// CPU time of this thread: what others do on the machine counts less than on a clock.
[[nodiscard]] double thread_ms();

/// The middle one, of an even number the upper of both; `values` is not empty.
[[nodiscard]] double median(std::vector<double> values);

}  // namespace hpr
