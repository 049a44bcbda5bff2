#include "rt/lights/light_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::size_t kBins = 12;
/// Past so many lights only the longest axis of a box is tried: near the root it matters little where it is cut.
constexpr std::size_t kFewLights = 1024;
/// Splits that cut off one light at a time would make the tree as deep as there are lights.
constexpr int kDeepest = 48;

/// An angle's cosine and sine.
struct Angle {
  double cosine = 1.0;
  double sine = 0.0;
};

Angle angle_of_cosine(double cosine) {
  return {cosine, std::sqrt(std::max(0.0, 1.0 - cosine * cosine))};
}

/// max(0, a - b).
Angle difference(const Angle& a, const Angle& b) {
  if (a.cosine >= b.cosine) return {};
  return {a.cosine * b.cosine + a.sine * b.sine, a.sine * b.cosine - a.cosine * b.sine};
}

void unite_directions(LightBounds& a, const LightBounds& b) {
  const double widest = std::max(a.spread_radians, b.spread_radians);
  a.emission_radians = std::max(a.emission_radians, b.emission_radians);
  if (a.two_sided != b.two_sided || widest >= kPi) {
    a.two_sided = false;
    a.spread_radians = kPi;
    return;
  }
  glm::dvec3 other = b.axis;
  if (a.two_sided && glm::dot(a.axis, other) < 0.0) other = -other;
  const glm::dvec3 normal = glm::cross(a.axis, other);
  const double apart = std::atan2(glm::length(normal), glm::dot(a.axis, other));
  if (apart + b.spread_radians <= a.spread_radians) return;
  if (apart + a.spread_radians <= b.spread_radians) {
    a.axis = other;
    a.spread_radians = b.spread_radians;
    return;
  }
  const double spread = 0.5 * (a.spread_radians + apart + b.spread_radians);
  const double turn = spread - a.spread_radians;
  const glm::dvec3 across = glm::cross(normal, a.axis);
  const double length = glm::length(across);
  if (spread >= kPi || !(length > 0.0)) {
    a.spread_radians = kPi;
    a.two_sided = false;
    return;
  }
  a.axis = glm::normalize(std::cos(turn) * a.axis + std::sin(turn) * (across / length));
  a.spread_radians = spread + 1e-12;  // what rounding took must not fall out of the cone
}

/// Conty and Kulla, equation 2: the solid angle light goes to, weighted by its cosine.
double orientation_measure(const LightBounds& lights) {
  const double o = lights.spread_radians;
  const double w = std::min(o + lights.emission_radians, kPi);
  return 2.0 * kPi * (1.0 - std::cos(o)) +
         0.5 * kPi * (2.0 * w * std::sin(o) - std::cos(o - 2.0 * w) - 2.0 * o * std::sin(o) + std::cos(o));
}

double cost_of(const LightBounds& lights) {
  const glm::dvec3 diagonal = lights.high - lights.low;
  return lights.strength * orientation_measure(lights) * glm::dot(diagonal, diagonal);
}

}  // namespace

LightBounds united(const LightBounds& a, const LightBounds& b) {
  if (!(a.strength > 0.0)) return b;
  if (!(b.strength > 0.0)) return a;
  LightBounds both = a;
  both.low = glm::min(a.low, b.low);
  both.high = glm::max(a.high, b.high);
  both.strength = a.strength + b.strength;
  both.reach = a.reach > 0.0 && b.reach > 0.0 ? std::max(a.reach, b.reach) : 0.0;
  unite_directions(both, b);
  return both;
}

LightCluster::LightCluster(const LightBounds& bounds)
    : center(0.5 * (bounds.low + bounds.high)),
      radius(0.5 * glm::distance(bounds.low, bounds.high)),
      half(0.5 * (bounds.high - bounds.low)),
      reach(bounds.reach),
      axis(bounds.axis),
      strength(bounds.strength),
      cos_spread(std::cos(bounds.spread_radians)),
      sin_spread(std::sin(bounds.spread_radians)),
      cos_emission(std::cos(bounds.emission_radians)),
      two_sided(bounds.two_sided) {}

