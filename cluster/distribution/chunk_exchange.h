#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "scene/chunk_range.h"

/// Sort-middle: each rank culls its share of the scene's chunks, and owners of tiles draw what was found for them
/// (Molnar, Cox, Ellsworth and Fuchs, "A Sorting Classification of Parallel Rendering", 1994).
namespace hpr {

/// Ascending ranges of chunks, for each screen of a frame.
using ScreenChunks = std::vector<std::vector<ChunkRange>>;

/// The part of `chunks` chunks that a rank culls: as many as others', to one.
[[nodiscard]] ChunkRange part_of_chunks(std::uint32_t chunks, int rank, int ranks);

/// Collective, in one round of messages. found[r]: what of this rank's share may be seen in the area of rank r. Returns
/// what all ranks found for this one, ascending, as shares are. A range takes about two bytes of a message.
[[nodiscard]] ScreenChunks exchange_chunks(Communicator& comm, std::span<const ScreenChunks> found);

}  // namespace hpr
