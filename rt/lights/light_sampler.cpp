#include "rt/lights/light_sampler.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "rt/sampling/sampling.h"
#include "scene/requirements.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;

double mean_of(const glm::dvec3& color) {
  return (color.r + color.g + color.b) / 3.0;
}

bool shines(const Light& light) {
  const double intensity = mean_of(glm::dvec3(light.intensity));
  return intensity > 0.0 && std::isfinite(intensity);
}

LightBounds bounds_of(const Light& light) {
  LightBounds bounds;
  bounds.low = light.position - glm::dvec3(light.radius);
  bounds.high = light.position + glm::dvec3(light.radius);
  bounds.strength = mean_of(glm::dvec3(light.intensity));
  bounds.reach = light.range;
  bounds.spread_radians = kPi;
  if (light.type == LightType::Spot) {
    bounds.axis = glm::normalize(glm::dvec3(light.direction));
    bounds.spread_radians = 0.0;
    bounds.emission_radians = std::min(static_cast<double>(light.outer_cone_radians), kPi);
  }
  return bounds;
}

bool stands_somewhere(const Light& light) {
  return light.type == LightType::Point || light.type == LightType::Spot;
}

LitSphere sphere_about(const Bounds& bounds) {
  // A little more than the corners: photons start outside of everything.
  return {0.5 * bounds.low + 0.5 * bounds.high, 0.5000001 * glm::distance(bounds.low, bounds.high)};
}

}  // namespace

LightSampler::LightSampler(const Scene& scene, ConstantEnvironment constant_environment)
    : constant_environment_(constant_environment),
      lit_(sphere_about(scene.bounds)),
      background_(scene.background.r, scene.background.g, scene.background.b),
      triangles_(scene) {
  if (gives_light(scene)) {
    std::ranges::copy_if(scene.lights, std::back_inserter(punctual_), shines);
  } else {
    punctual_.push_back(make_headlight());
  }
  if (scene.environment && scene.environment->image.size().area() > 0) environment_.emplace(*scene.environment);
  enumerated_ = punctual_.size() <= kMaxEnumerated ? punctual_.size() : 0;
  all_ = make_choices(true);
  if (enumerated_ > 0) sampled_ = make_choices(false);
  sum_powers();
  find_media(scene);
}

/// A light lies in one place; a mesh that emits, where its first triangle does.
void LightSampler::find_media(const Scene& scene) {
  const MediumFinder finder(scene);
  if (!finder.absorbs()) return;
  for (const Light& light : punctual_) {
    media_.push_back(stands_somewhere(light) ? finder.at(light.position) : Media{});
  }
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    const TriangleLight& triangle = triangles_[i];
    const bool same = i > 0 && triangles_[i - 1].instance == triangle.instance;
    media_.push_back(same ? Media(media_.back()) : finder.at(triangle.v0 + (triangle.e1 + triangle.e2) / 3.0));
  }
}

LightSampler::Choices LightSampler::make_choices(bool punctual) const {
  Choices choices;
  std::vector<LightBounds> standing;
  double sum = 0.0;
  const auto add_outside = [&](std::size_t light, double irradiance) {
    choices.outside.push_back(static_cast<std::uint32_t>(light));
    choices.outside_sums.push_back(sum += irradiance);
  };
  for (std::size_t i = 0; punctual && i < punctual_.size(); ++i) {
    if (stands_somewhere(punctual_[i])) {
      standing.push_back(bounds_of(punctual_[i]));
      choices.in_tree.push_back(static_cast<std::uint32_t>(i));
    } else {
      add_outside(i, mean_of(glm::dvec3(punctual_[i].intensity)));
    }
  }
  choices.first_triangle = standing.size();
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    standing.push_back(triangles_.bounds(i));
    choices.in_tree.push_back(static_cast<std::uint32_t>(punctual_.size() + i));
  }
  choices.tree = LightTree(standing);
  const double around = environment_ ? kPi * mean_of(environment_->mean()) : 0.0;
  const bool left_out =
      constant_environment_ == ConstantEnvironment::LeftToRays && environment_ && environment_->is_constant();
  if (around > 0.0 && !left_out) add_outside(environment_number(), around);
  return choices;
}

