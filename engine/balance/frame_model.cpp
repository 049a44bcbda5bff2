#include "engine/balance/frame_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cluster/distribution/balance.h"
#include "engine/balance/view_grouping.h"
#include "engine/session.h"
#include "raster/chunk_bounds.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// Tiles of a chunk's screen that it may touch.
Rect tiles_around(const Rect& pixels) {
  const auto end = [](int pixel) { return (pixel + kTileSide - 1) / kTileSide; };
  return {pixels.x0 / kTileSide, pixels.y0 / kTileSide, end(pixels.x1), end(pixels.y1)};
}

template <typename Body>
void each_tile(const FrameLayout& layout, const ScreenChunk& chunk, const Body& body) {
  const Rect tiles = tiles_around(chunk.pixels);
  for (int y = tiles.y0; y < tiles.y1; ++y) {
    for (int x = tiles.x0; x < tiles.x1; ++x) body(layout.tile_at(chunk.screen, x * kTileSide, y * kTileSide));
  }
}

double sum_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

/// What each rank has to do in a frame, in nanoseconds.
struct RankWork {
  explicit RankWork(int ranks)
      : draw(static_cast<std::size_t>(ranks), 0.0),
        composite(static_cast<std::size_t>(ranks), 0.0),
        light(static_cast<std::size_t>(ranks), 0.0) {}

  std::vector<double> draw;
  std::vector<double> composite;
  std::vector<double> light;
  double prepare = 0.0;  ///< of every rank
  double overlap = 1.0;
};

class Model {
 public:
  Model(const FrameLoad& load, const MachineSpeeds& speeds, int ranks)
      : load_(load), speeds_(speeds), ranks_(ranks), work_(ranks) {
    // Of surfaces behind each other one is lit.
    std::vector<double> covered(load.layout.tiles(), 0.0);
    for (const ScreenChunk& chunk : load.chunks) {
      const double part = chunk.covered / static_cast<double>(tiles_around(chunk.pixels).area());
      each_tile(load.layout, chunk, [&](std::size_t tile) { covered[tile] += part; });
    }
    for (std::size_t tile = 0; tile < covered.size(); ++tile) {
      const auto pixels = static_cast<double>(load.layout.place(tile).pixels.area());
      covered_.push_back(std::min(covered[tile], pixels));
      light_.push_back(load.light_ns.empty() ? covered_.back() * speeds.light : load.light_ns[tile]);
    }
  }

  FramePrediction predict(Distribution distribution, int groups) {
    switch (distribution) {
      case Distribution::SortFirst:
        sort_first(false);
        break;
      case Distribution::SortMiddle:
        sort_first(!load_.by_rays && ranks_ > 1);
        break;
      case Distribution::SortLast:
        nested_groups(1);
        break;
      case Distribution::Hybrid:
        if (groups == 0 && !load_.by_rays) {
          by_view();
        } else {
          nested_groups(std::min(groups > 0 ? groups : default_groups(ranks_), ranks_));
        }
        break;
    }
    return sum_up(distribution);
  }

 private:
  /// Per tile the area that it lies in, cut so that tiles cost about the same.
  [[nodiscard]] std::vector<int> areas_of(int areas) {
    std::vector<double> costs = light_;
    if (load_.by_rays) {
      for (std::size_t tile = 0; tile < costs.size(); ++tile) {
        costs[tile] += static_cast<double>(load_.layout.place(tile).pixels.area()) * speeds_.ray;
      }
    } else {
      for (const ScreenChunk& chunk : load_.chunks) {
        const double part = drawing_of(chunk) / static_cast<double>(tiles_around(chunk.pixels).area());
        each_tile(load_.layout, chunk, [&](std::size_t tile) { costs[tile] += part; });
      }
    }
    std::vector<int> area_of_tile(load_.layout.tiles(), 0);
    const auto cut = assign_tiles(load_.layout, std::vector<int>(static_cast<std::size_t>(areas), 1), costs);
    rects_.assign(static_cast<std::size_t>(areas), 0);
    for (std::size_t area = 0; area < cut.size(); ++area) {
      rects_[area] = cut[area].size();
      for (const std::size_t tile : tiles_of(load_.layout, cut[area])) area_of_tile[tile] = static_cast<int>(area);
    }
    return area_of_tile;
  }

