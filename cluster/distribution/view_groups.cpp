#include "cluster/distribution/view_groups.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "core/error.h"

namespace hpr {
namespace {

using Part = ViewGroups::Part;

/// A part on its way to a rank.
struct Item {
  Part part;
  float x = 0.0F;  ///< its center on the screen, in pixels
  float y = 0.0F;
  float triangles = 0.0F;
  float pixels = 0.0F;
};

/// A rectangle of a screen's grid of tiles.
struct Region {
  std::uint32_t screen = 0;
  Rect tiles;
};

Rect joined(const Rect& a, const Rect& b) {
  if (a.empty()) return b;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

Rect tiles_around(const Rect& pixels) {
  const auto end = [](int pixel) { return (pixel + kTileSide - 1) / kTileSide; };
  return {pixels.x0 / kTileSide, pixels.y0 / kTileSide, end(pixels.x1), end(pixels.y1)};
}

Item item_of(std::span<const ScreenChunk> chunks, std::size_t index) {
  const ScreenChunk& chunk = chunks[index];
  return {{static_cast<std::uint32_t>(index), tiles_around(chunk.pixels)},
          0.5F * static_cast<float>(chunk.pixels.x0 + chunk.pixels.x1),
          0.5F * static_cast<float>(chunk.pixels.y0 + chunk.pixels.y1),
          static_cast<float>(chunk.surfaces.count()),
          chunk.covered};
}

int& low_of(Rect& rect, bool along_x) {
  return along_x ? rect.x0 : rect.y0;
}
int& high_of(Rect& rect, bool along_x) {
  return along_x ? rect.x1 : rect.y1;
}

/// The part of an item before (or behind) a border of tiles; its pixels are taken to be spread evenly.
Item clipped(const Item& item, bool along_x, int border, bool before) {
  Item part = item;
  int& edge = before ? high_of(part.part.tiles, along_x) : low_of(part.part.tiles, along_x);
  edge = border;
  const Rect& tiles = part.part.tiles;
  part.pixels *= static_cast<float>(tiles.area()) / static_cast<float>(item.part.tiles.area());
  part.x = 0.5F * static_cast<float>((tiles.x0 + tiles.x1) * kTileSide);
  part.y = 0.5F * static_cast<float>((tiles.y0 + tiles.y1) * kTileSide);
  return part;
}

/// Where the screens of a part of the frame are cut: before tile `border` of region `region`, whose predecessors go to
/// the first half whole.
struct Cut {
  std::size_t region = 0;
  bool along_x = true;
  int border = 0;
};

/// Both halves of what is cut, and what that costs beyond what each half has to do anyway.
struct Halves {
  std::vector<Item> first;
  std::vector<Item> second;
  Cut cut;
  double overhead = 0.0;
};

class Grouping {
 public:
  Grouping(const FrameLayout& layout, std::span<const ScreenChunk> chunks, int ranks, const DrawSpeeds& speeds)
      : layout_(layout), chunks_(chunks), speeds_(speeds) {
    groups_.parts.resize(static_cast<std::size_t>(ranks));
    groups_.regions.assign(layout.tiles(), 0);
  }

  ViewGroups group() {
    std::vector<Item> items;
    items.reserve(chunks_.size());
    for (std::size_t i = 0; i < chunks_.size(); ++i) items.push_back(item_of(chunks_, i));
    std::vector<Region> regions;
    for (std::size_t screen = 0; screen < layout_.screens(); ++screen) {
      const Size grid = layout_.tile_grid(screen);
      regions.push_back({static_cast<std::uint32_t>(screen), {0, 0, grid.width, grid.height}});
    }
    divide(std::move(items), regions, 0, static_cast<int>(groups_.parts.size()));
    return std::move(groups_);
  }

 private:
  [[nodiscard]] double work(const Item& item) const {
    return item.triangles * speeds_.triangle + item.pixels * speeds_.pixel;
  }

  void divide(std::vector<Item> items, const std::vector<Region>& regions, int first_rank, int ranks) {
    if (ranks == 1) {
      auto& parts = groups_.parts[static_cast<std::size_t>(first_rank)];
      for (const Item& item : items) parts.push_back(item.part);
      std::ranges::sort(parts, {}, &Part::chunk);
      for (const Region& region : regions) set_region(region, first_rank);
      return;
    }
    const int half = ranks / 2;
    const double fraction = static_cast<double>(half) / ranks;
    Halves best;
    if (regions.size() == 1) {
      best = halve(items, regions, true, fraction);
      Halves other = halve(items, regions, false, fraction);
      if (other.overhead < best.overhead) best = std::move(other);
    } else {
      best = halve(items, regions, true, fraction);
    }
    items.clear();
    items.shrink_to_fit();
    auto [first, second] = cut_regions(regions, best.cut);
    divide(std::move(best.first), first, first_rank, half);
    divide(std::move(best.second), second, first_rank + half, ranks - half);
  }

  void set_region(const Region& region, int rank) {
    for (int y = region.tiles.y0; y < region.tiles.y1; ++y) {
      for (int x = region.tiles.x0; x < region.tiles.x1; ++x) {
        groups_.regions[layout_.tile_at(region.screen, x * kTileSide, y * kTileSide)] = rank;
      }
    }
  }

  /// Which of several regions an item lies in: by its screen, as each has one region at most, but for what hangs over.
  static std::size_t region_of(const Item& item, const std::vector<Region>& regions,
                               std::span<const ScreenChunk> chunks) {
    if (regions.size() == 1) return 0;
    const std::uint32_t screen = chunks[item.part.chunk].screen;
    const auto at = std::ranges::find(regions, screen, &Region::screen);
    return at == regions.end() ? regions.size() - 1 : static_cast<std::size_t>(at - regions.begin());
  }

  static std::pair<std::vector<Region>, std::vector<Region>> cut_regions(const std::vector<Region>& regions, Cut cut) {
    std::pair<std::vector<Region>, std::vector<Region>> halves;
    for (std::size_t i = 0; i < regions.size(); ++i) {
      if (i != cut.region) {
        (i < cut.region ? halves.first : halves.second).push_back(regions[i]);
        continue;
      }
      Region first = regions[i];
      Region second = regions[i];
      high_of(first.tiles, cut.along_x) = cut.border;
      low_of(second.tiles, cut.along_x) = cut.border;
      if (!first.tiles.empty()) halves.first.push_back(first);
      if (!second.tiles.empty()) halves.second.push_back(second);
    }
    return halves;
  }

  /// Halves items in order of their positions along an axis, screen after screen, so that the first half has about
  /// `fraction` of the work.
  [[nodiscard]] Halves halve(const std::vector<Item>& items, const std::vector<Region>& regions, bool wants_x,
                             double fraction) const {
    double total = 0.0;
    for (const Item& item : items) total += work(item);
    Halves halves;
    // Parts that both halves draw shift work from one to the other; a second look makes up for that.
    double wanted = fraction * total;
    for (int attempt = 0; attempt < 2; ++attempt) {
      halves = halve_at(items, regions, wants_x, wanted, fraction);
      double first = 0.0;
      double second = 0.0;
      for (const Item& item : halves.first) first += work(item);
      for (const Item& item : halves.second) second += work(item);
      const double miss = fraction * (first + second) - first;
      halves.overhead += std::abs(miss);
      if (std::abs(miss) < 0.02 * total) break;
      wanted += miss;
    }
    return halves;
  }

  [[nodiscard]] Halves halve_at(const std::vector<Item>& items, const std::vector<Region>& regions, bool wants_x,
                                double wanted, double fraction) const {
    // Bins of positions: cheaper than to sort, and finer than tiles.
    constexpr int kBinPixels = 8;
    struct Bins {
      bool along_x = true;
      int first_pixel = 0;
      std::size_t first = 0;
      std::size_t count = 0;
    };
    std::vector<Bins> bins;
    std::size_t all = 0;
    for (const Region& region : regions) {
      Rect tiles = region.tiles;
      const bool along_x = regions.size() == 1 ? wants_x : tiles.width() >= tiles.height();
      const int low = low_of(tiles, along_x);
      const int high = high_of(tiles, along_x);
      const auto count = static_cast<std::size_t>(std::max(1, (high - low) * kTileSide / kBinPixels));
      bins.push_back({along_x, low * kTileSide, all, count});
      all += count;
    }
    const auto bin_of = [&](const Item& item) {
      const Bins& of_region = bins[regions.empty() ? 0 : region_of(item, regions, chunks_)];
      const int pixel = static_cast<int>(of_region.along_x ? item.x : item.y) - of_region.first_pixel;
      return of_region.first +
             static_cast<std::size_t>(std::clamp(pixel / kBinPixels, 0, static_cast<int>(of_region.count) - 1));
    };
    if (bins.empty()) {  // more ranks than tiles
      bins.push_back({true, 0, 0, 1});
      all = 1;
    }
    std::vector<double> works(all, 0.0);
    std::vector<std::uint32_t> item_bins;
    item_bins.reserve(items.size());
    for (const Item& item : items) {
      item_bins.push_back(static_cast<std::uint32_t>(bin_of(item)));
      works[item_bins.back()] += work(item);
    }
    std::size_t split = 0;
    double before = 0.0;
    while (split + 1 < all && before + works[split] <= wanted) before += works[split++];

    Halves halves;
    halves.cut = cut_at(regions, bins, split, works[split] > 0.0 ? (wanted - before) / works[split] : fraction);
    for (std::size_t i = 0; i < items.size(); ++i) {
      bool first = item_bins[i] < split;
      if (item_bins[i] == split) {  // in the order of surfaces, which are near each other in space
        first = before + 0.5 * work(items[i]) < wanted;
        if (first) before += work(items[i]);
      }
      add(items[i], first, regions, halves);
    }
    return halves;
  }

  template <typename Bins>
  static Cut cut_at(const std::vector<Region>& regions, const std::vector<Bins>& bins, std::size_t split,
                    double inside) {
    if (regions.empty()) return {};
    std::size_t at = 0;
    while (at + 1 < bins.size() && split >= bins[at + 1].first) ++at;
    Rect tiles = regions[at].tiles;
    const int low = low_of(tiles, bins[at].along_x);
    const int high = high_of(tiles, bins[at].along_x);
    const double position =
        (static_cast<double>(split - bins[at].first) + inside) / static_cast<double>(bins[at].count);
    return {at, bins[at].along_x, std::clamp(low + static_cast<int>(std::lround(position * (high - low))), low, high)};
  }

  /// Adds an item to a half; to both, where that takes less than to merge what hangs over.
  void add(const Item& item, bool to_first, const std::vector<Region>& regions, Halves& halves) const {
    std::vector<Item>& half = to_first ? halves.first : halves.second;
    const Cut& cut = halves.cut;
    const bool is_cut = !regions.empty() && chunks_[item.part.chunk].screen == regions[cut.region].screen;
    Rect tiles = item.part.tiles;
    if (!is_cut || (to_first ? high_of(tiles, cut.along_x) <= cut.border : low_of(tiles, cut.along_x) >= cut.border)) {
      half.push_back(item);
      return;
    }
    if (to_first ? low_of(tiles, cut.along_x) >= cut.border : high_of(tiles, cut.along_x) <= cut.border) {
      halves.overhead += item.pixels * speeds_.merge;  // all of it hangs over
      half.push_back(item);
      return;
    }
    const Item before = clipped(item, cut.along_x, cut.border, true);
    const Item behind = clipped(item, cut.along_x, cut.border, false);
    const double merging = (to_first ? behind : before).pixels * speeds_.merge;
    const double drawing = item.triangles * speeds_.triangle;
    halves.overhead += std::min(merging, drawing);
    if (merging <= drawing) {
      half.push_back(item);
      return;
    }
    halves.first.push_back(before);
    halves.second.push_back(behind);
  }

  const FrameLayout& layout_;
  std::span<const ScreenChunk> chunks_;
  const DrawSpeeds& speeds_;
  ViewGroups groups_;
};

/// Sums of something over a rectangle of one screen's tiles, made of rectangles inside it.
class RectSums {
 public:
  void reset(const Rect& bounds) {
    bounds_ = bounds;
    grid_ = {bounds.width(), bounds.height()};
    sums_.assign(static_cast<std::size_t>(grid_.width + 1) * static_cast<std::size_t>(grid_.height + 1), 0.0);
  }
  void add(const Rect& tiles, double value) {
    at(tiles.x0, tiles.y0) += value;
    at(tiles.x1, tiles.y0) -= value;
    at(tiles.x0, tiles.y1) -= value;
    at(tiles.x1, tiles.y1) += value;
  }
  /// Once, after all add().
  void sum_up() {
    for (int y = bounds_.y0; y <= bounds_.y1; ++y) {
      for (int x = bounds_.x0 + 1; x <= bounds_.x1; ++x) at(x, y) += at(x - 1, y);
    }
    for (int y = bounds_.y0 + 1; y <= bounds_.y1; ++y) {
      for (int x = bounds_.x0; x <= bounds_.x1; ++x) at(x, y) += at(x, y - 1);
    }
  }
  double& at(int x, int y) {
    return sums_[static_cast<std::size_t>(y - bounds_.y0) * static_cast<std::size_t>(grid_.width + 1) +
                 static_cast<std::size_t>(x - bounds_.x0)];
  }

 private:
  Rect bounds_;
  Size grid_;
  std::vector<double> sums_;
};

/// What a rank draws into a tile.
struct DrawnPixels {
  int rank = 0;
  double pixels = 0.0;
};

/// What is known of groups once their parts are: tiles, owners and what they take.
class Completion {
 public:
  Completion(ViewGroups& groups, const FrameLayout& layout, std::span<const ScreenChunk> chunks,
             const DrawSpeeds& speeds)
      : groups_(groups), layout_(layout), chunks_(chunks), speeds_(speeds), drawn_(layout.tiles()) {}

  void find_tiles() {
    const std::size_t ranks = groups_.parts.size();
    groups_.tiles.assign(ranks, {});
    groups_.draw_ns.assign(ranks, 0.0);
    RectSums counts;
    RectSums pixels;
    for (std::size_t rank = 0; rank < ranks; ++rank) {
      const auto& parts = groups_.parts[rank];
      for (std::size_t first = 0, last = 0; first < parts.size(); first = last) {
        const std::uint32_t screen = chunks_[parts[first].chunk].screen;
        Rect bounds;
        for (last = first; last < parts.size() && chunks_[parts[last].chunk].screen == screen; ++last) {
          bounds = joined(bounds, parts[last].tiles);
        }
        counts.reset(bounds);
        pixels.reset(bounds);
        for (last = first; last < parts.size() && chunks_[parts[last].chunk].screen == screen; ++last) {
          add(parts[last], counts, pixels, groups_.draw_ns[rank]);
        }
        counts.sum_up();
        pixels.sum_up();
        collect(static_cast<int>(rank), screen, bounds, counts, pixels);
      }
    }
  }

  /// Dearest tiles first, each to the rank of those that draw into it that has least to do with it. `before`: owners
  /// that keep their tiles if that makes no great difference; empty: none do.
  void choose_owners(std::span<const double> light_costs, std::span<const int> before) {
    const std::size_t ranks = groups_.parts.size();
    groups_.merge_ns.assign(ranks, 0.0);
    groups_.light_ns.assign(ranks, 0.0);
    groups_.owners = groups_.regions;
    double touched = 0.0;
    double shared = 0.0;
    std::vector<double> totals(drawn_.size(), 0.0);
    std::vector<double> lights(drawn_.size(), 0.0);
    const double light_unit = unit_of(light_costs);
    for (std::size_t tile = 0; tile < drawn_.size(); ++tile) {
      for (const DrawnPixels& each : drawn_[tile]) totals[tile] += each.pixels;
      const auto pixels = static_cast<double>(layout_.place(tile).pixels.area());
      lights[tile] =
          light_costs.empty() ? std::min(totals[tile], pixels) * speeds_.light : light_costs[tile] * light_unit;
      touched += drawn_[tile].empty() ? 0.0 : pixels;
      shared += pixels * static_cast<double>(drawn_[tile].size());
    }
    groups_.overlap = touched > 0.0 ? shared / touched : 1.0;
    std::vector<std::size_t> order(drawn_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return lights[a] > lights[b]; });
    for (const std::size_t tile : order) {
      const auto& drawn = drawn_[tile];
      auto owner = static_cast<std::size_t>(groups_.regions[tile]);
      double own_pixels = 0.0;
      double least = -1.0;
      for (const DrawnPixels& each : drawn) {
        const auto rank = static_cast<std::size_t>(each.rank);
        constexpr double kKeeps = 0.9;
        const bool has_it = !before.empty() && before[tile] == each.rank;
        const double load = (groups_.merge_ns[rank] + groups_.light_ns[rank] +
                             (totals[tile] - each.pixels) * speeds_.merge + lights[tile]) *
                            (has_it ? kKeeps : 1.0);
        if (least >= 0.0 && load >= least) continue;
        least = load;
        owner = rank;
        own_pixels = each.pixels;
      }
      groups_.owners[tile] = static_cast<int>(owner);
      groups_.merge_ns[owner] += (totals[tile] - own_pixels) * speeds_.merge;
      groups_.light_ns[owner] += lights[tile];
    }
  }

 private:
  void add(const Part& part, RectSums& counts, RectSums& pixels, double& draw_ns) const {
    const ScreenChunk& chunk = chunks_[part.chunk];
    const auto whole = static_cast<double>(tiles_around(chunk.pixels).area());
    counts.add(part.tiles, 1.0);
    pixels.add(part.tiles, chunk.covered / whole);
    draw_ns += chunk.surfaces.count() * speeds_.triangle +
               chunk.covered * static_cast<double>(part.tiles.area()) / whole * speeds_.pixel;
  }

  void collect(int rank, std::uint32_t screen, const Rect& bounds, RectSums& counts, RectSums& pixels) {
    for (int y = bounds.y0; y < bounds.y1; ++y) {
      for (int x = bounds.x0; x < bounds.x1; ++x) {
        if (counts.at(x, y) < 0.5) continue;
        const std::size_t tile = layout_.tile_at(screen, x * kTileSide, y * kTileSide);
        // Of surfaces behind each other one is left.
        const auto size = static_cast<double>(layout_.place(tile).pixels.area());
        groups_.tiles[static_cast<std::size_t>(rank)].push_back(tile);
        drawn_[tile].push_back({rank, std::clamp(pixels.at(x, y), 0.0, size)});
      }
    }
  }

  /// Nanoseconds of a unit of measured costs, if light takes as long as expected in all.
  [[nodiscard]] double unit_of(std::span<const double> light_costs) const {
    const double sum = std::accumulate(light_costs.begin(), light_costs.end(), 0.0);
    double pixels = 0.0;
    for (const auto& drawn : drawn_) {
      for (const DrawnPixels& each : drawn) pixels += each.pixels;
    }
    return sum > 0.0 ? pixels * speeds_.light / sum : 0.0;
  }

  ViewGroups& groups_;
  const FrameLayout& layout_;
  std::span<const ScreenChunk> chunks_;
  const DrawSpeeds& speeds_;
  std::vector<std::vector<DrawnPixels>> drawn_;  ///< per tile
};

void complete(ViewGroups& groups, const FrameLayout& layout, std::span<const ScreenChunk> chunks,
              const DrawSpeeds& speeds, std::span<const double> light_costs, std::span<const int> owners_before) {
  Completion completion(groups, layout, chunks, speeds);
  completion.find_tiles();
  completion.choose_owners(light_costs, owners_before);
}

constexpr int kSeveral = -1;  ///< a chunk that several ranks draw
constexpr int kNobody = -2;

/// Per chunk of groups the one rank that draws it, or one of the above.
std::vector<int> drawers_of(const ViewGroups& groups, std::size_t chunks) {
  std::vector<int> drawers(chunks, kNobody);
  for (std::size_t rank = 0; rank < groups.parts.size(); ++rank) {
    for (const Part& part : groups.parts[rank]) {
      int& drawer = drawers.at(part.chunk);
      drawer = drawer == kNobody ? static_cast<int>(rank) : kSeveral;
    }
  }
  return drawers;
}

/// Gives a chunk to all ranks in whose regions it lies, each its own part of it.
void share_by_region(const FrameLayout& layout, std::span<const ScreenChunk> chunks, std::uint32_t index,
                     ViewGroups& groups) {
  const Rect tiles = tiles_around(chunks[index].pixels);
  for (int y = tiles.y0; y < tiles.y1; ++y) {
    for (int x = tiles.x0; x < tiles.x1; ++x) {
      const std::size_t tile = layout.tile_at(chunks[index].screen, x * kTileSide, y * kTileSide);
      auto& parts = groups.parts[static_cast<std::size_t>(groups.regions[tile])];
      if (parts.empty() || parts.back().chunk != index) parts.push_back({index, {x, y, x + 1, y + 1}});
      Rect& own = parts.back().tiles;
      own = {std::min(own.x0, x), std::min(own.y0, y), std::max(own.x1, x + 1), std::max(own.y1, y + 1)};
    }
  }
}

}  // namespace

double ViewGroups::slowest_ns() const {
  const auto slowest = [](const std::vector<double>& of_ranks) {
    return of_ranks.empty() ? 0.0 : std::ranges::max(of_ranks);
  };
  return slowest(draw_ns) + slowest(merge_ns) + slowest(light_ns);
}

double ViewGroups::ideal_ns() const {
  const auto mean = [](const std::vector<double>& of_ranks) {
    return std::accumulate(of_ranks.begin(), of_ranks.end(), 0.0) /
           static_cast<double>(std::max<std::size_t>(of_ranks.size(), 1));
  };
  return mean(draw_ns) + mean(merge_ns) + mean(light_ns);
}

ViewGroups group_by_view(const FrameLayout& layout, std::span<const ScreenChunk> chunks, int ranks,
                         const DrawSpeeds& speeds, std::span<const double> light_costs) {
  HPR_CHECK(ranks > 0 && (light_costs.empty() || light_costs.size() == layout.tiles()));
  ViewGroups groups = Grouping(layout, chunks, ranks, speeds).group();
  complete(groups, layout, chunks, speeds, light_costs, {});
  groups.made_unevenness = groups.unevenness();
  return groups;
}

ViewGroups follow_view(const ViewGroups& old, std::span<const ScreenChunk> old_chunks, const FrameLayout& layout,
                       std::span<const ScreenChunk> chunks, const DrawSpeeds& speeds,
                       std::span<const double> light_costs) {
  const std::vector<int> drawers = drawers_of(old, old_chunks.size());
  const auto before = [](const ScreenChunk& a, const ScreenChunk& b) {
    return a.screen != b.screen ? a.screen < b.screen : a.surfaces.first < b.surfaces.first;
  };
  ViewGroups kept;
  kept.parts.resize(old.parts.size());
  kept.regions = old.regions;
  std::size_t at = 0;
  for (std::uint32_t i = 0; i < chunks.size(); ++i) {
    while (at < old_chunks.size() && before(old_chunks[at], chunks[i])) ++at;
    const bool is_old = at < old_chunks.size() && !before(chunks[i], old_chunks[at]);
    int drawer = is_old ? drawers[at] : kNobody;
    if (drawer == kNobody) {
      const Rect& pixels = chunks[i].pixels;
      drawer = kept.regions[layout.tile_at(chunks[i].screen, (pixels.x0 + pixels.x1 - 1) / 2,
                                           (pixels.y0 + pixels.y1 - 1) / 2)];
    }
    if (drawer == kSeveral) {
      share_by_region(layout, chunks, i, kept);
    } else {
      kept.parts[static_cast<std::size_t>(drawer)].push_back({i, tiles_around(chunks[i].pixels)});
    }
  }
  complete(kept, layout, chunks, speeds, light_costs, old.owners);
  kept.made_unevenness = old.made_unevenness;
  if (kept.unevenness() <= (1.0 + kMinRegroupGain) * old.made_unevenness) return kept;
  ViewGroups anew = Grouping(layout, chunks, static_cast<int>(old.parts.size()), speeds).group();
  complete(anew, layout, chunks, speeds, light_costs, old.owners);
  ViewGroups& chosen = kept.slowest_ns() > (1.0 + kMinRegroupGain) * anew.slowest_ns() ? anew : kept;
  chosen.made_unevenness = chosen.unevenness();
  return std::move(chosen);
}

std::vector<SurfaceRange> drawn_surfaces(const ViewGroups& groups, std::span<const ScreenChunk> chunks, int rank,
                                         std::size_t screen) {
  std::vector<SurfaceRange> surfaces;
  for (const Part& part : groups.parts.at(static_cast<std::size_t>(rank))) {
    const ScreenChunk& chunk = chunks[part.chunk];
    if (chunk.screen != screen) continue;
    if (!surfaces.empty() && surfaces.back().last == chunk.surfaces.first) {
      surfaces.back().last = chunk.surfaces.last;
    } else if (surfaces.empty() || surfaces.back().last < chunk.surfaces.first) {
      surfaces.push_back(chunk.surfaces);
    }  // else several parts of one chunk
  }
  return surfaces;
}

Rect drawn_area(const ViewGroups& groups, const FrameLayout& layout, std::span<const ScreenChunk> chunks, int rank,
                std::size_t screen) {
  Rect tiles;
  for (const Part& part : groups.parts.at(static_cast<std::size_t>(rank))) {
    if (chunks[part.chunk].screen != screen) continue;
    tiles = joined(tiles, part.tiles);
  }
  const Size size = layout.size(screen);
  return intersection({tiles.x0 * kTileSide, tiles.y0 * kTileSide, tiles.x1 * kTileSide, tiles.y1 * kTileSide},
                      {0, 0, size.width, size.height});
}

}  // namespace hpr
