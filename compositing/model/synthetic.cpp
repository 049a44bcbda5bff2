#include "compositing/model/synthetic.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr int kPitchBits = 6;
constexpr int kPitch = 1 << kPitchBits;  ///< pixels between the lattice points of the depth noise

/// The finaliser of MurmurHash3.
constexpr std::uint32_t mix(std::uint32_t h) {
  h = (h ^ (h >> 16U)) * 0x85EBCA6BU;
  h = (h ^ (h >> 13U)) * 0xC2B2AE35U;
  return h ^ (h >> 16U);
}

constexpr std::uint32_t hash(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t seed) {
  std::uint32_t h = mix(seed ^ 0x9E3779B9U);
  h = mix(h ^ (a * 0x27D4EB2FU));
  h = mix(h ^ (b * 0x165667B1U));
  return mix(h ^ (c * 0x9E3779B1U));
}

/// Floor of the square root.
std::int64_t integer_root(std::int64_t value) {
  std::int64_t root = 0;
  for (std::int64_t bit = std::int64_t{1} << 31U; bit > 0; bit /= 2) {
    if ((root + bit) * (root + bit) <= value) root += bit;
  }
  return root;
}

struct Disc {
  std::int64_t x = 0;
  std::int64_t y = 0;
  std::int64_t radius_squared = 0;
};

/// What one rank draws: which pixels, how deep, in which colour. Its numbers are those of the published definition of
/// the layers, so that every implementation gets the same frame.
class Pattern {
 public:
  Pattern(SyntheticKind kind, int rank, Size size, std::uint32_t seed)
      : kind_(kind),
        rank_(static_cast<std::uint32_t>(rank)),
        seed_(seed),
        depth_tag_(1U + (rank_ * 37U + 11U) % 255U),  // 37 and 255 share no factor: distinct for 255 ranks
        box_{0, 0, size.width, size.height} {
    const std::uint32_t color = at_random(31);
    color_ = {96U + (color & 127U), 96U + (color >> 8U & 127U), 96U + (color >> 16U & 127U)};
    if (kind == SyntheticKind::Half) place_box(size);
    if (kind == SyntheticKind::Sparse) place_disc(size);
  }

  /// The keys of pixels [x0, x0 + row.size()) of row y. True when any of them is one.
  [[nodiscard]] bool fill_row(int x0, int y, std::span<Key> row) const {
    bool any = false;
    int cell = -1;
    std::uint32_t left = 0;
    std::uint32_t right = 0;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const int x = x0 + static_cast<int>(i);
      if (!covers(x, y)) continue;
      if (x / kPitch != cell) {
        cell = x / kPitch;
        left = lattice(cell, y);
        right = lattice(cell + 1, y);
      }
      const auto part = static_cast<std::uint32_t>(x % kPitch);
      const std::uint32_t noise = (left * (kPitch - part) + right * part) >> (2U * kPitchBits);
      row[i] = key(noise);
      any = true;
    }
    return any;
  }

 private:
  [[nodiscard]] std::uint32_t at_random(std::uint32_t purpose) const { return hash(rank_, purpose, 1, seed_); }

  void place_box(Size size) {
    const auto shrunk = [](int length) { return static_cast<int>(std::int64_t{length} * 7071 / 10000); };
    const auto offset = [&](std::uint32_t purpose, int room) {
      return static_cast<int>(at_random(purpose) % static_cast<std::uint32_t>(room + 1));
    };
    const int width = shrunk(size.width);
    const int height = shrunk(size.height);
    box_.x0 = offset(21, size.width - width);
    box_.y0 = offset(22, size.height - height);
    box_.x1 = box_.x0 + width;
    box_.y1 = box_.y0 + height;
  }

  void place_disc(Size size) {
    disc_.radius_squared = std::int64_t{size.width} * size.height * 10000 / 314159;  // pi r^2 is a tenth of the image
    const auto radius = static_cast<int>(integer_root(disc_.radius_squared)) + 1;
    const auto center = [&](std::uint32_t purpose, int length) {
      const int room = length - 2 * radius;
      return room > 0 ? radius + static_cast<int>(at_random(purpose) % static_cast<std::uint32_t>(room)) : length / 2;
    };
    disc_.x = center(11, size.width);
    disc_.y = center(12, size.height);
  }

  [[nodiscard]] bool covers(int x, int y) const {
    switch (kind_) {
      case SyntheticKind::Dense:
        return true;
      case SyntheticKind::Half:
        return x >= box_.x0 && x < box_.x1 && y >= box_.y0 && y < box_.y1;
      case SyntheticKind::Sparse: {
        const std::int64_t dx = x - disc_.x;
        const std::int64_t dy = y - disc_.y;
        return dx * dx + dy * dy <= disc_.radius_squared;
      }
      case SyntheticKind::Scatter:
        return (hash(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), rank_ + 1000U, seed_) & 1U) != 0;
      case SyntheticKind::Checker:
        return (static_cast<std::uint32_t>(x) + static_cast<std::uint32_t>(y) + rank_) % 2 == 0;
    }
    return false;
  }

  /// Depth noise at column `cell` of the lattice, interpolated down to row y: 16 bits times the pitch.
  [[nodiscard]] std::uint32_t lattice(int cell, int y) const {
    const auto column = static_cast<std::uint32_t>(cell);
    const auto row = static_cast<std::uint32_t>(y / kPitch);
    const auto part = static_cast<std::uint32_t>(y % kPitch);
    const std::uint32_t above = hash(column, row, rank_, seed_) & 0xFFFFU;
    const std::uint32_t below = hash(column, row + 1, rank_, seed_) & 0xFFFFU;
    return above * (kPitch - part) + below * part;
  }

  [[nodiscard]] Key key(std::uint32_t noise) const {
    const std::uint32_t shade = 255U - (noise >> 9U);  // nearer is brighter: 128 to 255
    const auto channel = [&](std::size_t i) { return (color_[i] * shade) >> 8U; };
    const std::uint32_t rgba = 0xFF000000U | channel(2) << 16U | channel(1) << 8U | channel(0);
    const std::uint32_t depth = noise << 8U | depth_tag_;  // of 2^24: this and 1 - depth are exact floats
    return make_color_key(1.0F - static_cast<float>(depth) * (1.0F / 16777216.0F), rgba);
  }

  SyntheticKind kind_;
  std::uint32_t rank_;
  std::uint32_t seed_;
  std::uint32_t depth_tag_;
  std::array<std::uint32_t, 3> color_{};
  Rect box_;
  Disc disc_;
};

