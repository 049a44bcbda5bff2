#include "cluster/distribution/scene_distribution.h"

#include <fmt/format.h>

#include <cstdint>
#include <exception>
#include <new>
#include <optional>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"

namespace hpr {

Scene distribute_scene(Communicator& comm, const std::function<Scene()>& load) {
  std::optional<Scene> loaded;
  const auto bytes = on_root(comm, [&] {
    loaded = load();
    return comm.size() > 1 ? to_bytes(*loaded) : std::vector<std::byte>{};
  });
  if (comm.size() == 1) return std::move(*loaded);
  loaded.reset();
  // Rank 0 too goes on with what was sent, not with what it loaded.
  std::optional<Scene> scene;
  try {
    scene = scene_from_bytes(bytes);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    // What came is no scene at all: its hash, of none, says so on every rank.
  }
  const auto hashes = all_gather_value(comm, scene ? content_hash(*scene) : std::uint64_t{0});
  for (std::size_t rank = 1; rank < hashes.size(); ++rank) {
    if (hashes[rank] != hashes[0]) {
      throw Error(
          ExitCode::BadInput,
          fmt::format("rank {} holds another scene: {} instead of {}", rank, hex16(hashes[rank]), hex16(hashes[0])),
          "run the same build of hpr on every host");
    }
  }
  return std::move(*scene);
}

}  // namespace hpr