double LightCluster::importance(const glm::dvec3& position, const glm::dvec3& normal) const {
  const glm::dvec3 to_center = center - position;
  const double distance = glm::length(to_center);
  if (!(distance + radius > 0.0) || !std::isfinite(distance + radius)) return 0.0;
  if (reach > 0.0 && glm::length(glm::max(glm::abs(to_center) - half, glm::dvec3(0.0))) > reach * (1.0 + 1e-9))
    return 0.0;
  double cosine = 1.0;
  if (distance > radius) {
    // Every angle may be less by that under which the lights are seen.
    const double near = 1.0 / distance;
    const double sine = radius * near;
    const Angle seen{std::sqrt((distance - radius) * near * (1.0 + sine)), sine};
    const double off_axis = -glm::dot(axis, to_center) * near;
    const Angle from_axis = angle_of_cosine(two_sided ? std::abs(off_axis) : off_axis);
    const Angle leaving = difference(difference(from_axis, {cos_spread, sin_spread}), seen);
    if (leaving.cosine <= cos_emission) return 0.0;
    // Rounding at grazing angles must not shut out a light.
    cosine = std::max(leaving.cosine, 1e-3);
    if (normal != glm::dvec3(0.0)) {
      const Angle arriving = difference(angle_of_cosine(glm::dot(normal, to_center) * near), seen);
      if (!(arriving.cosine > 0.0)) return 0.0;
      cosine *= arriving.cosine;
    }
  }
  const double nearest = std::max(distance, radius);
  const double importance = strength * cosine / (nearest * nearest);
  return std::isfinite(importance) ? std::min(importance, 1e300) : 1e300;
}

struct LightTree::Builder {
  std::span<const LightBounds> lights;
  std::vector<std::uint32_t> order;
  LightTree& tree;

  struct Split {
    double cost = std::numeric_limits<double>::infinity();
    int axis = 0;
    double at = 0.0;  ///< centres below it go first
  };

  [[nodiscard]] double center(std::uint32_t light, int axis) const {
    return 0.5 * (lights[light].low[axis] + lights[light].high[axis]);
  }

  /// The best of the planes between the bins of one axis.
  [[nodiscard]] Split best_split(std::span<const std::uint32_t> part, int axis, double from, double to,
                                 double longest) const {
    if (!(to > from)) return {};
    std::array<LightBounds, kBins> bins;
    const double scale = static_cast<double>(kBins) / (to - from);
    for (const std::uint32_t light : part) {
      const auto bin = static_cast<std::size_t>((center(light, axis) - from) * scale);
      LightBounds& bounds = bins[std::min(bin, kBins - 1)];
      bounds = united(bounds, lights[light]);
    }
    std::array<double, kBins> below{};
    LightBounds sum;
    for (std::size_t i = 0; i + 1 < kBins; ++i) below[i] = cost_of(sum = united(sum, bins[i]));
    sum = LightBounds{};
    Split best;
    best.axis = axis;
    for (std::size_t i = kBins - 1; i > 0; --i) {
      sum = united(sum, bins[i]);
      const double cost = (below[i - 1] + cost_of(sum)) * longest / (to - from);
      if (cost < best.cost) {
        best.cost = cost;
        best.at = from + static_cast<double>(i) / scale;
      }
    }
    return best;
  }

  /// Puts those that go first to the front and returns how many.
  [[nodiscard]] std::size_t divide(std::span<std::uint32_t> part, int depth) const {
    glm::dvec3 low(std::numeric_limits<double>::infinity());
    glm::dvec3 high(-std::numeric_limits<double>::infinity());
    for (const std::uint32_t light : part) {
      const glm::dvec3 at(center(light, 0), center(light, 1), center(light, 2));
      low = glm::min(low, at);
      high = glm::max(high, at);
    }
    const glm::dvec3 extent = high - low;
    const int longest = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    if (depth < kDeepest) {
      Split best;
      for (int axis = 0; axis < 3; ++axis) {
        if (part.size() > kFewLights && axis != longest) continue;
        const Split split = best_split(part, axis, low[axis], high[axis], extent[longest]);
        if (split.cost < best.cost) best = split;
      }
      const auto rest = std::partition(part.begin(), part.end(),
                                       [&](std::uint32_t light) { return center(light, best.axis) < best.at; });
      const auto first = static_cast<std::size_t>(rest - part.begin());
      if (first > 0 && first < part.size() && std::isfinite(best.cost)) return first;
    }
    const std::size_t half = part.size() / 2;
    std::ranges::nth_element(part, part.begin() + static_cast<std::ptrdiff_t>(half),
                             [&](std::uint32_t a, std::uint32_t b) {
                               return std::pair(center(a, longest), a) < std::pair(center(b, longest), b);
                             });
    return half;
  }

