#include "rt/denoiser.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "image/pixel_filter.h"
#include "rt/tile_output.h"

namespace hpr {
namespace {

/// A number of a screen that no wall has: where a frame's samples look again has a stream of its own.
constexpr std::uint32_t kLookScreen = 0xFFFFFFFEU;
/// Rays that are traced together, about.
constexpr std::size_t kRaysTogether = 1024;
/// Branches of a pixel's sampler.
constexpr std::uint32_t kLookBranch = 0x4C4F4F4BU;

/// Distance of unit normals from which on two places are not alike, in a frame's first sample.
constexpr float kNormalWidth = 0.6F;
/// On surfaces smoother than this roughness normals must be closer and neighbours count less, in proportion down to a
/// tenth: what mirrors show changes quickly with their normal and with the place.
constexpr float kSmooth = 0.25F;
constexpr float kLeastWidth = 0.1F;
/// Samples after which neighbours count less.
constexpr float kNeighbourSamples = 4.0F;
/// What is so many times as bright as all pixels about is rare light, whose share chance has not yet settled: blotches
/// if it were lent.
constexpr double kFarBrighter = 3.0;
/// Pixels to where neighbours lend nothing.
constexpr float kReach = 2.0F;
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

float spatial_weight(float distance2) {
  return std::max(0.0F, 1.0F - distance2 / square(kReach));
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

/// Places of sample `number` in the pixel.
std::vector<glm::dvec2> looks_at(const RaySettings& settings, const SampleNumber& number) {
  std::uint32_t first = 0;
  for (std::uint32_t sample = 0; sample < number.sample; ++sample) first += looks_of(sample);
  std::vector<glm::dvec2> looks(looks_of(number.sample));
  for (glm::dvec2& look : looks) {
    Sampler sampler(pixel_stream({settings.seed, number.frame}, kLookScreen, 0, 0), first++);
    look = sample_filter(settings.filter, sampler.two()).offset;
  }
  return looks;
}

/// Pixels of the tile where the mask is 1 and that are wanted, those near each other together: so rays are coherent.
std::vector<std::uint32_t> wanted_pixels(const TileJob& job, std::span<const std::uint8_t> mask) {
  constexpr std::uint32_t kCell = 4;
  std::vector<std::uint32_t> pixels;
  for (std::uint32_t i = 0; i < kTilePixels; ++i) {
    const std::uint32_t cell = i / (kCell * kCell);
    const std::uint32_t x = cell % (kTileSide / kCell) * kCell + i % kCell;
    const std::uint32_t y = cell / (kTileSide / kCell) * kCell + i / kCell % kCell;
    const std::uint32_t pixel = y * kTileSide + x;
    if (mask[pixel] != 0 && job.wants(pixel)) pixels.push_back(pixel);
  }
  return pixels;
}

}  // namespace

std::uint32_t looks_of(std::uint32_t sample) {
  return sample < 4 ? 8 : 4;
}

void Denoiser::start(std::size_t samples) {
  states_.assign(samples * kTilePixels, State::Unlit);
  seen_.resize(states_.size());
  spare_ = static_cast<std::uint32_t>(states_.size());
}

Denoiser::Seen Denoiser::look_at(const SurfacePoint& surface, const glm::dvec3& eye) {
  Seen seen;
  seen.place = surface.position - eye;
  seen.normal = surface.facing_normal();
  seen.material = surface.material;
  return seen;
}

void Denoiser::note(const TileWork& tile, std::span<const PathPoint> points) {
  for (const PathPoint& point : points) {
    State& state = states_[point.pixel];
    const bool lends = state == State::Unlit && point.throughput == glm::dvec3(1.0) && point.share == 1.0 &&
                       point.material.emission == glm::dvec3(0.0);
    state = lends ? State::Lends : State::KeepsToItself;
    if (!lends) continue;
    Seen& seen = seen_[point.pixel];
    seen = look_at(point.surface, tile.view->eye);
    seen.mapped = point.material.normal;
    seen.width = std::clamp(static_cast<float>(point.material.roughness) / kSmooth, kLeastWidth, 1.0F);
    for (const Lobe lobe : kLobes) seen.weight += glm::vec3(point.bsdf.weight(lobe));
  }
}

template <typename Weigh>
Denoiser::Lenders Denoiser::lenders_about(const TileJob& job, std::uint32_t pixel, const glm::ivec2& shift,
                                          const Weigh& weigh) const {
  const int column = static_cast<int>(pixel % kTileSide);
  const int row = static_cast<int>(pixel / kTileSide);
  Lenders found;
  const Rect about{column + shift.x - 1, row + shift.y - 1, column + shift.x + 2, row + shift.y + 2};
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

Denoiser::Lenders Denoiser::lenders_of_look(const TileJob& job, const Look& look, const Seen& seen) const {
  const glm::vec2 way = look.offset - job.view->jitter;  // from what the pixel's own sample sees
  const glm::ivec2 shift(glm::round(way));
  return lenders_about(job, look.pixel, shift, [&](const Seen& lender, int dx, int dy, glm::vec3&) {
    if (lender.material != seen.material || !is_placed_alike(*job.view, lender.place, seen.place, lender.normal)) {
      return 0.0F;
    }
    const float distance2 = square(static_cast<float>(dx) - way.x) + square(static_cast<float>(dy) - way.y);
    return spatial_weight(distance2) *
           normal_weight(lender.normal, seen.normal, sharpness_of(narrowed_ * lender.width));
  });
}

Denoiser::Lenders Denoiser::lenders_of_pixel(const TileJob& job, std::uint32_t pixel) const {
  const Seen& borrower = seen_[job.first_pixel + pixel];
  const float sharpness = sharpness_of(narrowed_ * borrower.width);
  const float others = borrower.width / (1.0F + static_cast<float>(job.number.sample) / kNeighbourSamples);
  return lenders_about(job, pixel, {}, [&](const Seen& lender, int dx, int dy, glm::vec3& ratio) {
    if (dx == 0 && dy == 0) return 1.0F;
    if (lender.material != borrower.material ||
        !is_placed_alike(*job.view, lender.place, borrower.place, lender.normal)) {
      return 0.0F;
    }
    for (int i = 0; i < 3; ++i) {
      if (!make_up(borrower.weight[i], lender.weight[i], ratio[i])) return 0.0F;
    }
    return others * spatial_weight(static_cast<float>(dx * dx + dy * dy)) *
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

/// What one of the rays traced sees, which is one of the looks at a pixel.
void Denoiser::add_look(TileWork& tile, const TileJob& job, const Look& look, std::size_t ray,
                        std::vector<PathPoint>& alone) {
  const RayRequest& request = tile.requests[ray];
  const auto add = [&](std::size_t sum, const glm::dvec3& light) { sums_.at(sum)[look.pixel] += look.share * light; };
  if (tile.hits[ray] == kNoSurface) {
    const glm::dvec3 light = tile.lights.environment(request.direction);
    add(0, light);
    if (tile.wants_components) add(1 + static_cast<std::size_t>(Component::Direct), light);
    return;
  }
  const WorldTriangle& triangle = tile.triangles.load(tile.surfaces, tile.hits[ray]);
  const SurfacePoint surface = tile.surfaces.meet(triangle, request.origin, request.direction);
  const Material& material = tile.scene.materials[surface.material];
  const bool may_emit = material.unlit || material.emissive != glm::vec3(0.0F);  // which lenders do not
  const Lenders lenders = may_emit ? Lenders{} : lenders_of_look(job, look, look_at(surface, job.view->eye));
  if (lenders.count == 0) {
    PathPoint& point = alone.emplace_back();
    point.surface = surface;
    start_point(tile, job, static_cast<int>(look.pixel) % kTileSide, static_cast<int>(look.pixel) / kTileSide,
                look.share, point);
    point.sampler = point.sampler.branch(kLookBranch + look.number);
    point.pixel = spare_ + look.pixel;
    return;
  }
  each_sum(tile, [&](std::size_t sum, const std::vector<glm::dvec3>& from) {
    glm::dvec3 light(0.0);
    for (std::size_t i = 0; i < lenders.count; ++i) light += glm::dvec3(lenders.weights[i]) * from[lenders.at[i]];
    add(sum, light / static_cast<double>(lenders.sum));
  });
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

void Denoiser::look_again(TileWork& tile, const TileJob& job, std::span<const std::uint8_t> outlines,
                          std::vector<PathPoint>& alone) {
  set_apart(tile, job);
  each_sum(tile, [&](std::size_t i, std::vector<glm::dvec3>& from) {
    sums_.at(i).assign(kTilePixels, glm::dvec3(0.0));
    std::fill_n(from.begin() + spare_, kTilePixels, glm::dvec3(0.0));
  });
  narrowed_ = 1.0F / std::cbrt(1.0F + static_cast<float>(job.number.sample));
  const std::vector<glm::dvec2> looks = looks_at(tile.settings, job.number);
  const double share = 1.0 / static_cast<double>(looks.size());
  std::vector<View> views(looks.size(), *job.view);
  for (std::size_t i = 0; i < looks.size(); ++i) views[i].jitter = looks[i];
  const std::vector<std::uint32_t> crossed = wanted_pixels(job, outlines);
  const std::size_t together = kRaysTogether / looks.size();
  for (std::size_t first = 0; first < crossed.size(); first += together) {
    const auto pixels = std::span(crossed).subspan(first, std::min(together, crossed.size() - first));
    tile.requests.clear();
    for (const std::uint32_t pixel : pixels) {
      for (const View& view : views) {
        const auto column = static_cast<int>(pixel % kTileSide);
        const auto row = static_cast<int>(pixel / kTileSide);
        tile.requests.push_back(eye_ray(view, job, column + 0.5, row + 0.5));
        tile.charge_ray(job.first_pixel + pixel);
      }
    }
    trace_from_eye(tile);
    for (std::size_t i = 0; i < tile.requests.size(); ++i) {
      const std::size_t number = i % looks.size();
      const Look look{pixels[i / looks.size()], static_cast<std::uint32_t>(number), looks[number], share};
      add_look(tile, job, look, i, alone);
    }
  }
  for (PathPoint& point : alone) finish_point(tile, point);
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

void Denoiser::resolve(TileWork& tile, const TileJob& job, std::span<const std::uint8_t> outlines) {
  for (int y = 0; y < job.place.height(); ++y) {
    for (int x = 0; x < job.place.width(); ++x) {
      const auto pixel = static_cast<std::uint32_t>(y * kTileSide + x);
      if (!job.wants(pixel)) continue;
      const std::uint32_t own = job.first_pixel + pixel;
      if (tile.wants_cost) tile.cost[own] += std::exchange(tile.cost[spare_ + pixel], 0.0F);
      const bool is_crossed = outlines[pixel] != 0 && states_[own] != State::Apart;
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
