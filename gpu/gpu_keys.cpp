#include "gpu/gpu_keys.h"

#include <hpr/shaders/keys.h>

#include <algorithm>
#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/error.h"

namespace hpr {
namespace {

/// As in keys.comp.
struct GpuView {
  glm::dvec3 eye{0.0};
  std::array<glm::dvec3, 3> axes{};
  double left = 0.0;
  double right = 0.0;
  double bottom = 0.0;
  double top = 0.0;
  double near_distance = 0.0;
  double far_distance = 0.0;
  glm::dvec2 jitter{0.0};
  glm::ivec2 block{0};
  glm::uvec2 size{0};
  glm::uvec2 screen{0};
  std::uint32_t orthographic = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuView) == 192);

struct Constants {
  std::uint64_t keys;
  std::uint64_t view;
  std::uint64_t scene;
};

GpuView as_read(const View& view) {
  GpuView read;
  read.eye = view.eye;
  read.axes = {view.axes[0], view.axes[1], view.axes[2]};
  read.left = view.left;
  read.right = view.right;
  read.bottom = view.bottom;
  read.top = view.top;
  read.near_distance = view.near_distance;
  read.far_distance = view.far_distance;
  read.jitter = view.jitter;
  read.block = {view.block.x0, view.block.y0};
  read.size = {view.size().width, view.size().height};
  read.screen = {view.screen.width, view.screen.height};
  read.orthographic = view.orthographic ? 1 : 0;
  return read;
}

}  // namespace

GpuKeys::GpuKeys(const GpuDevice& device)
    : device_(device),
      kernel_(device, keys, sizeof(Constants)),
      view_(device, sizeof(GpuView), GpuMemory::Upload),
      batch_(device) {}

Image<Key> GpuKeys::draw(const GpuScene& scene, const View& view) {
  HPR_CHECK(!view.points);
  Image<Key> image(view.size());
  const std::size_t bytes = image.pixels().size() * sizeof(Key);
  if (bytes == 0) return image;
  if (!keys_ || keys_->bytes() < bytes) {
    keys_.reset();
    read_.reset();
    keys_.emplace(device_, bytes, GpuMemory::Device);
    read_.emplace(device_, bytes, GpuMemory::Readback);
  }
  view_.mapped<GpuView>()[0] = as_read(view);
  batch_.begin_pass("keys");
  batch_.run(kernel_, image.pixels().size(), Constants{keys_->address(), view_.address(), scene.address()});
  batch_.begin_pass("read keys");
  batch_.copy(*keys_, *read_, bytes);
  batch_.submit();
  batch_.wait();
  std::ranges::copy(read_->mapped<const Key>().first(image.pixels().size()), image.pixels().begin());
  return image;
}

}  // namespace hpr
