#include "rt/passes/path_vertex.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "core/parallel.h"
#include "rt/lights/direct_light.h"
#include "rt/passes/pass.h"
#include "rt/photons/photon_query.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

Sampler sampler_of(const LightContext& context, const TileJob& job, int x, int y) {
  const glm::ivec2 pixel = job.origin() + glm::ivec2(x, y);
  return {pixel_stream({context.settings.seed, job.number.frame}, job.view->screen_number, pixel.x, pixel.y),
          job.number.sample};
}

/// See find_primary_vertices. Points are finished once all are found: by then the memory has what materials read.
class PrimaryVertices {
 public:
  PrimaryVertices(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                  PixelSums& sums, std::vector<PathVertex>& points)
      : context_(context), job_(job), rows_(rows), buffers_(buffers), sums_(sums), points_(points) {}

  void find() {
    const std::size_t before = points_.size();
    TileJob job = job_;
    job.rows = rows_;
    fetch_triangles(context_, std::span(&job, 1));
    find_surfaces();
    for (PathVertex& point : std::span(points_).subspan(before)) finish_vertex(context_, point);
  }

 private:
  void find_surfaces() {
    if (context_.rays != nullptr && context_.rays->has_alpha_tested()) trace_alpha_tested();
    const std::optional<glm::dvec3> even = context_.even_background();
    prefetch(rows_.first);
    for (int y = rows_.first; y < rows_.end; ++y) {
      if (y + 1 < rows_.end) prefetch(y + 1);
      for (int x = 0; x < job_.rect.width(); ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
        const double fraction = left_.empty() ? 1.0 : left_[pixel];
        if (!(fraction > 0.0) || !job_.wants(pixel)) continue;
        if (job_.keys[pixel] != kNoKey) {
          find_surface(x, y, job_.keys[pixel], fraction);
          continue;
        }
        const glm::dvec3 light = even ? *even : context_.lights.environment(glm::normalize(ray_of(x, y).direction));
        sums_.add_background(job_.first_pixel + static_cast<std::uint32_t>(pixel), fraction, light);
      }
    }
  }

  void find_surface(int x, int y, Key key, double fraction) {
    const Ray ray = ray_of(x, y);
    const WorldTriangle& triangle = buffers_.triangles.load(context_.surfaces, key_surface(key));
    PathVertex& point = points_.emplace_back(context_.surfaces, triangle, ray.origin, ray.direction);
    start_vertex(context_, job_, x, y, fraction, point);
  }

  void prefetch(int y) const {
    if (context_.surfaces.are_shared_out()) return;  // fetch_triangles() did, for all rows
    std::array<std::uint32_t, kTileSide> ids;
    const std::span<const Key> row = job_.keys.subspan(static_cast<std::size_t>(y) * kTileSide, kTileSide);
    std::ranges::transform(row, ids.begin(), [](Key key) { return key == kNoKey ? kNoSurface : key_surface(key); });
    context_.surfaces.prefetch(ids);
  }

  [[nodiscard]] Ray ray_of(int x, int y) const {
    return view_ray(*job_.view, job_.rect.x0 + x + 0.5, job_.rect.y0 + y + 0.5);
  }

