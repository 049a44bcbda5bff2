#include "cluster/distribution/scene_distribution.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <optional>
#include <utility>

#include "cluster/distribution/assignment.h"
#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

/// Rank 0 sends meshes when so many bytes of them wait.
constexpr std::size_t kBatchBytes = std::size_t{16} << 20U;

/// Takes the triangles out of the meshes that not all ranks hold; where those were read whole, they are kept apart.
void strip(LoadedScene& loaded) {
  if (loaded.whole_mesh) return;
  auto kept = std::make_shared<std::vector<Mesh>>(loaded.scene.meshes.size());
  for (std::size_t i = 0; i < kept->size(); ++i) {
    Mesh& mesh = loaded.scene.meshes[i];
    if (is_held_by_all(loaded.scene, mesh)) continue;
    (*kept)[i] = std::move(mesh);
    mesh = without_triangles((*kept)[i]);
  }
  loaded.whole_mesh = [kept](std::uint32_t mesh) { return std::move((*kept)[mesh]); };
}

/// A mesh of a scene that has no triangles there, whole.
Mesh read_whole(const std::function<Mesh(std::uint32_t)>& whole_mesh, const Scene& scene, std::uint32_t mesh) {
  Mesh whole = whole_mesh(mesh);
  whole.name = scene.meshes[mesh].name;
  whole.material = scene.meshes[mesh].material;
  if (content_hash(whole) != scene.meshes[mesh].partial->content) {
    throw Error(ExitCode::BadInput, fmt::format("{}: mesh {} changed while it was read", scene.name, mesh),
                "leave the file alone until it is loaded");
  }
  return whole;
}

/// Puts a scene together again that was read mesh by mesh.
Scene assembled(LoadedScene loaded) {
  for (std::uint32_t i = 0; i < loaded.scene.meshes.size(); ++i) {
    if (loaded.scene.meshes[i].partial) loaded.scene.meshes[i] = read_whole(loaded.whole_mesh, loaded.scene, i);
  }
  return std::move(loaded.scene);
}

std::uint64_t memory_of_part(const Scene& scene, int parts) {
  const std::uint64_t held_by_all = memory_of(scene);
  return held_by_all + (whole_memory_of(scene) - held_by_all) / static_cast<std::uint64_t>(parts);
}

/// Into how many parts a scene is cut for so many ranks.
int parts_for(const LoadedScene& loaded, int ranks) {
  if (loaded.islands > 0) {
    const int islands = std::min(loaded.islands, ranks);
    if (ranks % islands != 0) {
      throw Error(ExitCode::Usage, fmt::format("{} ranks make no {} groups of one size", ranks, islands),
                  "each group holds all of the scene: choose another number of groups or of ranks");
    }
    return ranks / islands;
  }
  for (int parts = 2; parts < ranks; ++parts) {
    if (ranks % parts == 0 && memory_of_part(loaded.scene, parts) <= loaded.memory_limit) return parts;
  }
  return ranks;
}

/// Throws Error (Limit) where one of so many parts of a scene is too large for a rank.
void check_part(const LoadedScene& loaded, int parts) {
  const std::uint64_t needed = memory_of_part(loaded.scene, parts);
  if (needed <= loaded.memory_limit) return;
  const std::uint64_t held_by_all = memory_of(loaded.scene);
  const std::uint64_t shared = whole_memory_of(loaded.scene) - held_by_all;
  const std::string hint =
      held_by_all >= loaded.memory_limit
          ? "raise --limit-mem: that much of it every rank needs"
          : fmt::format("use at least {} ranks, or raise --limit-mem",
                        (shared + loaded.memory_limit - held_by_all - 1) / (loaded.memory_limit - held_by_all));
  throw Error(ExitCode::Limit,
              fmt::format("{} needs {} bytes, more than the limit of {}",
                          parts == 1 ? "the scene" : fmt::format("each of {} parts of the scene", parts), needed,
                          loaded.memory_limit),
              hint);
}

