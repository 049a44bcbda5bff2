#include <hwy/targets.h>

// On x86 this file takes the place of the library libhwy, of which HPR needs these functions alone: when libhwy is
// loaded it measures the resolution of the machine's timer, which is 4 ms of every start. They choose the instruction
// sets that libhwy 1.0.3 chooses, and promise what <hwy/targets.h> says.
#if HWY_ARCH_X86
#include <cpuid.h>

#include <atomic>
#include <cstdint>

namespace hwy {
namespace {

/// Of what the compiler's own check has no name for: counts of leading zeros, and halves of floats.
bool has_lzcnt_and_f16c() {
  unsigned a = 0;
  unsigned b = 0;
  unsigned c = 0;
  unsigned d = 0;
  const bool f16c = __get_cpuid(1, &a, &b, &c, &d) != 0 && (c & bit_F16C) != 0;
  return f16c && __get_cpuid(0x80000001, &a, &b, &c, &d) != 0 && (c & bit_LZCNT) != 0;
}

/// Of the instruction sets that files are compiled for, those of this processor and its operating system.
std::int64_t find_targets() {
  std::int64_t targets = HWY_STATIC_TARGET | HWY_SCALAR | HWY_EMU128;
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("ssse3")) return targets;
  targets |= HWY_SSSE3;
  if (!__builtin_cpu_supports("sse4.1") || !__builtin_cpu_supports("sse4.2") || !__builtin_cpu_supports("pclmul") ||
      !__builtin_cpu_supports("aes")) {
    return targets;
  }
  targets |= HWY_SSE4;
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("bmi") || !__builtin_cpu_supports("bmi2") ||
      !__builtin_cpu_supports("fma") || !has_lzcnt_and_f16c()) {
    return targets;
  }
  targets |= HWY_AVX2;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw")) {
    targets |= HWY_AVX3;
  }
  return targets;
}

std::atomic<std::int64_t> for_test = 0;  ///< 0: none

}  // namespace

int64_t SupportedTargets() {
  static const std::int64_t found = find_targets();
  const std::int64_t asked = for_test.load();
  return asked != 0 ? asked : found;
}

void SetSupportedTargetsForTest(int64_t targets) {
  for_test.store(targets);
  GetChosenTarget().DeInit();
}

ChosenTarget& GetChosenTarget() {
  static ChosenTarget chosen;
  return chosen;
}

}  // namespace hwy
#endif
