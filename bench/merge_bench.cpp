#include <benchmark/benchmark.h>

#include <cstring>
#include <random>
#include <vector>

#include "compositing/kernels.h"

// How close the key merge comes to memory speed. A merge of n keys reads two streams and writes one, 3 n words; a copy
// of n keys reads one and writes one. So the same traffic as a merge is a copy of 1.5 n keys, and both are measured.
namespace {

constexpr std::size_t kKeys1080p = std::size_t{1920} * 1080;

std::vector<hpr::Key> random_keys(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<hpr::Key> keys(kKeys1080p);
  for (hpr::Key& key : keys) key = random();
  return keys;
}

void merge_1080p(benchmark::State& state) {
  std::vector<hpr::Key> into = random_keys(1);
  const std::vector<hpr::Key> from = random_keys(2);
  for (auto _ : state) {
    hpr::merge_keys(into, from);
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(3 * kKeys1080p * sizeof(hpr::Key)));
}
BENCHMARK(merge_1080p)->Unit(benchmark::kMillisecond);

/// `percent` of the keys of a 1080p layer, copied.
void copy_1080p(benchmark::State& state) {
  const std::size_t bytes = kKeys1080p * sizeof(hpr::Key) * static_cast<std::size_t>(state.range(0)) / 100;
  const std::vector<std::byte> from(bytes, std::byte{1});
  std::vector<std::byte> into(bytes);
  for (auto _ : state) {
    std::memcpy(into.data(), from.data(), bytes);
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(2 * bytes));
}
BENCHMARK(copy_1080p)->ArgName("percent")->Arg(100)->Arg(150)->Unit(benchmark::kMillisecond);

/// A layer of which `percent` of the pixels are drawn, scattered.
std::vector<hpr::Key> scattered_keys(std::int64_t percent) {
  std::mt19937_64 random(3);
  std::vector<hpr::Key> keys((kKeys1080p + hpr::kTilePixels - 1) / hpr::kTilePixels * hpr::kTilePixels);
  for (hpr::Key& key : keys) key = static_cast<std::int64_t>(random() % 100) < percent ? random() | 1U : hpr::kNoKey;
  return keys;
}

/// Finding the drawn pixels of a layer and writing them one after the other.
void pack_1080p(benchmark::State& state) {
  const std::vector<hpr::Key> keys = scattered_keys(state.range(0));
  std::vector<hpr::Key> packed(hpr::kTilePixels);
  for (auto _ : state) {
    for (std::size_t i = 0; i < keys.size(); i += hpr::kTilePixels) {
      const auto tile = std::span(keys).subspan(i).first<hpr::kTilePixels>();
      hpr::TileMask mask;
      benchmark::DoNotOptimize(hpr::find_drawn(tile, mask));
      benchmark::DoNotOptimize(hpr::pack_drawn(tile, mask, packed.data()));
    }
  }
}
BENCHMARK(pack_1080p)->ArgName("percent")->Arg(10)->Arg(50)->Unit(benchmark::kMillisecond);

void merge_packed_1080p(benchmark::State& state) {
  std::vector<hpr::Key> into = random_keys(1);
  into.resize((kKeys1080p + hpr::kTilePixels - 1) / hpr::kTilePixels * hpr::kTilePixels);
  const std::vector<hpr::Key> keys = scattered_keys(state.range(0));
  std::vector<hpr::TileMask> masks(keys.size() / hpr::kTilePixels);
  std::vector<std::vector<hpr::Key>> packed(masks.size(), std::vector<hpr::Key>(hpr::kTilePixels));
  for (std::size_t i = 0; i < masks.size(); ++i) {
    const auto tile = std::span(keys).subspan(i * hpr::kTilePixels).first<hpr::kTilePixels>();
    hpr::find_drawn(tile, masks[i]);
    packed[i].resize(hpr::pack_drawn(tile, masks[i], packed[i].data()));
  }
  for (auto _ : state) {
    for (std::size_t i = 0; i < masks.size(); ++i) {
      hpr::merge_packed(std::span(into).subspan(i * hpr::kTilePixels).first<hpr::kTilePixels>(), masks[i], packed[i]);
    }
    benchmark::ClobberMemory();
  }
}
BENCHMARK(merge_packed_1080p)->ArgName("percent")->Arg(10)->Arg(50)->Unit(benchmark::kMillisecond);

template <typename Pixel>
std::vector<Pixel> random_colors(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Pixel> pixels(kKeys1080p);
  using Channel = decltype(Pixel::a);
  const auto up_to = [&](Channel max) {
    return static_cast<Channel>(static_cast<double>(max) * static_cast<double>(random() % 1000) / 1000.0);
  };
  constexpr Channel kOne = sizeof(Channel) == 1 ? Channel{255} : Channel{1};
  for (Pixel& pixel : pixels) {
    const Channel a = up_to(kOne);
    pixel = {up_to(a), up_to(a), up_to(a), a};
  }
  return pixels;
}

template <typename Pixel>
void over_1080p(benchmark::State& state) {
  const std::vector<Pixel> front = random_colors<Pixel>(1);
  std::vector<Pixel> back = random_colors<Pixel>(2);
  for (auto _ : state) {
    hpr::composite_over(std::span<const Pixel>(front), std::span<const Pixel>(back), std::span(back));
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(3 * kKeys1080p * sizeof(Pixel)));
}
BENCHMARK_TEMPLATE(over_1080p, hpr::Rgba8Premultiplied)->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(over_1080p, hpr::RgbaPremultiplied)->Unit(benchmark::kMillisecond);

/// The bytes `over` moves, two streams read and one written, as a copy.
template <typename Pixel>
void copy_as_over_1080p(benchmark::State& state) {
  const std::vector<Pixel> from(kKeys1080p * 3 / 2, Pixel{1, 1, 1, 1});
  std::vector<Pixel> into(from.size());
  for (auto _ : state) {
    std::memcpy(into.data(), from.data(), from.size() * sizeof(Pixel));
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(2 * from.size() * sizeof(Pixel)));
}
BENCHMARK_TEMPLATE(copy_as_over_1080p, hpr::Rgba8Premultiplied)->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(copy_as_over_1080p, hpr::RgbaPremultiplied)->Unit(benchmark::kMillisecond);

/// Finding and packing the drawn pixels of a layer of colours, and unpacking them.
template <typename Pixel>
void pack_and_unpack_1080p(benchmark::State& state) {
  std::mt19937_64 random(3);
  std::vector<Pixel> pixels(kKeys1080p / hpr::kTilePixels * hpr::kTilePixels);
  for (Pixel& pixel : pixels) {
    if (static_cast<std::int64_t>(random() % 100) < state.range(0)) pixel = {1, 1, 1, 1};
  }
  std::vector<Pixel> packed(hpr::kTilePixels);
  for (auto _ : state) {
    for (std::size_t i = 0; i < pixels.size(); i += hpr::kTilePixels) {
      const auto tile = std::span(pixels).subspan(i).template first<hpr::kTilePixels>();
      hpr::TileMask mask;
      benchmark::DoNotOptimize(hpr::find_drawn(std::span<const Pixel, hpr::kTilePixels>(tile), mask));
      const std::size_t count = hpr::pack_drawn(std::span<const Pixel, hpr::kTilePixels>(tile), mask, packed.data());
      hpr::unpack_drawn(std::span<const Pixel>(packed).first(count), mask, tile);
    }
    benchmark::ClobberMemory();
  }
}
BENCHMARK_TEMPLATE(pack_and_unpack_1080p, hpr::Rgba8Premultiplied)->Arg(10)->Arg(50)->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(pack_and_unpack_1080p, hpr::RgbaPremultiplied)->Arg(10)->Arg(50)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