  [[nodiscard]] double drawing_of(const ScreenChunk& chunk) const {
    return chunk.surfaces.count() * speeds_.raster.triangle + chunk.covered * speeds_.raster.pixel;
  }

  /// `culls_together`: sort-middle, where each rank culls a part of the chunks for all.
  void sort_first(bool culls_together) {
    const std::vector<int> owners = areas_of(ranks_);
    if (load_.by_rays) {
      trace(owners, 1);
    } else {
      draw_in_areas(owners, culls_together);
    }
    for (std::size_t tile = 0; tile < owners.size(); ++tile) {
      work_.light[static_cast<std::size_t>(owners[tile])] += light_[tile];
    }
    work_.prepare += build_of(static_cast<double>(load_.built_triangles));
  }

  /// Each rank draws all chunks that touch its tiles, as far as they lie there.
  void draw_in_areas(const std::vector<int>& owners, bool culls_together) {
    std::vector<bool> drawn(owners.size(), false);
    std::vector<double> parts(static_cast<std::size_t>(ranks_), 0.0);
    std::vector<int> touched;
    for (const ScreenChunk& chunk : load_.chunks) {
      const double part = 1.0 / static_cast<double>(tiles_around(chunk.pixels).area());
      touched.clear();
      each_tile(load_.layout, chunk, [&](std::size_t tile) {
        const auto rank = static_cast<std::size_t>(owners[tile]);
        if (parts[rank] == 0.0) touched.push_back(owners[tile]);
        parts[rank] += part;
        drawn[tile] = true;
      });
      for (const int rank : touched) {
        double& of_rank = parts[static_cast<std::size_t>(rank)];
        work_.draw[static_cast<std::size_t>(rank)] +=
            chunk.surfaces.count() * speeds_.raster.triangle + chunk.covered * of_rank * speeds_.raster.pixel;
        of_rank = 0.0;
      }
    }
    for (std::size_t tile = 0; tile < owners.size(); ++tile) {
      if (drawn[tile]) work_.draw[static_cast<std::size_t>(owners[tile])] += read_of(load_.layout.place(tile).pixels);
    }
    const double culling = static_cast<double>(load_.objects.size()) * speeds_.chunk;
    for (std::size_t rank = 0; rank < work_.draw.size(); ++rank) {
      const auto rects = static_cast<double>(rects_[rank]);
      work_.draw[rank] += rects * speeds_.raster.draw + (culls_together ? culling / ranks_ : rects * culling);
    }
    if (culls_together) rounds_ = 1.0;
  }

  /// Rays through all pixels of each rank's area, in as many layers as ranks share it.
  void trace(const std::vector<int>& areas, int members) {
    // What misses a part's box costs little.
    const double ray = members == 1 ? speeds_.ray : speeds_.ray * (0.3 + 0.7 / members);
    for (std::size_t tile = 0; tile < areas.size(); ++tile) {
      const double cost = static_cast<double>(load_.layout.place(tile).pixels.area()) * ray;
      for (int member = 0; member < members; ++member) {
        const std::size_t rank = static_cast<std::size_t>(areas[tile]) * static_cast<std::size_t>(members) +
                                 static_cast<std::size_t>(member);
        if (rank < work_.draw.size()) work_.draw[rank] += cost;
      }
    }
  }

  /// Groups that own tiles and whose ranks share all objects; sort-last is one group of all.
  void nested_groups(int groups) {
    const std::vector<int> areas = areas_of(groups);
    const auto members = make_groups(ranks_, groups);
    const int largest = static_cast<int>(std::ranges::max(members, {}, &std::vector<int>::size).size());
    work_.prepare += build_of(static_cast<double>(load_.built_triangles) / largest);
    if (load_.by_rays) {
      trace(areas, largest);
      for (std::size_t tile = 0; tile < areas.size(); ++tile) add_merging(tile, members, areas, covered_[tile]);
      work_.overlap = largest;
    } else {
      draw_parts(members, areas, largest);
    }
    std::vector<int> owners(light_.size());
    for (std::size_t tile = 0; tile < owners.size(); ++tile) {
      owners[tile] = static_cast<int>(tile * static_cast<std::size_t>(ranks_) / owners.size());
    }
    light_evenly(owners);
  }

