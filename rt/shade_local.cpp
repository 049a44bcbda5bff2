#include "rt/lighter.h"

namespace hpr {

void shade_local(Lighter& lighter, std::span<const View> views, TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles, const SampleNumber& number) {
  TileLayer<Rgb> radiance(keys.layout());
  lighter.light(views, keys, tiles, {.radiance = &radiance}, number);
  for (const std::size_t tile : tiles) {
    const std::span<const Rgb> colors = radiance.tile(tile);
    const std::span<Key> words = keys.tile(tile);
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] != kNoKey) words[i] = make_color_key(key_depth(words[i]), to_word(to_srgb(colors[i])));
    }
  }
}

}  // namespace hpr
