#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace hpr {

/// Chunks [first, last) of what ranks draw, by their numbers: every chunk of every instance has one, in ascending order
/// of surface id. The same on all ranks that draw the same objects.
struct ChunkRange {
  std::uint32_t first = 0;
  std::uint32_t last = 0;

  [[nodiscard]] std::uint32_t count() const { return last - first; }
  bool operator==(const ChunkRange&) const = default;
};

/// Adds a range behind those of an ascending list; one that touches the last becomes part of it.
inline void append_range(std::vector<ChunkRange>& ranges, const ChunkRange& range) {
  if (range.count() == 0) return;
  if (!ranges.empty() && ranges.back().last == range.first) {
    ranges.back().last = range.last;
  } else {
    ranges.push_back(range);
  }
}

/// How many chunks some disjoint ranges hold.
[[nodiscard]] inline std::uint64_t chunks_in(std::span<const ChunkRange> ranges) {
  std::uint64_t count = 0;
  for (const ChunkRange& range : ranges) count += range.count();
  return count;
}

}  // namespace hpr
