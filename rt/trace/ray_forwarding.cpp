#include "rt/trace/ray_forwarding.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <thread>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "rt/trace/ray_scene.h"
#include "scene/scene.h"

namespace hpr {
namespace {

constexpr int kHalvings = 4;
constexpr std::uint32_t kBoxTriangles = 64;

void widen(RayBox& box, const RayBox& by) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] = std::min(box.low[axis], by.low[axis]);
    box.high[axis] = std::max(box.high[axis], by.high[axis]);
  }
}

RayBox empty_box() {
  RayBox box;
  box.low.fill(std::numeric_limits<float>::infinity());
  box.high.fill(-std::numeric_limits<float>::infinity());
  return box;
}

RayBox box_of(const Scene& scene, const RaySpace& space, const InstanceRange& part) {
  const Instance& instance = scene.instances[part.instance];
  const Mesh& mesh = scene.mesh_of(instance);
  RayBox box = empty_box();
  for (std::uint32_t i = part.range.first; i < part.range.last; ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const glm::dvec3 position = space.from_world(world_position(instance, mesh.positions[mesh.triangle(i)[corner]]));
      const std::array<float, 3> at{static_cast<float>(position.x), static_cast<float>(position.y),
                                    static_cast<float>(position.z)};
      widen(box, {at, at});
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] -= kBoxSlack * std::max(1.0F, std::abs(box.low[axis]));
    box.high[axis] += kBoxSlack * std::max(1.0F, std::abs(box.high[axis]));
  }
  return box;
}

/// Halves them about the middle of the longest axis, and again, and puts boxes about what is left together.
void merge_near(std::span<RayBox> boxes, int halvings, std::vector<RayBox>& merged) {
  if (boxes.empty()) return;
  RayBox all = enclosing_box(boxes);
  if (halvings == 0 || boxes.size() == 1) {
    merged.push_back(all);
    return;
  }
  std::size_t longest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (all.high[axis] - all.low[axis] > all.high[longest] - all.low[longest]) longest = axis;
  }
  const auto median = boxes.begin() + static_cast<std::ptrdiff_t>(boxes.size() / 2);
  std::ranges::nth_element(boxes, median, {}, [&](const RayBox& box) { return box.low[longest] + box.high[longest]; });
  merge_near({boxes.begin(), median}, halvings - 1, merged);
  merge_near({median, boxes.end()}, halvings - 1, merged);
}

}  // namespace

RayBox enclosing_box(std::span<const RayBox> boxes) {
  RayBox all = empty_box();
  for (const RayBox& box : boxes) widen(all, box);
  return all;
}

std::vector<RayBox> enclosing_boxes(const Scene& scene, const RaySpace& space, std::span<const SurfaceRange> part) {
  std::vector<RayBox> small;
  for (InstanceRange piece : split_by_instance(scene, merged_ranges({part.begin(), part.end()}, scene.triangles))) {
    const std::uint32_t last = piece.range.last;
    for (std::uint32_t first = piece.range.first; first < last; first += kBoxTriangles) {
      piece.range = {first, std::min(first + kBoxTriangles, last)};
      small.push_back(box_of(scene, space, piece));
    }
  }
  std::vector<RayBox> boxes;
  merge_near(small, kHalvings, boxes);
  return boxes;
}

namespace {

/// Threads per core: a message pays off only for many rays, so more threads than cores collect them.
constexpr int kThreadsEach = 4;

Error lost() {
  return {ExitCode::Lost, "another rank failed while rays travelled", "see its own error"};
}

using Ask = RayForwarding::Ask;

/// A ray, or a surface's id.
std::size_t bytes_of_question(const RayForwarding::Kind& kind) {
  if (kind.ask == Ask::Triangles) return sizeof(std::uint32_t);
  return sizeof(RayBatch::Ray) + (kind.has_passed != 0 ? sizeof(Passed) : 0);
}

/// A bit for every shadow ray, what it met for every other one.
std::size_t bytes_of_answers(const RayForwarding::Kind& kind) {
  if (kind.ask == Ask::Shadow) return (kind.count + 7) / 8;
  return kind.count * (kind.ask == Ask::Triangles ? sizeof(TriangleRecord) : sizeof(Passed));
}

}  // namespace

