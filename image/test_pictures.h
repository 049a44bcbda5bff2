#pragma once

#include <vector>

#include "image/image.h"

/// Pictures for tests of metrics, that any other program can make as well.
namespace hpr::test {

/// [height][width][3]: 8-bit levels of slanting ramps with steps where they wrap; `change` adds texture, as many levels
/// deep as 29 changes.
inline std::vector<float> ramps(Size size, int change) {
  std::vector<float> values;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const int level = (3 * x + 5 * y + 50 * c + change * ((x * x + 3 * x * y + 2 * y) % 29)) % 256;
        values.push_back(static_cast<float>(level) / 255.0F);
      }
    }
  }
  return values;
}

}  // namespace hpr::test
