#include "engine/balance/load_balance.h"

#include <algorithm>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/timing.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "rt/deferred_shader.h"
#include "rt/passes/pass_list.h"
#include "rt/trace/ray_scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

/// What a pixel without a surface costs, by one that has one.
constexpr double kEmptyPixelCost = 0.05;

/// What a rank says of a tile.
struct TileNote {
  std::uint32_t tile = 0;
  float cost = 0.0F;
};

std::vector<std::vector<TileNote>> all_notes(Communicator& comm, const std::vector<TileNote>& mine) {
  return all_gather_lists(comm, std::span<const TileNote>(mine));
}

bool is_balanced(const FramePlan& plan) {
  return plan.balance != Balance::Static && plan.areas.size() > 1;
}

/// Per group how many ranks it has.
std::vector<int> group_sizes(int ranks, std::size_t groups) {
  std::vector<int> sizes;
  for (const auto& group : make_groups(ranks, static_cast<int>(groups)))
    sizes.push_back(static_cast<int>(group.size()));
  return sizes;
}

void set_areas(Session& session, FramePlan& plan, std::vector<std::vector<ScreenRect>> areas) {
  if (areas == plan.areas) return;
  plan.areas = std::move(areas);
  const int ranks = session.comm().size();
  const auto groups = make_groups(ranks, static_cast<int>(plan.areas.size()));
  const auto mine = std::ranges::find(groups, plan.mine.group) - groups.begin();
  plan.mine.area = plan.areas.at(static_cast<std::size_t>(mine));
  plan.tiles = tiles_of(plan.layout, plan.mine.area);
  if (!plan.drawn_by) return;
  std::vector<Assignment> assigned = assign(plan.distribution, session.scene(), plan.layout, ranks, plan.groups);
  for (std::size_t group = 0; group < groups.size(); ++group) {
    for (const int rank : groups[group]) assigned[static_cast<std::size_t>(rank)].area = plan.areas[group];
  }
  plan.drawn_by.emplace(assigned, plan.layout);
}

/// Rays through a grid of a tile's pixels.
RayBatch rays_through(const View& view, const Rect& pixels, const RaySpace& space) {
  constexpr int kSide = 4;
  RayBatch rays;
  for (int i = 0; i < kSide * kSide; ++i) {
    const int column = i % kSide;
    const int row = i / kSide;
    const double x = pixels.x0 + (column + 0.5) * pixels.width() / kSide;
    const double y = pixels.y0 + (row + 0.5) * pixels.height() / kSide;
    Ray ray = view_ray(view, x, y);
    ray.origin += ray.direction * view.near_distance;
    rays.push(space.from_world(ray.origin), glm::normalize(ray.direction), std::numeric_limits<double>::infinity(),
              Faces::Front);
  }
  return rays;
}

/// Collective. Per tile about what it costs, as some rays find out: each rank sends those of its share of the tiles,
/// and the result is the same on all ranks.
std::vector<double> estimate_costs(Session& session, const FramePlan& plan, std::span<const View> views) {
  const trace::Span span("estimate costs");
  session.partition_rays(plan.rays);
  const RayScene& scene = session.ray_scene(plan.rays.build);
  const auto ranks = static_cast<std::size_t>(session.comm().size());
  const auto rank = static_cast<std::size_t>(session.rank());
  const std::size_t first = plan.layout.tiles() * rank / ranks;
  std::vector<TileNote> mine(plan.layout.tiles() * (rank + 1) / ranks - first);
  scene.for_each(session.threads(), mine.size(), [&](std::size_t i) {
    const TilePlace location = plan.layout.place(first + i);
    const RayBatch rays = rays_through(views[location.screen], location.pixels, scene.space());
    std::vector<std::uint32_t> hits(rays.size());
    (void)scene.closest(rays, hits);
    const auto empty = static_cast<double>(std::ranges::count(hits, kNoSurface)) / static_cast<double>(hits.size());
    const auto pixels = static_cast<double>(location.pixels.width()) * location.pixels.height();
    mine[i] = {static_cast<std::uint32_t>(first + i),
               static_cast<float>(pixels * (1.0 - (1.0 - kEmptyPixelCost) * empty))};
  });
  std::vector<double> costs(plan.layout.tiles(), 0.0);
  for (const auto& notes : all_notes(session.comm(), mine)) {
    for (const TileNote& note : notes) costs[note.tile] = note.cost;
  }
  return costs;
}

