#include "rt/lights/direct_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace hpr {

double balance_heuristic(const LightContext& context, double pdf, double light_pdf) {
  if (!(pdf > 0.0)) return 1.0;
  const double lights = light_pdf * context.settings.light_samples;
  return pdf / (pdf + lights);
}

void add_emission(const LightContext& context, const Wavefront& wave, PixelSums& sums) {
  for (const PathVertex& point : wave.vertices) {
    if (point.material.emission == glm::dvec3(0.0) || (point.material.unlit && point.gathered) || point.is_caustic) {
      continue;
    }
    double weight = 1.0;
    if (point.previous_pdf > 0.0) {
      weight = balance_heuristic(context, point.previous_pdf,
                                 context.lights.surface_pdf(point.previous_position, point.previous_normal,
                                                            point.surface.surface, point.surface));
    }
    sums.add(point.pixel, point.component, weight * point.throughput * point.material.emission);
  }
}

bool DirectLight::sample_next() {
  wave_.samples.clear();
  if (light_ < context_.lights.enumerated()) {
    sample_enumerated();
    return true;
  }
  if (context_.lights.has_tree() && round_ < context_.settings.light_samples) {
    sample_others();
    return true;
  }
  return false;
}

void DirectLight::sample_enumerated() {
  const std::size_t end = std::min(light_ + kLightsAtOnce, context_.lights.enumerated());
  for (; light_ < end; ++light_) {
    const bool fixed = context_.lights.enumerated_is_fixed(light_);
    for (std::uint32_t i = 0; i < wave_.vertices.size(); ++i) {
      PathVertex& point = wave_.vertices[i];
      if (point.is_upsampled(Component::Direct)) continue;
      const glm::dvec2 u = fixed ? glm::dvec2(0.0) : next_two(point.sampler, point.depth);
      add(i, context_.lights.sample_enumerated(light_, point.surface.position, *context_.view, u));
    }
  }
}

void DirectLight::sample_others() {
  for (std::uint32_t i = 0; i < wave_.vertices.size(); ++i) {
    PathVertex& point = wave_.vertices[i];
    if (point.is_upsampled(Component::Direct)) continue;
    const double choice = point.sampler.one();
    const glm::dvec2 u = round_ == 0 ? next_two(point.sampler, point.depth) : point.sampler.two();
    auto light = context_.lights.sample(point.surface.position, point.bsdf.light_normal(), *context_.view, choice, u);
    if (!light) continue;
    light->weight /= context_.settings.light_samples;
    add(i, *light);
  }
  ++round_;
}

void DirectLight::add(std::uint32_t index, const LightSample& light) {
  if (light.weight == glm::dvec3(0.0)) return;
  const PathVertex& point = wave_.vertices[index];
  glm::dvec3 scattered(0.0);
  if (!(light.pdf > 0.0) && !context_.leaves_caustics(point)) {
    scattered = point.bsdf.total(light.to_light);
  } else {
    scattered = shared_scattering(point, light);
  }
  const double cosine = std::abs(glm::dot(point.material.normal, light.to_light));
  glm::dvec3 radiance = point.throughput * scattered * light.weight * cosine;
  // The headlight stands at the eye and lights what the eye sees only.
  if (!light.casts_shadows && point.gathered) return;
  if (light.casts_shadows) {
    radiance *= transmittance_to_light(point.media, point.surface, point.material, light.to_light, light.distance);
  }
  if (radiance == glm::dvec3(0.0)) return;
  wave_.samples.push_back({index, 1.0F, light, radiance});
}

glm::dvec3 DirectLight::shared_scattering(const PathVertex& point, const LightSample& light) const {
  glm::dvec3 scattered(0.0);
  const Scattering all = point.bsdf.scattering(light.to_light);
  const bool leaves_caustics = context_.leaves_caustics(point);
  const bool may_be_found = light.pdf > 0.0 && (!point.gathers_near() || light.distance < point.gather_reach);
  const std::size_t lobes = point.bsdf.lobes().size();
  for (std::size_t lobe = 0; lobe < lobes; ++lobe) {
    if (leaves_caustics && context_.follows_for_itself(point.bsdf, kLobes[lobe])) continue;
    const double weight =
        may_be_found && point.may_follow[lobe] ? 1.0 - balance_heuristic(context_, all.pdf[lobe], light.pdf) : 1.0;
    scattered += weight * all.value[lobe];
  }
  return scattered;
}

void add_samples(const Wavefront& wave, PixelSums& sums) {
  for (const DirectSample& sample : wave.samples) {
    const PathVertex& point = wave.vertices[sample.point];
    const glm::dvec3 arriving = static_cast<double>(sample.visible) * sample.radiance;
    if (point.component != Component::Direct || !sums.wants_components) {
      sums.add(point.pixel, point.component, arriving);
      continue;
    }
    sums.radiance[point.pixel] += arriving;
    sums.components[static_cast<std::size_t>(Component::Direct)][point.pixel] += sample.radiance;
    sums.components[static_cast<std::size_t>(Component::Shadow)][point.pixel] += arriving - sample.radiance;
  }
}

}  // namespace hpr
