#include "rt/denoise/silhouette_edges.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

namespace hpr {
namespace {

/// How far apart they may lie, in distances from the eye.
constexpr float kMaxDistance = 0.1F;
/// Cosine between the normals of two places that no edge lies between.
constexpr float kMinCosine = 0.8F;
/// Halvings of an edge: they leave a sixty-fourth of a pixel to either side.
constexpr int kHalvings = 5;
/// Halvings of how far an edge may bend; its bounds in pixels and in lengths of the straight line.
constexpr int kBendHalvings = 3;
constexpr float kMaxLineBend = 0.125F;
constexpr float kMaxLineBendOfChord = 0.25F;
/// Bounds for edges whose bend is interpolated from the pixels before and after: of the bend, in lengths of the line,
/// and of the difference of the two estimates, in pixels.
constexpr float kMaxEvenBend = 0.025F;
constexpr float kMaxUneven = 0.03F;
/// Ridge of the estimate: the error of an edge relative to usual bends, squared.
constexpr float kBendRidge = 0.01F;
/// Pixels of a square that are gone through together: so rays are coherent.
constexpr int kBlock = 8;

/// Calls body(x, y) for all places of [0, width) x [0, height), block after block.
template <typename Body>
void for_each_place(int width, int height, const Body& body) {
  for (int y0 = 0; y0 < height; y0 += kBlock) {
    for (int x0 = 0; x0 < width; x0 += kBlock) {
      for (int y = y0; y < std::min(height, y0 + kBlock); ++y) {
        for (int x = x0; x < std::min(width, x0 + kBlock); ++x) body(x, y);
      }
    }
  }
}

/// Sets the fraction and the centroid of a polygon around the pixel's centre.
void measure(std::span<const glm::vec2> polygon, SilhouetteEdges::Pixel& pixel) {
  pixel.fraction = 0.0F;
  pixel.centroid = glm::vec2(0.0F);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::vec2& a = polygon[i];
    const glm::vec2& b = polygon[(i + 1) % polygon.size()];
    const float twice = a.x * b.y - b.x * a.y;
    pixel.fraction += 0.5F * twice;
    pixel.centroid += twice / 6.0F * (a + b);
  }
  pixel.centroid /= pixel.fraction;
}

float square(float value) {
  return value * value;
}

float max_bend(const SilhouetteEdges::Pixel& pixel) {
  return std::min(kMaxLineBend, kMaxLineBendOfChord * glm::length(pixel.chord));
}

/// What the bend takes from the left side, a segment of a parabola.
void take_bend(SilhouetteEdges::Pixel& pixel) {
  const float removed = 2.0F / 3.0F * pixel.bend * glm::length(pixel.chord);
  const glm::vec2 from = pixel.start + 0.5F * pixel.chord + 0.4F * pixel.bend * pixel.to_left;
  const float left = std::clamp(pixel.fraction - removed, 0.0F, 1.0F);
  if (left > 0.0F) pixel.centroid = glm::clamp((pixel.fraction * pixel.centroid - removed * from) / left, -0.5F, 0.5F);
  pixel.fraction = left;
}

}  // namespace

SurfaceFeature feature_at(const SurfacePoint& point, const glm::dvec3& eye) {
  return {true, point.material, point.position - eye, point.facing_normal()};
}

float max_distance2(const View& view, const glm::vec3& position) {
  // Parallel rays have no eye to be far from.
  return view.orthographic ? std::numeric_limits<float>::infinity()
                           : square(kMaxDistance) * glm::dot(position, position);
}

bool is_within_depth(const View& view, const SurfaceFeature& first, const SurfaceFeature& second) {
  if (first.material != second.material) return false;
  const glm::vec3 offset = second.position - first.position;
  return glm::dot(offset, offset) <= max_distance2(view, second.position);
}

bool is_coplanar(const View& view, const SurfaceFeature& first, const SurfaceFeature& second) {
  const glm::vec3 offset = second.position - first.position;
  const float off = glm::dot(offset, first.normal);
  return off * off <= kMaxBend * kMaxBend * glm::dot(offset, offset) && is_within_depth(view, first, second);
}

bool is_silhouette(const View& view, const SurfaceFeature& a, const SurfaceFeature& b) {
  if (a.is_surface != b.is_surface) return true;
  return a.is_surface && (glm::dot(a.normal, b.normal) < kMinCosine || !is_coplanar(view, a, b));
}

View unjittered(const TileJob& job) {
  View view = *job.view;
  view.jitter = glm::dvec2(0.0);
  return view;
}

