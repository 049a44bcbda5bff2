#include "cluster/distribution/scene_distribution.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <optional>
#include <utility>

#include "cluster/distribution/assignment.h"
#include "cluster/distribution/texture_distribution.h"
#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "scene/mesh_reader.h"
#include "scene/pages/part_pages.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

/// Rank 0 sends meshes when so many bytes of them wait.
constexpr std::size_t kBatchBytes = std::size_t{16} << 20U;

using ReadMesh = std::function<std::unique_ptr<MeshReader>(std::uint32_t)>;

/// Takes the triangles out of the meshes that not all ranks hold; where those were read whole, they are kept apart.
void strip(LoadedScene& loaded) {
  if (loaded.read_mesh) return;
  auto kept = std::make_shared<std::vector<Mesh>>(loaded.scene.meshes.size());
  for (std::size_t i = 0; i < kept->size(); ++i) {
    Mesh& mesh = loaded.scene.meshes[i];
    if (is_held_by_all(loaded.scene, mesh)) continue;
    (*kept)[i] = std::move(mesh);
    mesh = without_triangles((*kept)[i]);
  }
  loaded.read_mesh = [kept](std::uint32_t mesh) { return std::make_unique<WholeMeshReader>(std::move((*kept)[mesh])); };
}

/// A mesh of a scene that has no triangles there, to be read once more.
std::unique_ptr<MeshReader> open_mesh(const ReadMesh& read_mesh, const Scene& scene, std::uint32_t mesh) {
  std::unique_ptr<MeshReader> whole = read_mesh(mesh);
  whole->name = scene.meshes[mesh].name;
  whole->material = scene.meshes[mesh].material;
  if (content_hash(*whole) != scene.meshes[mesh].partial->content) {
    throw Error(ExitCode::BadInput, fmt::format("{}: mesh {} changed while it was read", scene.name, mesh),
                "leave the file alone until it is loaded");
  }
  return whole;
}

