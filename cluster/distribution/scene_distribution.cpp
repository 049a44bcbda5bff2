#include "cluster/distribution/scene_distribution.h"

#include <fmt/format.h>

#include <optional>

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
  Scene scene = scene_from_bytes(bytes);
  const auto hashes = all_gather_value(comm, content_hash(scene));
  for (std::size_t rank = 1; rank < hashes.size(); ++rank) {
    if (hashes[rank] != hashes[0]) {
      throw Error(
          ExitCode::BadInput,
          fmt::format("rank {} holds another scene: {} instead of {}", rank, hex16(hashes[rank]), hex16(hashes[0])),
          "run the same build of hpr on every host");
    }
  }
  return scene;
}

}  // namespace hpr
