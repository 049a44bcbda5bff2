#include "raster/chunk_bounds.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "core/error.h"
#include "core/parallel.h"
#include "raster/draw_list.h"

namespace hpr {
namespace {

/// The chunks of a mesh, as if it had an instance of index 0 whose surfaces start with 0.
std::vector<SceneChunk> chunks_of(const Mesh& mesh) {
  std::vector<SceneChunk> chunks;
  HPR_CHECK(!mesh.partial);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  for (std::uint32_t first = 0; first < count; first += kChunkTriangles) {
    const glm::vec3 start = mesh.positions[mesh.triangles[first].x];
    SceneChunk chunk{0, {first, std::min(count, first + kChunkTriangles)}, {start, start}};
    double doubled_area = 0.0;
    for (std::uint32_t t = first; t < chunk.surfaces.last; ++t) {
      const glm::vec3 a = mesh.positions[mesh.triangles[t].x];
      const glm::vec3 b = mesh.positions[mesh.triangles[t].y];
      const glm::vec3 c = mesh.positions[mesh.triangles[t].z];
      for (const glm::vec3& corner : {a, b, c}) chunk.box.add({corner, corner});
      doubled_area += glm::length(glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a)));
    }
    chunk.area = static_cast<float>(0.5 * doubled_area);
    chunks.push_back(chunk);
  }
  return chunks;
}

/// About where a chunk lies in the world.
struct Ball {
  glm::dvec3 center{0.0};
  double radius = 0.0;
};

Ball ball_of(const SceneChunk& chunk, const Instance& instance) {
  const glm::dvec3 low(chunk.box.low);
  const glm::dvec3 high(chunk.box.high);
  const glm::dmat3 axes(instance.to_world);
  const double scale = std::max({glm::length(axes[0]), glm::length(axes[1]), glm::length(axes[2])});
  return {glm::dvec3(instance.to_world * glm::dvec4(0.5 * (low + high), 1.0)), 0.5 * scale * glm::distance(low, high)};
}

/// Cauchy: surfaces that face all directions alike show half of their area from any side. The scale is that of the
/// box's center.
double covered_pixels(const glm::dmat4& clip_from_mesh, const View& view, const SceneChunk& chunk) {
  const auto row = [&](int index) {
    return glm::dvec3(clip_from_mesh[0][index], clip_from_mesh[1][index], clip_from_mesh[2][index]);
  };
  const glm::dvec3 center = 0.5 * (glm::dvec3(chunk.box.low) + glm::dvec3(chunk.box.high));
  const double w = std::max(glm::dot(row(3), center) + clip_from_mesh[3][3], 1e-9);
  const double across = 0.5 * view.size().width * glm::length(row(0)) / w;
  const double down = 0.5 * view.size().height * glm::length(row(1)) / w;
  return 0.5 * chunk.area * across * down;
}

}  // namespace

SceneChunks make_scene_chunks(const Scene& scene, int threads) {
  std::vector<std::vector<SceneChunk>> of_mesh(scene.meshes.size());
  parallel_for(threads, of_mesh.size(), [&](std::size_t mesh) { of_mesh[mesh] = chunks_of(scene.meshes[mesh]); });
  SceneChunks made;
  Ball last;
  for (const InstanceRange& part : split_by_instance(scene, covering_surfaces(scene, false))) {
    const Instance& instance = scene.instances[part.instance];
    for (SceneChunk chunk : of_mesh[instance.mesh]) {
      if (chunk.surfaces.last <= part.range.first || chunk.surfaces.first >= part.range.last) continue;
      chunk.instance = part.instance;
      chunk.surfaces.first += instance.first_surface;
      chunk.surfaces.last += instance.first_surface;
      const Ball ball = ball_of(chunk, instance);
      auto& clusters = made.clusters;
      const bool joins = !clusters.empty() && clusters.back().last == chunk.surfaces.first &&
                         chunk.surfaces.last - clusters.back().first <= kChunkTriangles &&
                         glm::distance(ball.center, last.center) <= 2.0 * (ball.radius + last.radius);
      if (joins) {
        clusters.back().last = chunk.surfaces.last;
      } else {
        clusters.push_back(chunk.surfaces);
        last = ball;  // of a cluster's first chunk
      }
      chunk.cluster = static_cast<std::uint32_t>(clusters.size() - 1);
      made.chunks.push_back(chunk);
    }
  }
  return made;
}

std::vector<ChunkBounds> bound_chunks(const Scene& scene, std::span<const SceneChunk> chunks, const View& view,
                                      int threads) {
  View centered = view;
  centered.jitter = {0.0, 0.0};
  // Beyond the view too, where jitter may bring something in.
  const int margin = static_cast<int>(std::ceil(kMaxJitter));
  const Rect whole{0, 0, view.size().width, view.size().height};
  const Rect reachable{-margin, -margin, whole.x1 + margin, whole.y1 + margin};
  const glm::dmat4 from_eye_relative = clip_from_world(centered, centered.eye);

  constexpr std::size_t kBatchChunks = 1024;
  std::vector<std::vector<ChunkBounds>> batches((chunks.size() + kBatchChunks - 1) / kBatchChunks);
  const auto bound_batch = [&](std::size_t batch) {
    std::uint32_t instance = 0;
    std::optional<glm::dmat4> matrix;
    std::optional<Culler> culler;
    const std::size_t last = std::min(chunks.size(), (batch + 1) * kBatchChunks);
    for (std::size_t i = batch * kBatchChunks; i < last; ++i) {
      const SceneChunk& chunk = chunks[i];
      if (i == batch * kBatchChunks || chunk.instance != instance) {
        instance = chunk.instance;
        matrix = drawable_matrix(scene.instances[instance], from_eye_relative, centered.eye);
        culler.reset();
        if (matrix) culler.emplace(*matrix, centered, reachable);
      }
      if (!culler || culler->outside(chunk.box)) continue;
      Rect pixels = culler->pixels(chunk.box);
      pixels = intersection({pixels.x0 - margin, pixels.y0 - margin, pixels.x1 + margin, pixels.y1 + margin}, whole);
      if (pixels.empty()) continue;
      const double covered = std::min(covered_pixels(*matrix, centered, chunk), static_cast<double>(pixels.area()));
      batches[batch].push_back({static_cast<std::uint32_t>(i), pixels, static_cast<float>(covered)});
    }
  };
  parallel_for(batches.size() > 4 ? threads : 1, batches.size(), bound_batch);
  std::vector<ChunkBounds> bounds;
  for (const auto& batch : batches) bounds.insert(bounds.end(), batch.begin(), batch.end());
  return bounds;
}

}  // namespace hpr
