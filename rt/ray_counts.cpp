#include "rt/ray_counts.h"

#include <algorithm>
#include <cstddef>

namespace hpr {

RayCounts& RayCounts::operator+=(const RayCounts& other) {
  primary += other.primary;
  for (std::size_t i = 0; i < kPasses; ++i) passes[i] += other.passes[i];
  invalid += other.invalid;
  cut += other.cut;
  not_finite += other.not_finite;
  first_not_finite = std::min(first_not_finite, other.first_not_finite);
  return *this;
}

}  // namespace hpr
