#include "cluster/distribution/assignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr std::array kDistributions{Distribution::SortFirst, Distribution::SortLast, Distribution::Hybrid};

std::size_t tiles_in(const Rect& rect) {
  const auto along = [](int from, int to) {
    return static_cast<std::size_t>((to + kTileSide - 1) / kTileSide - from / kTileSide);
  };
  return rect.empty() ? 0 : along(rect.x0, rect.x1) * along(rect.y0, rect.y1);
}

std::size_t tiles_in(std::span<const ScreenRect> rects) {
  return std::accumulate(rects.begin(), rects.end(), std::size_t{0},
                         [](std::size_t sum, const ScreenRect& rect) { return sum + tiles_in(rect.pixels); });
}

/// Cuts a rectangle at a tile border, `steps` tiles from its left (or upper) edge.
std::pair<ScreenRect, ScreenRect> cut_at(const ScreenRect& rect, bool along_x, int steps) {
  const int from = along_x ? rect.pixels.x0 : rect.pixels.y0;
  const int to = along_x ? rect.pixels.x1 : rect.pixels.y1;
  const int at = std::min(from + kTileSide * steps, to);
  ScreenRect first = rect;
  ScreenRect second = rect;
  (along_x ? first.pixels.x1 : first.pixels.y1) = at;
  (along_x ? second.pixels.x0 : second.pixels.y0) = at;
  return {first, second};
}

/// Moves about `wanted` tiles of `rect` to `first` and the rest to `second`. One straight cut across the longer side,
/// unless it would miss `wanted` by a twentieth of the smaller part: then the row of tiles it runs through is cut as
/// well.
void cut(const ScreenRect& rect, double wanted, std::vector<ScreenRect>& first, std::vector<ScreenRect>& second) {
  const auto add = [](std::vector<ScreenRect>& rects, const ScreenRect& part) {
    if (!part.pixels.empty()) rects.push_back(part);
  };
  const bool along_x = rect.pixels.width() >= rect.pixels.height();
  const int length = along_x ? rect.pixels.width() : rect.pixels.height();
  const int steps = (length + kTileSide - 1) / kTileSide;
  const auto tiles = static_cast<double>(tiles_in(rect.pixels));
  const double per_step = tiles / steps;
  const int nearest = std::clamp(static_cast<int>(std::lround(wanted / per_step)), 0, steps);
  const double miss = std::abs(nearest * per_step - wanted);
  const int whole = static_cast<int>(wanted / per_step);
  const int rest = static_cast<int>(std::lround(wanted - whole * per_step));
  if (miss < 0.5 || miss <= 0.05 * std::min(wanted, tiles - wanted) || rest == 0 || whole == steps) {
    const auto [before, after] = cut_at(rect, along_x, nearest);
    add(first, before);
    add(second, after);
    return;
  }
  const auto [before, others] = cut_at(rect, along_x, whole);
  const auto [row, after] = cut_at(others, along_x, 1);
  const auto [row_before, row_after] = cut_at(row, !along_x, rest);
  add(first, before);
  add(first, row_before);
  add(second, row_after);
  add(second, after);
}

void assign_recursively(std::vector<ScreenRect> rects, std::span<const int> weights,
                        std::span<std::vector<ScreenRect>> areas) {
  if (weights.size() == 1) {
    areas[0] = std::move(rects);
    return;
  }
  const std::size_t half = weights.size() / 2;
  const double fraction =
      static_cast<double>(std::accumulate(weights.begin(), weights.begin() + static_cast<std::ptrdiff_t>(half), 0)) /
      std::accumulate(weights.begin(), weights.end(), 0);
  double wanted = fraction * static_cast<double>(tiles_in(rects));
  std::vector<ScreenRect> first;
  std::vector<ScreenRect> second;
  for (const ScreenRect& rect : rects) {
    const auto tiles = static_cast<double>(tiles_in(rect.pixels));
    if (tiles <= wanted) {
      first.push_back(rect);
    } else if (wanted < 0.5) {
      second.push_back(rect);
    } else {
      cut(rect, wanted, first, second);
    }
    wanted = std::max(0.0, wanted - tiles);
  }
  assign_recursively(std::move(first), weights.first(half), areas.first(half));
  assign_recursively(std::move(second), weights.subspan(half), areas.subspan(half));
}

struct Chunk {
  SurfaceRange surfaces;
  glm::dvec3 center;
};

std::vector<Chunk> make_chunks(const Scene& scene, std::uint32_t most) {
  std::vector<Chunk> chunks;
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    for (std::uint32_t first = 0, last = 0; first < count; first = last) {
      last = first + std::min(most, count - first);
      glm::dvec3 low(mesh.positions[mesh.triangles[first].x]);
      glm::dvec3 high = low;
      for (std::uint32_t t = first; t < last; ++t) {
        for (int corner = 0; corner < 3; ++corner) {
          const glm::dvec3 p(mesh.positions[mesh.triangles[t][corner]]);
          low = glm::min(low, p);
          high = glm::max(high, p);
        }
      }
      const glm::dvec3 center(instance.to_world * glm::dvec4(0.5 * (low + high), 1.0));
      chunks.push_back({{instance.first_surface + first, instance.first_surface + last}, center});
    }
  }
  return chunks;
}

/// The chunks' surfaces in order of their ids, neighbours joined.
std::vector<SurfaceRange> joined(std::span<Chunk> chunks) {
  std::ranges::sort(chunks, {}, [](const Chunk& chunk) { return chunk.surfaces.first; });
  std::vector<SurfaceRange> ranges;
  for (const Chunk& chunk : chunks) {
    if (!ranges.empty() && ranges.back().last == chunk.surfaces.first) {
      ranges.back().last = chunk.surfaces.last;
    } else {
      ranges.push_back(chunk.surfaces);
    }
  }
  return ranges;
}