/// The query of one thread: the ranks each of its rays is sent to, and the answers so far.
struct RayForwarding::Query {
  Kind kind;
  const RayBatch* rays = nullptr;
  std::span<Passed> passed = {};                    ///< of rays that look for the closest; none: they passed nothing
  std::span<std::uint8_t> blocked = {};             ///< of shadow rays
  std::vector<Passed> met = {};                     ///< by rays that look for the closest
  std::span<const std::uint32_t> surfaces = {};     ///< whose triangles are asked for
  std::vector<TriangleRecord> records = {};         ///< of those
  std::vector<std::vector<std::uint32_t>> to = {};  ///< per rank the rays or surfaces that go there
};

/// One call of for_each().
struct RayForwarding::Run {
  int threads;
  std::size_t count;
  const std::function<void(std::size_t)>& body;
  std::atomic<std::size_t> next = 0;
  int cores;  ///< that nobody works on; mutex_ guards it, and failure
  std::condition_variable core_is_free;
  std::exception_ptr failure;

  Run(int budget, std::size_t calls, const std::function<void(std::size_t)>& what)
      : threads(budget), count(calls), body(what), cores(budget) {}

  // Not a std::counting_semaphore: that of GCC 12 may sleep though it counts more than 0 (GCC bug 104928).
  void take_core(std::unique_lock<std::mutex>& lock) {
    core_is_free.wait(lock, [this] { return cores > 0; });
    --cores;
  }
  void release_core() {
    ++cores;
    core_is_free.notify_one();
  }
};

/// Rays or surfaces of one query that came from one rank, as they lie in its message, and where in the answer theirs
/// stand.
struct RayForwarding::QueryBlock {
  Kind kind;
  const std::byte* questions = nullptr;
  std::byte* answers = nullptr;
};

RayForwarding::RayForwarding(Communicator& comm, const Scene& scene, const RaySpace& space,
                             std::span<const SurfaceRange> part)
    : comm_(comm), scene_(scene) {
  const std::vector<RayBox> mine = enclosing_boxes(scene, space, part);
  boxes_ = all_gather_lists(comm, std::span(mine));
  for (const std::vector<RayBox>& boxes : boxes_) bounds_.push_back(enclosing_box(boxes));
  if (!is_shared_out(scene)) return;
  const std::vector<SurfaceRange> own = merged_ranges({part.begin(), part.end()}, scene.triangles);
  owners_ = SurfaceOwners(all_gather_lists(comm, std::span(own)));
}

std::uint32_t RayForwarding::add(const RayScene& part) {
  parts_[next_part_] = &part;
  return next_part_++;
}

std::uint64_t RayForwarding::occluded(std::uint32_t part, const RayBatch& rays, std::span<std::uint8_t> blocked) {
  Query query{.kind = {.part = part, .ask = Ask::Shadow}, .rays = &rays, .blocked = blocked};
  const std::uint64_t invalid = parts_.at(part)->occluded_local(rays, blocked);
  route(query);
  wait_for_answers(query);
  return invalid;
}

std::uint64_t RayForwarding::closest(std::uint32_t part, const RayBatch& rays, std::span<Passed> passed,
                                     std::span<std::uint32_t> surfaces) {
  const auto has_passed = static_cast<std::uint16_t>(passed.empty() ? 0 : 1);
  Query query{.kind = {.part = part, .has_passed = has_passed}, .rays = &rays, .passed = passed};
  query.met.assign(passed.begin(), passed.end());
  query.met.resize(rays.size());
  const std::uint64_t invalid = parts_.at(part)->closest_local(rays, query.met, surfaces);
  route(query);
  wait_for_answers(query);
  for (std::size_t i = 0; i < surfaces.size(); ++i) surfaces[i] = query.met[i].surface;
  if (!passed.empty()) std::ranges::copy(query.met, passed.begin());
  return invalid;
}

bool RayForwarding::is_here(std::uint32_t surface) const {
  const SurfaceLocation location = locate_surface(scene_, surface);
  return scene_.mesh_of(scene_.instances[location.instance]).holds(location.triangle);
}

std::shared_ptr<const Mesh> RayForwarding::triangle(std::uint32_t id) {
  for (;;) {
    if (auto known = triangles_.find(id)) return known;
    fetch_triangles(std::span(&id, 1));
  }
}

