#pragma once

#include <string>
#include <vector>

namespace hpr {

/// One line of `hpr bench`: what we need for something, and what a floor or peer needs for it on the same input.
struct BenchRow {
  std::string name;
  double ours = 0.0;
  double floor = 0.0;  ///< 0: there is none
  std::string unit;
  double ratio = 0.0;  ///< our speed / the floor's: 1 is equal, more is faster; 0 without a floor
};

/// Prints rows as a table, or as one JSON document (schema hpr.bench/1). `machine`: what they were measured on.
void print_bench(const std::vector<BenchRow>& rows, const std::string& machine, bool json);

}  // namespace hpr
