#include "gpu/light/gpu_tile_shader.h"

#include <fmt/format.h>
#include <hpr/shaders/light_ambient.h>
#include <hpr/shaders/light_ambient_plain.h>
#include <hpr/shaders/light_direct.h>
#include <hpr/shaders/light_direct_plain.h>
#include <hpr/shaders/light_finish.h>
#include <hpr/shaders/light_finish_plain.h>
#include <hpr/shaders/light_follow.h>
#include <hpr/shaders/light_follow_plain.h>
#include <hpr/shaders/light_photons.h>
#include <hpr/shaders/light_photons_plain.h>
#include <hpr/shaders/light_start.h>
#include <hpr/shaders/light_start_plain.h>
#include <hpr/shaders/light_vertex.h>
#include <hpr/shaders/light_vertex_plain.h>

#include <algorithm>
#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "core/error.h"
#include "gpu/gpu_view.h"
#include "rt/passes/pass.h"
#include "rt/passes/path_vertex.h"
#include "rt/sampling/sampler.h"

namespace hpr {

/// As in path.glsl.
struct GpuPathLimits {
  double glossy_cutoff = 0.0;
  double near_distance = 0.0;
  std::uint32_t max_depth = 0;
  std::uint32_t followed = 0;
  std::uint32_t gathers = 0;
  std::uint32_t padding = 0;
};

/// As in light_state.glsl.
struct GpuLightInput {
  std::uint64_t scene = 0;
  std::uint64_t alpha_tested = 0;
  std::uint64_t surfaces = 0;
  std::uint64_t materials = 0;
  std::uint64_t lights = 0;
  std::uint64_t photons = 0;
  std::uint64_t tiles = 0;
  std::uint64_t keys = 0;
  std::uint64_t pixels = 0;
  std::uint64_t states = 0;
  std::uint64_t waiting = 0;
  std::uint64_t views = 0;
  std::uint64_t eye_media = 0;
  std::uint64_t counters = 0;
  std::uint64_t points = 0;
  std::uint64_t point_lights = 0;
  std::uint64_t random_frame = 0;
  glm::dvec3 background{0.0};
  double ambient = 0.0;
  double occlusion_reach = 0.0;
  GpuPathLimits limits;
  std::uint32_t shows_environment = 0;
  std::uint32_t sample_index = 0;
  std::uint32_t light_samples = 1;
  std::uint32_t occlusion_rays = 0;
  std::uint32_t shadows = 0;
  std::uint32_t terminator_fix = 0;
  std::uint32_t max_waiting = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuLightInput) == 240);
static_assert(sizeof(EyePoint) == 80 && sizeof(PointLight) == 80);