void LightSampler::sum_powers() {
  double sum = 0.0;
  const auto add = [&](double chosen_by, double watts) {
    power_sums_.push_back(sum += chosen_by);
    power_ += watts;
  };
  for (const Light& light : punctual_) {
    const double watts = mean_of(power_of(light, lit_));
    add(watts, watts);
  }
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    add(triangles_[i].sides() * kPi * triangles_[i].area * triangles_[i].brightness, mean_of(triangles_.power(i)));
  }
  if (environment_) {
    const double watts = 4.0 * kPi * kPi * lit_.radius * lit_.radius * mean_of(environment_->mean());
    add(watts, watts);
  }
}

std::size_t LightSampler::enumerated() const {
  return enumerated_;
}

LightSample LightSampler::sample_enumerated(std::size_t light, const glm::dvec3& position, const View& view,
                                            const glm::dvec2& u) const {
  return sample_punctual(punctual_[light], position, view, u);
}

bool LightSampler::enumerated_is_fixed(std::size_t light) const {
  return is_fixed(punctual_[light]);
}

bool LightSampler::has_tree() const {
  return !one().tree.empty() || !one().outside.empty();
}

/// How often a light outside the tree is chosen: in proportion to its irradiance and to what the tree promises, which
/// is a rough estimate, and therefore never trusted to rule out either.
double LightSampler::outside_share(const Choices& choices, const glm::dvec3& position, const glm::dvec3& normal) const {
  if (choices.outside.empty()) return 0.0;
  const double from_tree = choices.tree.empty() ? 0.0 : choices.tree.importance(position, normal);
  if (!(from_tree > 0.0)) return 1.0;
  return std::clamp(choices.outside_sums.back() / (choices.outside_sums.back() + from_tree), 0.1, 0.9);
}

std::optional<LightSampler::Chosen> LightSampler::choose(const Choices& choices, const glm::dvec3& position,
                                                         const glm::dvec3& normal, double u) const {
  const double fraction = outside_share(choices, position, normal);
  if (u < fraction) {
    const DiscreteSample picked = sample_discrete(choices.outside_sums, u / fraction);
    return Chosen{choices.outside[picked.index], fraction * picked.probability, picked.rest};
  }
  if (!(fraction < 1.0)) return std::nullopt;
  const auto choice = choices.tree.choose(position, normal, (u - fraction) / (1.0 - fraction));
  if (!choice) return std::nullopt;
  return Chosen{choices.in_tree[choice->light], (1.0 - fraction) * choice->probability};
}

std::optional<LightSample> LightSampler::sample(const Choices& choices, const glm::dvec3& position,
                                                const glm::dvec3& normal, const View& view, double u_choice,
                                                const glm::dvec2& u) const {
  const auto chosen = choose(choices, position, normal, u_choice);
  if (!chosen) return std::nullopt;
  LightSample sample;
  if (chosen->light < punctual_.size()) {
    sample = sample_punctual(punctual_[chosen->light], position, view, u);
  } else if (chosen->light < environment_number()) {
    sample = triangles_.sample(chosen->light - punctual_.size(), position, u);
  } else {
    sample_environment(normal, chosen->rest, u, sample);
  }
  sample.weight /= chosen->probability;
  sample.pdf *= chosen->probability;
  const double weight = mean_of(sample.weight);
  if (!(weight > 0.0) || !std::isfinite(weight)) return std::nullopt;
  return sample;
}

void LightSampler::sample_environment(const glm::dvec3& normal, double rest, const glm::dvec2& u,
                                      LightSample& sample) const {
  const auto direction = environment_->sample(normal, rest, u);
  if (!direction) return;
  sample.to_light = *direction;
  sample.distance = std::numeric_limits<double>::infinity();
  const EnvironmentMap::DirectionalRadiance seen = environment_->evaluate(sample.to_light, normal);
  sample.pdf = seen.pdf;
  if (sample.pdf > 0.0) sample.weight = seen.radiance / sample.pdf;
}