/// Whether a frame has a scene for rays, however it is balanced.
bool has_ray_scene(Session& session, const FramePlan& plan) {
  if (plan.primary == Primary::Rays || plan.rays.reference || traces_own_rays(plan.rays.show)) return true;
  return needs_light(plan.rays.show) && traces_rays_beside_keys(session.requirements(), plan.rays);
}

}  // namespace

double cost_of_keys(const TileLayer<Key>& keys, std::size_t tile) {
  if (!keys.active(tile)) return kEmptyPixelCost * kTilePixels;
  return kTilePixels - (1.0 - kEmptyPixelCost) * static_cast<double>(std::ranges::count(keys.tile(tile), kNoKey));
}

void LoadBalance::forget() {
  layout_ = {};
  keys_spent_.clear();
  light_spent_.clear();
  costs_.clear();
  light_costs_.clear();
}

const MachineSpeeds& LoadBalance::speeds(Session& session, bool by_raster) {
  if (!speeds_ || (by_raster && !raster_measured_)) {
    speeds_ = measure_speeds(session, by_raster);
    raster_measured_ = by_raster;
  }
  return *speeds_;
}

void LoadBalance::set_speeds(const MachineSpeeds& speeds) {
  speeds_ = speeds;
  raster_measured_ = true;
}

void LoadBalance::start_frame(const FrameLayout& layout) {
  if (layout != layout_) forget();
  layout_ = layout;
  keys_spent_.assign(layout.tiles(), 0.0);
  light_spent_.assign(layout.tiles(), 0.0);
}

void LoadBalance::add_keys(const FrameLayout& layout, std::span<const TileCost> costs) {
  if (layout != layout_) return;
  for (const TileCost& cost : costs) keys_spent_[cost.tile] += cost.ms;
}

void LoadBalance::add_light(const FrameLayout& layout, std::span<const TileCost> costs) {
  if (layout != layout_) return;
  for (const TileCost& cost : costs) light_spent_[cost.tile] += cost.ms;
}

void LoadBalance::add_keys(const FrameLayout& layout, std::span<const std::size_t> tiles, double ms) {
  if (layout != layout_) return;
  for (const std::size_t tile : tiles) keys_spent_[tile] += ms / static_cast<double>(tiles.size());
}

void LoadBalance::finish_frame(Communicator& comm, const FrameLayout& layout, int samples) {
  if (layout != layout_) return;
  struct TileSpent {
    std::uint32_t tile = 0;
    float keys = 0.0F;
    float light = 0.0F;
  };
  std::vector<TileSpent> mine;
  for (std::size_t tile = 0; tile < keys_spent_.size(); ++tile) {
    if (keys_spent_[tile] + light_spent_[tile] == 0.0) continue;
    mine.push_back({static_cast<std::uint32_t>(tile), static_cast<float>(keys_spent_[tile]),
                    static_cast<float>(light_spent_[tile])});
  }
  std::vector<double> all(keys_spent_.size(), 0.0);
  std::vector<double> light(keys_spent_.size(), 0.0);
  for (const auto& spent : all_gather_lists(comm, std::span<const TileSpent>(mine))) {
    for (const TileSpent& each : spent) {
      all.at(each.tile) += (double{each.keys} + double{each.light}) / std::max(samples, 1);
      light[each.tile] += double{each.light} / std::max(samples, 1);
    }
  }
  costs_.add(all);
  light_costs_.add(light);
  start_frame(layout);
}

std::span<const double> LoadBalance::costs(const FrameLayout& layout) const {
  return layout == layout_ ? costs_.costs() : std::span<const double>();
}

std::span<const double> LoadBalance::light_costs(const FrameLayout& layout) const {
  return layout == layout_ ? light_costs_.costs() : std::span<const double>();
}

