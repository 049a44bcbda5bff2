#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/frame.h"
#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"
#include "rt/sampling/sampler.h"

/// `--verify`: some of a frame's tiles are drawn a second time, by another rank, and compared bit for bit, as memory
/// and links that flip bits leave no other trace. A tile of which the two drawings differ is drawn a third time, and
/// what two of the three agree on is what the frame shows.
namespace hpr {

class Communicator;
class Session;

/// Whether a tile is among the `percent` of a frame's tiles that are verified: by a hash of seed, frame and tile, so
/// that all ranks agree and other frames have other tiles.
[[nodiscard]] bool is_verified(double percent, const RandomKey& random, std::size_t tile);

/// Samples of a frame that are verified together.
struct VerifiedSamples {
  double percent = 0.0;  ///< of the frame's tiles
  RandomKey random;
  std::uint32_t first_sample = 0;
  bool lit = true;                    ///< whether their radiance and alpha are compared, beside their keys
  const PixelMask* wanted = nullptr;  ///< pixels of this rank's tiles that mean something; null, on all ranks: all
};

/// Tiles of one sample as they were drawn afresh.
struct TileDrawing {
  TileLayer<Key> keys;
  TileLayer<Rgb> radiance;
  TileLayer<float> alpha = {};  ///< without tiles where frames have none
};

/// Draws tiles of all samples afresh on this rank, alone; the pixels that `wanted` leaves out mean nothing.
using DrawTiles = std::function<std::vector<TileDrawing>(std::span<const std::size_t> tiles, const PixelMask* wanted)>;

/// Collective. Verifies the owned tiles of `frames`, one a sample, and replaces those that two drawings of other ranks
/// agree to differ from. Rank 0 warns of each tile with its first differing pixel, the ranks and their hosts. The same
/// counts on all ranks. All ranks throw alike what `draw` throws on any. `host`: of this rank.
[[nodiscard]] VerifyCounts verify_tiles(Communicator& comm, const std::string& host, const VerifiedSamples& samples,
                                        std::span<Frame> frames, const DrawTiles& draw);

/// Collective, after make_frame or make_round has made `frames` of `jittered` and before the session draws anything
/// else: verify_tiles by the session's means.
[[nodiscard]] VerifyCounts verify(Session& session, const FramePlan& plan, std::span<const JitteredViews> jittered,
                                  std::span<Frame> frames);

}  // namespace hpr
