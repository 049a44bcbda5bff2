#include "gpu/gpu_keys.h"

#include <fmt/format.h>
#include <hpr/shaders/keys.h>

#include <algorithm>

#include "core/error.h"
#include "gpu/gpu_view.h"

namespace hpr {
namespace {

/// As in keys.comp: of a ray that has not looked at all there is.
constexpr Key kUnfinished = ~Key{0};

/// Of a piece of a screen that is drawn at once.
constexpr std::size_t kSoftwarePixels = std::size_t{1} << 16U;
constexpr std::size_t kPixels = std::size_t{1} << 20U;

struct Constants {
  std::uint64_t keys;
  std::uint64_t view;
  std::uint64_t scene;
};

}  // namespace

GpuKeys::GpuKeys(const GpuDevice& device)
    : device_(device),
      kernel_(device.kernel(keys, sizeof(Constants))),
      view_(device, sizeof(GpuView), GpuMemory::Upload),
      batch_(device) {}

Image<Key> GpuKeys::draw(const GpuScene& scene, const View& view) {
  HPR_CHECK(!view.points);
  Image<Key> image(view.size());
  if (image.pixels().empty()) return image;
  // Row by row, or more: what waits have a limit for, and watchdogs of displays, is never a whole large screen.
  const std::size_t wanted = device_.info().software ? kSoftwarePixels : kPixels;
  const auto width = static_cast<std::size_t>(view.size().width);
  const auto rows = static_cast<int>(std::max<std::size_t>(wanted / width, 1));
  const std::size_t bytes = width * static_cast<std::size_t>(std::min(rows, view.size().height)) * sizeof(Key);
  if (!keys_ || keys_->bytes() < bytes) {
    keys_.reset();
    read_.reset();
    keys_.emplace(device_, bytes, GpuMemory::Device);
    read_.emplace(device_, bytes, GpuMemory::Readback);
  }
  for (int y = 0; y < view.size().height; y += rows) {
    View band = view;
    band.block.y0 = view.block.y0 + y;
    band.block.y1 = std::min(band.block.y0 + rows, view.block.y1);
    draw_band(scene, band, image.pixels().subspan(static_cast<std::size_t>(y) * width, band.size().area()));
  }
  return image;
}

void GpuKeys::draw_band(const GpuScene& scene, const View& band, std::span<Key> pixels) {
  view_.mapped<GpuView>()[0] = as_read(band);
  batch_.begin_pass("device keys");
  batch_.run(kernel_, pixels.size(), Constants{keys_->address(), view_.address(), scene.address()});
  batch_.begin_pass("device read-back");
  batch_.copy(*keys_, *read_, pixels.size_bytes());
  batch_.submit();
  batch_.wait();
  const std::span<const Key> found = read_->mapped<const Key>().first(pixels.size());
  if (std::ranges::find(found, kUnfinished) != found.end()) {
    throw Error(ExitCode::Limit,
                fmt::format("{} ends loops after some turns, and the scene needs more: so much lies behind and within "
                            "each other",
                            device_.info().name),
                "take a GPU, or leave the keys to Embree: no --backend vulkan");
  }
  std::ranges::copy(found, pixels.begin());
}

}  // namespace hpr