  /// Rays go from the near plane to the surface the key names: what they meet covers a share of what lies behind.
  void trace_alpha_tested() {
    left_.assign(kTilePixels, 1.0);
    buffers_.requests.clear();
    std::vector<SurfacePlane>& ends = buffers_.scratch.ends;
    ends.clear();
    WorldTriangle triangle;
    for (int y = rows_.first; y < rows_.end; ++y) {
      for (int x = 0; x < job_.rect.width(); ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
        if (!job_.wants(pixel)) continue;
        RayRequest request = eye_ray(*job_.view, job_, x + 0.5, y + 0.5);
        ends.emplace_back();
        if (job_.keys[pixel] != kNoKey) {
          ends.back() = context_.rays->plane_at(key_surface(job_.keys[pixel]), request, triangle);
        }
        request.owner = pixel;
        buffers_.requests.push_back(request);
        sums_.count_ray(job_.first_pixel + pixel);
      }
    }
    buffers_.counts.primary += buffers_.requests.size();
    buffers_.scratch.batch.purpose = {RayKind::Primary};
    std::vector<RayRequest> rays = std::move(buffers_.requests);
    context_.rays->visit_alpha_tested(
        rays, buffers_.scratch,
        [&](std::size_t i, const SurfacePoint& surface, double coverage) {
          const std::uint32_t pixel = rays[i].owner;
          const int x = static_cast<int>(pixel) % kTileSide;
          const int y = static_cast<int>(pixel) / kTileSide;
          Sampler sampler = sampler_of(context_, job_, x, y).branch(surface.surface);
          const double covered = left_[pixel] * coverage;
          const double fraction = covered * russian_roulette_weight(covered, sampler);
          if (fraction > 0.0) {
            start_vertex(context_, job_, x, y, fraction, points_.emplace_back(surface));
          }
          left_[pixel] *= 1.0 - coverage;
          left_[pixel] *= russian_roulette_weight(left_[pixel], sampler);
          return left_[pixel] > 0.0;
        },
        ends);
    buffers_.requests = std::move(rays);
  }

  const LightContext& context_;
  const TileJob& job_;
  RowRange rows_;
  RayBuffers& buffers_;
  PixelSums& sums_;
  std::vector<PathVertex>& points_;
  std::vector<double> left_;  ///< per pixel: the share not yet covered; empty where nothing covers in part
};

}  // namespace

void start_vertex(const LightContext& context, const TileJob& job, int x, int y, double coverage, PathVertex& point) {
  point.coverage = coverage;
  point.media = context.eye_media;
  point.throughput = coverage * transmittance(point.media.here, glm::distance(job.view->eye, point.surface.position));
  point.sampler = sampler_of(context, job, x, y);
  point.pixel = job.first_pixel + static_cast<std::uint32_t>(y * kTileSide + x);
  prefetch_material(context.scene, point.surface);
}

RayRequest eye_ray(const View& view, const TileJob& job, double x, double y) {
  const Ray ray = view_ray(view, job.rect.x0 + x, job.rect.y0 + y);
  RayRequest request;
  request.origin = ray.origin + ray.direction * view.near_distance;
  request.direction = glm::normalize(ray.direction);
  request.faces = Faces::Front;
  request.reach = view.orthographic ? view.far_distance - view.near_distance : std::numeric_limits<double>::infinity();
  return request;
}

std::vector<std::size_t> fullest_first(std::span<const std::size_t> tiles, const TileLayer<Key>& keys, int threads) {
  constexpr std::size_t kManyPerThread = 64;
  std::vector<std::size_t> order(tiles.begin(), tiles.end());
  if (threads < 2 || order.size() > kManyPerThread * static_cast<std::size_t>(threads)) return order;
  std::vector<std::pair<std::ptrdiff_t, std::size_t>> empty(order.size());  // pixels, of every fourth row
  parallel_for(threads, order.size(), [&](std::size_t i) {
    const std::size_t tile = order[i];
    std::ptrdiff_t pixels = keys.active(tile) ? 0 : kTilePixels;
    for (std::size_t row = 0; keys.active(tile) && row < kTilePixels; row += 4 * std::size_t{kTileSide}) {
      pixels += std::ranges::count(keys.tile(tile).subspan(row, kTileSide), kNoKey);
    }
    empty[i] = {pixels, tile};
  });
  std::ranges::sort(empty);
  std::ranges::transform(empty, order.begin(), [](const auto& each) { return each.second; });
  return order;
}

int end_of_wavefront(const TileJob& job, int first) {
  if (job.wanted.empty()) {
    const int end = first + static_cast<int>(kWavefrontVertices) / kTileSide;
    return std::min(end - (job.origin().y + end) % 2, job.end_row());
  }
  std::size_t points = 0;
  int row = first;
  do {
    const auto pixels = job.wanted.subspan(static_cast<std::size_t>(row) * kTileSide, kTileSide);
    points += static_cast<std::size_t>(std::ranges::count(pixels, std::uint8_t{1}));
  } while (++row < job.end_row() && points + kTileSide <= kWavefrontVertices);
  return row;
}

