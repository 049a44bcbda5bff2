#include "engine/verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <optional>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/log.h"
#include "core/timing.h"
#include "engine/session.h"
#include "engine/tile_ownership.h"
#include "gpu/gpu_primary_rays.h"
#include "raster/rasterizer.h"
#include "rt/deferred_shader.h"
#include "rt/trace/primary_rays.h"

namespace hpr {

bool is_verified(double percent, const RandomKey& random, std::size_t tile) {
  const std::array<std::uint64_t, 3> words{random.seed, random.frame, tile};
  const double in_unit = static_cast<double>(xxh64(std::as_bytes(std::span(words))) >> 11U) * 0x1p-53;
  return in_unit < percent / 100.0;
}

namespace {

/// A tile that is verified, and who draws it.
struct VerifiedTile {
  std::size_t tile = 0;
  int owner = 0;
  int checker = 0;  ///< draws it again
  int judge = 0;    ///< draws it once more where those two differ
  std::uint64_t owner_hash = 0;
  std::uint64_t checker_hash = 0;
  std::uint64_t judge_hash = 0;

  [[nodiscard]] bool differs() const { return owner_hash != checker_hash; }
  [[nodiscard]] bool is_replaced() const { return differs() && judge_hash == checker_hash; }
  [[nodiscard]] bool is_unmended() const { return differs() && judge_hash != checker_hash && judge_hash != owner_hash; }
};

/// One sample of a tile, whoever drew it.
struct TileSample {
  const TileLayer<Key>* keys;
  const TileLayer<Rgb>* radiance;  ///< null where it is not compared
  const TileLayer<float>* alpha;   ///< null where it is not compared, or there is none
};

std::vector<TileSample> samples_of(std::span<const Frame> frames, bool lit) {
  std::vector<TileSample> samples;
  for (const Frame& frame : frames)
    samples.push_back({frame.keys, lit ? &frame.radiance : nullptr, lit ? frame.alpha() : nullptr});
  return samples;
}

std::vector<TileSample> samples_of(std::span<const TileDrawing> drawings, bool lit) {
  std::vector<TileSample> samples;
  for (const TileDrawing& drawing : drawings) {
    const bool has_alpha = lit && drawing.alpha.tiles() > 0;
    samples.push_back({&drawing.keys, lit ? &drawing.radiance : nullptr, has_alpha ? &drawing.alpha : nullptr});
  }
  return samples;
}

/// Calls `body` with the index in the tile and the position on the screen of each pixel that means something, row by
/// row, until it returns false.
template <typename Body>
void each_pixel(const Rect& pixels, std::span<const std::uint8_t> wanted, const Body& body) {
  for (int y = pixels.y0; y < pixels.y1; ++y) {
    for (int x = pixels.x0; x < pixels.x1; ++x) {
      const auto index = static_cast<std::size_t>(y - pixels.y0) * kTileSide + static_cast<std::size_t>(x - pixels.x0);
      if (!wanted.empty() && wanted[index] == 0) continue;
      if (!body(index, x, y)) return;
    }
  }
}

std::uint64_t hash_of(std::span<const TileSample> samples, std::size_t tile, const PixelMask* wanted) {
  ContentHash hash;
  std::vector<Key> keys;
  std::vector<Rgb> colors;
  std::vector<float> alphas;
  for (const TileSample& sample : samples) {
    keys.clear();
    colors.clear();
    alphas.clear();
    each_pixel(sample.keys->layout().place(tile).pixels, mask_of(wanted, tile), [&](std::size_t index, int, int) {
      keys.push_back(sample.keys->tile(tile)[index]);
      if (sample.radiance != nullptr) colors.push_back(sample.radiance->tile(tile)[index]);
      if (sample.alpha != nullptr) alphas.push_back(sample.alpha->tile(tile)[index]);
      return true;
    });
    hash.add(std::as_bytes(std::span(keys)));
    hash.add(std::as_bytes(std::span(colors)));
    if (sample.alpha != nullptr) hash.add(std::as_bytes(std::span(alphas)));
  }
  return hash.value();
}

/// Collective. The verified tiles of all ranks, ascending.
std::vector<VerifiedTile> find_tiles(Communicator& comm, const VerifiedSamples& samples,
                                     std::span<const std::size_t> owned) {
  std::vector<std::size_t> mine;
  std::ranges::copy_if(owned, std::back_inserter(mine),
                       [&](std::size_t tile) { return is_verified(samples.percent, samples.random, tile); });
  std::vector<VerifiedTile> tiles;
  const auto all = all_gather_lists(comm, std::span<const std::size_t>(mine));
  for (int rank = 0; rank < comm.size(); ++rank) {
    for (const std::size_t tile : all[static_cast<std::size_t>(rank)]) tiles.push_back({.tile = tile, .owner = rank});
  }
  std::ranges::sort(tiles, {}, &VerifiedTile::tile);
  // In turns, so that each rank draws about as many for others as the others do.
  const int others = std::max(comm.size() - 1, 1);
  int turn = 0;
  for (VerifiedTile& each : tiles) {
    each.checker = (each.owner + 1 + turn++ % others) % comm.size();
    each.judge = (each.checker + 1) % comm.size();
    if (each.judge == each.owner && comm.size() > 2) each.judge = (each.judge + 1) % comm.size();
  }
  return tiles;
}

/// Draws tiles for other ranks and makes the hashes known.
class Redrawing {
 public:
  Redrawing(Communicator& comm, const VerifiedSamples& samples, const FrameLayout& layout, const DrawTiles& draw)
      : comm_(comm), samples_(samples), layout_(layout), draw_(draw) {}

