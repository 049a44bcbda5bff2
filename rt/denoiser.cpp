#include "rt/denoiser.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "rt/tile_output.h"

namespace hpr {
namespace {

/// Branches of a pixel's sampler.
constexpr std::uint32_t kLookBranch = 0x4C4F4F4BU;

/// Distance of unit normals from which on two places are not alike, in a frame's first sample.
constexpr float kNormalWidth = 0.6F;
/// On surfaces smoother than this roughness normals must be closer and neighbours count less, in proportion down to a
/// tenth: what mirrors show changes quickly with their normal and with the place.
constexpr float kSmooth = 0.25F;
constexpr float kLeastWidth = 0.1F;
/// At so many places of a pixel's part that shows a surface a sample looks again, and of one that shows many.
constexpr std::uint32_t kLooksAgain = 2;
constexpr std::uint32_t kLooksAtMany = 4;
/// Samples after which neighbours count less.
constexpr float kNeighbourSamples = 16.0F;
/// What is so many times as bright as all pixels about is rare light, whose share chance has not yet settled: blotches
/// if it were lent.
constexpr double kFarBrighter = 3.0;
/// How many times as much light one may scatter as the other.
constexpr float kMostBrighter = 4.0F;

float square(float value) {
  return value * value;
}

/// What `normal_weight` takes of so narrow a width, in parts of kNormalWidth.
float sharpness_of(float width) {
  return 1.0F / square(kNormalWidth * width);
}

/// 1 for the same normal; 0 from a distance on, the inverse of whose square is `sharpness`.
float normal_weight(const glm::vec3& a, const glm::vec3& b, float sharpness) {
  const glm::vec3 difference = a - b;
  return square(std::max(0.0F, 1.0F - glm::dot(difference, difference) * sharpness));
}

/// 0 just outside the window.
float spatial_weight(float distance2, int radius) {
  return std::max(0.0F, 1.0F - distance2 / square(static_cast<float>(radius) + 1.0F));
}

/// What the lender's light is multiplied by; nothing where the two scatter too different shares.
bool make_up(float borrower, float lender, float& ratio) {
  if (borrower == lender) {
    ratio = 1.0F;
    return true;
  }
  ratio = borrower / lender;
  return ratio <= kMostBrighter && ratio >= 1.0F / kMostBrighter;
}

std::size_t index_of(int column, int row) {
  return static_cast<std::size_t>(row) * kTileSide + static_cast<std::size_t>(column);
}

}  // namespace

void Denoiser::start(std::size_t samples) {
  states_.assign(samples * kTilePixels, State::Unlit);
  seen_.resize(states_.size());
  spare_ = static_cast<std::uint32_t>(states_.size());
}

void Denoiser::note(const TileWork& tile, std::span<const PathPoint> points) {
  for (const PathPoint& point : points) {
    State& state = states_[point.pixel];
    const bool lends = state == State::Unlit && point.throughput == glm::dvec3(1.0) && point.share == 1.0 &&
                       point.material.emission == glm::dvec3(0.0);
    Seen& seen = seen_[point.pixel];
    if (state == State::Unlit) seen.sight = sight_of(point.surface, tile.view->eye);
    state = lends ? State::Lends : State::KeepsToItself;
    if (!lends) continue;
    seen.mapped = point.material.normal;
    seen.width = std::clamp(static_cast<float>(point.material.roughness) / kSmooth, kLeastWidth, 1.0F);
    seen.weight = glm::vec3(0.0F);
    for (const Lobe lobe : kLobes) seen.weight += glm::vec3(point.bsdf.weight(lobe));
  }
}

template <typename Weigh>
Denoiser::Lenders Denoiser::lenders_in(const TileJob& job, const Window& window, const Weigh& weigh) const {
  const int column = static_cast<int>(window.pixel % kTileSide);
  const int row = static_cast<int>(window.pixel / kTileSide);
  const glm::ivec2 middle = glm::ivec2(column, row) + window.shift;
  const int radius = window.radius;
  Lenders found;
  const Rect about{middle.x - radius, middle.y - radius, middle.x + radius + 1, middle.y + radius + 1};
  const Rect pixels = intersection(about, {0, 0, job.place.width(), job.place.height()});
  for (int y = pixels.y0; y < pixels.y1; ++y) {
    for (int x = pixels.x0; x < pixels.x1; ++x) {
      const std::uint32_t lender = job.first_pixel + static_cast<std::uint32_t>(y * kTileSide + x);
      if (states_[lender] != State::Lends) continue;
      glm::vec3 ratio(1.0F);
      const float weight = weigh(seen_[lender], x - column, y - row, ratio);
      if (!(weight > 0.0F)) continue;
      found.at[found.count] = lender;
      found.weights[found.count++] = weight * ratio;
      found.sum += weight;
    }
  }
  return found;
}

Denoiser::Lenders Denoiser::lenders_of_look(const TileJob& job, const Look& look, const Sight& seen) const {
  const glm::vec2 way = look.place - glm::vec2(job.view->jitter);  // from what the pixel's own sample sees
  const Window window{look.pixel, glm::ivec2(glm::round(way)), 1};
  return lenders_in(job, window, [&](const Seen& lender, int dx, int dy, glm::vec3&) {
    if (!is_beside(*job.view, lender.sight, seen)) return 0.0F;
    const float distance2 = square(static_cast<float>(dx) - way.x) + square(static_cast<float>(dy) - way.y);
    return spatial_weight(distance2, window.radius) *
           normal_weight(lender.sight.normal, seen.normal, sharpness_of(narrowed_ * lender.width));
  });
}

Denoiser::Lenders Denoiser::lenders_of_pixel(const TileJob& job, std::uint32_t pixel) const {
  const Seen& borrower = seen_[job.first_pixel + pixel];
  const float sharpness = sharpness_of(narrowed_ * borrower.width);
  const float others = borrower.width / (1.0F + static_cast<float>(job.number.sample) / kNeighbourSamples);
  const Window window{pixel, {}, job.number.sample == 0 ? kMostRadius : 1};
  return lenders_in(job, window, [&](const Seen& lender, int dx, int dy, glm::vec3& ratio) {
    if (dx == 0 && dy == 0) return 1.0F;
    if (!is_beside(*job.view, lender.sight, borrower.sight)) return 0.0F;
    for (int i = 0; i < 3; ++i) {
      if (!make_up(borrower.weight[i], lender.weight[i], ratio[i])) return 0.0F;
    }
    return others * spatial_weight(static_cast<float>(dx * dx + dy * dy), window.radius) *
           normal_weight(lender.mapped, borrower.mapped, sharpness);
  });
}

/// Calls `body` with the index of each sum that is wanted and its pixels.
template <typename Body>
void Denoiser::each_sum(TileWork& tile, const Body& body) {
  body(std::size_t{0}, tile.radiance);
  if (!tile.wants_components) return;
  for (std::size_t i = 0; i < kComponents; ++i) body(1 + i, tile.components[i]);
}

void Denoiser::add_background(TileWork& tile, const Look& look, const glm::dvec3& direction) {
  const glm::dvec3 light = look.share * tile.lights.environment(direction);
  sums_[0][look.pixel] += light;
  if (tile.wants_components) sums_[1 + static_cast<std::size_t>(Component::Direct)][look.pixel] += light;
}

bool Denoiser::add_lent(TileWork& tile, const TileJob& job, const Look& look, const Sight& seen) {
  const Material& material = tile.scene.materials[seen.material];
  if (material.unlit || material.emissive != glm::vec3(0.0F)) return false;  // what emits lends nothing
  const Lenders lenders = lenders_of_look(job, look, seen);
  if (lenders.count == 0) return false;
  const double share = look.share / static_cast<double>(lenders.sum);
  each_sum(tile, [&](std::size_t sum, const std::vector<glm::dvec3>& from) {
    glm::dvec3 light(0.0);
    for (std::size_t i = 0; i < lenders.count; ++i) light += glm::dvec3(lenders.weights[i]) * from[lenders.at[i]];
    sums_.at(sum)[look.pixel] += share * light;
  });
  return true;
}

/// What one of the rays traced sees, which is one of the looks at a pixel.
void Denoiser::add_look(TileWork& tile, const TileJob& job, const Look& look, std::size_t ray,
                        std::vector<PathPoint>& alone) {
  const RayRequest& request = tile.requests[ray];
  if (tile.hits[ray] == kNoSurface) return add_background(tile, look, request.direction);
  const WorldTriangle& triangle = tile.triangles.load(tile.surfaces, tile.hits[ray]);
  const SurfacePoint surface = tile.surfaces.meet(triangle, request.origin, request.direction);
  if (add_lent(tile, job, look, sight_of(surface, job.view->eye))) return;
  PathPoint& point = alone.emplace_back();
  point.surface = surface;
  start_point(tile, job, static_cast<int>(look.pixel) % kTileSide, static_cast<int>(look.pixel) / kTileSide, look.share,
              point);
  point.sampler = point.sampler.branch(kLookBranch + look.number);
  point.pixel = spare_ + look.pixel;
}

/// The brightest of the pixels about one that are lit.
double Denoiser::brightest_about(const TileWork& tile, const TileJob& job, int column, int row) {
  const Rect about{column - 1, row - 1, column + 2, row + 2};
  const Rect pixels = intersection(about, {0, 0, job.place.width(), job.place.height()});
  double found = 0.0;
  for (int y = pixels.y0; y < pixels.y1; ++y) {
    for (int x = pixels.x0; x < pixels.x1; ++x) {
      const std::size_t pixel = index_of(x, y);
      if ((x == column && y == row) || !job.wants(pixel)) continue;
      found = std::max(found, brightness(tile.radiance[job.first_pixel + pixel]));
    }
  }
  return found;
}

void Denoiser::set_apart(const TileWork& tile, const TileJob& job) {
  std::vector<std::size_t> apart;
  for (int y = 0; y < job.place.height(); ++y) {
    for (int x = 0; x < job.place.width(); ++x) {
      const std::size_t own = job.first_pixel + index_of(x, y);
      if (states_[own] == State::Unlit) continue;
      const glm::dvec3& light = tile.radiance[own];
      const bool is_far_brighter =
          states_[own] == State::Lends && brightness(light) > kFarBrighter * brightest_about(tile, job, x, y);
      if (!fits_floats(light) || is_far_brighter) apart.push_back(own);
    }
  }
  for (const std::size_t pixel : apart) states_[pixel] = State::Apart;
}

void Denoiser::set_unexpected_apart(const TileJob& job, std::span<const PixelPart> parts) {
  const glm::vec2 place(job.view->jitter);
  for (auto part = parts.begin(); part != parts.end();) {
    const std::uint32_t pixel = part->pixel;
    const auto next = std::find_if(part, parts.end(), [&](const PixelPart& each) { return each.pixel != pixel; });
    const std::uint32_t own = job.first_pixel + pixel;
    const Sight seen = states_[own] == State::Unlit ? Sight{} : seen_[own].sight;
    const bool is_expected =
        std::any_of(part, next, [&](const PixelPart& each) { return each.is_like(*job.view, seen, place); });
    if (job.wants(pixel) && !is_expected) states_[own] = State::Apart;
    part = next;
  }
}

void Denoiser::look_again(TileWork& tile, const TileJob& job, const TileParts& again, std::vector<PathPoint>& alone) {
  set_apart(tile, job);
  each_sum(tile, [&](std::size_t i, std::vector<glm::dvec3>& from) {
    sums_.at(i).assign(kTilePixels, glm::dvec3(0.0));
    std::fill_n(from.begin() + spare_, kTilePixels, glm::dvec3(0.0));
  });
  narrowed_ = 1.0F / std::sqrt(std::sqrt(1.0F + static_cast<float>(job.number.sample)));
  set_unexpected_apart(job, again.parts);
  View view = unjittered(job);
  tile.requests.clear();
  looks_.clear();
  for (const PixelPart& part : again.parts) {
    if (!job.wants(part.pixel) || states_[job.first_pixel + part.pixel] == State::Apart) continue;
    look_at_part(tile, job, view, part, *again.places);
  }
  trace_from_eye(tile);
  for (std::size_t i = 0; i < looks_.size(); ++i) add_look(tile, job, looks_[i], i, alone);
  for (PathPoint& point : alone) finish_point(tile, point);
}

/// Asks for a ray where nobody lends.
void Denoiser::look_at_part(TileWork& tile, const TileJob& job, View& view, const PixelPart& part,
                            const Looks& places) {
  if (part.shows == PixelPart::Shows::Background) {
    const Look look{part.pixel, 0, part.place(places, job.number.sample), part.share};
    return add_background(tile, look, ray_through(view, job, look.pixel, look.place).direction);
  }
  const bool is_surface = part.shows == PixelPart::Shows::Surface;
  const std::uint32_t count = is_surface ? std::clamp(part.count(), 1U, kLooksAgain) : kLooksAtMany;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t number = looks_.empty() || looks_.back().pixel != part.pixel ? 0 : looks_.back().number + 1;
    const glm::vec2 place = part.place(places, job.number.sample * count + i);
    const Look look{part.pixel, number, place, part.share / static_cast<float>(count)};
    if (is_surface && add_lent(tile, job, look, part.patch.at(place))) continue;
    looks_.push_back(look);
    tile.requests.push_back(ray_through(view, job, look.pixel, place));
    tile.charge_ray(job.first_pixel + look.pixel);
  }
}