std::span<PathVertex> last_wavefront(std::span<PathVertex> points) {
  if (points.size() <= kWavefrontVertices) return points;
  std::size_t first = points.size() - kWavefrontVertices;
  while (first < points.size() && points[first - 1].pixel == points[first].pixel) ++first;
  return first < points.size() ? points.subspan(first) : points;
}

void fetch_triangles(const LightContext& context, std::span<const TileJob> jobs) {
  if (!context.surfaces.are_shared_out()) return;
  std::vector<std::uint32_t> ids;
  for (const TileJob& job : jobs) {
    for (int y = job.rows.first; y < job.end_row(); ++y) {
      for (int x = 0; x < job.rect.width(); ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x);
        if (job.keys[pixel] != kNoKey) ids.push_back(key_surface(job.keys[pixel]));
      }
    }
  }
  context.surfaces.prefetch(ids);
}

void find_primary_vertices(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                           PixelSums& sums, std::vector<PathVertex>& points) {
  PrimaryVertices(context, job, rows, buffers, sums, points).find();
}

namespace {

/// From here on a point that could be followed in two ways is followed in one, by chance: else the rays of nested glass
/// would double with every surface.
constexpr int kChoosingDepth = 2;

/// Paths that may go on for ever are ended by roulette from here on, by what is left of their throughput.
constexpr int kRouletteDepth = 3;
/// And at the latest here; what white rooms would have beyond is less than roulette leaves.
constexpr int kMaxGathered = 256;

/// Where all lobes are followed: each from what the eye sees, and then one of them by chance, in proportion to the
/// light it scatters.
void choose_lobes(const LightContext& context, PathVertex& point) {
  std::array<double, kLobes.size()> sums{};
  double sum = 0.0;
  const auto lobes = point.bsdf.lobes();
  for (std::size_t i = 0; i < lobes.size(); ++i) {
    const bool ends = point.followed >= context.settings.max_depth && context.follows_for_itself(point.bsdf, kLobes[i]);
    if (point.depth == 0) {
      point.may_follow[i] = !ends && point.bsdf.present(kLobes[i]);
      point.lobe_weights[i] = point.may_follow[i] ? 1.0F : 0.0F;
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
  const DiscreteSample picked = sample_discrete(std::span(sums).first(lobes.size()), u);
  point.lobe_weights[picked.index] = static_cast<float>(1.0 / (picked.probability * chance));
}

/// Which lobes of a surface with extensions passes of their own follow: all of those they can, and where a plain one
/// would choose, one by chance, in proportion to its light, but none seldom.
void choose_followed(const LightContext& context, PathVertex& point) {
  std::array<double, kLobes.size()> bright{};
  double sum = 0.0;
  for (const Lobe lobe : point.bsdf.lobes()) {
    const auto i = static_cast<std::size_t>(lobe);
    if (!context.follows_for_itself(point.bsdf, lobe)) continue;
    bright[i] = brightness(point.throughput * point.bsdf.weight(lobe));
    point.may_follow[i] = bright[i] > 0.0;
    point.lobe_weights[i] = static_cast<float>(russian_roulette_weight(bright[i], point.sampler));
    sum += bright[i];
  }
  if (point.depth < kChoosingDepth || std::ranges::count(point.may_follow, true) < 2) return;
  constexpr double kMinFraction = 0.1;
  std::array<double, kLobes.size()> sums{};
  double total = 0.0;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    sums[i] = total += point.may_follow[i] ? bright[i] + kMinFraction * sum : 0.0;
  }
  const DiscreteSample picked = sample_discrete(sums, point.sampler.one());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    point.lobe_weights[i] *= i == picked.index ? static_cast<float>(1.0 / picked.probability) : 0.0F;
  }
}

/// Whether lamps and skies that a ray finds are what caustic photons bring.
bool is_caustic(const LightContext& context, const PathVertex& from, const PassInfo& pass) {
  return context.leaves_caustics(from) && !pass.gathers_all_lobes;
}

/// See PathVertex::gather_reach. Photons are not asked where a ray that gathers ends near its start: both lie in one
/// crease, into which their map reaches from beyond.
double gather_reach(const LightContext& context, const PathVertex& from, const PathVertex& reached) {
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  if (!context.final_gathers() || !reached.gathered) return kEndless;
  const double near = context.photons->near;
  return glm::distance(reached.surface.position, from.surface.position) < near ? kEndless : near;
}

/// What reaches the pixel by a ray that leaves the scene, as far as sampling lights does not find it.
glm::dvec3 sky_along(const LightContext& context, const LobeRay& ray, const glm::dvec3& direction,
                     const PassInfo& pass) {
  const PathVertex& from = *ray.from;
  if (!context.scene.environment && (pass.gathers_all_lobes || from.gathered))
    return glm::dvec3(0.0);  // a backdrop is no light
  if (is_caustic(context, from, pass)) return glm::dvec3(0.0);
  const double light_pdf =
      ray.pdf > 0.0 ? context.lights.environment_pdf(from.surface.position, from.bsdf.light_normal(), direction) : 0.0;
  return balance_heuristic(context, ray.pdf, light_pdf) * ray.throughput * context.lights.environment(direction);
}

/// Rays that carry the eye's look on by mirrors and glass see what it sees; those that gather light meet what light
/// meets, and so do those in a solid.
Faces faces_met(const PathVertex& from, const PassInfo& pass, const glm::dvec3& direction) {
  const bool looks = !from.gathered && !pass.gathers_all_lobes;
  return looks && !leads_into_solid(from.surface, from.material, direction) ? Faces::Front : Faces::Both;
}

/// Whether a ray for each channel goes through a surface that disperses: where the eye looks through it, and it bends
/// light in one direction. Not from within, where one channel may be let through at an angle that reflects another.
bool splits_channels(const PathVertex& point) {
  return !point.surface.inside && point.depth < kChoosingDepth && !point.gathered && disperses(point.material) &&
         point.material.roughness < Bsdf::kDeltaRoughness && carries_channels(point.throughput);
}

/// What ray i finds of the sky; of rays that gather from the first surface also what it would have found, as direct
/// light less its shadow.
void add_sky(const LightContext& context, const RayBuffers& buffers, std::size_t i, const PassInfo& pass,
             PixelSums& sums) {
  const LobeRay& ray = buffers.lobe_rays[i];
  const PathVertex& from = *ray.from;
  if (pass.gathers_all_lobes && from.gathers_near()) return;
  const bool leaves = buffers.lobe_hits[i] == kNoSurface;
  const bool shows_sky = pass.gathers_all_lobes && from.depth == 0;
  if (!leaves && !(shows_sky && sums.wants_components)) return;
  const glm::dvec3 sky = sky_along(context, ray, buffers.lobe_requests[i].direction, pass);
  if (!shows_sky) return sums.add(from.pixel, component_after(from, pass.component), sky);
  if (leaves) return sums.add(from.pixel, Component::Direct, sky, true);
  sums.add_shadowed(from.pixel, sky);
}

/// Adds the point that ray i reaches to `next`, but for what finish_vertex does.
PathVertex& add_vertex(const LightContext& context, RayBuffers& buffers, std::size_t i, const PassInfo& pass,
                       std::vector<PathVertex>& next) {
  const LobeRay& ray = buffers.lobe_rays[i];
  const RayRequest& request = buffers.lobe_requests[i];
  const PathVertex& from = *ray.from;
  const WorldTriangle& triangle = buffers.triangles.load(context.surfaces, buffers.lobe_hits[i]);
  PathVertex& reached = next.emplace_back(context.surfaces, triangle, request.origin, request.direction);
  reached.throughput = ray.throughput;
  reached.media = media_towards(from.media, from.surface, from.material, request.direction);
  reached.previous_position = from.surface.position;
  reached.previous_normal = from.bsdf.light_normal();
  reached.previous_pdf = ray.pdf;
  reached.sampler = ray.sampler;
  reached.pixel = from.pixel;
  reached.depth = static_cast<std::uint16_t>(from.depth + 1);
  reached.followed = static_cast<std::uint16_t>(from.followed + (pass.gathers_all_lobes ? 0 : 1));
  reached.gathered = from.gathered || pass.gathers_all_lobes;
  reached.gather_reach = gather_reach(context, from, reached);
  reached.is_caustic = is_caustic(context, from, pass);
  reached.component = component_after(from, pass.component);
  return reached;
}

}  // namespace

