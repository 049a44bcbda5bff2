#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "rt/trace/paged_rays.h"
#include "rt/trace/ray_boxes.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/remote_triangles.h"
#include "scene/scene.h"

namespace hpr {

/// Which ranks a ray is sent to.
enum class Routing {
  ByBoxes,  ///< those whose boxes it meets before its local hit
  ToAll,    ///< all others, to compare with
};

/// What this rank asked of others since it began.
struct ForwardingCounts {
  std::uint64_t rounds = 0;
  std::uint64_t max_waiting = 0;                 ///< the most rays and triangles that waited for others at once
  std::array<std::uint64_t, kRayKinds> asked{};  ///< rays that were traced here, and triangles that were not here
  std::array<std::uint64_t, kRayKinds> hops{};   ///< of those to another rank, or to a page: a question and its answer
  std::uint64_t max_generation = 0;              ///< of what waited
};

/// Forwards rays through a scene of which every rank's Embree holds a part: a ray is sent to the remote ranks whose
/// boxes it meets before its local hit, and its remote hits come back. Two messages between any two ranks carry all
/// rays of a round, of whatever kind and generation, and their answers: 28 bytes a ray, 40 where it may have passed
/// surfaces; a bit back for a shadow ray, 12 bytes for others. Triangles that a rank does not hold come the same way.
///
/// Each thread waits for one answer at a time, and calls under way go on before others begin, those of later
/// generations first: so what waits is bounded by what the threads ask for once.
///
/// Where parts are in pages (Scene::part_pages) each page is asked as a rank of its own would be, also this rank's:
/// once a round a rank brings a page for all that waits for it, first those that are in memory.
///
/// Answers have the bits of a scene that is whole: the nearest of all ranks' hits, the lowest id among equals.
class RayForwarding {
 public:
  /// Collective. `part`: the surfaces that this rank holds, any ranges; the ranks' parts are the whole scene. `comm`
  /// and `scene` outlive this; `comm` is used by the threads that call the constructor and for_each() only.
  RayForwarding(Communicator& comm, const Scene& scene, const RaySpace& space, std::span<const SurfaceRange> part,
                Routing routing = Routing::ByBoxes);
  /// For a scene whose parts are in pages, as many on all ranks.
  RayForwarding(Communicator& comm, Scene& scene, const RaySpace& space);

  /// This rank's part of something of which every rank holds one, in the same order on all; see RayScene::share.
  /// Returns its number.
  [[nodiscard]] std::uint32_t add(const RayScene& part, std::vector<SurfaceRange> surfaces, const RayBuild& build);
  void remove(std::uint32_t part);
  /// Null where this rank's part is all in memory.
  [[nodiscard]] PagedRays* pages() { return pages_ ? &*pages_ : nullptr; }

  /// Collective, whatever each rank's `count`: calls body(i) for i in [0, count), by many threads, of which
  /// `threads` at a time do not wait for forwarded rays; as many trace the rays that arrive. Of calls of large
  /// `memory`, two for each of those are under way, of small ones kThreadsEach. Returns when all ranks are done.
  /// Rethrows the first exception a call left; the other ranks throw Error (Lost).
  void for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body,
                CallMemory memory = CallMemory::Large);
  /// From inside a body of for_each() only: calls body(i) for i in [0, count) by this thread and by those that have
  /// nothing else to do, so that their rays travel together. Rethrows the first exception a call left.
  void for_each_within(std::size_t count, const std::function<void(std::size_t)>& body);

  /// The queries of RayScene over all ranks' parts of that number; from inside a body of for_each() only. Empty
  /// `passed`: the rays have passed nothing.
  std::uint64_t occluded(std::uint32_t part, const RayBatch& rays, std::span<std::uint8_t> blocked);
  std::uint64_t closest(std::uint32_t part, const RayBatch& rays, std::span<Passed> passed,
                        std::span<std::uint32_t> surfaces);