std::vector<int> LoadBalance::owners_of_light(Communicator& comm, const TileLayer<Key>& keys,
                                              std::span<const std::size_t> present) const {
  const std::span<const double> known = light_costs(keys.layout());
  std::vector<TileNote> mine;
  mine.reserve(present.size());
  for (const std::size_t tile : present) {
    const double cost = known.empty() ? cost_of_keys(keys, tile) : known[tile];
    mine.push_back({static_cast<std::uint32_t>(tile), static_cast<float>(cost)});
  }
  std::vector<int> owners(keys.tiles(), -1);
  std::vector<double> expected(keys.tiles(), 0.0);
  const auto all = all_notes(comm, mine);
  for (std::size_t rank = 0; rank < all.size(); ++rank) {
    for (const TileNote& note : all[rank]) {
      HPR_CHECK(owners.at(note.tile) == -1);
      owners[note.tile] = static_cast<int>(rank);
      expected[note.tile] = note.cost;
    }
  }
  return balance_owners(std::move(owners), expected, comm.size());
}

std::string explain_balance(const FramePlan& plan) {
  switch (plan.balance) {
    case Balance::Static:
      return "balance: static (as asked: tiles are shared out by their number)";
    case Balance::Measured:
      return "balance: measured (as asked: tiles are shared out by what they took before, or are expected to)";
    case Balance::Demand:
      break;
  }
  if (plan.shading == Shading::Local) return "balance: measured (light before compositing stays with who drew it)";
  if (plan.rays.part) return "balance: measured (rays travel, so that light is a matter of all ranks)";
  if (plan.rays.reference) return "balance: estimated (what the reference takes for each tile is not measured)";
  return "balance: demand (tiles are shared out by what they took before, or are expected to, and ranks of a host that "
         "are done light rows of others')";
}

bool lends_light(Session& session, const FramePlan& plan) {
  if (plan.balance != Balance::Demand || session.comm().size() == 1 || session.comm().models_time()) return false;
  if (plan.shading == Shading::Local || !plan.lit || plan.rays.on_device) return false;
  return !session.shader(plan.rays).is_whole();
}

void plan_areas(Session& session, FramePlan& plan, std::span<const View> views) {
  if (!is_balanced(plan)) return;
  const std::span<const double> known = session.balance().costs(plan.layout);
  if (known.empty() && !has_ray_scene(session, plan)) return;
  const std::vector<double> estimate = known.empty() ? estimate_costs(session, plan, views) : std::vector<double>();
  set_areas(session, plan,
            assign_tiles(plan.layout, group_sizes(session.comm().size(), plan.areas.size()),
                         known.empty() ? std::span<const double>(estimate) : known));
}

void group_by_view(Session& session, FramePlan& plan, std::span<const View> views) {
  const std::span<const double> light_costs = session.balance().light_costs(plan.layout);
  if (plan.by_view) {
    if (plan.by_view->fits(views)) return;
    plan.by_view->follow(session, plan.layout, views, {}, light_costs);
  } else {
    plan.by_view.emplace(session, plan.layout, views, DrawSpeeds{}, light_costs);
  }
  const ViewGroups& groups = plan.by_view->groups();
  plan.mine.area.clear();
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    const Rect area = drawn_area(groups, plan.layout, plan.by_view->chunks(), session.rank(), screen);
    if (!area.empty()) plan.mine.area.push_back({screen, area});
  }
  plan.tiles = groups.tiles.at(static_cast<std::size_t>(session.rank()));
  if (plan.drawn_by) plan.drawn_by.emplace(groups, plan.by_view->chunks(), plan.layout);
}

void update_areas(Session& session, FramePlan& plan, std::span<const View> views) {
  if (plan.by_view) group_by_view(session, plan, views);
  if (!is_balanced(plan)) return;
  const std::span<const double> costs = session.balance().costs(plan.layout);
  if (costs.empty()) return;
  const std::vector<int> sizes = group_sizes(session.comm().size(), plan.areas.size());
  set_areas(session, plan, next_areas(plan.areas, plan.layout, sizes, costs));
}

}  // namespace hpr