  /// Per first surface of a range the part of the objects that it belongs to.
  [[nodiscard]] std::vector<std::pair<std::uint32_t, int>> parts_of_surfaces(int parts) const {
    const auto partition = partition_chunks(load_.objects, parts);
    std::vector<std::pair<std::uint32_t, int>> part_of;
    for (std::size_t part = 0; part < partition.size(); ++part) {
      for (const SurfaceRange& range : partition[part]) part_of.emplace_back(range.first, static_cast<int>(part));
    }
    std::ranges::sort(part_of);
    return part_of;
  }

  void draw_parts(const std::vector<std::vector<int>>& members, const std::vector<int>& areas, int largest) {
    const auto part_of = parts_of_surfaces(largest);
    std::vector<DrawnLayers> layers(load_.layout.tiles());
    std::vector<Rect> bounds(work_.draw.size() * load_.layout.screens());
    std::vector<int> touched;
    std::vector<double> parts(members.size(), 0.0);
    for (const ScreenChunk& chunk : load_.chunks) {
      const auto after = std::ranges::upper_bound(part_of, std::pair(chunk.surfaces.first, largest));
      const int part = after == part_of.begin() ? 0 : std::prev(after)->second;
      const double fraction = 1.0 / static_cast<double>(tiles_around(chunk.pixels).area());
      touched.clear();
      each_tile(load_.layout, chunk, [&](std::size_t tile) {
        auto& of_group = parts[static_cast<std::size_t>(areas[tile])];
        if (of_group == 0.0) touched.push_back(areas[tile]);
        of_group += fraction;
        add_layer(layers[tile], part, chunk.covered * fraction);
      });
      for (const int group : touched) {
        const auto& of_group = members[static_cast<std::size_t>(group)];
        const auto rank = static_cast<std::size_t>(of_group[static_cast<std::size_t>(part) % of_group.size()]);
        double& fraction_here = parts[static_cast<std::size_t>(group)];
        work_.draw[rank] +=
            chunk.surfaces.count() * speeds_.raster.triangle + chunk.covered * fraction_here * speeds_.raster.pixel;
        fraction_here = 0.0;
        Rect& drawn = bounds[rank * load_.layout.screens() + chunk.screen];
        drawn = drawn.empty() ? chunk.pixels
                              : Rect{std::min(drawn.x0, chunk.pixels.x0), std::min(drawn.y0, chunk.pixels.y0),
                                     std::max(drawn.x1, chunk.pixels.x1), std::max(drawn.y1, chunk.pixels.y1)};
      }
    }
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      const std::size_t rank = i / load_.layout.screens();
      if (bounds[i].empty()) continue;
      work_.draw[rank] += read_of(bounds[i]) / static_cast<double>(members.size()) + speeds_.raster.draw;
    }
    for (double& draw : work_.draw) draw += bounding_ns() / largest;
    merge_layers(layers, members, areas);
  }

  /// Per part of the objects about how many pixels of a tile it draws.
  using DrawnLayers = std::vector<std::pair<int, double>>;

  static void add_layer(DrawnLayers& layers, int part, double pixels) {
    const auto same = std::ranges::find(layers, part, &std::pair<int, double>::first);
    if (same == layers.end()) {
      layers.emplace_back(part, pixels);
    } else {
      same->second += pixels;
    }
  }

  void merge_layers(std::span<const DrawnLayers> layers, const std::vector<std::vector<int>>& members,
                    const std::vector<int>& areas) {
    double touched_tiles = 0.0;
    double layers_in_all = 0.0;
    for (std::size_t tile = 0; tile < layers.size(); ++tile) {
      if (layers[tile].empty()) continue;
      const auto pixels = static_cast<double>(load_.layout.place(tile).pixels.area());
      double drawn = 0.0;
      for (const auto& [part, covered] : layers[tile]) drawn += std::min(covered, pixels);
      add_merging(tile, members, areas,
                  drawn / static_cast<double>(layers[tile].size()) * static_cast<double>(layers[tile].size() - 1));
      touched_tiles += 1.0;
      layers_in_all += static_cast<double>(layers[tile].size());
    }
    work_.overlap = touched_tiles > 0.0 ? layers_in_all / touched_tiles : 1.0;
  }

  /// Pixels of a tile that are merged, by all ranks of its group alike.
  void add_merging(std::size_t tile, const std::vector<std::vector<int>>& members, const std::vector<int>& areas,
                   double pixels) {
    const auto& of_group = members[static_cast<std::size_t>(areas[tile])];
    if (of_group.size() == 1) return;
    const double merge = ranks_ <= speeds_.host_ranks ? speeds_.merge_in_place : speeds_.merge;
    for (const int rank : of_group) {
      work_.composite[static_cast<std::size_t>(rank)] += pixels * merge / static_cast<double>(of_group.size());
    }
    rounds_ = std::max(rounds_, 2.0 * std::ceil(std::log2(static_cast<double>(of_group.size()))));
  }

  void by_view() {
    const ViewGroups groups = group_by_view(load_.layout, load_.chunks, ranks_, speeds_.draw_speeds(), load_.light_ns);
    std::vector<std::size_t> peers(work_.draw.size(), 0);
    for (std::size_t rank = 0; rank < work_.draw.size(); ++rank) {
      for (const ViewGroups::Part& part : groups.parts[rank]) {
        const ScreenChunk& chunk = load_.chunks[part.chunk];
        const double fraction =
            static_cast<double>(part.tiles.area()) / static_cast<double>(tiles_around(chunk.pixels).area());
        work_.draw[rank] +=
            chunk.surfaces.count() * speeds_.raster.triangle + chunk.covered * fraction * speeds_.raster.pixel;
      }
      for (std::size_t screen = 0; screen < load_.layout.screens(); ++screen) {
        const Rect area = drawn_area(groups, load_.layout, load_.chunks, static_cast<int>(rank), screen);
        if (!area.empty()) work_.draw[rank] += read_of(area) + speeds_.raster.draw;
      }
      std::vector<int> owners;
      for (const std::size_t tile : groups.tiles[rank]) {
        if (groups.owners[tile] != static_cast<int>(rank)) owners.push_back(groups.owners[tile]);
      }
      std::ranges::sort(owners);
      const auto last = std::unique(owners.begin(), owners.end());
      peers[rank] = static_cast<std::size_t>(last - owners.begin());
      work_.composite[rank] = groups.merge_ns[rank] + static_cast<double>(peers[rank]) * speeds_.post;
    }
    rounds_ = 1.0;
    work_.overlap = groups.overlap;
    // Every rank bounds some of the chunks, and groups all.
    const auto chunks = static_cast<double>(load_.chunks.size());
    work_.prepare += bounding_ns() / ranks_ +
                     chunks * (speeds_.group + static_cast<double>(sizeof(ScreenChunk)) / sizeof(Key) * speeds_.merge) +
                     ranks_ * 100.0 + std::ceil(std::log2(ranks_)) * speeds_.message;
    light_evenly(groups.owners);
  }

  /// After compositing tiles go to who has time.
  void light_evenly(const std::vector<int>& owners) {
    const std::vector<int> lit_by = balance_owners(owners, light_, ranks_);
    for (std::size_t tile = 0; tile < owners.size(); ++tile) {
      work_.light[static_cast<std::size_t>(lit_by[tile])] += light_[tile];
      if (lit_by[tile] != owners[tile]) {
        work_.composite[static_cast<std::size_t>(lit_by[tile])] += covered_[tile] * speeds_.merge;
      }
    }
  }

  /// All chunks on every screen.
  [[nodiscard]] double bounding_ns() const {
    return static_cast<double>(load_.objects.size() * load_.layout.screens()) * speeds_.chunk;
  }
  [[nodiscard]] double read_of(const Rect& pixels) const {
    return static_cast<double>(pixels.area()) * speeds_.raster.read;
  }
  [[nodiscard]] double build_of(double triangles) const { return triangles * speeds_.build / load_.frames; }

  /// Ranks that are done leave their cores to others.
  [[nodiscard]] double phase_ms(std::span<const double> of_ranks) const {
    const double mean = sum_of(of_ranks) / static_cast<double>(of_ranks.size());
    return 1e-6 * std::max(std::ranges::max(of_ranks) / speeds_.crowding, mean);
  }

  [[nodiscard]] FramePrediction sum_up(Distribution distribution) {
    FramePrediction prediction;
    prediction.distribution = distribution;
    const auto host = static_cast<std::size_t>(std::max(speeds_.host_ranks, 1));
    for (std::size_t first = 0; first < work_.light.size(); first += host) {
      const std::span<double> of_host =
          std::span(work_.light).subspan(first, std::min(host, work_.light.size() - first));
      std::ranges::fill(of_host, sum_of(of_host) / static_cast<double>(of_host.size()));
    }
    prediction.draw_ms = phase_ms(work_.draw);
    prediction.composite_ms = phase_ms(work_.composite) + 1e-6 * (ranks_ > 1 ? rounds_ : 0.0) * speeds_.message;
    prediction.light_ms = phase_ms(work_.light);
    prediction.prepare_ms = 1e-6 * work_.prepare;
    prediction.show_ms = 1e-6 * showing_ns();
    std::vector<double> both;
    for (std::size_t rank = 0; rank < work_.draw.size(); ++rank) both.push_back(work_.draw[rank] + work_.light[rank]);
    prediction.imbalance = slowest_over_mean(both);
    prediction.overlap = work_.overlap;
    prediction.drawn_ns = sum_of(both);
    return prediction;
  }

  /// Each rank finishes about as many pixels; those who show them get what others have, one after the other.
  [[nodiscard]] double showing_ns() const {
    double pixels = 0.0;
    for (std::size_t tile = 0; tile < light_.size(); ++tile) {
      pixels += static_cast<double>(load_.layout.place(tile).pixels.area());
    }
    const double finishing = pixels * speeds_.finish / ranks_;
    if (ranks_ == 1) return finishing;
    const double others = 1.0 - 1.0 / ranks_;
    return finishing + pixels / std::min(load_.writers, ranks_) * others * speeds_.collect + speeds_.message;
  }

  const FrameLoad& load_;
  const MachineSpeeds& speeds_;
  int ranks_;
  RankWork work_;
  double rounds_ = 0.0;             ///< of messages
  std::vector<double> covered_;     ///< per tile the pixels that show something
  std::vector<double> light_;       ///< per tile
  std::vector<std::size_t> rects_;  ///< per area
};

}  // namespace