void RayForwarding::fetch_triangles(std::span<const std::uint32_t> ids) {
  if (owners_.is_empty()) return;
  std::vector<std::uint32_t> missing(ids.begin(), ids.end());
  std::ranges::sort(missing);
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  std::erase_if(missing, [&](std::uint32_t id) { return id == kNoSurface || is_here(id) || triangles_.find(id); });
  if (missing.empty()) return;
  Query query{.kind = {.ask = Ask::Triangles}, .surfaces = missing};
  query.records.resize(missing.size());
  query.to.resize(boxes_.size());
  for (std::uint32_t i = 0; i < missing.size(); ++i) {
    query.to[static_cast<std::size_t>(owners_.rank_of(missing[i]))].push_back(i);
  }
  wait_for_answers(query);
  for (std::size_t i = 0; i < missing.size(); ++i) {
    const Instance& instance = scene_.instances[locate_surface(scene_, missing[i]).instance];
    triangles_.add(missing[i], mesh_of(query.records[i], scene_.mesh_of(instance).material));
  }
}

/// Finds the ranks that rays are sent to once their local hits are known.
void RayForwarding::route(Query& query) const {
  // What lies at the distance of a hit may still come before it, by its id.
  constexpr float kBeyond = 1.0F + 1e-5F;
  query.to.resize(boxes_.size());
  const bool is_shadow = query.kind.ask == Ask::Shadow;
  for (std::uint32_t i = 0; i < query.rays->size(); ++i) {
    RayBatch::Ray ray = query.rays->ray(i);
    if (!is_traceable(ray) || (is_shadow && query.blocked[i] != 0)) continue;
    if (!is_shadow && query.met[i].surface != kNoSurface) {
      ray.reach = std::min(ray.reach, query.met[i].distance * kBeyond);
    }
    const BoxedRay line(ray);
    for (std::size_t rank = 0; rank < boxes_.size(); ++rank) {
      const auto meets = [&](const RayBox& box) { return line.meets(box); };
      if (static_cast<int>(rank) == comm_.rank() || !meets(bounds_[rank])) continue;
      if (std::ranges::any_of(boxes_[rank], meets)) query.to[rank].push_back(i);
    }
  }
}

/// Waits until the other ranks have answered.
void RayForwarding::wait_for_answers(Query& query) {
  if (std::ranges::all_of(query.to, [](const auto& rays) { return rays.empty(); })) return;
  std::unique_lock lock(mutex_);
  HPR_CHECK(run_ != nullptr);
  waiting_.push_back(&query);
  const std::uint64_t asked = round_;
  run_->release_core();
  if (--running_ == 0) all_waiting_.notify_one();
  answered_.wait(lock, [&] { return round_ != asked || failed_; });
  if (round_ == asked) throw lost();
  run_->take_core(lock);
}

void RayForwarding::release(bool answered) {
  const std::lock_guard lock(mutex_);
  running_ += static_cast<int>(waiting_.size());
  waiting_.clear();
  if (answered) {
    ++round_;
  } else {
    failed_ = true;
  }
  answered_.notify_all();
}

/// What one of the threads does.
void RayForwarding::work(Run& run) {
  std::unique_lock lock(mutex_);
  run.take_core(lock);
  lock.unlock();
  std::exception_ptr failure;
  try {
    for (std::size_t i = run.next++; i < run.count; i = run.next++) run.body(i);
  } catch (...) {
    run.next = run.count;
    failure = std::current_exception();
  }
  lock.lock();
  if (failure && !run.failure) run.failure = failure;
  // Who has failed may have had a core or not. One too many does no harm: others soon end as well.
  run.release_core();
  if (--running_ == 0) all_waiting_.notify_one();
}

/// Rounds until all ranks are done, or one of them has failed.
RayForwarding::State RayForwarding::run_rounds(const Run& run) {
  State all = State::Working;
  while (all == State::Working) {
    std::unique_lock lock(mutex_);
    all_waiting_.wait(lock, [&] { return running_ == 0; });
    const State mine = run.failure ? State::Failed : waiting_.empty() ? State::Done : State::Working;
    lock.unlock();
    all = round(mine, run.threads);
    release(all == State::Working);
  }
  return all;
}

