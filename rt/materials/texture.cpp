#include "rt/materials/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace hpr {
namespace {

/// A coordinate brought into [0, 1] by the wrap mode, before it is scaled to texels: huge values lose nothing more.
double wrapped(double coordinate, Wrap wrap) {
  if (wrap == Wrap::Repeat && std::abs(coordinate) < 0x1p31) {
    const double left = coordinate - static_cast<double>(static_cast<std::int64_t>(coordinate));
    return left < 0.0 ? left + 1.0 : left;
  }
  if (!std::isfinite(coordinate)) return 0.0;
  switch (wrap) {
    case Wrap::ClampToEdge:
      return std::clamp(coordinate, 0.0, 1.0);
    case Wrap::MirroredRepeat: {
      const double in_period = coordinate - 2.0 * std::floor(0.5 * coordinate);
      return in_period > 1.0 ? 2.0 - in_period : in_period;
    }
    case Wrap::Repeat:
      break;
  }
  return coordinate - std::floor(coordinate);
}

/// The texel that stands at `index`, at most one beyond an edge.
int texel_index(int index, int count, Wrap wrap) {
  if (index < 0) return wrap == Wrap::Repeat ? count - 1 : 0;
  if (index >= count) return wrap == Wrap::Repeat ? 0 : count - 1;
  return index;
}

glm::dvec4 decoded(Rgba8 texel, Encoding encoding) {
  constexpr double kLevel = 1.0 / 255.0;
  if (encoding == Encoding::Srgb) {
    return {srgb_to_linear(texel.r), srgb_to_linear(texel.g), srgb_to_linear(texel.b), texel.a * kLevel};
  }
  return glm::dvec4(texel.r, texel.g, texel.b, texel.a) * kLevel;
}

}  // namespace

glm::dvec4 sample_texture(const Texture& texture, Encoding encoding, glm::dvec2 uv) {
  const Size size = texture.image.size();
  if (size.area() == 0) return glm::dvec4(1.0);
  const double s = wrapped(uv.x, texture.wrap_s) * size.width;
  const double t = wrapped(uv.y, texture.wrap_t) * size.height;
  if (texture.nearest) {
    const int column = texel_index(static_cast<int>(s), size.width, texture.wrap_s);
    return decoded(texture.image.at(column, texel_index(static_cast<int>(t), size.height, texture.wrap_t)), encoding);
  }
  const double x = s - 0.5;
  const double y = t - 0.5;
  const int x0 = x < 0.0 ? -1 : static_cast<int>(x);
  const int y0 = y < 0.0 ? -1 : static_cast<int>(y);
  const double fx = x - x0;
  const double fy = y - y0;
  const int left = texel_index(x0, size.width, texture.wrap_s);
  const int right = texel_index(x0 + 1, size.width, texture.wrap_s);
  const int above = texel_index(y0, size.height, texture.wrap_t);
  const int below = texel_index(y0 + 1, size.height, texture.wrap_t);
  const std::array<Rgba8, 4> texels{texture.image.at(left, above), texture.image.at(right, above),
                                    texture.image.at(left, below), texture.image.at(right, below)};
  // Much of most textures is even.
  if (texels[0] == texels[1] && texels[0] == texels[2] && texels[0] == texels[3]) return decoded(texels[0], encoding);
  const glm::dvec4 upper = decoded(texels[0], encoding) * (1.0 - fx) + decoded(texels[1], encoding) * fx;
  const glm::dvec4 lower = decoded(texels[2], encoding) * (1.0 - fx) + decoded(texels[3], encoding) * fx;
  return upper * (1.0 - fy) + lower * fy;
}

void prefetch_texture(const Texture& texture, glm::dvec2 uv) {
  const Size size = texture.image.size();
  if (size.area() == 0) return;
  const int x = std::min(static_cast<int>(wrapped(uv.x, texture.wrap_s) * size.width), size.width - 1);
  const double t = wrapped(uv.y, texture.wrap_t) * size.height;
  // Its neighbours in the row mostly lie in the same line of the cache.
  for (const double row : {t - 0.5, t + 0.5}) {
    __builtin_prefetch(&texture.image.at(x, std::clamp(static_cast<int>(row), 0, size.height - 1)));
  }
}

glm::dvec2 transformed_uv(const TextureRef& reference, const glm::vec2& uv) {
  const auto& m = reference.transform;
  const double u = uv.x;
  const double v = uv.y;
  return {m[0] * u + m[2] * v + m[4], m[1] * u + m[3] * v + m[5]};
}

}  // namespace hpr