/// By the jitter: where a screen of points has none, that is the ray of the pixel's centre.
RayRequest ray_through(View& view, const TileJob& job, std::uint32_t pixel, const glm::vec2& position) {
  view.jitter = position;
  const RayRequest ray =
      eye_ray(view, job, static_cast<int>(pixel % kTileSide) + 0.5, static_cast<int>(pixel / kTileSide) + 0.5);
  view.jitter = glm::dvec2(0.0);
  return ray;
}

void trace_primary_rays(const LightContext& context, RayBuffers& buffers, Coherence coherence) {
  buffers.hits.resize(buffers.requests.size());
  if (buffers.requests.empty()) return;
  buffers.counts.primary += buffers.requests.size();
  buffers.scratch.batch.purpose = {RayKind::Primary};
  buffers.counts.invalid += context.rays->closest(buffers.requests, buffers.hits, buffers.scratch, coherence);
}

void trace_features(const LightContext& context, RayBuffers& buffers, const glm::dvec3& eye,
                    std::vector<SurfaceFeature>& seen, Coherence coherence) {
  trace_primary_rays(context, buffers, coherence);
  seen.clear();
  for (std::size_t i = 0; i < buffers.hits.size(); ++i) {
    SurfaceFeature& feature = seen.emplace_back();
    if (buffers.hits[i] == kNoSurface) continue;
    const WorldTriangle& triangle = buffers.triangles.load(context.surfaces, buffers.hits[i]);
    const SurfacePoint point =
        context.surfaces.meet(triangle, buffers.requests[i].origin, buffers.requests[i].direction);
    feature = feature_at(point, eye);
  }
}

void SilhouetteEdges::trace_corners(const LightContext& context, RayBuffers& buffers, const TileJob& job) {
  buffers.requests.clear();
  for (int y = -1; y <= height_ + 1; ++y) {
    for (int x = -1; x <= width_ + 1; ++x) buffers.requests.push_back(eye_ray(view_, job, x, y));
  }
  trace_features(context, buffers, view_.eye, features_, Coherence::High);
}

void SilhouetteEdges::find_edge(int x, int y, int axis) {
  const glm::ivec2 end(x + 1 - axis, y + axis);
  if (end.x > width_ || end.y > height_) return;
  const std::uint32_t from = corner(x, y);
  const std::uint32_t to = corner(end.x, end.y);
  if (!is_silhouette(view_, features_[from], features_[to])) return;
  edge_at_.at(static_cast<std::size_t>(axis))[from] = static_cast<std::int32_t>(edges_.size());
  edges_.push_back({.start = {x, y}, .direction = {1 - axis, axis}, .before = from, .after = to});
}

void SilhouetteEdges::find_edges() {
  edges_.clear();
  for (std::vector<std::int32_t>& starts : edge_at_) starts.assign(features_.size(), -1);
  for_each_place(width_ + 1, height_ + 1, [&](int x, int y) {
    find_edge(x, y, 0);
    find_edge(x, y, 1);
  });
}

void SilhouetteEdges::bisect_edges(const LightContext& context, RayBuffers& buffers, const TileJob& job) {
  for (int halving = 0; halving < kHalvings; ++halving) {
    buffers.requests.clear();
    for (const Edge& edge : edges_) {
      if (edge.is_clear) buffers.requests.push_back(eye_ray(view_, job, edge.center().x, edge.center().y));
    }
    trace_features(context, buffers, view_.eye, traced_features_);
    auto seen = traced_features_.begin();
    for (Edge& edge : edges_) {
      if (!edge.is_clear) continue;
      const bool is_before = !is_silhouette(view_, features_[edge.before], *seen);
      const bool is_after = !is_silhouette(view_, *seen, features_[edge.after]);
      edge.is_clear = is_before != is_after;
      const double center = 0.5 * (edge.low + edge.high);
      (is_before ? edge.before : edge.after) = static_cast<std::uint32_t>(features_.size());
      (is_before ? edge.low : edge.high) = center;
      features_.push_back(*seen++);
    }
  }
}