FrameLoad load_of(Session& session, std::span<const View> views) {
  FrameLoad load;
  std::vector<Size> sizes;
  for (const View& view : views) sizes.push_back(view.size());
  load.layout = FrameLayout(std::move(sizes));
  load.chunks = chunks_on_screens(session, views);
  for (const SceneChunk& chunk : session.scene_chunks().chunks) {
    const glm::dvec3 center = 0.5 * (glm::dvec3(chunk.box.low) + glm::dvec3(chunk.box.high));
    load.objects.push_back(
        {chunk.surfaces, session.scene().instances[chunk.instance].to_world * glm::dvec4(center, 1.0)});
  }
  return load;
}

FramePrediction predict_frame(Distribution distribution, const FrameLoad& load, const MachineSpeeds& speeds, int ranks,
                              int groups) {
  HPR_CHECK(ranks > 0);
  return Model(load, speeds, ranks).predict(distribution, groups);
}

double efficiency(const FramePrediction& one_rank, const FramePrediction& prediction, int ranks) {
  return one_rank.total_ms() / (ranks * prediction.total_ms());
}

FrameLimit limit_of(const FramePrediction& one_rank, const FramePrediction& prediction, int ranks) {
  constexpr double kMinPart = 0.005;
  FrameLimit limit{kFramePhases.data(), 0.0};
  if (prediction.total_ms() <= 0.0) return limit;
  for (const FramePhase& phase : kFramePhases) {
    const double lost = prediction.*phase.ms - one_rank.*phase.ms / ranks;
    if (lost / prediction.total_ms() > std::max(limit.part, kMinPart)) limit = {&phase, lost / prediction.total_ms()};
  }
  return limit;
}

}  // namespace hpr