  /// Surface `id`, of whatever rank's part, as a mesh of one triangle; from inside a body of for_each() only.
  [[nodiscard]] std::shared_ptr<const Mesh> triangle(std::uint32_t id);
  /// Gets those of some surfaces together, kNoSurface and those that are here left out, for calls of triangle() that
  /// follow; from inside a body of for_each() only.
  void fetch_triangles(std::span<const std::uint32_t> ids, std::uint16_t generation);

  /// Threads that work for a core of a rank, most of which wait.
  static constexpr int kThreadsEach = 16;
  /// Outside of for_each().
  [[nodiscard]] const ForwardingCounts& counts() const { return counts_; }

  enum class Ask : std::uint16_t {
    Closest,    ///< what rays meet first
    Shadow,     ///< whether anything stands in their way
    Triangles,  ///< what surfaces are
  };
  /// The form of a query, as messages encode it.
  struct Kind {
    std::uint32_t part = 0;
    std::uint32_t count = 0;
    Ask ask = Ask::Closest;
    std::uint16_t has_passed = 0;  ///< whether rays say what they have passed
    std::uint32_t page = 0;        ///< of the rank that is asked
  };

 private:
  struct Query;
  struct CoreWait;
  struct Bulk;
  struct Calls;
  struct Run;
  struct QueryBlock;
  enum class State : std::uint32_t { Working, Done, Failed };

  /// Starts every message; answers repeat that of their query.
  struct MessageHeader {
    State state = State::Working;
    std::uint32_t round = 0;
  };

  void route(Query& query) const;
  void wait_for_answers(Query& query);
  void count(const Query& query);
  void rest();
  void call_helpers(Run& run, std::size_t wanted);
  void call(Run& run, Calls& calls, std::size_t i, std::unique_lock<std::mutex>& lock);
  void work(Run& run);
  [[nodiscard]] State run_rounds(const Run& run);
  [[nodiscard]] State round(State mine, int threads);
  void sort_waiting();
  [[nodiscard]] std::vector<Bulk> bulks_to(std::size_t rank) const;
  void add_bulks(std::size_t holder, std::vector<Bulk>& bulks) const;
  void gather_holders(const RaySpace& space, const std::vector<std::vector<SurfaceRange>>& mine);
  [[nodiscard]] std::size_t pages_each() const { return boxes_.size() / static_cast<std::size_t>(comm_.size()); }
  [[nodiscard]] std::vector<std::vector<std::byte>> pack(State mine) const;
  [[nodiscard]] State state_in(std::span<const std::byte> message) const;
  static void unpack(std::span<const std::byte> message, std::vector<std::byte>& answers,
                     std::vector<QueryBlock>& blocks);
  void answer_all(std::span<const QueryBlock> blocks, int threads);
  void answer(const QueryBlock& block, const RayScene* scene) const;
  void store_answers(std::size_t rank, std::span<const std::byte> answers) const;
  void release(bool answered);

  template <typename Put>
  static void put_question(const Query& query, std::uint32_t i, const Put& put);
  static void store_answer(const Kind& kind, const std::byte* from, std::size_t index, Query& query, std::uint32_t i);
  [[nodiscard]] bool is_here(std::uint32_t surface) const;
  void answer_triangles(const QueryBlock& block) const;

  Communicator& comm_;
  const Scene& scene_;
  Routing routing_;
  SurfaceOwners owners_;  ///< of surfaces, where ranks hold parts of meshes
  RemoteTriangles triangles_;
  std::vector<std::vector<RayBox>> boxes_;  ///< [holder]: the ranks, or the pages of each rank in turn
  std::vector<RayBox> bounds_;              ///< all of a holder's
  std::optional<PagedRays> pages_;
  std::map<std::uint32_t, const RayScene*> parts_;
  std::uint32_t next_part_ = 0;

  std::mutex mutex_;
  std::condition_variable all_waiting_;
  Run* run_ = nullptr;  ///< inside for_each()
  std::vector<Query*> waiting_;
  ForwardingCounts counts_;
  int running_ = 0;          ///< threads of this rank that neither rest nor have ended
  std::uint64_t round_ = 0;  ///< of answers
  bool failed_ = false;
};

}  // namespace hpr