constexpr std::array<std::string_view, 5> kNames{"dense", "half", "sparse", "scatter", "checker"};

}  // namespace

std::string_view name_of(SyntheticKind kind) {
  return kNames.at(static_cast<std::size_t>(kind));
}

const std::vector<SyntheticKind>& all_synthetic_kinds() {
  static const std::vector<SyntheticKind> kinds{SyntheticKind::Dense, SyntheticKind::Half, SyntheticKind::Sparse,
                                                SyntheticKind::Scatter, SyntheticKind::Checker};
  return kinds;
}

SyntheticKind parse_synthetic_kind(std::string_view name) {
  for (const SyntheticKind kind : all_synthetic_kinds()) {
    if (name_of(kind) == name) return kind;
  }
  throw Error(ExitCode::Usage, fmt::format("no synthetic layers are named '{}'", printable(name)),
              unknown_name_hint(printable(name), std::vector<std::string>(kNames.begin(), kNames.end())));
}

TileLayer<Key> synthetic_layer(SyntheticKind kind, int rank, Size size, std::uint32_t seed) {
  return synthetic_wall(kind, rank, size, {1, 1}, seed);
}

TileLayer<Key> synthetic_wall(SyntheticKind kind, int rank, Size screen, Size grid, std::uint32_t seed) {
  const Pattern pattern(kind, rank, {screen.width * grid.width, screen.height * grid.height}, seed);
  TileLayer<Key> layer(grid_layout(screen, grid));
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    const TilePlace position = layer.layout().place(tile);
    const int left = static_cast<int>(position.screen) % grid.width * screen.width;
    const int top = static_cast<int>(position.screen) / grid.width * screen.height;
    bool any = false;
    for (int y = position.pixels.y0; y < position.pixels.y1; ++y) {
      const auto row = layer.tile(tile).subspan(static_cast<std::size_t>(y - position.pixels.y0) * kTileSide,
                                                static_cast<std::size_t>(position.pixels.width()));
      any = pattern.fill_row(left + position.pixels.x0, top + y, row) || any;
    }
    if (any) layer.set_active(tile);
  }
  return layer;
}

FrameLayout grid_layout(Size screen, Size grid) {
  return FrameLayout(std::vector<Size>(grid.area(), screen));
}

void draw_everywhere(TileLayer<Key>& layer, int rank) {
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    std::ranges::fill(layer.tile(tile), make_key(0.5F, static_cast<std::uint32_t>(rank)));
    layer.set_active(tile);
  }
}

}  // namespace hpr
