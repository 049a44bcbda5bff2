#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <mutex>
#include <numeric>
#include <random>

#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr int kLayers = 64;
constexpr double kSpacing = 1e-3;

/// Layer i from the front: premultiplied, in [0, 1].
RgbaPremultiplied layer_color(int i) {
  const float alpha = 0.02F + 0.06F * static_cast<float>(i * 29 % kLayers) / static_cast<float>(kLayers);
  const auto channel = [&](int k) { return alpha * static_cast<float>((i * k + 7) % 17) / 16.0F; };
  return {channel(3), channel(5), channel(11), alpha};
}

std::vector<int> shuffled() {
  std::vector<int> order(kLayers);
  std::iota(order.begin(), order.end(), 0);
  std::ranges::shuffle(order, std::mt19937(3));
  return order;
}

/// The layers in order, by definition, in double, before `behind`.
glm::dvec3 exact_color(const glm::dvec3& behind) {
  glm::dvec3 sum(0.0);
  double left = 1.0;
  for (int i = 0; i < kLayers; ++i) {
    const RgbaPremultiplied color = layer_color(i);
    sum += left * glm::dvec3(color.r, color.g, color.b);
    left *= 1.0 - double{color.a};
  }
  return sum + left * behind;
}

double largest_error(const glm::dvec3& found) {
  const glm::dvec3 error = glm::abs(found);
  return std::max({error.x, error.y, error.z});
}

/// Quads of alpha mode BLEND, a millimetre apart, in any order in the scene.
StabilityFinding veils(const Globals& globals) {
  const glm::vec3 background(0.5F, 0.25F, 0.125F);
  Scene scene;
  for (const int i : shuffled()) {
    const RgbaPremultiplied color = layer_color(i);
    Material material;
    material.alpha_mode = AlphaMode::Blend;
    material.unlit = true;
    material.base_color = {color.r / color.a, color.g / color.a, color.b / color.a, color.a};
    scene.materials.push_back(material);
    Mesh mesh = rectangle({-3.0F, -3.0F}, {3.0F, 3.0F});
    mesh.material = static_cast<std::uint32_t>(scene.materials.size() - 1);
    add(scene, std::move(mesh), glm::translate(glm::dmat4(1.0), {0.01, 0.02, -1.0 - kSpacing * i}));
  }
  scene.background = {background.r, background.g, background.b};
  finish_scene(scene);
  const Picture picture = make_picture(globals, scene, head_on({64, 64}, 1.0, 0.01));
  StabilityFinding finding =
      make_finding("layers/veils", "64 BLEND quads 1 mm apart, shuffled, seen through rays",
                   over_error_bound<RgbaPremultiplied>(kLayers + 1), "largest error of a channel",
                   "The bound of 64 merges by `over` in floats, and colours divided by their alpha once.");
  for (const Rgb& color : picture.radiance.pixels()) {
    const glm::dvec3 error = glm::dvec3(color.r, color.g, color.b) - exact_color(background);
    finding.measured =
        std::max(finding.measured, std::isfinite(error.x + error.y + error.z) ? largest_error(error) : HUGE_VAL);
  }
  return finding;
}

/// The layers, one a rank, blended by a strategy: the largest error of a channel.
double blended_error(const std::string& strategy, const FrameLayout& layout) {
  const std::vector<int> order = shuffled();  // order[i]: the rank that has layer i
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const glm::dvec3 expected = exact_color(glm::dvec3(0.0));
  double worst = 0.0;
  std::size_t owned = 0;
  std::mutex mutex;
  run_local_ranks(kLayers, [&](Communicator& comm) {
    const auto mine = std::ranges::find(order, comm.rank()) - order.begin();
    TileLayer<RgbaPremultiplied> layer(layout);
    for (const std::size_t tile : tiles) {
      std::ranges::fill(layer.tile(tile), layer_color(static_cast<int>(mine)));
      layer.set_active(tile);
    }
    const Composited result = make_blender<RgbaPremultiplied>(strategy)->blend(comm, layer, tiles, order, {});
    const std::lock_guard lock(mutex);
    owned += result.tiles.size();
    for (const std::size_t tile : result.tiles) {
      for (const RgbaPremultiplied& color : layer.tile(tile)) {
        worst = std::max(worst, largest_error(glm::dvec3(color.r, color.g, color.b) - expected));
      }
    }
  });
  return owned == tiles.size() ? worst : HUGE_VAL;
}

StabilityFinding blended() {
  StabilityFinding finding = make_finding(
      "layers/blended", "64 translucent layers on 64 ranks in shuffled order, every strategy that keeps an order",
      over_error_bound<RgbaPremultiplied>(kLayers), "largest error of a channel",
      "63 merges of three roundings, in colour and in alpha.");
  const FrameLayout layout({{128, 64}});
  for (const auto& blender : all_blenders<RgbaPremultiplied>()) {
    if (!blender->fits(kLayers)) continue;
    finding.measured = std::max(finding.measured, blended_error(std::string(blender->name()), layout));
  }
  return finding;
}

std::vector<StabilityFinding> measure_layers(const Globals& globals) {
  return {veils(globals), blended()};
}

}  // namespace

StabilityCase layers_case() {
  return {"layers", "64 translucent layers in any order: the exact mixture", measure_layers};
}

}  // namespace hpr::stability