namespace {

/// Vertices of a pixel that may wait: two surfaces that a path begins with may split into all lobes and channels, what
/// comes after does not.
constexpr std::uint32_t kMaxWaiting = 12;
/// And surfaces that cover in part of what the pixel shows; the CPU finishes tiles that show more of them.
constexpr std::uint32_t kMaxLayers = 20;

/// Of pixels that are left out, as in light_state.glsl: one that no surface has.
constexpr Key kUnwanted = Key{1} << 32U;

/// As in light_state.glsl.
struct GpuTile {
  glm::ivec2 corner{0};
  glm::uvec2 size{0};
  std::uint32_t view = 0;
  std::uint32_t padding = 0;
};

/// As light_state.glsl counts rays; behind them the pixels that are not done, and rays that were cut.
constexpr std::array kCountedPasses{PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion,
                                    PassId::Gather};

constexpr std::size_t kWaitingPixels = kCountedPasses.size();
constexpr std::size_t kCutRays = kWaitingPixels + 1;
constexpr std::size_t kCounters = kCutRays + 1;

/// Lit at once on the CPU: a batch has a time limit.
constexpr std::size_t kSoftwareTiles = 4;
/// On a GPU: enough threads for any there is, and few enough for that limit.
constexpr std::size_t kMinTiles = 4;
constexpr std::size_t kMaxTiles = 256;
/// Of a GPU's memory, for what tiles need while they are lit.
constexpr std::uint64_t kMemoryFraction = 16;
/// Vertices of each pixel that are shaded before the CPU asks whether all is done.
constexpr int kRounds = 2;
constexpr int kMaxLightSamples = 64;

/// The steps of light, in the order of a vertex.
enum Step : std::size_t { Start, Vertex, Direct, Ambient, Photons, Follow, Finish };

/// By step.
std::array<GpuStep, 7> steps() {
  return {{{"device start", light_start, light_start_plain},
           {"device vertex", light_vertex, light_vertex_plain},
           {"device direct", light_direct, light_direct_plain},
           {"device ambient", light_ambient, light_ambient_plain, PassId::AmbientOcclusion},
           {"device photons", light_photons, light_photons_plain, PassId::Photon},
           {"device follow", light_follow, light_follow_plain},
           {"device finish", light_finish, light_finish_plain}}};
}

/// Null where all surfaces cover what is behind them.
std::unique_ptr<GpuScene> alpha_tested_of(const GpuDevice& device, const Scene& scene, int threads) {
  const std::vector<SurfaceRange> surfaces = covering_surfaces(scene, true);
  return surfaces.empty() ? nullptr : std::make_unique<GpuScene>(device, scene, surfaces, threads);
}

bool has_extensions(const Scene& scene) {
  return std::ranges::any_of(scene.materials, [](const Material& material) { return material.extensions != nullptr; });
}

/// A tile that was not finished covers so little, see kUnfinished in light_state.glsl.
bool is_finished(std::span<const glm::vec4> pixels) {
  return std::ranges::none_of(pixels, [](const glm::vec4& pixel) { return pixel.a < 0.0F; });
}

/// As in path.glsl.
constexpr std::uint32_t kGathersByRays = 1;
constexpr std::uint32_t kGathersPhotons = 2;

GpuPathLimits limits_of(const ShadingInputs& inputs, const PhotonMaps* photons) {
  GpuPathLimits limits{.glossy_cutoff = inputs.settings.glossy_cutoff,
                       .max_depth = static_cast<std::uint32_t>(inputs.settings.max_depth)};
  for (std::size_t lobe = 0; lobe < kLobes.size(); ++lobe) {
    if (inputs.followed_lobes.at(lobe)) limits.followed |= 1U << lobe;
  }
  if (photons != nullptr) limits.near_distance = photons->near;
  if (runs_pass(inputs.plan, PassId::Gather)) limits.gathers = photons != nullptr ? kGathersPhotons : kGathersByRays;
  return limits;
}

bool emits_through_coat(const Material& material) {
  return material.extensions && material.extensions->clearcoat > 0.0F && material.emissive != glm::vec3(0.0F);
}

/// Of a tile: those for which a mask, where there is one, wants light.
std::uint64_t wanted_pixels(const Rect& pixels, std::span<const std::uint8_t> wanted) {
  std::uint64_t count = 0;
  for (int y = 0; y < pixels.height(); ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * kTileSide;
    for (int x = 0; x < pixels.width(); ++x) {
      count += wanted.empty() || wanted[row + static_cast<std::size_t>(x)] != 0 ? 1U : 0U;
    }
  }
  return count;
}

void grow_to(const GpuDevice& device, std::optional<GpuBuffer>& buffer, std::size_t bytes, GpuMemory memory) {
  if (buffer && buffer->bytes() >= bytes) return;
  buffer.reset();
  buffer.emplace(device, bytes, memory);
}

}  // namespace

std::string refusal_of_light(const Scene& scene, const RaySettings& settings) {
  if (settings.show != Show::Shaded) return "what is shown is no light";
  if (settings.reference) return "the reference is the CPU's";
  if (!settings.half_resolution.empty()) return "passes at half resolution are the CPU's";
  if (settings.part) return "rays travel between ranks";
  if (settings.light_samples > kMaxLightSamples) {
    return fmt::format("more than {} light samples are the CPU's", kMaxLightSamples);  // a batch has a time limit
  }
  if (std::ranges::any_of(scene.materials, emits_through_coat)) return "emission through clear coats is the CPU's";
  return {};
}

