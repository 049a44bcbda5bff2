#pragma once

#include <cstdio>
#include <cstdlib>

/// Stops the program when the programmer broke a contract. Always on; never for user errors, never in inner loops.
#define HPR_CHECK(condition)                                                                     \
  do {                                                                                           \
    if (!(condition)) {                                                                          \
      std::fprintf(stderr, "hpr: %s:%d: broken contract: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                              \
    }                                                                                            \
  } while (false)
