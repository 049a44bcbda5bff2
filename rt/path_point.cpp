#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "rt/direct_light.h"
#include "rt/pass.h"
#include "rt/photon_gather.h"

namespace hpr {
namespace {

/// From here on a point that could be followed in two ways is followed in one, by chance: else the rays of nested glass
/// would double with every surface.
constexpr int kChoosingDepth = 2;

double brightness(const glm::dvec3& color) {
  return std::max({color.r, color.g, color.b});
}

/// A ray on its way to the next point.
struct Following {
  const PathPoint* from = nullptr;
  glm::dvec3 direction{0.0};
  glm::dvec3 throughput{0.0};
  double pdf = 0.0;
  Media media;
  Sampler sampler;
};

}  // namespace

Component component_after(const PathPoint& point, Component first) {
  return point.depth == 0 ? first : point.component;
}

void finish_point(const TileWork& tile, PathPoint& point, double metres) {
  point.material = evaluate_material(tile.scene, point.surface);
  if (metres > 0.0) point.throughput *= left_at(point.media, point.surface, point.material, metres);
  point.bsdf = Bsdf(point.material, point.surface);
  if (point.depth >= tile.settings.max_depth) return;
  std::array<double, kLobes.size()> bright{};
  for (const Lobe lobe : {Lobe::Reflection, Lobe::Transmission}) {
    const auto i = static_cast<std::size_t>(lobe);
    if (!tile.followed_lobes[i]) continue;
    if (!is_followed(point.bsdf, lobe, tile.settings.glossy_cutoff)) continue;
    bright[i] = brightness(point.throughput * point.bsdf.weight(lobe));
    point.may_follow[i] = bright[i] > 0.0;
    point.follows[i] = static_cast<float>(survival(bright[i], point.sampler));
  }
  const auto reflection = static_cast<std::size_t>(Lobe::Reflection);
  const auto transmission = static_cast<std::size_t>(Lobe::Transmission);
  if (point.depth < kChoosingDepth || !point.may_follow[reflection] || !point.may_follow[transmission]) return;
  const double share = std::clamp(bright[reflection] / (bright[reflection] + bright[transmission]), 0.1, 0.9);
  const bool reflects = point.sampler.one() < share;
  point.follows[reflection] *= reflects ? static_cast<float>(1.0 / share) : 0.0F;
  point.follows[transmission] *= reflects ? 0.0F : static_cast<float>(1.0 / (1.0 - share));
}

void follow_lobe(TileWork& tile, const Wave& wave, Lobe lobe, Component component, std::uint64_t& counter,
                 std::vector<PathPoint>& next) {
  std::vector<Following> rays;
  for (const PathPoint& point : wave.points) {
    const double factor = point.follows[static_cast<std::size_t>(lobe)];
    if (factor == 0.0) continue;
    Sampler sampler = point.sampler.branch(static_cast<std::uint32_t>(lobe));
    const auto sample = point.bsdf.sample(lobe, sampler.two());
    if (!sample) continue;
    glm::dvec3 throughput = factor * point.throughput * sample->weight;
    throughput *= survival(brightness(throughput), sampler);
    if (throughput == glm::dvec3(0.0)) continue;
    rays.push_back({&point, sample->direction, throughput, sample->pdf,
                    media_towards(point.media, point.surface, point.material, sample->direction), sampler});
  }
  tile.requests.clear();
  for (Following& ray : rays) {
    tile.requests.push_back({ray_origin(ray.from->surface, ray.direction), ray.direction,
                             std::numeric_limits<double>::infinity(), &ray.sampler, 0});
    tile.charge_ray(ray.from->pixel);
  }
  std::vector<std::optional<SurfacePoint>> hits(rays.size());
  counter += rays.size();
  tile.counts.invalid += tile.rays->closest(tile.requests, hits, tile.scratch);

  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Following& ray = rays[i];
    const glm::dvec3& place = ray.from->surface.position;
    const Component part = component_after(*ray.from, component);
    if (!hits[i]) {
      const double light_pdf =
          ray.pdf > 0.0 ? tile.lights.environment_pdf_one(place, ray.from->bsdf.light_normal(), ray.direction) : 0.0;
      tile.add(ray.from->pixel, part,
               share_of_ray(tile, ray.pdf, light_pdf) * ray.throughput * tile.lights.environment(ray.direction));
      continue;
    }
    PathPoint& reached = next.emplace_back();
    reached.surface = *hits[i];
    reached.throughput = ray.throughput;
    reached.media = ray.media;
    reached.seen_from = place;
    reached.seen_normal = ray.from->bsdf.light_normal();
    reached.seen_pdf = ray.pdf;
    reached.sampler = ray.sampler;
    reached.pixel = ray.from->pixel;
    reached.depth = static_cast<std::uint16_t>(ray.from->depth + 1);
    reached.component = part;
    finish_point(tile, reached, glm::distance(reached.surface.position, place));
  }
}

}  // namespace hpr