  /// Collective. Each of `tiles` is drawn by its `rank`, whose hash of it becomes its `hash`.
  std::vector<TileDrawing> draw(std::span<VerifiedTile> tiles, int VerifiedTile::*rank,
                                std::uint64_t VerifiedTile::*hash) {
    PixelMask wanted;
    if (samples_.wanted != nullptr) {
      wanted = PixelMask(layout_);
      std::vector<TileMove> moves;
      for (const VerifiedTile& each : tiles) moves.push_back({each.tile, each.owner, each.*rank});
      move_tiles(comm_, moves, *samples_.wanted, wanted, reader_);
    }
    const PixelMask* const mask = samples_.wanted != nullptr ? &wanted : nullptr;
    std::vector<std::size_t> mine;
    for (const VerifiedTile& each : tiles) {
      if (each.*rank == comm_.rank()) mine.push_back(each.tile);
    }
    std::vector<TileDrawing> drawings;
    agree_on_failure(comm_, [&] { drawings = draw_(mine, mask); });
    exchange_hashes(samples_of(drawings, samples_.lit), mask, tiles, rank, hash);
    return drawings;
  }

  /// Collective. Makes known what `samples` of each tile's `rank` hash to.
  void exchange_hashes(std::span<const TileSample> samples, const PixelMask* wanted, std::span<VerifiedTile> tiles,
                       int VerifiedTile::*rank, std::uint64_t VerifiedTile::*hash) {
    std::vector<std::uint64_t> mine;
    for (const VerifiedTile& each : tiles) {
      if (each.*rank == comm_.rank()) mine.push_back(hash_of(samples, each.tile, wanted));
    }
    const auto all = all_gather_lists(comm_, std::span<const std::uint64_t>(mine));
    std::vector<std::size_t> next(all.size(), 0);
    for (VerifiedTile& each : tiles) {
      const auto from = static_cast<std::size_t>(each.*rank);
      each.*hash = all.at(from).at(next[from]++);
    }
  }