double LightSampler::surface_pdf(const Choices& choices, const glm::dvec3& position, const glm::dvec3& normal,
                                 std::uint32_t surface, const SurfacePoint& hit) const {
  const auto triangle = triangles_.find(surface);
  if (!triangle) return 0.0;
  const double in_tree = 1.0 - outside_share(choices, position, normal);
  const double probability = in_tree * choices.tree.probability(position, normal, choices.first_triangle + *triangle);
  return probability > 0.0 ? triangles_.pdf(*triangle, position, hit.position) * probability : 0.0;
}

double LightSampler::environment_pdf(const Choices& choices, const glm::dvec3& position, const glm::dvec3& normal,
                                     const glm::dvec3& direction) const {
  if (choices.outside.empty() || choices.outside.back() != environment_number()) return 0.0;
  // Equals sample_discrete(), bit for bit.
  const double before = choices.outside.size() > 1 ? choices.outside_sums[choices.outside.size() - 2] : 0.0;
  const double sum = choices.outside_sums.back();
  const double probability = outside_share(choices, position, normal) * ((sum - before) / sum);
  return environment_->evaluate(direction, normal).pdf * probability;
}

std::optional<LightSample> LightSampler::sample(const glm::dvec3& position, const glm::dvec3& normal, const View& view,
                                                double u_choice, const glm::dvec2& u) const {
  return sample(one(), position, normal, view, u_choice, u);
}

std::optional<LightSample> LightSampler::sample_any(const glm::dvec3& position, const glm::dvec3& normal,
                                                    const View& view, double u_choice, const glm::dvec2& u) const {
  return sample(all_, position, normal, view, u_choice, u);
}

double LightSampler::surface_pdf(const glm::dvec3& position, const glm::dvec3& normal, std::uint32_t surface,
                                 const SurfacePoint& hit) const {
  return surface_pdf(one(), position, normal, surface, hit);
}

double LightSampler::surface_pdf_any(const glm::dvec3& position, const glm::dvec3& normal, std::uint32_t surface,
                                     const SurfacePoint& hit) const {
  return surface_pdf(all_, position, normal, surface, hit);
}

glm::dvec3 LightSampler::environment(const glm::dvec3& direction) const {
  return environment_ ? environment_->radiance(direction) : background_;
}

double LightSampler::environment_irradiance(const glm::dvec3& normal) const {
  return environment_ ? environment_->irradiance(normal) : 0.0;
}

std::optional<glm::dvec3> LightSampler::constant_environment() const {
  if (!environment_) return background_;
  return environment_->is_constant() ? std::optional(environment_->mean()) : std::nullopt;
}

double LightSampler::environment_pdf(const glm::dvec3& position, const glm::dvec3& normal,
                                     const glm::dvec3& direction) const {
  return environment_pdf(one(), position, normal, direction);
}

double LightSampler::environment_pdf_any(const glm::dvec3& position, const glm::dvec3& normal,
                                         const glm::dvec3& direction) const {
  return environment_pdf(all_, position, normal, direction);
}

double LightSampler::power() const {
  return power_;
}

std::optional<PhotonStart> LightSampler::emit(double u_choice, const glm::dvec2& u_place,
                                              const glm::dvec2& u_direction) const {
  if (power_sums_.empty() || !(power_sums_.back() > 0.0)) return std::nullopt;
  const DiscreteSample picked = sample_discrete(power_sums_, u_choice);
  PhotonStart start;
  if (picked.index < punctual_.size()) {
    start = emit_punctual(punctual_[picked.index], lit_, u_place, u_direction);
  } else if (picked.index < environment_number()) {
    start = triangles_.emit(picked.index - punctual_.size(), picked.rest, u_place, u_direction);
  } else {
    const glm::dvec3 all_sides(0.0);
    const auto from = environment_->sample(all_sides, 0.0, u_direction);
    if (!from) return std::nullopt;
    const EnvironmentMap::DirectionalRadiance seen = environment_->evaluate(*from, all_sides);
    const double disc = kPi * lit_.radius * lit_.radius;
    start =
        emit_from_outside(lit_, -*from, seen.pdf > 0.0 ? seen.radiance * (disc / seen.pdf) : glm::dvec3(0.0), u_place);
  }
  start.flux /= picked.probability;
  if (picked.index < media_.size()) start.media = media_[picked.index];
  return start;
}

}  // namespace hpr