std::size_t tiles_at_once(const GpuInfo& device, std::size_t tile_bytes) {
  if (device.software) return kSoftwareTiles;
  const std::uint64_t fit = device.memory / kMemoryFraction / std::max<std::uint64_t>(tile_bytes, 1);
  return std::clamp<std::uint64_t>(fit, kMinTiles, kMaxTiles);
}

GpuTileShader::GpuTileShader(const GpuDevice& device, const ShadingInputs& inputs, int threads)
    : device_(device),
      inputs_(inputs),
      scene_(device, inputs.scene, covering_surfaces(inputs.scene, false), threads),
      alpha_tested_(alpha_tested_of(device, inputs.scene, threads)),
      surfaces_(device, inputs.scene, inputs.surfaces),
      materials_(device, inputs.scene),
      lights_(device, inputs.scene, inputs.lights, materials_),
      photons_(device),
      input_(device, sizeof(GpuLightInput), GpuMemory::Upload),
      counters_(device, kCounters * sizeof(std::uint32_t), GpuMemory::Readback),
      steps_(device, steps(),
             {.extended = has_extensions(inputs.scene),
              .variant = alpha_tested_ ? 1U : 0U,
              .input = input_.address(),
              .plan = inputs.plan}) {
  max_waiting_ = kMaxWaiting + (alpha_tested_ ? kMaxLayers : 0);
  const bool extended = has_extensions(inputs.scene);
  const auto layout = extended ? steps()[Vertex].shader : steps()[Vertex].plain_shader;
  state_bytes_ = array_stride(layout, "PixelState");
  waiting_bytes_ = max_waiting_ * array_stride(layout, "FoundVertex");
  tiles_at_once_ = tiles_at_once(device.info(), kTilePixels * (state_bytes_ + waiting_bytes_));
  if (runs_pass(inputs.plan, PassId::Photon) && refusal_of_photons(inputs.scene).empty()) {
    const GpuPhotonInputs traced{scene_.address(), surfaces_.address(), materials_.address(), lights_.address()};
    photon_tracer_ = std::make_unique<GpuPhotonTracer>(device, traced, extended);
  }
}

/// Memory for so many tiles that are lit at once.
void GpuTileShader::grow(std::size_t tiles, std::size_t views) {
  grow_to(device_, views_, views * sizeof(GpuView), GpuMemory::Upload);
  grow_to(device_, eye_media_, views * sizeof(Media), GpuMemory::Upload);
  grow_to(device_, tiles_, tiles * sizeof(GpuTile), GpuMemory::Upload);
  grow_to(device_, states_, tiles * kTilePixels * state_bytes_, GpuMemory::Device);
  grow_to(device_, waiting_, tiles * kTilePixels * waiting_bytes_, GpuMemory::Device);
}

/// Puts the photons of a sample on the device, once.
void GpuTileShader::hold_photons(const PhotonMaps* maps, const SampleNumber& number) {
  if (maps == nullptr || held_photons_ == number) return;
  photons_.put(*maps);
  held_photons_ = number;
}

void GpuTileShader::put_view(std::size_t i, const View& view, const Media& media) {
  views_->mapped<GpuView>()[i] = as_read(view);
  eye_media_->mapped<Media>()[i] = media;
}

void GpuTileShader::shade(const TilesToShade& lit, RayCounts& counts, const Store& store) {
  const std::size_t most = tiles_at_once_;
  if (lit.tiles.empty()) return;
  hold_photons(lit.photons, lit.samples.front().number);
  for (const ShadedSample& sample : lit.samples) {
    for (std::size_t first = 0; first < lit.tiles.size(); first += most) {
      if (lit.is_overtaken && lit.is_overtaken()) return;
      shade_some(lit, sample, lit.tiles.subspan(first, std::min(most, lit.tiles.size() - first)), counts, store);
    }
  }
}

void GpuTileShader::run_step(std::size_t step, std::size_t tiles) {
  steps_.run(step, tiles * kTilePixels, tiles);
}

