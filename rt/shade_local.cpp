#include <algorithm>
#include <vector>

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

void light_empty(Lighter& lighter, std::span<const View> views, const TileLayer<Key>& keys,
                 std::span<const std::size_t> tiles, TileLayer<Rgb>& radiance, const SampleNumber& number) {
  std::vector<std::size_t> open;
  std::ranges::copy_if(tiles, std::back_inserter(open),
                       [&](std::size_t tile) { return std::ranges::count(keys.tile(tile), kNoKey) > 0; });
  // Keys that carry colours name no surfaces: pixels that have one are lit as if they were empty, and left out.
  const TileLayer<Key> empty(keys.layout());
  TileLayer<Rgb> behind(keys.layout());
  lighter.light(views, empty, open, {.radiance = &behind}, number);
  for (const std::size_t tile : open) {
    const std::span<const Key> words = keys.tile(tile);
    const std::span<const Rgb> from = behind.tile(tile);
    const std::span<Rgb> to = radiance.tile(tile);
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] == kNoKey) to[i] = from[i];
    }
  }
}

}  // namespace hpr
