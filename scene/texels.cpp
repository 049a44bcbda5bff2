#include "scene/texels.h"

#include <algorithm>
#include <utility>

#include "core/bytes.h"

namespace hpr {

TexelFacts facts_of(std::span<const Rgba8> texels) {
  TexelFacts facts;
  for (const Rgba8& texel : texels) {
    facts.least = {std::min(facts.least.r, texel.r), std::min(facts.least.g, texel.g), std::min(facts.least.b, texel.b),
                   std::min(facts.least.a, texel.a)};
    facts.largest = {std::max(facts.largest.r, texel.r), std::max(facts.largest.g, texel.g),
                     std::max(facts.largest.b, texel.b), std::max(facts.largest.a, texel.a)};
  }
  facts.content = xxh64(std::as_bytes(texels));
  return facts;
}

Texels::Texels(Image<Rgba8> image) : size_(image.size()), facts_(facts_of(std::as_const(image).pixels())) {
  const auto kept = std::make_shared<const Image<Rgba8>>(std::move(image));
  texels_ = kept->pixels().data();
  owner_ = kept;
}

Image<Rgba8> Texels::image() const {
  Image<Rgba8> copy(size_);
  std::ranges::copy(pixels(), copy.pixels().begin());
  return copy;
}

}  // namespace hpr