 private:
  Communicator& comm_;
  const VerifiedSamples& samples_;
  const FrameLayout& layout_;
  const DrawTiles& draw_;
  TileReader reader_;
};

/// Where two drawings of a tile differ first.
struct Difference {
  std::size_t tile = 0;
  std::uint32_t sample = 0;
  ScreenPixel pixel;
};

Difference find_difference(std::span<const TileSample> one, std::span<const TileSample> other, std::size_t tile,
                           const VerifiedSamples& samples) {
  const TilePlace location = one.front().keys->layout().place(tile);
  const auto differ = [&](const auto* a, const auto* b, std::size_t index) {
    return a != nullptr && !std::ranges::equal(std::as_bytes(a->tile(tile).subspan(index, 1)),
                                               std::as_bytes(b->tile(tile).subspan(index, 1)));
  };
  Difference found{.tile = tile, .sample = samples.first_sample, .pixel = kNoPixel};
  for (std::size_t i = 0; i < one.size() && found.pixel == kNoPixel; ++i) {
    found.sample = samples.first_sample + static_cast<std::uint32_t>(i);
    each_pixel(location.pixels, mask_of(samples.wanted, tile), [&](std::size_t index, int x, int y) {
      if (!differ(one[i].keys, other[i].keys, index) && !differ(one[i].radiance, other[i].radiance, index) &&
          !differ(one[i].alpha, other[i].alpha, index)) {
        return true;
      }
      found.pixel = {static_cast<std::uint32_t>(location.screen), y, x};
      return false;
    });
  }
  return found;
}

std::string describe(const VerifiedTile& tile, const Difference& difference, std::uint64_t frame,
                     std::span<const std::string> hosts) {
  const auto named = [&](int rank) {
    return fmt::format("rank {} on {}", rank, hosts[static_cast<std::size_t>(rank)]);
  };
  std::string text = fmt::format(
      "frame {}: {} drew tile {} of screen {} otherwise than {}, first in pixel {},{} of sample {}; a third drawing, "
      "by {}, agrees with ",
      frame, named(tile.checker), tile.tile, difference.pixel.screen, named(tile.owner), difference.pixel.x,
      difference.pixel.y, difference.sample, named(tile.judge));
  if (tile.is_unmended()) return text + "neither";
  return text + (tile.is_replaced() ? "the former, whose pixels are shown" : "the latter");
}

/// On rank 0: one line for each of `tiles`, which differ; no more than a reader wants of a frame.
void report(std::span<const VerifiedTile> tiles, std::span<const Difference> differences, std::uint64_t frame,
            std::span<const std::string> hosts) {
  constexpr std::size_t kMaxLines = 10;
  for (std::size_t i = 0; i < std::min(tiles.size(), kMaxLines); ++i) {
    const auto difference = std::ranges::find(differences, tiles[i].tile, &Difference::tile);
    const std::string text = describe(tiles[i], *difference, frame, hosts);
    if (tiles[i].is_unmended()) {
      log::error("{}", text);
    } else {
      log::warning("{}", text);
    }
  }
  if (tiles.size() > kMaxLines) log::warning("frame {}: and {} more tiles", frame, tiles.size() - kMaxLines);
}

/// Collective. Brings the second drawings of `tiles` to their owners, sample by sample.
std::vector<TileDrawing> send_to_owners(Communicator& comm, std::span<const VerifiedTile> tiles,
                                        std::span<const TileDrawing> second, bool lit) {
  std::vector<TileMove> moves;
  moves.reserve(tiles.size());
  for (const VerifiedTile& each : tiles) moves.push_back({each.tile, each.checker, each.owner});
  std::vector<TileDrawing> received;
  TileReader reader;
  for (const TileDrawing& drawing : second) {
    received.push_back({TileLayer<Key>(drawing.keys.layout()), TileLayer<Rgb>(drawing.keys.layout()),
                        TileLayer<float>(drawing.alpha.layout())});
    received.back().keys.set_depth_format(drawing.keys.depth_format());
    move_tiles(comm, moves, drawing.keys, received.back().keys, reader);
    if (lit) move_tiles(comm, moves, drawing.radiance, received.back().radiance, reader);
    if (lit && drawing.alpha.tiles() > 0) move_tiles(comm, moves, drawing.alpha, received.back().alpha, reader);
  }
  return received;
}

/// Takes a tile of every sample over from the second drawings.
void replace_tile(std::span<const TileDrawing> second, std::size_t tile, bool lit, std::span<Frame> frames) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    copy_tiles(second[i].keys, *frames[i].keys, {&tile, 1});
    if (lit) copy_tiles(second[i].radiance, frames[i].radiance, {&tile, 1});
    if (lit && frames[i].is_transparent) {
      copy_tiles(second[i].alpha, frames[i].aovs.single.at(Aov::Coverage), {&tile, 1});
    }
  }
}

}  // namespace

VerifyCounts verify_tiles(Communicator& comm, const std::string& host, const VerifiedSamples& samples,
                          std::span<Frame> frames, const DrawTiles& draw) {
  std::vector<VerifiedTile> tiles = find_tiles(comm, samples, frames.front().owned);
  if (tiles.empty()) return {};
  const std::vector<TileSample> owned = samples_of(std::span<const Frame>(frames), samples.lit);
  Redrawing redrawing(comm, samples, frames.front().keys->layout(), draw);
  const std::vector<TileDrawing> second = redrawing.draw(tiles, &VerifiedTile::checker, &VerifiedTile::checker_hash);
  redrawing.exchange_hashes(owned, samples.wanted, tiles, &VerifiedTile::owner, &VerifiedTile::owner_hash);

  VerifyCounts counts{.tiles = tiles.size() * frames.size()};
  std::erase_if(tiles, [](const VerifiedTile& each) { return !each.differs(); });
  if (tiles.empty()) return counts;
  (void)redrawing.draw(tiles, &VerifiedTile::judge, &VerifiedTile::judge_hash);

  // The owners get the second drawing: to find where theirs differs, and to take it over where it won.
  const std::vector<TileDrawing> received = send_to_owners(comm, tiles, second, samples.lit);
  std::vector<Difference> mine;
  for (const VerifiedTile& each : tiles) {
    counts.mismatches += 1;
    counts.unmended += each.is_unmended() ? 1U : 0U;
    if (each.owner != comm.rank()) continue;
    mine.push_back(find_difference(owned, samples_of(received, samples.lit), each.tile, samples));
    if (each.is_replaced()) replace_tile(received, each.tile, samples.lit, frames);
  }
  std::vector<Difference> differences;
  for (const auto& list : all_gather_lists(comm, std::span<const Difference>(mine))) {
    differences.insert(differences.end(), list.begin(), list.end());
  }
  const std::vector<std::string> hosts = all_gather_texts(comm, host);
  if (comm.rank() == 0) report(tiles, differences, samples.random.frame, hosts);
  return counts;
}