/// Which triangles of each mesh some surfaces are, of meshes that are shared out.
std::vector<std::vector<SurfaceRange>> triangles_of(const Scene& scene, const std::vector<SurfaceRange>& part) {
  std::vector<std::vector<SurfaceRange>> triangles(scene.meshes.size());
  for (const InstanceRange& range : split_by_instance(scene, part)) {
    const std::uint32_t mesh = scene.instances[range.instance].mesh;
    if (scene.meshes[mesh].partial) triangles[mesh].push_back(range.range);
  }
  for (std::size_t mesh = 0; mesh < triangles.size(); ++mesh) {
    triangles[mesh] = merged_ranges(std::move(triangles[mesh]), scene.meshes[mesh].triangle_count());
  }
  return triangles;
}

/// What rank 0 sends in one round.
enum class More : std::uint64_t { Comes, Done, Failed };

/// Starts a message of a round; meshes follow.
struct BatchHeader {
  More more = More::Comes;
  std::uint64_t hash = 0;  ///< of what follows
};
struct MeshHeader {
  std::uint64_t number = 0;
  std::uint64_t bytes = 0;
};

/// The messages of a round.
class MeshBatch {
 public:
  explicit MeshBatch(int ranks) : messages_(static_cast<std::size_t>(ranks)) { clear(); }

  void add(std::size_t rank, std::uint32_t number, const Mesh& mesh) {
    ByteBuffer& message = messages_[rank];
    const std::size_t before = message.size();
    message.extend(sizeof(MeshHeader));
    append_bytes(mesh, message);
    const MeshHeader header{number, message.size() - before - sizeof(MeshHeader)};
    std::memcpy(&message.bytes()[before], &header, sizeof(header));
    waiting_ += header.bytes;
  }
  [[nodiscard]] bool is_full() const { return waiting_ >= kBatchBytes; }

  void send(Communicator& comm, More more) {
    std::vector<Outgoing> out;
    for (std::size_t rank = 1; rank < messages_.size(); ++rank) {
      const std::span<std::byte> message = messages_[rank].bytes();
      const BatchHeader header{more, xxh64(message.subspan(sizeof(BatchHeader)))};
      std::memcpy(message.data(), &header, sizeof(header));
      out.push_back({static_cast<int>(rank), message});
    }
    comm.exchange(out, {}, nullptr);
    clear();
  }

  /// Takes a round's meshes into `scene`. Throws Error (BadInput) for others than were sent.
  static void unpack(Communicator& comm, std::span<const std::byte> message, const BatchHeader& header, Scene& scene) {
    std::span<const std::byte> rest = message.subspan(sizeof(header));
    if (header.hash != xxh64(rest)) {
      throw Error(ExitCode::BadInput, fmt::format("rank {} received other meshes than were sent", comm.rank()),
                  "check the network and its memory");
    }
    while (!rest.empty()) {
      MeshHeader mesh;
      HPR_CHECK(rest.size() >= sizeof(mesh));
      std::memcpy(&mesh, rest.data(), sizeof(mesh));
      HPR_CHECK(rest.size() - sizeof(mesh) >= mesh.bytes);
      scene.meshes.at(mesh.number) = mesh_from_bytes(rest.subspan(sizeof(mesh), mesh.bytes));
      rest = rest.subspan(sizeof(mesh) + mesh.bytes);
    }
  }

 private:
  void clear() {
    for (ByteBuffer& message : messages_) {
      message = {};  // memory of large ones goes back
      message.extend(sizeof(BatchHeader));
    }
    waiting_ = 0;
  }

  std::vector<ByteBuffer> messages_;
  std::size_t waiting_ = 0;
};

using WantedTriangles = std::vector<std::vector<std::vector<SurfaceRange>>>;  // by part and mesh

/// Adds the parts of a mesh to what ranks are sent; rank 0 takes its own.
void add_parts(Communicator& comm, const Mesh& whole, std::uint32_t number, const WantedTriangles& wanted, Scene& scene,
               MeshBatch& batch) {
  const std::shared_ptr<const PartialMesh> partial = scene.meshes[number].partial;
  const auto ranks = static_cast<std::size_t>(comm.size());
  for (std::size_t part = 0; part < wanted.size(); ++part) {
    if (wanted[part][number].empty()) continue;
    Mesh mesh = part_of_mesh(whole, wanted[part][number], *partial);
    for (std::size_t rank = part; rank < ranks; rank += wanted.size()) {
      if (rank > 0) batch.add(rank, number, mesh);
    }
    if (part == 0) scene.meshes[number] = std::move(mesh);
    if (batch.is_full()) batch.send(comm, More::Comes);
  }
}

