#include "gpu/gpu_primary_rays.h"

#include <algorithm>
#include <utility>

#include "core/error.h"

namespace hpr {

void GpuPrimaryRays::hold(const Scene& scene, std::span<const SurfaceRange> objects) {
  const auto has = [&](const Held& held) { return held.scene && std::ranges::equal(objects, held.objects); };
  if (has(held_.front())) return;
  std::swap(held_.front(), held_.back());
  if (has(held_.front())) return;
  held_.front().scene.reset();  // frees its memory before the next one takes some
  held_.front().scene = std::make_unique<GpuScene>(device_, scene, objects, threads_);
  held_.front().objects.assign(objects.begin(), objects.end());
}

void GpuPrimaryRays::release() {
  for (Held& held : held_) held.scene.reset();
}

namespace {

/// The smallest box about those of `parts` that lie on the view.
Rect box_about(std::span<const Rect> parts, const View& view) {
  Rect box;
  for (const Rect& part : parts) {
    const Rect drawn = intersection(part, Rect{0, 0, view.size().width, view.size().height});
    if (drawn.empty()) continue;
    box = box.empty() ? drawn
                      : Rect{std::min(box.x0, drawn.x0), std::min(box.y0, drawn.y0), std::max(box.x1, drawn.x1),
                             std::max(box.y1, drawn.y1)};
  }
  return box;
}

/// Merges the keys of `pixels`, of which `keys` has those of `box`, into a tile; whether anything is seen there.
bool merge(const Rect& pixels, const Rect& tile_pixels, const Image<Key>& keys, const Rect& box, std::span<Key> tile) {
  bool seen = false;
  for (int y = pixels.y0; y < pixels.y1; ++y) {
    for (int x = pixels.x0; x < pixels.x1; ++x) {
      const Key key = keys.at(x - box.x0, y - box.y0);
      Key& there = tile[static_cast<std::size_t>((y - tile_pixels.y0) * kTileSide + x - tile_pixels.x0)];
      there = std::max(there, key);
      seen = seen || key != kNoKey;
    }
  }
  return seen;
}

}  // namespace

void GpuPrimaryRays::draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer) {
  HPR_CHECK(held_.front().scene && layer.depth_format() == DepthFormat::Float32);
  const FrameLayout& layout = layer.layout();
  const Rect box = box_about(parts, view);  // the device draws all of it
  if (box.empty()) return;
  View boxed = view;
  boxed.block = {view.block.x0 + box.x0, view.block.y0 + box.y0, view.block.x0 + box.x1, view.block.y0 + box.y1};
  const Image<Key> keys = keys_.draw(*held_.front().scene, boxed);
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
    const TilePlace location = layout.place(tile);
    const Rect drawn = location.screen == screen ? intersection(location.pixels, box) : Rect{};
    for (const Rect& part : parts) {
      const Rect pixels = intersection(part, drawn);
      if (pixels.empty()) continue;
      layer.touch(tile);
      if (merge(pixels, location.pixels, keys, box, layer.tile(tile))) layer.set_active(tile);
    }
  }
}

bool fits_on_gpu(const Scene& scene) {
  return !scene.part_pages &&
         std::ranges::none_of(scene.meshes, [](const Mesh& mesh) { return mesh.partial != nullptr; });
}

}  // namespace hpr