namespace {

/// The rectangles that tiles of one screen cover, neighbors of a row joined: each costs OpenGL a draw of its own.
std::vector<Rect> rects_of(const FrameLayout& layout, std::span<const std::size_t> tiles, std::size_t screen) {
  std::vector<Rect> rects;
  for (const std::size_t tile : tiles) {
    const TilePlace location = layout.place(tile);
    if (location.screen != screen) continue;
    if (!rects.empty() && rects.back().y0 == location.pixels.y0 && rects.back().x1 == location.pixels.x0) {
      rects.back().x1 = location.pixels.x1;
    } else {
      rects.push_back(location.pixels);
    }
  }
  return rects;
}

/// Keys of `tiles` from all surfaces of the scene, whichever this rank draws in the frame.
void draw_keys(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
               std::span<const std::size_t> tiles, const PixelMask* wanted, std::span<TileLayer<Key>* const> keys) {
  for (std::size_t screen = 0; screen < plan.layout.screens(); ++screen) {
    const std::vector<Rect> parts = rects_of(plan.layout, tiles, screen);
    if (parts.empty()) continue;
    std::vector<View> views;
    for (const JitteredViews& each : jittered) views.push_back(each.views[screen]);
    if (plan.keys_on_device && wanted == nullptr) {
      GpuPrimaryRays& device = session.gpu_primary_rays(covering_surfaces(session.scene(), false));
      for (std::size_t i = 0; i < views.size(); ++i) device.draw(views[i], screen, parts, *keys[i]);
      continue;
    }
    if (plan.primary == Primary::Rays) {
      session.whole_primary_rays(plan.rays).draw(views, screen, parts, keys, wanted);
      continue;
    }
    Rasterizer& rasterizer = session.whole_rasterizer();
    for (std::size_t i = 0; i < views.size(); ++i) rasterizer.draw(views[i], screen, parts, *keys[i]);
  }
}

std::vector<TileDrawing> draw_tiles(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                                    std::span<const std::size_t> tiles, const PixelMask* wanted) {
  std::vector<TileDrawing> drawings;
  for (std::size_t i = 0; i < jittered.size(); ++i) {
    drawings.push_back({TileLayer<Key>(plan.layout), TileLayer<Rgb>(plan.layout),
                        TileLayer<float>(plan.is_transparent() ? plan.layout : FrameLayout())});
    drawings.back().keys.set_depth_format(plan.depth_format);
  }
  if (tiles.empty()) return drawings;
  std::vector<TileLayer<Key>*> keys;
  keys.reserve(drawings.size());
  for (TileDrawing& drawing : drawings) keys.push_back(&drawing.keys);
  draw_keys(session, plan, jittered, tiles, wanted, keys);
  if (!plan.lit) return drawings;
  std::vector<ShadedSample> samples;
  for (std::size_t i = 0; i < jittered.size(); ++i) {
    const LightOutput output{.radiance = &drawings[i].radiance,
                             .coverage = plan.is_transparent() ? &drawings[i].alpha : nullptr};
    samples.push_back({jittered[i].views, &drawings[i].keys, output, jittered[i].sample.number, wanted});
  }
  session.shader(plan.rays).shade(samples, tiles);
  return drawings;
}

}  // namespace

VerifyCounts verify(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                    std::span<Frame> frames) {
  const trace::Span span("verify");
  const FrameSample& first = jittered.front().sample;
  const VerifiedSamples samples{.percent = plan.verify_percent,
                                .random = {plan.rays.seed, first.number.frame},
                                .first_sample = first.number.sample,
                                .lit = plan.lit,
                                .wanted = first.wanted};
  return verify_tiles(session.comm(), session.host(), samples, frames,
                      [&](std::span<const std::size_t> tiles, const PixelMask* wanted) {
                        return draw_tiles(session, plan, jittered, tiles, wanted);
                      });
}

}  // namespace hpr
