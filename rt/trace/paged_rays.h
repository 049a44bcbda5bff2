#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "rt/trace/ray_scene.h"
#include "scene/scene.h"

namespace hpr {

/// What rays meet of a part of which pages come from the disk (PartPages): Embree's scenes of the pages that are in
/// memory, built when they are first asked for.
class PagedRays {
 public:
  /// `scene` outlives this, and so do its pages.
  PagedRays(Scene& scene, const RaySpace& space);
  ~PagedRays();
  PagedRays(const PagedRays&) = delete;
  PagedRays& operator=(const PagedRays&) = delete;

  /// What of all pages ray scene number `number` has: some surfaces. Its trees are built with the lowest quality, as
  /// building them is most of what a page takes to come.
  void add(std::uint32_t number, std::vector<SurfaceRange> surfaces, const RayBuild& build);
  void remove(std::uint32_t number);

  [[nodiscard]] std::size_t pages() const;
  /// The surfaces of one, as the scene has them now.
  [[nodiscard]] std::span<const SurfaceRange> surfaces(std::size_t page) const;
  /// Pages, those first that are in memory.
  [[nodiscard]] std::vector<std::size_t> nearest_first() const;

  /// Calls `body` while the scene has the triangles of that page. While nobody else looks at the scene's meshes.
  void with(std::size_t page, const std::function<void()>& body) const;
  /// From inside with() that page only: what ray scene `number` has of it. Builds it with `threads` threads.
  [[nodiscard]] const RayScene& ray_scene(std::size_t page, std::uint32_t number, int threads);
  /// How many of those there are, of all pages.
  [[nodiscard]] std::size_t ray_scenes() const { return built_.size(); }

 private:
  struct Contents {
    std::vector<SurfaceRange> surfaces;
    RayBuild build;
  };

  Scene& scene_;
  RaySpace space_;
  std::map<std::uint32_t, Contents> contents_;
  std::map<std::pair<std::size_t, std::uint32_t>, std::unique_ptr<RayScene>> built_;  ///< by page and number
};

}  // namespace hpr
