#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <random>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "compositing/model/synthetic.h"
#include "compositing/test_layers.h"
#include "image/key.h"

namespace hpr {
namespace {

constexpr std::array kFormats{DepthFormat::Float32, DepthFormat::Bits24, DepthFormat::Bits16};

TEST(DepthFormat, RoundsMonotonouslyAndNeverPastTheNearPlane) {
  for (const DepthFormat format : kFormats) {
    constexpr std::uint32_t kOne = 0x3F800000;
    std::uint32_t before = 0;
    const auto check = [&](std::uint32_t bits) {
      const float depth = std::bit_cast<float>(bits);
      const float rounded = quantized_depth(depth, format);
      const auto after = std::bit_cast<std::uint32_t>(rounded);
      ASSERT_GE(after, before) << bits;
      ASSERT_LE(after, kOne) << bits;
      ASSERT_EQ(quantized_depth(rounded, format), rounded);
      ASSERT_LE(bits > after ? bits - after : after - bits, (1U << lost_bits(format)) / 2) << bits;
      before = after;
    };
    for (std::uint32_t bits = 0; bits <= kOne; bits += 251) check(bits);
    before = 0;
    for (std::uint32_t bits = kOne - 100'000; bits <= kOne; ++bits) check(bits);
    EXPECT_EQ(quantized_depth(0.0F, format), 0.0F);
    EXPECT_EQ(quantized_depth(1.0F, format), 1.0F);
  }
}

TEST(DepthFormat, StepsAreTheRelativeOnesThatAreClaimed) {
  EXPECT_EQ(std::nextafter(1.0F, 2.0F), 1.0F + std::ldexp(1.0F, -23));
  for (const auto& [format, step] : {std::pair{DepthFormat::Bits24, -17}, std::pair{DepthFormat::Bits16, -9}}) {
    for (const float depth : {0.5F, 0.001F, 1e-6F}) {
      const float octave = std::exp2(std::floor(std::log2(depth)));
      EXPECT_EQ(quantized_depth(octave * (1 + 0.4F * std::ldexp(1.0F, step)), format), octave);
      EXPECT_EQ(quantized_depth(octave * (1 + 0.6F * std::ldexp(1.0F, step)), format),
                octave * (1 + std::ldexp(1.0F, step)));
    }
  }
}

TEST(DepthFormat, AllQuantizedKeysFitTheBytesTheyAreSentInAndComeBack) {
  std::mt19937_64 random(5);
  for (const DepthFormat format : kFormats) {
    std::vector<Key> keys{kNoKey, make_key(1.0F, 0), make_key(0.0F, 0xFFFFFFFE), make_key(1.0F, 0xFFFFFFFE)};
    for (int i = 0; i < 1000; ++i) {
      keys.push_back(make_key(quantized_depth(test::awkward_depth(random), format), static_cast<std::uint32_t>(i)));
    }
    for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{5}, keys.size()}) {
      const std::span<const Key> some(keys.data(), count);
      std::vector<std::byte> bytes(count * sent_bytes(format) + 1, std::byte{0x5A});
      narrow_keys(some, format, bytes.data());
      EXPECT_EQ(bytes.back(), std::byte{0x5A});
      std::vector<Key> back(count, 77);
      widen_keys(bytes.data(), format, back);
      EXPECT_TRUE(std::ranges::equal(back, some));
    }
  }
}

TileLayer<Key> quantized(TileLayer<Key> layer, DepthFormat format) {
  layer.set_depth_format(format);
  for (Key& key : layer.run({0, layer.tiles()})) {
    if (key != kNoKey) key = quantized_key(key, format);
  }
  return layer;
}

/// The frame a strategy leaves on rank 0 after assembly.
std::vector<Key> composited(const std::string& strategy, int ranks, DepthFormat format, const FrameLayout& layout) {
  std::vector<Key> frame;
  run_local_ranks(ranks, [&](Communicator& comm) {
    TileLayer<Key> layer = quantized(test::random_layer(comm.rank(), layout), format);
    const std::vector<int> shown_by(layout.screens(), 0);
    const auto compositor = make_compositor(strategy);
    const Composited mine = compositor->composite(comm, layer, all_tiles(layout));
    Assembler().assemble(comm, layer, mine.tiles, shown_by);
    if (comm.rank() == 0) frame = test::keys_of(layer);
  });
  return frame;
}

TEST(DepthFormat, EveryStrategyGivesTheSameBitsOnAnyNumberOfRanks) {
  const FrameLayout layout({{200, 130}, {65, 70}});
  for (const DepthFormat format : kFormats) {
    for (const int ranks : {1, 2, 3, 4, 7}) {
      std::vector<Key> expected(layout.tiles() * kTilePixels, kNoKey);
      for (int rank = 0; rank < ranks; ++rank) {
        const std::vector<Key> keys = test::keys_of(quantized(test::random_layer(rank, layout), format));
        for (std::size_t i = 0; i < keys.size(); ++i) expected[i] = std::max(expected[i], keys[i]);
      }
      for (const auto& compositor : all_compositors()) {
        const std::string name(compositor->name());
        if (!compositor->fits(ranks)) continue;
        EXPECT_TRUE(composited(name, ranks, format, layout) == expected) << name << ", " << ranks << " ranks";
      }
    }
  }
}

TEST(DepthFormat, MessagesShrinkAsTheKeysDo) {
  for (const SyntheticKind kind : {SyntheticKind::Dense, SyntheticKind::Scatter}) {
    std::map<DepthFormat, std::size_t> sent;
    for (const DepthFormat format : kFormats) {
      run_local_ranks(2, [&](Communicator& comm) {
        CountingCommunicator counting(comm);
        TileLayer<Key> layer = quantized(synthetic_layer(kind, comm.rank(), {1024, 512}, 1), format);
        (void)make_compositor("binary-swap")->composite(counting, layer, all_tiles(layer.layout()));
        if (comm.rank() == 0) sent[format] = counting.bytes_sent();
      });
    }
    const auto whole = static_cast<double>(sent[DepthFormat::Float32]);
    EXPECT_NEAR(static_cast<double>(sent[DepthFormat::Bits24]) / whole, 7.0 / 8.0, 0.02);
    EXPECT_NEAR(static_cast<double>(sent[DepthFormat::Bits16]) / whole, 6.0 / 8.0, 0.02);
  }
}

}  // namespace
}  // namespace hpr