/// Shades vertex after vertex of all pixels' paths, until none waits; false where that was overtaken.
bool GpuTileShader::follow_paths(std::size_t tiles, bool with_photons, const std::function<bool()>& is_overtaken) {
  std::uint32_t& waiting = counters_.mapped<std::uint32_t>()[kWaitingPixels];
  run_step(Start, tiles);
  while (true) {
    waiting = 0;
    for (int round = 0; round < kRounds; ++round) {
      run_step(Vertex, tiles);
      run_step(Direct, tiles);
      run_step(Ambient, tiles);
      if (with_photons) run_step(Photons, tiles);
      run_step(Follow, tiles);
    }
    steps_.finish();
    if (waiting == 0) return true;
    if (is_overtaken && is_overtaken()) return false;
  }
}

/// Lights what the input says and reads what it adds up to; false where that was overtaken.
bool GpuTileShader::light(const GpuLightInput& input, std::size_t tiles, const std::function<bool()>& is_overtaken,
                          RayCounts& counts) {
  input_.mapped<GpuLightInput>()[0] = input;
  std::ranges::fill(counters_.mapped<std::uint32_t>(), 0U);
  if (!follow_paths(tiles, input.photons != 0, is_overtaken)) return false;
  run_step(Finish, tiles);
  if (input.points != 0) {
    steps_.batch().copy(*point_lights_, *read_lights_, tiles * kTilePixels * sizeof(PointLight));
  } else {
    steps_.batch().copy(*pixels_, *read_, tiles * kTilePixels * sizeof(glm::vec4));
  }
  steps_.finish();
  for (std::size_t i = 0; i < kCountedPasses.size(); ++i) {
    counts[kCountedPasses.at(i)] += counters_.mapped<std::uint32_t>()[i];
  }
  counts.cut += counters_.mapped<std::uint32_t>()[kCutRays];
  return true;
}

/// What all light of the scene has in common.
GpuLightInput GpuTileShader::input_of(const PhotonMaps* photons) const {
  const RaySettings& settings = inputs_.settings;
  GpuLightInput input{.scene = scene_.address(),
                      .alpha_tested = alpha_tested_ ? alpha_tested_->address() : 0,
                      .surfaces = surfaces_.address(),
                      .materials = materials_.address(),
                      .lights = lights_.address(),
                      .photons = photons != nullptr ? photons_.address() : 0,
                      .tiles = tiles_->address(),
                      .states = states_->address(),
                      .waiting = waiting_->address(),
                      .views = views_->address(),
                      .eye_media = eye_media_->address(),
                      .counters = counters_.address(),
                      .ambient = settings.ambient,
                      .occlusion_reach = occlusion_reach(inputs_.scene),
                      .limits = limits_of(inputs_, photons),
                      .light_samples = static_cast<std::uint32_t>(settings.light_samples),
                      .occlusion_rays = static_cast<std::uint32_t>(settings.occlusion_rays)};
  input.shadows = runs_pass(inputs_.plan, PassId::Shadow) ? 1 : 0;
  input.terminator_fix = settings.terminator_fix ? 1 : 0;
  input.max_waiting = max_waiting_;
  return input;
}