glm::dvec3 LightContext::background(const glm::dvec3& direction) const {
  if (settings.background.kind == Background::Kind::Environment) return lights.environment(direction);
  return even_background().value_or(glm::dvec3(0.0));
}

std::optional<glm::dvec3> LightContext::even_background() const {
  switch (settings.background.kind) {
    case Background::Kind::Environment:
      return lights.constant_environment();
    case Background::Kind::Color: {
      const Rgb& color = settings.background.color;
      return glm::dvec3(color.r, color.g, color.b);
    }
    case Background::Kind::Transparent:
      return glm::dvec3(0.0);
  }
  return std::nullopt;
}

bool LightContext::follows_for_itself(const Bsdf& bsdf, Lobe lobe) const {
  return followed_lobes[static_cast<std::size_t>(lobe)] && is_followed(bsdf, lobe, settings.glossy_cutoff);
}

double occlusion_reach(const Scene& scene) {
  constexpr double kRadii = 0.25;
  return kRadii * glm::length(scene.bounds.high - scene.bounds.low) / 2.0;
}

Component component_after(const PathVertex& point, Component first) {
  return point.depth == 0 ? first : point.component;
}

void finish_vertex(const LightContext& context, PathVertex& point, double metres) {
  point.material = evaluate_material(context.scene, point.surface);
  if (metres > 0.0) point.throughput *= transmittance_to(point.media, point.surface, point.material, metres);
  if (disperses(point.material) && !splits_channels(point) &&
      !(Bsdf::shares_directions(point.material) && carries_channels(point.throughput))) {
    choose_channel(point.material, point.throughput, point.sampler.one());
  }
  point.bsdf = Bsdf(point.material, point.surface);
  if (context.gathers) {
    if (point.depth < kMaxGathered) choose_lobes(context, point);
    return;
  }
  if (point.depth >= context.settings.max_depth) return;
  if (point.bsdf.is_extended()) return choose_followed(context, point);
  std::array<double, kLobes.size()> bright{};
  for (const Lobe lobe : {Lobe::Reflection, Lobe::Transmission}) {
    const auto i = static_cast<std::size_t>(lobe);
    if (!context.follows_for_itself(point.bsdf, lobe)) continue;
    bright[i] = brightness(point.throughput * point.bsdf.weight(lobe));
    point.may_follow[i] = bright[i] > 0.0;
    point.lobe_weights[i] = static_cast<float>(russian_roulette_weight(bright[i], point.sampler));
  }
  const auto reflection = static_cast<std::size_t>(Lobe::Reflection);
  const auto transmission = static_cast<std::size_t>(Lobe::Transmission);
  if (point.depth < kChoosingDepth || !point.may_follow[reflection] || !point.may_follow[transmission]) return;
  const double fraction = std::clamp(bright[reflection] / (bright[reflection] + bright[transmission]), 0.1, 0.9);
  const bool reflects = point.sampler.one() < fraction;
  point.lobe_weights[reflection] *= reflects ? static_cast<float>(1.0 / fraction) : 0.0F;
  point.lobe_weights[transmission] *= reflects ? 0.0F : static_cast<float>(1.0 / (1.0 - fraction));
}