  /// Appends the tree over `part` and returns its bounds.
  LightBounds build(std::span<std::uint32_t> part, std::uint32_t parent, int depth) {
    const auto index = static_cast<std::uint32_t>(tree.nodes_.size());
    tree.nodes_.emplace_back();
    tree.nodes_[index].parent = parent;
    if (part.size() == 1) {
      tree.nodes_[index].lights = LightCluster(lights[part.front()]);
      tree.nodes_[index].light = part.front();
      tree.leaf_of_[part.front()] = index;
      return lights[part.front()];
    }
    const std::size_t count = divide(part, depth);
    const LightBounds first = build(part.first(count), index, depth + 1);
    tree.nodes_[index].second = static_cast<std::uint32_t>(tree.nodes_.size());
    const LightBounds both = united(first, build(part.subspan(count), index, depth + 1));
    tree.nodes_[index].lights = LightCluster(both);
    return both;
  }
};

LightTree::LightTree(std::span<const LightBounds> lights) {
  if (lights.empty()) return;
  leaf_of_.resize(lights.size());
  nodes_.reserve(2 * lights.size() - 1);
  Builder builder{lights, std::vector<std::uint32_t>(lights.size()), *this};
  std::iota(builder.order.begin(), builder.order.end(), 0U);
  builder.build(builder.order, 0, 0);
}

double LightTree::share_of_first(std::uint32_t node, const glm::dvec3& position, const glm::dvec3& normal) const {
  const double first = nodes_[node + 1].lights.importance(position, normal);
  const double second = nodes_[nodes_[node].second].lights.importance(position, normal);
  const double sum = first + second;
  return sum > 0.0 ? first / sum : -1.0;
}

std::optional<LightTree::Choice> LightTree::choose(const glm::dvec3& position, const glm::dvec3& normal,
                                                   double u) const {
  if (nodes_.empty() || !(importance(position, normal) > 0.0)) return std::nullopt;
  std::uint32_t node = 0;
  Choice choice{0, 1.0};
  while (nodes_[node].second != 0) {
    const double fraction = share_of_first(node, position, normal);
    if (fraction < 0.0) return std::nullopt;
    if (u < fraction) {
      u /= fraction;
      choice.probability *= fraction;
      ++node;
    } else {
      u = std::min((u - fraction) / (1.0 - fraction), 1.0 - 1e-16);
      choice.probability *= 1.0 - fraction;
      node = nodes_[node].second;
    }
  }
  choice.light = nodes_[node].light;
  return choice;
}

double LightTree::probability(const glm::dvec3& position, const glm::dvec3& normal, std::size_t light) const {
  // Multiplied from the root down, as choose() does.
  if (!(importance(position, normal) > 0.0)) return 0.0;
  std::array<std::uint32_t, 128> path{};
  std::size_t length = 0;
  for (std::uint32_t node = leaf_of_[light]; node != 0; node = nodes_[node].parent) path[length++] = node;
  double probability = 1.0;
  for (std::size_t i = length; i > 0; --i) {
    const std::uint32_t parent = nodes_[path[i - 1]].parent;
    const double fraction = share_of_first(parent, position, normal);
    if (fraction < 0.0) return 0.0;
    probability *= path[i - 1] == parent + 1 ? fraction : 1.0 - fraction;
  }
  return probability;
}

}  // namespace hpr