void GpuTileShader::shade_some(const TilesToShade& lit, const ShadedSample& sample, std::span<const std::size_t> tiles,
                               RayCounts& counts, const Store& store) {
  const FrameLayout& layout = sample.keys->layout();
  const RaySettings& settings = inputs_.settings;
  grow(tiles.size(), sample.views.size());
  const std::size_t pixel_count = tiles.size() * kTilePixels;
  grow_to(device_, keys_, pixel_count * sizeof(Key), GpuMemory::Upload);
  grow_to(device_, pixels_, pixel_count * sizeof(glm::vec4), GpuMemory::Device);
  grow_to(device_, read_, pixel_count * sizeof(glm::vec4), GpuMemory::Readback);
  for (std::size_t i = 0; i < sample.views.size(); ++i) put_view(i, sample.views[i], lit.eyes[i]);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const TilePlace location = layout.place(tiles[i]);
    tiles_->mapped<GpuTile>()[i] = {{location.pixels.x0, location.pixels.y0},
                                    {location.pixels.width(), location.pixels.height()},
                                    static_cast<std::uint32_t>(location.screen),
                                    static_cast<std::uint32_t>(i)};
    const std::span<Key> keys = keys_->mapped<Key>().subspan(i * kTilePixels, kTilePixels);
    std::ranges::copy(sample.keys->tile(tiles[i]), keys.begin());
    const std::span<const std::uint8_t> wanted = mask_of(sample.wanted, tiles[i]);
    for (std::size_t pixel = 0; pixel < wanted.size(); ++pixel) {
      if (wanted[pixel] == 0) keys[pixel] = kUnwanted;
    }
    if (alpha_tested_) counts.primary += wanted_pixels(location.pixels, wanted);
  }
  GpuLightInput input = input_of(lit.photons);
  input.keys = keys_->address();
  input.pixels = pixels_->address();
  input.random_frame = frame_stream({settings.seed, sample.number.frame});
  input.sample_index = sample.number.sample;
  input.shows_environment = settings.background.kind == Background::Kind::Environment ? 1 : 0;
  if (settings.background.kind == Background::Kind::Color) {
    const Rgb& color = settings.background.color;
    input.background = {color.r, color.g, color.b};
  }
  if (!light(input, tiles.size(), lit.is_overtaken, counts)) return;

  const std::span<const glm::vec4> pixels = read_->mapped<const glm::vec4>();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto tile = pixels.subspan(i * kTilePixels, kTilePixels);
    store(sample, tiles[i], is_finished(tile) ? tile : std::span<const glm::vec4>());
  }
}

/// Points that are lit in place of a tile's pixels.
struct GpuTileShader::PointBlock {
  const PointsOfView* group = nullptr;
  std::size_t first = 0;
  std::size_t count = 0;
};

void GpuTileShader::shade_points(const PointsToShade& lit, RayCounts& counts) {
  hold_photons(lit.photons, lit.number);
  std::vector<PointBlock> blocks;
  for (const PointsOfView& group : lit.groups) {
    for (std::size_t first = 0; first < group.points.size(); first += kTilePixels) {
      blocks.push_back({&group, first, std::min<std::size_t>(kTilePixels, group.points.size() - first)});
    }
  }
  const std::size_t most = tiles_at_once_;
  for (std::size_t first = 0; first < blocks.size(); first += most) {
    if (lit.is_overtaken && lit.is_overtaken()) return;
    shade_blocks(std::span(blocks).subspan(first, std::min(most, blocks.size() - first)), lit, counts);
  }
}

void GpuTileShader::shade_blocks(std::span<const PointBlock> blocks, const PointsToShade& lit, RayCounts& counts) {
  grow(blocks.size(), blocks.size());
  const std::size_t pixels = blocks.size() * kTilePixels;
  grow_to(device_, points_, pixels * sizeof(EyePoint), GpuMemory::Upload);
  grow_to(device_, point_lights_, pixels * sizeof(PointLight), GpuMemory::Device);
  grow_to(device_, read_lights_, pixels * sizeof(PointLight), GpuMemory::Readback);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const PointBlock& block = blocks[i];
    put_view(i, *block.group->view, block.group->eye_media);
    tiles_->mapped<GpuTile>()[i] = {{0, 0}, {kTileSide, kTileSide}, static_cast<std::uint32_t>(i), 0};
    const std::span<EyePoint> points = points_->mapped<EyePoint>().subspan(i * kTilePixels, kTilePixels);
    std::ranges::copy(block.group->points.subspan(block.first, block.count), points.begin());
    std::ranges::fill(points.subspan(block.count), EyePoint{});
  }
  GpuLightInput input = input_of(lit.photons);
  input.points = points_->address();
  input.point_lights = point_lights_->address();
  if (!light(input, blocks.size(), lit.is_overtaken, counts)) return;
  const std::span<const PointLight> found = read_lights_->mapped<const PointLight>();
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    std::ranges::copy(found.subspan(i * kTilePixels, blocks[i].count),
                      blocks[i].group->light.subspan(blocks[i].first).begin());
  }
}

}  // namespace hpr