LobeRays::LobeRays(const LightContext& context, const Wavefront& wave, RayBuffers& buffers, PixelSums& sums)
    : context_(context), wave_(wave), buffers_(buffers), sums_(sums) {
  buffers.lobe_rays.clear();
  buffers.lobe_requests.clear();
}

void LobeRays::add(const PassInfo& pass, std::span<const Lobe> lobes) {
  const std::size_t before = buffers_.lobe_rays.size();
  for (const Lobe lobe : lobes) {
    for (const PathVertex& point : wave_.vertices) {
      if (point.lobe_weights[static_cast<std::size_t>(lobe)] == 0.0F) continue;
      if (context_.gathers && context_.follows_for_itself(point.bsdf, lobe) == pass.gathers_all_lobes) continue;
      add_rays(pass, lobe, point);
    }
  }
  ends_.push_back(buffers_.lobe_rays.size());
  buffers_.counts[pass.id] += buffers_.lobe_rays.size() - before;
}

void LobeRays::add_rays(const PassInfo& pass, Lobe lobe, const PathVertex& point) {
  if (lobe != Lobe::Transmission || !splits_channels(point)) return add_ray(pass, lobe, point, point.bsdf);
  for (int channel = 0; channel < 3; ++channel) {
    if (!(point.throughput[channel] > 0.0)) continue;
    MaterialPoint material = point.material;
    set_channel(material, channel, 1.0);
    // All with the same numbers: what is noisy further on is so in grey.
    add_ray(pass, lobe, point, Bsdf(material, point.surface));
  }
}