void RayForwarding::for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body) {
  HPR_CHECK(run_ == nullptr);
  Run run(std::max(threads, 1), count, body);
  constexpr std::size_t kMetTogether = 2048;  // different triangles, by a thread's rays
  triangles_.set_capacity(static_cast<std::size_t>(run.threads * kThreadsEach) * kMetTogether);
  run_ = &run;
  failed_ = false;
  const std::size_t size = std::min(count, static_cast<std::size_t>(run.threads * kThreadsEach));
  running_ = static_cast<int>(size);
  State all = State::Failed;
  {
    std::vector<std::jthread> team;
    try {
      for (std::size_t i = 0; i < size; ++i) {
        team.emplace_back([this, &run, i, rank = trace::row_of_this_thread().rank] {
          const trace::InRow row({rank, static_cast<int>(i)});
          work(run);
        });
      }
      all = run_rounds(run);
    } catch (...) {
      run.failure = std::current_exception();
      release(false);
    }
  }
  run_ = nullptr;
  if (run.failure) std::rethrow_exception(run.failure);
  if (all == State::Failed) throw lost();
}

/// Writes question `i` of a query as it lies in a message.
template <typename Put>
void RayForwarding::put_question(const Query& query, std::uint32_t i, const Put& put) {
  if (query.kind.ask == Ask::Triangles) return put(query.surfaces[i]);
  put(query.rays->ray(i));
  if (query.kind.has_passed != 0) put(query.passed[i]);
}

/// For every rank: how its sender fares, and the rays that go there, query by query.
std::vector<std::vector<std::byte>> RayForwarding::pack(State mine) const {
  std::vector<std::vector<std::byte>> messages(boxes_.size());
  for (std::size_t rank = 0; rank < messages.size(); ++rank) {
    std::vector<std::byte>& message = messages[rank];
    std::size_t bytes = sizeof(MessageHeader);
    for (const Query* query : waiting_) {
      if (!query->to[rank].empty()) bytes += sizeof(Kind) + query->to[rank].size() * bytes_of_question(query->kind);
    }
    message.resize(bytes);
    std::byte* to = message.data();
    const auto put = [&](const auto& value) {
      std::memcpy(to, &value, sizeof(value));
      to += sizeof(value);
    };
    put(MessageHeader{mine, static_cast<std::uint32_t>(round_)});
    for (const Query* query : waiting_) {
      if (query->to[rank].empty()) continue;
      Kind kind = query->kind;
      kind.count = static_cast<std::uint32_t>(query->to[rank].size());
      put(kind);
      for (const std::uint32_t i : query->to[rank]) put_question(*query, i, put);
    }
  }
  return messages;
}

/// How the sender fares. Throws Error (Lost) when it is elsewhere: it has failed, and says so to others.
RayForwarding::State RayForwarding::state_in(std::span<const std::byte> message) const {
  MessageHeader head{State::Failed, 0};
  if (message.size() >= sizeof(MessageHeader)) std::memcpy(&head, message.data(), sizeof(MessageHeader));
  if (message.size() >= sizeof(MessageHeader) && head.round == static_cast<std::uint32_t>(round_)) return head.state;
  throw lost();
}

/// What lies in `message`; `answers` becomes as large as the answers to it.
void RayForwarding::unpack(std::span<const std::byte> message, std::vector<std::byte>& answers,
                           std::vector<QueryBlock>& blocks) {
  std::size_t bytes = sizeof(MessageHeader);
  const std::size_t first = blocks.size();
  for (std::size_t at = sizeof(MessageHeader); at < message.size();) {
    QueryBlock block;
    std::memcpy(&block.kind, message.data() + at, sizeof(Kind));
    block.questions = message.data() + at + sizeof(Kind);
    at += sizeof(Kind) + block.kind.count * bytes_of_question(block.kind);
    HPR_CHECK(at <= message.size());
    bytes += bytes_of_answers(block.kind);
    blocks.push_back(block);
  }
  answers.assign(bytes, std::byte{0});
  std::memcpy(answers.data(), message.data(), sizeof(MessageHeader));
  std::byte* to = answers.data() + sizeof(MessageHeader);
  for (QueryBlock& block : std::span(blocks).subspan(first)) {
    block.answers = to;
    to += bytes_of_answers(block.kind);
  }
}

