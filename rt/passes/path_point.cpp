#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <span>

#include "rt/lights/direct_light.h"
#include "rt/passes/pass.h"
#include "rt/photons/photon_query.h"
#include "rt/sampling/pick.h"

namespace hpr {
namespace {

/// From here on a point that could be followed in two ways is followed in one, by chance: else the rays of nested glass
/// would double with every surface.
constexpr int kChoosingDepth = 2;

/// Paths that may go on for ever are ended by roulette from here on, by what is left of their throughput.
constexpr int kRouletteDepth = 3;
/// And at the latest here; what white rooms would have beyond is less than roulette leaves.
constexpr int kMostGathered = 256;

/// Where all lobes are followed: each from what the eye sees, and then one of them by chance, in proportion to the
/// light it scatters.
void choose_among_all_lobes(const LightContext& context, PathPoint& point) {
  std::array<double, kLobes.size()> sums{};
  double sum = 0.0;
  for (std::size_t i = 0; i < kLobes.size(); ++i) {
    const bool ends = point.followed >= context.settings.max_depth && context.follows_for_itself(point.bsdf, kLobes[i]);
    if (point.depth == 0) {
      point.may_follow[i] = !ends && point.bsdf.present(kLobes[i]);
      point.follows[i] = point.may_follow[i] ? 1.0F : 0.0F;
      continue;
    }
    const double bright = ends ? 0.0 : brightness(point.throughput * point.bsdf.weight(kLobes[i]));
    point.may_follow[i] = bright > 0.0;
    sums[i] = sum += bright;
  }
  if (!(sum > 0.0)) return;
  const double chance = point.depth < kRouletteDepth ? 1.0 : std::min(sum, 1.0);
  const double u = point.sampler.one() / chance;
  if (!(u < 1.0)) return;
  const Picked picked = pick(sums, u);
  point.follows[picked.index] = static_cast<float>(1.0 / (picked.probability * chance));
}

/// What reaches the pixel by a ray that leaves the scene, as far as sampling lights does not find it.
glm::dvec3 sky_along(const LightContext& context, const Following& ray, const glm::dvec3& direction,
                     const PassInfo& pass) {
  const PathPoint& from = *ray.from;
  if (!context.scene.environment && (pass.gathers_all_lobes || from.gathered))
    return glm::dvec3(0.0);  // a backdrop is no light
  const double light_pdf =
      ray.pdf > 0.0 ? context.lights.environment_pdf_one(from.surface.position, from.bsdf.light_normal(), direction)
                    : 0.0;
  return share_of_ray(context, ray.pdf, light_pdf) * ray.throughput * context.lights.environment(direction);
}

/// Makes a ray per point of the wave that follows the lobe: buffers.following and buffers.requests.
void aim_rays(const LightContext& context, const Wave& wave, const PassInfo& pass, Lobe lobe, RayBuffers& buffers,
              PixelSums& sums) {
  std::vector<Following>& rays = buffers.following;
  rays.clear();
  buffers.requests.clear();
  for (const PathPoint& point : wave.points) {
    const double factor = point.follows[static_cast<std::size_t>(lobe)];
    if (factor == 0.0) continue;
    if (context.gathers && context.follows_for_itself(point.bsdf, lobe) == pass.gathers_all_lobes) continue;
    Sampler sampler = point.sampler.branch(static_cast<std::uint32_t>(lobe));
    const auto sample = point.bsdf.sample(lobe, next_two(sampler, point.depth));
    if (!sample) continue;
    glm::dvec3 throughput = factor * point.throughput * sample->weight;
    throughput *= survival(brightness(throughput), sampler);
    if (throughput == glm::dvec3(0.0)) continue;
    rays.push_back({&point, throughput, sample->pdf, sampler});
    buffers.requests.push_back({ray_origin(point.surface, sample->direction), sample->direction,
                                std::numeric_limits<double>::infinity(), nullptr, 0});
    sums.charge_ray(point.pixel);
  }
  for (std::size_t i = 0; i < rays.size(); ++i) buffers.requests[i].sampler = &rays[i].sampler;
}

/// What ray i finds of the sky; of rays that gather from the first surface also what it would have found, as direct
/// light less its shadow.
void add_sky(const LightContext& context, const RayBuffers& buffers, std::size_t i, const PassInfo& pass,
             PixelSums& sums) {
  const Following& ray = buffers.following[i];
  const PathPoint& from = *ray.from;
  const bool leaves = buffers.hits[i] == kNoSurface;
  const bool shows_sky = pass.gathers_all_lobes && from.depth == 0;
  if (!leaves && !(shows_sky && sums.wants_components)) return;
  const glm::dvec3 sky = sky_along(context, ray, buffers.requests[i].direction, pass);
  if (!shows_sky) return sums.add(from.pixel, component_after(from, pass.component), sky);
  if (leaves) return sums.add(from.pixel, Component::Direct, sky, true);
  sums.add_hidden(from.pixel, sky);
}

/// Sets the point that ray i reaches, but for what finish_point does.
void reach(const LightContext& context, RayBuffers& buffers, std::size_t i, const PassInfo& pass, PathPoint& reached) {
  const Following& ray = buffers.following[i];
  const RayRequest& request = buffers.requests[i];
  const PathPoint& from = *ray.from;
  const WorldTriangle& triangle = buffers.triangles.load(context.surfaces, buffers.hits[i]);
  reached.surface = context.surfaces.meet(triangle, request.origin, request.direction);
  reached.throughput = ray.throughput;
  reached.media = media_towards(from.media, from.surface, from.material, request.direction);
  reached.seen_from = from.surface.position;
  reached.seen_normal = from.bsdf.light_normal();
  reached.seen_pdf = ray.pdf;
  reached.sampler = ray.sampler;
  reached.pixel = from.pixel;
  reached.depth = static_cast<std::uint16_t>(from.depth + 1);
  reached.followed = static_cast<std::uint16_t>(from.followed + (pass.gathers_all_lobes ? 0 : 1));
  reached.gathered = from.gathered || pass.gathers_all_lobes;
  reached.component = component_after(from, pass.component);
}

}  // namespace

bool LightContext::follows_for_itself(const Bsdf& bsdf, Lobe lobe) const {
  return followed_lobes[static_cast<std::size_t>(lobe)] && is_followed(bsdf, lobe, settings.glossy_cutoff);
}

Component component_after(const PathPoint& point, Component first) {
  return point.depth == 0 ? first : point.component;
}

void finish_point(const LightContext& context, PathPoint& point, double metres) {
  point.material = evaluate_material(context.scene, point.surface);
  if (metres > 0.0) point.throughput *= left_at(point.media, point.surface, point.material, metres);
  point.bsdf = Bsdf(point.material, point.surface);
  if (context.gathers) {
    if (point.depth < kMostGathered) choose_among_all_lobes(context, point);
    return;
  }
  if (point.depth >= context.settings.max_depth) return;
  std::array<double, kLobes.size()> bright{};
  for (const Lobe lobe : {Lobe::Reflection, Lobe::Transmission}) {
    const auto i = static_cast<std::size_t>(lobe);
    if (!context.follows_for_itself(point.bsdf, lobe)) continue;
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

void follow_lobe(const LightContext& context, const Wave& wave, const PassInfo& pass, Lobe lobe, RayBuffers& buffers,
                 PixelSums& sums, std::vector<PathPoint>& next) {
  aim_rays(context, wave, pass, lobe, buffers, sums);
  buffers.hits.resize(buffers.following.size());
  buffers.counts[pass.id] += buffers.following.size();
  buffers.counts.invalid += context.rays->closest(buffers.requests, buffers.hits, buffers.scratch);

  const std::size_t before = next.size();
  for (std::size_t i = 0; i < buffers.following.size(); ++i) {
    add_sky(context, buffers, i, pass, sums);
    if (buffers.hits[i] == kNoSurface) continue;
    reach(context, buffers, i, pass, next.emplace_back());
    prefetch_material(context.scene, next.back().surface);
  }
  // By now the memory has what materials read.
  for (PathPoint& reached : std::span(next).subspan(before)) {
    finish_point(context, reached, glm::distance(reached.surface.position, reached.seen_from));
  }
}

}  // namespace hpr
