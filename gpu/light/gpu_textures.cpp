#include "gpu/light/gpu_textures.h"

#include <array>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "image/color.h"

namespace hpr {
namespace {

/// As in textures.glsl.
struct GpuTexture {
  std::uint64_t image = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::uint32_t wrap_s = 0;
  std::uint32_t wrap_t = 0;
  std::uint32_t nearest = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuTexture) == 32);
static_assert(sizeof(TextureRef) == 32 && offsetof(TextureRef, transform) == 8);  // shaders read them as they are
static_assert(sizeof(Rgba8) == 4);

}  // namespace

GpuTextures::GpuTextures(const GpuDevice& device, std::span<const Texture> textures) : tables_(device) {
  std::vector<GpuTexture> items;
  std::vector<Rgba8> texels;
  std::map<std::pair<const Rgba8*, std::size_t>, std::size_t> first_of;
  for (const Texture& texture : textures) {
    const Texels& image = texture.image;
    GpuTexture& item = items.emplace_back();
    item.width = image.width();
    item.height = image.height();
    item.wrap_s = static_cast<std::uint32_t>(texture.wrap_s);
    item.wrap_t = static_cast<std::uint32_t>(texture.wrap_t);
    item.nearest = texture.nearest ? 1 : 0;
    const std::size_t count = image.size().area();
    if (count == 0) continue;
    image.require();
    const Rgba8* const first = &image.at(0, 0);
    const auto [known, is_new] = first_of.try_emplace({first, count}, texels.size());
    if (is_new) texels.insert(texels.end(), first, first + count);
    item.image = known->second;
  }
  std::array<double, 256> levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) levels.at(i) = srgb_to_linear(static_cast<std::uint8_t>(i));

  const std::uint64_t first = tables_.upload(texels);
  for (GpuTexture& item : items) item.image = first + item.image * sizeof(Rgba8);
  address_ = tables_.upload_one(std::array{tables_.upload(items), tables_.upload_one(levels)});
}

}  // namespace hpr
