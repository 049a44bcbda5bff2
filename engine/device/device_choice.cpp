#include "engine/device/device_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <map>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "gpu/bvh.h"
#include "scene/scene.h"

namespace hpr {

DeviceOffer offer_of(const std::vector<GpuInfo>& gpus, const std::string& host) {
  DeviceOffer offer{.host = host, .problem = "no GPU that Vulkan knows"};
  for (const GpuInfo& gpu : gpus) {
    if (gpu.software) continue;
    if (gpu.lacks.empty()) return {DeviceOffer::State::Ready, host};
    offer = {DeviceOffer::State::Lacking, host, fmt::format("{} lacks {}", printable(gpu.name), gpu.lacks)};
  }
  return offer;
}

DeviceOffer start_offered(const std::string& host, int local_rank, const StartGpu& start) {
  DeviceOffer offer;
  try {
    start([&](const std::vector<GpuInfo>& gpus) {
      offer = offer_of(gpus, host);
      if (offer.state != DeviceOffer::State::Ready) throw Error(ExitCode::NoDevice, offer.problem);
      return choose_gpu(gpus, {.local_rank = local_rank});
    });
  } catch (const Error& error) {
    if (offer.state == DeviceOffer::State::Ready) offer.state = DeviceOffer::State::Failed;
    offer.problem = error.what();
  }
  offer.host = host;
  return offer;
}

DeviceChoice choose_devices(std::span<const DeviceOffer> of_ranks) {
  using State = DeviceOffer::State;
  const auto has = [&](State state) { return std::ranges::count(of_ranks, state, &DeviceOffer::state) > 0; };
  const auto say = [&](State state, std::string_view what) {
    const auto who = std::ranges::find(of_ranks, state, &DeviceOffer::state);
    return fmt::format("{}{} ({})", what,
                       of_ranks.size() > 1 ? fmt::format(" of rank {} on {}", who - of_ranks.begin(), who->host) : "",
                       who->problem);
  };
  if (has(State::Failed)) return {false, say(State::Failed, "the GPU") + " does not start", true};
  const bool is_mixed = has(State::Ready);
  if (is_mixed && !has(State::None) && !has(State::Lacking)) return {.uses = true};
  if (!is_mixed && !has(State::Lacking)) return {};
  DeviceChoice choice{false, say(has(State::Lacking) ? State::Lacking : State::None, "no GPU"), is_mixed};
  if (is_mixed) choice.why += ", and all ranks of a picture need one";
  return choice;
}

std::string describe_crowding(std::span<const DeviceOfRank> of_ranks) {
  using Card = std::pair<std::string, std::array<std::uint8_t, 16>>;
  std::map<std::string, std::size_t> ranks;  // of a host, that use GPUs
  std::set<Card> cards;
  for (const DeviceOfRank& rank : of_ranks) {
    if (rank.software) continue;
    ++ranks[rank.host];
    cards.insert({rank.host, rank.uuid});
  }
  for (const auto& [host, count] : ranks) {
    const auto there = std::ranges::count(cards, host, &Card::first);
    if (count <= static_cast<std::size_t>(there)) continue;
    return fmt::format(
        "{} ranks on {} use {} GPU{} together: they start one after the other, and wait for each other; --ranks {} has "
        "one for each",
        count, host, there, there == 1 ? "" : "s", cards.size());
  }
  return {};
}

namespace {

/// Of a scene's trees and triangles: those of keys, which are kept twice while objects change, and of light.
constexpr std::uint64_t kCopies = 3;
/// In world space a tree has a leaf a triangle at most, and as many inner nodes.
constexpr std::uint64_t kTreeBytes = 2 * sizeof(BvhNode) + sizeof(std::uint32_t);
/// Matrices, boxes and addresses of an instance, in all tables together.
constexpr std::uint64_t kInstanceBytes = 1024;

std::uint64_t bytes_of(const Mesh& mesh) {
  const std::uint64_t triangles = mesh.triangle_count() * sizeof(glm::uvec3);
  const std::uint64_t positions = mesh.positions.size() * sizeof(glm::vec3);
  const std::uint64_t more = mesh.normals.size() * sizeof(glm::vec3) + mesh.colors.size() * sizeof(glm::vec4) +
                             (mesh.uvs[0].size() + mesh.uvs[1].size()) * sizeof(glm::vec2) +
                             mesh.tangents.size() * sizeof(glm::vec4);
  return kCopies * (triangles + positions + mesh.triangle_count() * kTreeBytes) + triangles + positions + more;
}

}  // namespace

std::uint64_t device_bytes_of(const Scene& scene) {
  std::uint64_t bytes = scene.instances.size() * kInstanceBytes;
  for (const Mesh& mesh : scene.meshes) bytes += bytes_of(mesh);
  for (const Texture& texture : scene.textures) bytes += texture.image.size().area() * sizeof(Rgba8);
  return bytes;
}

}  // namespace hpr
