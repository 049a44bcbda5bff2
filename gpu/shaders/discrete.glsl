// Choices in proportion to running sums: sample_discrete() of rt/sampling/sampling.h.

layout(buffer_reference, scalar) readonly buffer Sums {
  double sums[];
};

struct DiscreteSample {
  uint index;
  double probability;
  double rest;  // what is left of the random number, again uniform in [0, 1)
};

const double kBelowOne = 0.99999999999999988898lf;  // the largest number below 1

// `count` sums from `first` on, which never fall and end above 0.
DiscreteSample sample_discrete(Sums sums, uint first, uint count, double u) {
  double whole = sums.sums[first + count - 1u];
  double target = min(u, kBelowOne) * whole;
  // The product may round up to the whole sum: then the last one that adds to it.
  bool is_last = !(target < whole);
  uint low = 0u;
  uint high = count - 1u;
  while (low < high) {
    uint at = (low + high) >> 1;
    double sum = sums.sums[first + at];
    if (is_last ? sum < whole : !(target < sum)) {
      low = at + 1u;
    } else {
      high = at;
    }
  }
  double before = low > 0u ? sums.sums[first + low - 1u] : 0.0lf;
  double weight = sums.sums[first + low] - before;
  return DiscreteSample(low, weight / whole, clamp((target - before) / weight, 0.0lf, kBelowOne));
}