double LobeRays::fraction(std::size_t i) const {
  return static_cast<double>(ends_[i] - first_of(i)) / static_cast<double>(std::max<std::size_t>(ends_.back(), 1));
}

void LobeRays::add_ray(const PassInfo& pass, Lobe lobe, const PathVertex& point, const Bsdf& bsdf) {
  Sampler sampler = point.sampler.branch(static_cast<std::uint32_t>(lobe));
  const auto sample = bsdf.sample(lobe, next_two(sampler, point.depth));
  if (!sample) return;
  const double factor = point.lobe_weights[static_cast<std::size_t>(lobe)];
  glm::dvec3 throughput = factor * point.throughput * sample->weight;
  throughput *= russian_roulette_weight(brightness(throughput), sampler);
  if (throughput == glm::dvec3(0.0)) return;
  buffers_.lobe_rays.push_back({&point, throughput, sample->pdf, sampler});
  buffers_.lobe_requests.push_back(
      {ray_origin(point.surface, sample->direction), sample->direction,
       pass.gathers_all_lobes ? point.gather_reach : std::numeric_limits<double>::infinity(), nullptr, 0,
       faces_met(point, pass, sample->direction)});
  sums_.count_ray(point.pixel);
}

void LobeRays::trace() {
  buffers_.lobe_hits.resize(buffers_.lobe_rays.size());
  if (buffers_.lobe_rays.empty()) return;
  for (std::size_t i = 0; i < buffers_.lobe_rays.size(); ++i) {
    buffers_.lobe_requests[i].sampler = &buffers_.lobe_rays[i].sampler;
  }
  buffers_.scratch.batch.purpose = {RayKind::Bounce, wave_.generation()};
  buffers_.counts.invalid += context_.rays->closest(buffers_.lobe_requests, buffers_.lobe_hits, buffers_.scratch);
}

void LobeRays::finish(const PassInfo& pass, std::vector<PathVertex>& next) {
  const std::size_t before = next.size();
  for (std::size_t i = first_of(finished_); i < ends_[finished_]; ++i) {
    add_sky(context_, buffers_, i, pass, sums_);
    if (buffers_.lobe_hits[i] == kNoSurface) continue;
    const PathVertex& reached = add_vertex(context_, buffers_, i, pass, next);
    if (reached.depth == 1 && !pass.gathers_all_lobes)
      sums_.note_distance(reached.pixel, glm::distance(reached.surface.position, reached.previous_position));
    prefetch_material(context_.scene, reached.surface);
  }
  ++finished_;
  // By now the memory has what materials read.
  for (PathVertex& reached : std::span(next).subspan(before)) {
    finish_vertex(context_, reached, glm::distance(reached.surface.position, reached.previous_position));
  }
}

}  // namespace hpr