int longest_axis(std::span<const Chunk> chunks) {
  if (chunks.empty()) return 0;
  glm::dvec3 low = chunks.front().center;
  glm::dvec3 high = low;
  for (const Chunk& chunk : chunks) {
    low = glm::min(low, chunk.center);
    high = glm::max(high, chunk.center);
  }
  const glm::dvec3 extent = high - low;
  return extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
}

void partition_recursively(std::span<Chunk> chunks, std::span<std::vector<SurfaceRange>> parts) {
  if (parts.size() == 1) {
    parts[0] = joined(chunks);
    return;
  }
  const int axis = longest_axis(chunks);
  std::ranges::sort(chunks, [axis](const Chunk& a, const Chunk& b) {
    return a.center[axis] != b.center[axis] ? a.center[axis] < b.center[axis] : a.surfaces.first < b.surfaces.first;
  });
  const std::size_t half = parts.size() / 2;
  std::uint64_t total = 0;
  for (const Chunk& chunk : chunks) total += chunk.surfaces.count();
  const std::uint64_t wanted = total * half / parts.size();
  std::size_t split = 0;
  for (std::uint64_t sum = 0; split < chunks.size() && sum + chunks[split].surfaces.count() / 2 < wanted; ++split) {
    sum += chunks[split].surfaces.count();
  }
  partition_recursively(chunks.first(split), parts.first(half));
  partition_recursively(chunks.subspan(split), parts.subspan(half));
}

}  // namespace

std::string_view name_of(Distribution distribution) {
  switch (distribution) {
    case Distribution::SortFirst:
      return "sort-first";
    case Distribution::SortLast:
      return "sort-last";
    case Distribution::Hybrid:
      return "hybrid";
  }
  return "";
}

Distribution parse_distribution(std::string_view name, std::span<const std::string> further) {
  std::vector<std::string> choices;
  for (const Distribution choice : kDistributions) {
    if (name == name_of(choice)) return choice;
    choices.emplace_back(name_of(choice));
  }
  choices.insert(choices.end(), further.begin(), further.end());
  throw Error(ExitCode::Usage, fmt::format("unknown distribution '{}'", name), unknown_name_hint(name, choices));
}

std::vector<std::vector<ScreenRect>> assign_tiles(const FrameLayout& layout, const std::vector<int>& weights) {
  HPR_CHECK(!weights.empty() && std::ranges::all_of(weights, [](int weight) { return weight > 0; }));
  std::vector<ScreenRect> whole;
  for (std::size_t screen = 0; screen < layout.screens(); ++screen) {
    whole.push_back({screen, {0, 0, layout.size(screen).width, layout.size(screen).height}});
  }
  std::vector<std::vector<ScreenRect>> areas(weights.size());
  assign_recursively(std::move(whole), weights, areas);
  return areas;
}

std::vector<std::vector<SurfaceRange>> partition_objects(const Scene& scene, int parts, std::uint32_t chunk) {
  HPR_CHECK(parts > 0 && chunk > 0);
  std::vector<std::vector<SurfaceRange>> partition(static_cast<std::size_t>(parts));
  std::vector<Chunk> chunks = make_chunks(scene, chunk);
  partition_recursively(chunks, partition);
  return partition;
}

std::vector<std::vector<int>> make_groups(int ranks, int groups) {
  HPR_CHECK(ranks > 0 && groups > 0 && groups <= ranks);
  std::vector<std::vector<int>> made(static_cast<std::size_t>(groups));
  for (int rank = 0; rank < ranks; ++rank) {
    made[static_cast<std::size_t>(static_cast<std::int64_t>(rank) * groups / ranks)].push_back(rank);
  }
  return made;
}

int default_groups(int ranks) {
  return std::max(1, static_cast<int>(std::lround(std::sqrt(ranks))));
}

std::vector<std::size_t> tiles_of(const FrameLayout& layout, std::span<const ScreenRect> area) {
  std::vector<std::size_t> tiles;
  for (const ScreenRect& rect : area) {
    for (int y = rect.pixels.y0; y < rect.pixels.y1; y += kTileSide) {
      for (int x = rect.pixels.x0; x < rect.pixels.x1; x += kTileSide)
        tiles.push_back(layout.tile_at(rect.screen, x, y));
    }
  }
  std::ranges::sort(tiles);
  return tiles;
}

std::vector<Assignment> assign(Distribution distribution, const Scene& scene, const FrameLayout& layout, int ranks,
                               int groups) {
  // Sort-first is a group per rank, sort-last one group of all: hybrid nests them, so one rule makes all three.
  const int group_count = distribution == Distribution::SortFirst  ? ranks
                          : distribution == Distribution::SortLast ? 1
                                                                   : groups;
  const auto members = make_groups(ranks, group_count);
  std::vector<int> weights;
  weights.reserve(members.size());
  for (const auto& group : members) weights.push_back(static_cast<int>(group.size()));
  const auto areas = assign_tiles(layout, weights);

  std::vector<Assignment> assignments(static_cast<std::size_t>(ranks));
  std::vector<std::vector<std::vector<SurfaceRange>>> parts(static_cast<std::size_t>(ranks) + 1);  // by group size
  for (std::size_t g = 0; g < members.size(); ++g) {
    auto& objects = parts[members[g].size()];
    if (objects.empty()) objects = partition_objects(scene, static_cast<int>(members[g].size()));
    for (std::size_t i = 0; i < members[g].size(); ++i) {
      assignments[static_cast<std::size_t>(members[g][i])] = {members[g], objects[i], areas[g]};
    }
  }
  return assignments;
}

}  // namespace hpr