/// Light of small lights has no noise that sharing would take, and shadows with edges.
void Denoiser::share(TileWork& tile, std::uint32_t pixel, std::uint32_t own, const Lenders& lenders) {
  const auto sharp = [&](std::uint32_t of) {
    const auto part = [&](Component component) { return tile.components[static_cast<std::size_t>(component)][of]; };
    return keeps_direct(tile.scene) ? part(Component::Direct) + part(Component::Shadow) : glm::dvec3(0.0);
  };
  each_sum(tile, [&](std::size_t i, const std::vector<glm::dvec3>& from) {
    const bool is_sharp =
        i == 1 + static_cast<std::size_t>(Component::Direct) || i == 1 + static_cast<std::size_t>(Component::Shadow);
    glm::dvec3& sum = sums_.at(i)[pixel];
    if (is_sharp && keeps_direct(tile.scene)) {
      sum = from[own];
      return;
    }
    for (std::size_t k = 0; k < lenders.count; ++k) {
      const glm::dvec3 light = i == 0 ? from[lenders.at[k]] - sharp(lenders.at[k]) : from[lenders.at[k]];
      sum += glm::dvec3(lenders.weights[k]) * light;
    }
    sum /= static_cast<double>(lenders.sum);
    if (i == 0) sum += sharp(own);
  });
}

void Denoiser::resolve(TileWork& tile, const TileJob& job, const TileParts& again) {
  for (int y = 0; y < job.place.height(); ++y) {
    for (int x = 0; x < job.place.width(); ++x) {
      const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
      if (!job.wants(pixel)) continue;
      const std::uint32_t own = job.first_pixel + pixel;
      if (tile.wants_cost) tile.cost[own] += std::exchange(tile.cost[spare_ + pixel], 0.0F);
      const bool is_crossed = again.crossed[pixel] != 0 && states_[own] != State::Apart;
      if (is_crossed) {
        each_sum(tile, [&](std::size_t i, const std::vector<glm::dvec3>& from) {
          sums_.at(i)[pixel] += from[spare_ + pixel];
        });
      } else if (states_[own] == State::Lends) {
        share(tile, pixel, own, lenders_of_pixel(job, pixel));
      } else {
        each_sum(tile, [&](std::size_t i, const std::vector<glm::dvec3>& from) { sums_.at(i)[pixel] = from[own]; });
      }
    }
  }
  each_sum(tile, [&](std::size_t i, std::vector<glm::dvec3>& to) {
    std::ranges::copy(sums_.at(i), to.begin() + job.first_pixel);
  });
}

}  // namespace hpr