/// `around`: the edges of the pixel, crossed ones, from that above it in the order of the clock.
void SilhouetteEdges::find_sides(Pixel& pixel, int x, int y, const std::array<std::int32_t, 4>& around) const {
  std::array<std::size_t, 2> ends{};
  std::size_t crossings = 0;
  for (std::size_t i = 0; i < around.size(); ++i) {
    if (around.at(i) < 0) continue;
    if (crossings == ends.size() || !edges_[static_cast<std::size_t>(around.at(i))].is_clear) return;
    ends.at(crossings++) = i;
  }
  if (crossings != ends.size()) return;
  pixel.has_sides = true;
  for (std::size_t i = 0; i < ends.size(); ++i) pixel.edges.at(i) = static_cast<std::uint32_t>(around.at(ends.at(i)));
  const glm::dvec2 centre(x + 0.5, y + 0.5);
  const auto put = [&](std::size_t side, const glm::vec2& position, std::uint32_t feature) {
    pixel.known.at(side).at(pixel.counts.at(side)++) = {position, feature};
  };
  // Corner i starts edge i in the order of the clock: those past the first crossing up to the second lie to the left.
  const std::array<std::uint32_t, 4> corners{corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)};
  constexpr std::array<glm::vec2, 4> kCorners{glm::vec2(-0.5F, -0.5F), {0.5F, -0.5F}, {0.5F, 0.5F}, {-0.5F, 0.5F}};
  std::array<glm::vec2, 5> left_side;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    put(i > ends[0] && i <= ends[1] ? 0 : 1, kCorners.at(i), corners.at(i));
  }
  std::array<glm::vec2, 2> crossed_at;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const Edge& edge = edges_[static_cast<std::size_t>(around.at(ends.at(i)))];
    crossed_at.at(i) = edge.center() - centre;
    // The lower edge and the left one run against the clock.
    const bool starts_first = (ends.at(i) < 2) == (i == 0);
    put(starts_first ? 1 : 0, edge.at(edge.low) - centre, edge.before);
    put(starts_first ? 0 : 1, edge.at(edge.high) - centre, edge.after);
  }
  std::size_t vertices = 0;
  left_side.at(vertices++) = crossed_at[0];
  for (std::size_t i = ends[0] + 1; i <= ends[1]; ++i) left_side.at(vertices++) = kCorners.at(i);
  left_side.at(vertices++) = crossed_at[1];
  measure(std::span(left_side).first(vertices), pixel);
  pixel.start = crossed_at[0];
  pixel.chord = crossed_at[1] - crossed_at[0];
  pixel.to_left = glm::normalize(glm::vec2(pixel.chord.y, -pixel.chord.x));
}

bool SilhouetteEdges::differ(int x, int y, const glm::ivec2& direction) const {
  return is_silhouette(view_, features_[corner(x, y)], features_[corner(x + direction.x, y + direction.y)]);
}

/// Whether what a corner shows ends on both sides of it, and is not the tip of something wider: it may then leave the
/// pixel again between corners.
bool SilhouetteEdges::is_thin_along(int x, int y, const glm::ivec2& axis) const {
  const auto ends_at_both = [&](int cx, int cy) { return differ(cx, cy, axis) && differ(cx, cy, -axis); };
  if (!ends_at_both(x, y)) return false;
  const glm::ivec2 across(axis.y, axis.x);
  return std::ranges::all_of(std::array{across, -across}, [&](const glm::ivec2& direction) {
    return differ(x, y, direction) || ends_at_both(x + direction.x, y + direction.y);
  });
}

bool SilhouetteEdges::is_thin(int x, int y) const {
  return is_thin_along(x, y, {1, 0}) || is_thin_along(x, y, {0, 1});
}

void SilhouetteEdges::find_pixels() {
  crossed_.clear();
  for_each_place(width_, height_, [&](int x, int y) {
    const std::array<std::int32_t, 4> around{edge_at_[0][corner(x, y)], edge_at_[1][corner(x + 1, y)],
                                             edge_at_[0][corner(x, y + 1)], edge_at_[1][corner(x, y)]};
    if (std::ranges::max(around) < 0) return;
    Pixel& pixel = crossed_.emplace_back();
    pixel.pixel = static_cast<std::uint32_t>(y * kTileSide + x);
    const bool is_some_thin = is_thin(x, y) || is_thin(x + 1, y) || is_thin(x, y + 1) || is_thin(x + 1, y + 1);
    if (!is_some_thin) find_sides(pixel, x, y, around);
    if (!pixel.has_sides) return;
    for (const std::uint32_t edge : pixel.edges) {
      std::array<std::int32_t, 2>& pixels = edges_[edge].pixels;
      pixels.at(pixels[0] < 0 ? 0 : 1) = static_cast<std::int32_t>(crossed_.size() - 1);
    }
  });
}

/// Where the edge leaves the next pixel that it crosses, from this one's centre.
std::optional<glm::vec2> SilhouetteEdges::end_of_next(const Pixel& pixel, std::size_t end) const {
  const std::uint32_t edge = pixel.edges.at(end);
  for (const std::int32_t i : edges_[edge].pixels) {
    if (i < 0 || crossed_[static_cast<std::size_t>(i)].pixel == pixel.pixel) continue;
    const Pixel& next = crossed_[static_cast<std::size_t>(i)];
    const auto position = [](const Pixel& of) { return glm::vec2(of.pixel % kTileSide, of.pixel / kTileSide); };
    return position(next) - position(pixel) + next.end(next.edges[0] == edge ? 1 : 0);
  }
  return std::nullopt;
}

