#include "cluster/distribution/assignment.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "cluster/distribution/area_cutting.h"
#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

std::size_t tiles_in(const Rect& rect) {
  const auto along = [](int from, int to) {
    return static_cast<std::size_t>((to + kTileSide - 1) / kTileSide - from / kTileSide);
  };
  return rect.empty() ? 0 : along(rect.x0, rect.x1) * along(rect.y0, rect.y1);
}

/// Moves about `wanted` tiles of `rect` to `first` and the rest to `second`. One straight cut across the longer side,
/// unless it would miss `wanted` by a twentieth of the smaller part: then the row of tiles it runs through is cut as
/// well.
void cut_by_count(const ScreenRect& rect, double wanted, std::vector<ScreenRect>& first,
                  std::vector<ScreenRect>& second) {
  const bool along_x = rect.pixels.width() >= rect.pixels.height();
  const int steps = slices_of(rect, along_x);
  const auto tiles = static_cast<double>(tiles_in(rect.pixels));
  const double per_step = tiles / steps;
  const int nearest = std::clamp(static_cast<int>(std::lround(wanted / per_step)), 0, steps);
  const double miss = std::abs(nearest * per_step - wanted);
  const int whole = static_cast<int>(wanted / per_step);
  const int rest = static_cast<int>(std::lround(wanted - whole * per_step));
  if (miss < 0.5 || miss <= 0.05 * std::min(wanted, tiles - wanted) || rest == 0 || whole == steps) {
    add_if_any(first, slice(rect, along_x, 0, nearest));
    add_if_any(second, slice(rect, along_x, nearest, steps));
    return;
  }
  const ScreenRect row = slice(rect, along_x, whole, whole + 1);
  add_if_any(first, slice(rect, along_x, 0, whole));
  add_if_any(first, slice(row, !along_x, 0, rest));
  add_if_any(second, slice(row, !along_x, rest, slices_of(row, !along_x)));
  add_if_any(second, slice(rect, along_x, whole + 1, steps));
}

/// Of triangles [first, last) of a mesh that may be known by its chunks alone.
Bounds chunk_bounds(const Mesh& mesh, std::uint32_t first, std::uint32_t last) {
  if (!mesh.partial) return bounds_of(mesh, std::span(mesh.triangles).subspan(first, last - first));
  HPR_CHECK(first % kPartChunk == 0 && last - first <= kPartChunk);
  return mesh.partial->chunks.at(first / kPartChunk);
}

std::vector<ObjectChunk> make_chunks(const Scene& scene, std::uint32_t most) {
  std::vector<ObjectChunk> chunks;
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    const std::uint32_t count = mesh.triangle_count();
    for (std::uint32_t first = 0, last = 0; first < count; first = last) {
      last = first + std::min(most, count - first);
      const Bounds box = chunk_bounds(mesh, first, last);
      const glm::dvec3 center(instance.to_world * glm::dvec4(0.5 * (box.low + box.high), 1.0));
      chunks.push_back({{instance.first_surface + first, instance.first_surface + last}, center});
    }
  }
  return chunks;
}

/// The chunks' surfaces in order of their ids, neighbours joined.
std::vector<SurfaceRange> joined(std::span<ObjectChunk> chunks) {
  std::ranges::sort(chunks, {}, [](const ObjectChunk& chunk) { return chunk.surfaces.first; });
  std::vector<SurfaceRange> ranges;
  for (const ObjectChunk& chunk : chunks) {
    if (!ranges.empty() && ranges.back().last == chunk.surfaces.first) {
      ranges.back().last = chunk.surfaces.last;
    } else {
      ranges.push_back(chunk.surfaces);
    }
  }
  return ranges;
}

int longest_axis(std::span<const ObjectChunk> chunks) {
  if (chunks.empty()) return 0;
  glm::dvec3 low = chunks.front().center;
  glm::dvec3 high = low;
  for (const ObjectChunk& chunk : chunks) {
    low = glm::min(low, chunk.center);
    high = glm::max(high, chunk.center);
  }
  const glm::dvec3 extent = high - low;
  return extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
}

void partition_recursively(std::span<ObjectChunk> chunks, std::span<std::vector<SurfaceRange>> parts) {
  if (parts.size() == 1) {
    parts[0] = joined(chunks);
    return;
  }
  const int axis = longest_axis(chunks);
  std::ranges::sort(chunks, [axis](const ObjectChunk& a, const ObjectChunk& b) {
    return a.center[axis] != b.center[axis] ? a.center[axis] < b.center[axis] : a.surfaces.first < b.surfaces.first;
  });
  const std::size_t half = parts.size() / 2;
  std::uint64_t total = 0;
  for (const ObjectChunk& chunk : chunks) total += chunk.surfaces.count();
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
    case Distribution::SortMiddle:
      return "sort-middle";
    case Distribution::SortLast:
      return "sort-last";
    case Distribution::Hybrid:
      return "hybrid";
  }
  return "";
}

std::string distribution_names() {
  std::vector<std::string_view> names;
  names.reserve(kDistributions.size());
  for (const Distribution distribution : kDistributions) names.push_back(name_of(distribution));
  return fmt::format("{}", fmt::join(names, ", "));
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
  std::vector<std::vector<ScreenRect>> areas(weights.size());
  share_out(
      whole_screens(layout), weights, areas,
      [](const ScreenRect& rect) { return static_cast<double>(tiles_in(rect.pixels)); }, cut_by_count);
  return areas;
}

std::vector<std::vector<SurfaceRange>> partition_objects(const Scene& scene, int parts, std::uint32_t chunk) {
  HPR_CHECK(parts > 0 && chunk > 0);
  if (!scene.parts.empty()) {
    if (parts == 1) return {{{0, scene.triangles}}};
    HPR_CHECK(scene.parts.size() == static_cast<std::size_t>(parts));
    return scene.parts;
  }
  return partition_chunks(make_chunks(scene, chunk), parts);
}

std::vector<std::vector<SurfaceRange>> partition_chunks(std::vector<ObjectChunk> chunks, int parts) {
  std::vector<std::vector<SurfaceRange>> partition(static_cast<std::size_t>(parts));
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

std::vector<Rect> parts_of(std::span<const ScreenRect> area, std::size_t screen) {
  std::vector<Rect> parts;
  for (const ScreenRect& rect : area) {
    if (rect.screen == screen) parts.push_back(rect.pixels);
  }
  return parts;
}

std::vector<Assignment> assign(Distribution distribution, const Scene& scene, const FrameLayout& layout, int ranks,
                               int groups) {
  // Sort-first and sort-middle are a group per rank, sort-last one group of all: hybrid nests them, so one rule makes
  // all of them.
  const int group_count = draws_alone(distribution) ? ranks : distribution == Distribution::SortLast ? 1 : groups;
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