/// On rank 0: reads the meshes of `scene` one by one and sends each rank what it holds.
void send_meshes(Communicator& comm, const std::function<Mesh(std::uint32_t)>& whole_mesh, Scene& scene,
                 MeshBatch& batch) {
  WantedTriangles wanted;
  for (const std::vector<SurfaceRange>& part : scene.parts) wanted.push_back(triangles_of(scene, part));
  for (std::uint32_t i = 0; i < scene.meshes.size(); ++i) {
    const auto is_unwanted = [&](const auto& of_part) { return of_part[i].empty(); };
    if (!scene.meshes[i].partial || std::ranges::all_of(wanted, is_unwanted)) continue;
    add_parts(comm, read_whole(whole_mesh, scene, i), i, wanted, scene, batch);
  }
}

/// On other ranks: takes all rounds, also those after one that failed.
void receive_meshes(Communicator& comm, Scene& scene, std::optional<Error>& failure) {
  BatchHeader header;
  while (header.more == More::Comes) {
    const std::vector<std::byte> message = comm.receive(0);
    HPR_CHECK(message.size() >= sizeof(header));
    std::memcpy(&header, message.data(), sizeof(header));
    if (failure) continue;
    failure = failure_of([&] { MeshBatch::unpack(comm, message, header, scene); });
  }
}

/// Collective. Brings each rank the triangles of its part.
void share_out(Communicator& comm, const std::function<Mesh(std::uint32_t)>& whole_mesh, Scene& scene) {
  std::optional<Error> failure;
  if (comm.rank() == 0) {
    MeshBatch batch(comm.size());
    failure = failure_of([&] { send_meshes(comm, whole_mesh, scene, batch); });
    batch.send(comm, failure ? More::Failed : More::Done);
  } else {
    receive_meshes(comm, scene, failure);
  }
  agree_on_failure(comm, [&] {
    if (failure) throw Error(*failure);
  });
}

/// As bytes for all ranks, in parts where that is wanted.
std::vector<std::byte> packed(LoadedScene& loaded, int ranks) {
  if (!loaded.in_parts) return to_bytes(loaded.scene);
  strip(loaded);
  const int parts = parts_for(loaded, ranks);
  check_part(loaded, parts);
  if (parts == 1) return to_bytes(assembled(std::move(loaded)));
  loaded.scene.parts = partition_objects(loaded.scene, parts);
  return to_bytes(loaded.scene);
}

void check_hashes(Communicator& comm, const std::optional<Scene>& scene) {
  const auto hashes = all_gather_value(comm, scene ? content_hash(*scene) : std::uint64_t{0});
  for (std::size_t rank = 1; rank < hashes.size(); ++rank) {
    if (hashes[rank] != hashes[0]) {
      throw Error(
          ExitCode::BadInput,
          fmt::format("rank {} holds another scene: {} instead of {}", rank, hex16(hashes[rank]), hex16(hashes[0])),
          "run the same build of hpr on every host");
    }
  }
}

}  // namespace

Scene distribute_scene(Communicator& comm, const std::function<LoadedScene()>& load) {
  std::optional<LoadedScene> loaded;
  const auto bytes = on_root(comm, [&] {
    loaded = load();
    if (comm.size() > 1) return packed(*loaded, comm.size());
    if (loaded->in_parts) check_part(*loaded, 1);
    return std::vector<std::byte>{};
  });
  if (comm.size() == 1) return assembled(*std::move(loaded));
  std::function<Mesh(std::uint32_t)> whole_mesh;
  if (loaded) whole_mesh = std::move(loaded->whole_mesh);
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
  check_hashes(comm, scene);
  if (!scene->parts.empty()) share_out(comm, whole_mesh, *scene);
  return std::move(*scene);
}

}  // namespace hpr