/// The bend of a parabola through both ends and those of the pixels before and after; nothing where it would not do.
std::optional<float> SilhouetteEdges::even_bend(const Pixel& pixel) const {
  if (view_.points) return std::nullopt;  // corners and pixels may see otherwise
  const float length = glm::length(pixel.chord);
  const glm::vec2 along = pixel.chord / length;
  float sum = 0.0F;
  float weights = 0.0F;
  float low = std::numeric_limits<float>::infinity();
  float high = -low;
  for (const std::size_t end : {0U, 1U}) {
    const std::optional<glm::vec2> next = end_of_next(pixel, end);
    if (!next) continue;
    // From the nearer end, away from the pixel; the second divided difference and the inverse of its variance.
    const glm::vec2 offset = *next - pixel.end(end);
    const float away = end == 0 ? -glm::dot(offset, along) : glm::dot(offset, along);
    if (!(away > 0.0F)) return std::nullopt;
    const float product = away * (away + length);
    const float curve = glm::dot(offset, pixel.to_left) / product;
    const float weight =
        1.0F / (1.0F / square(product) + 1.0F / square(away * length) + 1.0F / square(length * (away + length)));
    const float bend = -0.25F * curve * square(length);
    low = std::min(low, bend);
    high = std::max(high, bend);
    sum += weight * bend;
    weights += weight;
  }
  if (weights == 0.0F || high - low > kMaxUneven) return std::nullopt;
  const float bend = sum / (weights + kBendRidge);
  return std::abs(bend) <= kMaxEvenBend * length ? std::optional(bend) : std::nullopt;
}

bool SilhouetteEdges::is_on_side(const Pixel& pixel, std::size_t side, const SurfaceFeature& feature) const {
  const auto& known = pixel.known.at(side);
  return std::any_of(known.begin(), known.begin() + pixel.counts.at(side),
                     [&](const KnownFeature& each) { return !is_silhouette(view_, features_[each.feature], feature); });
}

/// Bisects by the feature seen in the middle of the edge as it is assumed to bend.
void SilhouetteEdges::halve_bend(std::size_t i) {
  Pixel& pixel = *bent_[i];
  const bool is_left = is_on_side(pixel, 0, traced_features_[i]);
  if (!is_left && !is_on_side(pixel, 1, traced_features_[i])) pixel.has_sides = false;  // something else lies between
  const std::size_t side = is_left ? 0 : 1;
  pixel.known.at(side).at(pixel.counts.at(side)++) = {pixel.middle_of_edge(),
                                                      static_cast<std::uint32_t>(features_.size())};
  features_.push_back(traced_features_[i]);
  between_[i].at(is_left ? 1 : 0) = pixel.bend;
  pixel.bend = 0.5F * (between_[i][0] + between_[i][1]);
}

void SilhouetteEdges::bisect_bends(const LightContext& context, RayBuffers& buffers, const TileJob& job) {
  bent_.clear();
  between_.clear();
  for (Pixel& pixel : crossed_) {
    if (!pixel.has_sides) continue;
    if (const std::optional<float> bend = even_bend(pixel)) {
      pixel.bend = *bend;
      take_bend(pixel);
      continue;
    }
    bent_.push_back(&pixel);
    between_.push_back({-max_bend(pixel), max_bend(pixel)});
  }
  for (int halving = 0; halving < kBendHalvings; ++halving) {
    buffers.requests.clear();
    for (const Pixel* pixel : bent_) {
      buffers.requests.push_back(ray_through(view_, job, pixel->pixel, pixel->middle_of_edge()));
    }
    trace_features(context, buffers, view_.eye, traced_features_);
    for (std::size_t i = 0; i < bent_.size(); ++i) halve_bend(i);
  }
  for (std::size_t i = 0; i < bent_.size(); ++i) {
    Pixel& pixel = *bent_[i];
    const float limit = max_bend(pixel);
    if (between_[i][0] == -limit || between_[i][1] == limit) pixel.has_sides = false;  // it bends more than that
    take_bend(pixel);
  }
}

void SilhouetteEdges::find(const LightContext& context, RayBuffers& buffers, const TileJob& job) {
  view_ = unjittered(job);
  width_ = job.rect.width();
  height_ = job.rect.height();
  trace_corners(context, buffers, job);
  find_edges();
  bisect_edges(context, buffers, job);
  find_pixels();
  bisect_bends(context, buffers, job);
}

}  // namespace hpr
