#pragma once

#include <algorithm>
#include <array>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/remote_triangles.h"
#include "scene/scene.h"

namespace hpr {

/// Axis-aligned, in ray space.
struct RayBox {
  std::array<float, 3> low{};
  std::array<float, 3> high{};
};

/// Boxes are wider by this much of the larger of their coordinates and the scene, so that no rounding on the way to a
/// triangle, through an instance's coordinates too, takes it out of its box.
inline constexpr float kBoxSlack = 1e-4F;

/// About all of them.
[[nodiscard]] RayBox enclosing_box(std::span<const RayBox> boxes);

/// Boxes about the surfaces of `part`, 16 at most: few enough to be tried one by one, many enough that empty space
/// between surfaces is left out.
[[nodiscard]] std::vector<RayBox> enclosing_boxes(const Scene& scene, const RaySpace& space,
                                                  std::span<const SurfaceRange> part);

/// A ray as boxes are met by it.
struct BoxedRay {
  std::array<float, 3> origin;
  std::array<float, 3> per_step;  ///< 1 / direction
  float reach;

  explicit BoxedRay(const RayBatch::Ray& ray) : origin(ray.origin), per_step(), reach(ray.reach) {
    for (std::size_t axis = 0; axis < 3; ++axis) per_step[axis] = 1.0F / ray.direction[axis];
  }

  /// Or nearly. What is no number, of a line along a box's side, excludes nothing: the first argument stays.
  [[nodiscard]] bool meets(const RayBox& box) const {
    float from = 0.0F;
    float to = reach;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float a = (box.low[axis] - origin[axis]) * per_step[axis];
      const float b = (box.high[axis] - origin[axis]) * per_step[axis];
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    }
    return from <= to + kBoxSlack * std::max(1.0F, to);
  }
};

/// Forwards rays through a scene of which every rank's Embree holds a part: a ray is sent to the remote ranks whose
/// boxes it meets before its local hit, and its remote hits come back. Two messages between any two ranks carry all
/// rays of a round, of whatever kind and generation, and their answers: 28 bytes a ray, 40 where it may have passed
/// surfaces; a bit back for a shadow ray, 12 bytes for others. Triangles that a rank does not hold come the same way.
///
/// Answers have the bits of a scene that is whole: the nearest of all ranks' hits, the lowest id among equals.
class RayForwarding {
 public:
  /// Collective. `part`: the surfaces that this rank holds, any ranges; the ranks' parts are the whole scene. `comm`
  /// and `scene` outlive this; `comm` is used by the threads that call the constructor and for_each() only.
  RayForwarding(Communicator& comm, const Scene& scene, const RaySpace& space, std::span<const SurfaceRange> part);

  /// This rank's part of something of which every rank holds one, in the same order on all. Returns its number.
  [[nodiscard]] std::uint32_t add(const RayScene& part);
  void remove(std::uint32_t part) { parts_.erase(part); }

  /// Collective, whatever each rank's `count`: calls body(i) for i in [0, count), by many threads, of which
  /// `threads` at a time do not wait for forwarded rays; as many trace the rays that arrive. Returns when all ranks are
  /// done. Rethrows the first exception a call left; the other ranks throw Error (Lost).
  void for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body);

  /// The queries of RayScene over all ranks' parts of that number; from inside a body of for_each() only. Empty
  /// `passed`: the rays have passed nothing.
  std::uint64_t occluded(std::uint32_t part, const RayBatch& rays, std::span<std::uint8_t> blocked);
  std::uint64_t closest(std::uint32_t part, const RayBatch& rays, std::span<Passed> passed,
                        std::span<std::uint32_t> surfaces);

  /// Surface `id`, of whatever rank's part, as a mesh of one triangle; from inside a body of for_each() only.
  [[nodiscard]] std::shared_ptr<const Mesh> triangle(std::uint32_t id);
  /// Gets those of some surfaces together, kNoSurface and those that are here left out, for calls of triangle() that
  /// follow; from inside a body of for_each() only.
  void fetch_triangles(std::span<const std::uint32_t> ids);

  enum class Ask : std::uint16_t {
    Closest,    ///< what rays meet first
    Shadow,     ///< whether anything stands in their way
    Triangles,  ///< what surfaces are
  };
  /// The kind of a query, as messages encode it.
  struct Kind {
    std::uint32_t part = 0;
    std::uint32_t count = 0;
    Ask ask = Ask::Closest;
    std::uint16_t has_passed = 0;  ///< whether rays say what they have passed
  };

 private:
  struct Query;
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
  void work(Run& run);
  [[nodiscard]] State run_rounds(const Run& run);
  [[nodiscard]] State round(State mine, int threads);
  [[nodiscard]] std::vector<std::vector<std::byte>> pack(State mine) const;
  [[nodiscard]] State state_in(std::span<const std::byte> message) const;
  static void unpack(std::span<const std::byte> message, std::vector<std::byte>& answers,
                     std::vector<QueryBlock>& blocks);
  void answer(const QueryBlock& block) const;
  void store_answers(std::size_t rank, std::span<const std::byte> answers) const;
  void release(bool answered);

  template <typename Put>
  static void put_question(const Query& query, std::uint32_t i, const Put& put);
  [[nodiscard]] bool is_here(std::uint32_t surface) const;
  void answer_triangles(const QueryBlock& block) const;

  Communicator& comm_;
  const Scene& scene_;
  SurfaceOwners owners_;  ///< of surfaces, where ranks hold parts of meshes
  RemoteTriangles triangles_;
  std::vector<std::vector<RayBox>> boxes_;  ///< [rank]
  std::vector<RayBox> bounds_;              ///< all of a rank's
  std::map<std::uint32_t, const RayScene*> parts_;
  std::uint32_t next_part_ = 0;

  std::mutex mutex_;
  std::condition_variable all_waiting_;
  std::condition_variable answered_;
  Run* run_ = nullptr;  ///< inside for_each()
  std::vector<Query*> waiting_;
  int running_ = 0;          ///< threads of this rank that neither rest nor have ended
  std::uint64_t round_ = 0;  ///< of answers
  bool failed_ = false;
};

}  // namespace hpr