/// Puts a scene together again that was read mesh by mesh.
Scene assembled(LoadedScene loaded) {
  for (std::uint32_t i = 0; i < loaded.scene.meshes.size(); ++i) {
    if (loaded.scene.meshes[i].partial) loaded.scene.meshes[i] = open_mesh(loaded.read_mesh, loaded.scene, i)->take();
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

/// How a scene is cut. Ranks agree on it: it goes into a message.
struct PartPlan {
  std::uint64_t parts = 1;
  std::uint64_t pages = 0;  ///< of each part; 0: all of it is in memory
  std::uint64_t room = 0;   ///< bytes for pages
};

/// Pages that are to be in memory at a time: rays of neighboring tiles then mostly meet the same ones.
constexpr std::uint64_t kPagesInMemory = 16;
/// More would come and go all the time.
constexpr std::uint64_t kMaxPages = 256;

/// Chooses pages where one of so many parts is too large for a rank. As parts are cut between chunks of triangles,
/// there are no more pages than chunks.
PartPlan plan_of(const LoadedScene& loaded, int parts) {
  PartPlan plan{static_cast<std::uint64_t>(parts)};
  const std::uint64_t held_by_all = memory_of(loaded.scene);
  const std::uint64_t needed = memory_of_part(loaded.scene, parts) - held_by_all;
  if (!loaded.in_pages || needed + held_by_all <= loaded.memory_limit || held_by_all >= loaded.memory_limit)
    return plan;
  const std::uint64_t room = loaded.memory_limit - held_by_all;
  const std::uint64_t pages = (kPagesInMemory * needed + room - 1) / room;
  if (pages > kMaxPages) return plan;
  const std::uint64_t chunks = (loaded.scene.triangles / plan.parts + kPartChunk - 1) / kPartChunk;
  return {plan.parts, std::clamp<std::uint64_t>(pages, 2, std::max<std::uint64_t>(chunks, 2)), room};
}

/// Throws Error (Limit) for one of so many parts of a scene, which is too large for a rank.
[[noreturn]] void refuse_part(const LoadedScene& loaded, int parts) {
  const std::uint64_t needed = memory_of_part(loaded.scene, parts);
  const std::uint64_t held_by_all = memory_of(loaded.scene);
  const std::string what = parts == 1 ? "the scene" : fmt::format("each of {} parts of the scene", parts);
  const std::string says =
      fmt::format("{} needs {} bytes, more than the limit of {}", what, needed, loaded.memory_limit);
  if (held_by_all >= loaded.memory_limit) {
    throw Error(ExitCode::Limit, says, "raise --limit-mem: that much of it every rank needs");
  }
  const std::uint64_t shared = whole_memory_of(loaded.scene) - held_by_all;
  const std::uint64_t room = loaded.memory_limit - held_by_all;
  if (!loaded.in_pages) {
    throw Error(ExitCode::Limit, says,
                fmt::format("use at least {} ranks, keep pages of it on disk with --data paged, or raise --limit-mem",
                            (shared + room - 1) / room));
  }
  const std::uint64_t at_most = room * kMaxPages / kPagesInMemory;  // that pages make possible
  throw Error(ExitCode::Limit,
              fmt::format("{}, and than {} pages that fit into it {} at a time", says, kMaxPages, kPagesInMemory),
              fmt::format("use at least {} ranks, or raise --limit-mem", (shared + at_most - 1) / at_most));
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
/// A piece of a mesh follows (PartPieces).
struct MeshHeader {
  std::uint64_t bytes = 0;
  std::uint64_t page = 0;  ///< of the part; 0 where it has none
  PagePiece piece;
  std::uint32_t unused = 0;
};

/// Where a piece goes that came: into the scene, or to the disk.
void keep_piece(Scene& scene, const MeshHeader& header, std::span<const std::byte> bytes) {
  if (scene.part_pages) return scene.part_pages->add(header.page, header.piece, bytes);
  append_piece(scene.meshes.at(header.piece.mesh), mesh_from_bytes(bytes), header.piece.vertices,
               header.piece.triangles);
}

/// One of rank 0, which nobody sent.
void keep_own_piece(Scene& scene, const MeshHeader& header, Mesh piece) {
  if (!scene.part_pages) {
    append_piece(scene.meshes.at(header.piece.mesh), std::move(piece), header.piece.vertices, header.piece.triangles);
    return;
  }
  ByteBuffer bytes;
  append_bytes(piece, bytes);
  keep_piece(scene, header, bytes.bytes());
}

/// The messages of a round.
class MeshBatch {
 public:
  explicit MeshBatch(int ranks) : messages_(static_cast<std::size_t>(ranks)) { clear(); }

  /// For all ranks that hold one part: made into bytes once. `header` lacks their number.
  void add(std::span<const std::size_t> ranks, MeshHeader header, const Mesh& mesh) {
    if (ranks.empty()) return;
    ByteBuffer& message = messages_[ranks.front()];
    const std::size_t before = message.size();
    message.extend(sizeof(MeshHeader));
    append_bytes(mesh, message);
    header.bytes = message.size() - before - sizeof(MeshHeader);
    std::memcpy(&message.bytes()[before], &header, sizeof(header));
    const std::span<const std::byte> added = message.bytes().subspan(before);
    for (const std::size_t rank : ranks.subspan(1)) {
      std::memcpy(messages_[rank].extend(added.size()).data(), added.data(), added.size());
    }
    waiting_ += ranks.size() * header.bytes;
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
      keep_piece(scene, mesh, rest.subspan(sizeof(mesh), mesh.bytes));
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

using WantedTriangles = std::vector<std::vector<std::vector<SurfaceRange>>>;  // by part, or its page, and mesh

/// Adds the parts of a mesh to what ranks are sent, piece by piece; rank 0 takes its own.
void add_parts(Communicator& comm, MeshReader& whole, std::uint32_t number, const WantedTriangles& wanted, Scene& scene,
               MeshBatch& batch) {
  const std::shared_ptr<const PartialMesh> partial = scene.meshes[number].partial;
  const auto ranks = static_cast<std::size_t>(comm.size());
  const std::size_t pages = wanted.size() / scene.parts.size();
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i][number].empty()) continue;
    const std::size_t part = i / pages;
    std::vector<std::size_t> holders;
    for (std::size_t rank = part; rank < ranks; rank += scene.parts.size()) {
      if (rank > 0) holders.push_back(rank);
    }
    PartPieces pieces(whole, wanted[i][number], *partial);
    while (std::optional<Mesh> piece = pieces.next()) {
      const MeshHeader header{0, i % pages, {number, pieces.vertices(), pieces.triangles()}};
      batch.add(holders, header, *piece);
      if (part == 0) keep_own_piece(scene, header, *std::move(piece));
      if (batch.is_full()) batch.send(comm, More::Comes);
    }
  }
}

/// On rank 0: reads the meshes of `scene` one by one and sends each rank what it holds.
void send_meshes(Communicator& comm, const ReadMesh& read_mesh, Scene& scene, MeshBatch& batch) {
  WantedTriangles wanted;
  for (const auto& part : scene.pages.empty() ? scene.parts : scene.pages) wanted.push_back(triangles_of(scene, part));
  for (std::uint32_t i = 0; i < scene.meshes.size(); ++i) {
    const auto is_unwanted = [&](const auto& of_part) { return of_part[i].empty(); };
    if (!scene.meshes[i].partial || std::ranges::all_of(wanted, is_unwanted)) continue;
    add_parts(comm, *open_mesh(read_mesh, scene, i), i, wanted, scene, batch);
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
void share_out(Communicator& comm, const ReadMesh& read_mesh, const PartPlan& plan, Scene& scene) {
  std::optional<Error> failure;
  agree_on_failure(comm, [&] {
    const std::size_t part = static_cast<std::size_t>(comm.rank()) % plan.parts;
    if (plan.pages > 0) scene.part_pages = std::make_shared<PartPages>(part, plan.pages);
  });
  if (comm.rank() == 0) {
    MeshBatch batch(comm.size());
    failure = failure_of([&] { send_meshes(comm, read_mesh, scene, batch); });
    batch.send(comm, failure ? More::Failed : More::Done);
  } else {
    receive_meshes(comm, scene, failure);
  }
  agree_on_failure(comm, [&] {
    if (failure) throw Error(*failure);
    if (scene.part_pages) scene.part_pages->keep_in(plan.room);
  });
}

/// Makes a scene ready for ranks that hold parts of it, in one part where none is wanted.
PartPlan prepare_parts(LoadedScene& loaded, int ranks) {
  if (!loaded.in_parts) return {};
  if (ranks > 1 || loaded.in_pages) strip(loaded);
  const int parts = ranks > 1 ? parts_for(loaded, ranks) : 1;
  const PartPlan plan = plan_of(loaded, parts);
  if (plan.pages == 0 && memory_of_part(loaded.scene, parts) > loaded.memory_limit) refuse_part(loaded, parts);
  return plan;
}

/// What a part leaves of a rank's memory to texels that may come and go.
std::uint64_t room_for_texels(const LoadedScene& loaded, const PartPlan& plan) {
  const std::uint64_t part = memory_of_part(loaded.scene, static_cast<int>(plan.parts));
  return loaded.memory_limit > part ? loaded.memory_limit - part : 0;
}

/// Cuts a scene into parts, and these into pages where it is to have some.
void cut(Scene& scene, const PartPlan& plan) {
  const std::uint64_t pages = std::max<std::uint64_t>(plan.pages, 1);
  std::vector<std::vector<SurfaceRange>> pieces = partition_objects(scene, static_cast<int>(plan.parts * pages));
  if (plan.pages == 0) {
    scene.parts = std::move(pieces);
    return;
  }
  scene.parts.resize(plan.parts);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    std::vector<SurfaceRange>& part = scene.parts[i / pages];
    part.insert(part.end(), pieces[i].begin(), pieces[i].end());
  }
  for (std::vector<SurfaceRange>& part : scene.parts) part = merged_ranges(std::move(part), scene.triangles);
  scene.pages = std::move(pieces);
}

/// As bytes for all ranks, in parts where that is wanted.
std::vector<std::byte> packed(LoadedScene& loaded, const PartPlan& plan) {
  if (!loaded.in_parts) return to_bytes(loaded.scene);
  if (plan.parts == 1 && plan.pages == 0) return to_bytes(assembled(std::move(loaded)));
  cut(loaded.scene, plan);
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
  TextureContents textures;
  std::uint64_t room = 0;
  PartPlan plan;
  const auto bytes = on_root(comm, [&] {
    loaded = load();
    plan = prepare_parts(*loaded, comm.size());
    room = room_for_texels(*loaded, plan);
    const bool travels = comm.size() > 1 || plan.pages > 0;
    const bool is_complete = std::ranges::count(loaded->sources, nullptr) == std::ssize(loaded->sources);
    if (travels || !is_complete) textures = take_texels(*loaded);
    return travels ? packed(*loaded, plan) : std::vector<std::byte>{};
  });
  plan = all_gather_value(comm, plan).front();
  if (comm.size() == 1 && plan.pages == 0) {
    Scene scene = assembled(*std::move(loaded));
    if (!textures.texels.empty()) share_textures(comm, std::move(textures), room, scene);
    return scene;
  }
  ReadMesh read_mesh;
  if (loaded) read_mesh = std::move(loaded->read_mesh);
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
  if (!scene->parts.empty()) share_out(comm, read_mesh, plan, *scene);
  share_textures(comm, std::move(textures), room, *scene);
  return std::move(*scene);
}

}  // namespace hpr
