#include <algorithm>

#include "rt/lighter.h"

namespace hpr {

RayCounts& RayCounts::operator+=(const RayCounts& other) {
  primary += other.primary;
  shadow += other.shadow;
  reflection += other.reflection;
  refraction += other.refraction;
  gather += other.gather;
  ambient_occlusion += other.ambient_occlusion;
  photon += other.photon;
  invalid += other.invalid;
  cut += other.cut;
  not_finite += other.not_finite;
  first_not_finite = std::min(first_not_finite, other.first_not_finite);
  return *this;
}

}  // namespace hpr