RayForwarding::State RayForwarding::round(State mine, int threads) {
  const trace::Span span("rays travel");
  const std::vector<std::vector<std::byte>> arrived = all_to_all(comm_, pack(mine));
  State all = State::Done;
  for (const auto& message : arrived) {
    const State state = state_in(message);
    if (state == State::Failed) return state;
    if (state == State::Working) all = state;
  }
  if (all == State::Done) return all;

  std::vector<QueryBlock> blocks;
  std::vector<std::vector<std::byte>> answers(arrived.size());
  for (std::size_t rank = 0; rank < arrived.size(); ++rank) unpack(arrived[rank], answers[rank], blocks);
  parallel_for(threads, blocks.size(), [&](std::size_t i) { answer(blocks[i]); });
  const std::vector<std::vector<std::byte>> back = all_to_all(comm_, std::move(answers));
  for (std::size_t rank = 0; rank < back.size(); ++rank) store_answers(rank, back[rank]);
  return all;
}

void RayForwarding::answer_triangles(const QueryBlock& block) const {
  for (std::size_t i = 0; i < block.kind.count; ++i) {
    std::uint32_t id = 0;
    std::memcpy(&id, block.questions + i * sizeof(id), sizeof(id));
    const TriangleRecord record = record_of(scene_, id);
    std::memcpy(block.answers + i * sizeof(record), &record, sizeof(record));
  }
}

void RayForwarding::answer(const QueryBlock& block) const {
  if (block.kind.ask == Ask::Triangles) return answer_triangles(block);
  const DenormalsAsZero mode;
  const bool is_shadow = block.kind.ask == Ask::Shadow;
  const RayScene& scene = *parts_.at(block.kind.part);
  const std::size_t count = block.kind.count;
  RayBatch batch;
  std::vector<Passed> met(is_shadow ? 0 : count);
  const std::byte* from = block.questions;
  for (std::size_t i = 0; i < count; ++i, from += bytes_of_question(block.kind)) {
    RayBatch::Ray ray;
    std::memcpy(&ray, from, sizeof(ray));
    batch.push(ray);
    if (block.kind.has_passed != 0) std::memcpy(&met[i], from + sizeof(ray), sizeof(Passed));
  }
  if (is_shadow) {
    std::vector<std::uint8_t> blocked(count);
    (void)scene.occluded_local(batch, blocked);
    for (std::size_t i = 0; i < count; ++i) block.answers[i / 8] |= std::byte{blocked[i]} << (i % 8);
    return;
  }
  std::vector<std::uint32_t> surfaces(count);
  (void)scene.closest_local(batch, met, surfaces);
  std::memcpy(block.answers, met.data(), bytes_of_answers(block.kind));
}

/// Of one rank, in the order its questions were sent.
void RayForwarding::store_answers(std::size_t rank, std::span<const std::byte> answers) const {
  (void)state_in(answers);
  const std::byte* from = answers.data() + sizeof(MessageHeader);
  for (Query* query : waiting_) {
    const std::vector<std::uint32_t>& sent = query->to[rank];
    Kind kind = query->kind;
    kind.count = static_cast<std::uint32_t>(sent.size());
    HPR_CHECK(from + bytes_of_answers(kind) <= answers.data() + answers.size());
    for (std::size_t i = 0; i < sent.size(); ++i) {
      if (kind.ask == Ask::Triangles) {
        std::memcpy(&query->records[sent[i]], from + i * sizeof(TriangleRecord), sizeof(TriangleRecord));
        continue;
      }
      if (kind.ask == Ask::Shadow) {
        query->blocked[sent[i]] |= std::to_integer<std::uint8_t>(from[i / 8] >> (i % 8) & std::byte{1});
        continue;
      }
      Passed met;
      std::memcpy(&met, from + i * sizeof(Passed), sizeof(Passed));
      Passed& best = query->met[sent[i]];
      const bool nearer = best.surface == kNoSurface || met.distance < best.distance ||
                          (met.distance == best.distance && met.surface < best.surface);
      if (met.surface != kNoSurface && nearer) best = met;
    }
    from += bytes_of_answers(kind);
  }
}

}  // namespace hpr
