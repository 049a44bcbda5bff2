#pragma once

#include <xmmintrin.h>

namespace hpr {

/// Denormal numbers read and written as zero while it lives, as Embree advises; the thread's own mode returns after.
class DenormalsAsZero {
 public:
  DenormalsAsZero() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040U); }
  ~DenormalsAsZero() { _mm_setcsr(before_); }
  DenormalsAsZero(const DenormalsAsZero&) = delete;
  DenormalsAsZero& operator=(const DenormalsAsZero&) = delete;

 private:
  unsigned int before_;
};

}  // namespace hpr
