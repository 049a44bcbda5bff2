#include "rt/trace/ray_forwarding.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <thread>
#include <tuple>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/timing.h"
#include "rt/trace/ray_scene.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// Calls of large memory that are under way, per core.
constexpr int kLargeCallsEach = 2;

/// What is answered together by one thread.
constexpr std::uint32_t kMaxBulk = 4096;

/// Precedence to cores, beside the generation of rays: the end of what other calls wait for, and calls not begun yet.
constexpr int kEnds = 1 << 16;
constexpr int kBegins = -1;

/// Different triangles that a call of large memory meets before it comes to use them.
constexpr std::size_t kFetchedTogether = 1024;

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

/// A thread that waits for a core.
struct RayForwarding::CoreWait {
  int precedence = 0;
  bool has_core = false;
  std::condition_variable may_go_on = {};
};

/// The query of one thread: the ranks each of its rays is sent to, and the answers so far.
struct RayForwarding::Query {
  Kind kind;
  RayPurpose purpose;
  const RayBatch* rays = nullptr;
  std::span<Passed> passed = {};                    ///< of rays that look for the closest; none: they passed nothing
  std::span<std::uint8_t> blocked = {};             ///< of shadow rays
  std::vector<Passed> met = {};                     ///< by rays that look for the closest
  std::span<const std::uint32_t> surfaces = {};     ///< whose triangles are asked for
  std::vector<TriangleRecord> records = {};         ///< of those
  std::vector<std::vector<std::uint32_t>> to = {};  ///< per rank the rays or surfaces that go there
  CoreWait wait = {.precedence = purpose.generation};
  bool is_answered = false;

  [[nodiscard]] std::size_t size() const { return rays != nullptr ? rays->size() : surfaces.size(); }
};

/// Queries of one form, as they lie in a message: later generations first.
struct RayForwarding::Bulk {
  Kind kind;
  std::vector<Query*> queries = {};
};

/// The calls of one for_each(), or of one for_each_within(). RayForwarding::mutex_ guards all of it.
struct RayForwarding::Calls {
  std::size_t count;
  const std::function<void(std::size_t)>& body;
  std::size_t next = 0;  ///< the first that nobody makes yet
  std::size_t left;      ///< that have not returned
  std::exception_ptr failure = nullptr;
  bool is_waited_for = false;  ///< by a thread that rests
  std::condition_variable are_done = {};

  Calls(std::size_t calls, const std::function<void(std::size_t)>& what) : count(calls), body(what), left(calls) {}

  /// Those that nobody makes yet are left out.
  void drop() {
    left -= count - next;
    next = count;
  }
};

/// One call of for_each(). RayForwarding::mutex_ guards what changes.
struct RayForwarding::Run {
  int threads;
  Calls all;
  std::size_t max_under_way;  ///< of those
  std::size_t under_way = 0;
  std::vector<Calls*> within = {};       ///< of for_each_within(), latest last: what other calls wait for
  int cores;                             ///< that nobody works on
  std::vector<CoreWait*> for_core = {};  ///< in the order they came; none where a core is free
  std::size_t idle = 0;                  ///< threads that have no call to make
  std::size_t called = 0;                ///< of those that were, how many are to look for calls and don't yet
  bool is_over = false;
  std::condition_variable may_go_on = {};  ///< idle ones

  Run(int budget, std::size_t calls, const std::function<void(std::size_t)>& what, std::size_t most)
      : threads(budget), all(calls, what), max_under_way(most), cores(budget) {}

  /// What a thread is to do next.
  [[nodiscard]] Calls* next_calls() {
    while (!within.empty() && within.back()->next == within.back()->count) within.pop_back();
    if (!within.empty()) return within.back();
    return all.next < all.count && under_way < max_under_way ? &all : nullptr;
  }

  /// Lets `wait` go on as soon as there is a core for it.
  void queue(CoreWait& wait) {
    for_core.push_back(&wait);
    if (cores == 0) return;
    --cores;
    release_core();
  }
  void take_core(int precedence, std::unique_lock<std::mutex>& lock) {
    CoreWait wait{.precedence = precedence};
    queue(wait);
    wait.may_go_on.wait(lock, [&] { return wait.has_core; });
  }
  /// Hands the core to whom it is due: later generations first, so that few calls wait.
  void release_core() {
    if (for_core.empty()) {
      ++cores;
      return;
    }
    const auto next = std::ranges::max_element(for_core, {}, &CoreWait::precedence);
    (*next)->has_core = true;
    (*next)->may_go_on.notify_one();
    for_core.erase(next);
  }
  /// Whether a thread waits for a core that has begun what it does.
  [[nodiscard]] bool has_begun_calls() const {
    return std::ranges::any_of(for_core, [](const CoreWait* wait) { return wait->precedence > kBegins; });
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
                             std::span<const SurfaceRange> part, Routing routing)
    : comm_(comm), scene_(scene), routing_(routing) {
  gather_holders(space, {merged_ranges({part.begin(), part.end()}, scene.triangles)});
}

RayForwarding::RayForwarding(Communicator& comm, Scene& scene, const RaySpace& space)
    : comm_(comm), scene_(scene), routing_(Routing::ByBoxes) {
  pages_.emplace(scene, space);
  std::vector<std::vector<SurfaceRange>> mine;
  for (std::size_t page = 0; page < pages_->pages(); ++page) {
    mine.push_back(merged_ranges({pages_->surfaces(page).begin(), pages_->surfaces(page).end()}, scene.triangles));
  }
  gather_holders(space, mine);
}

/// Collective. Finds the boxes of all ranks' parts, and of which holder each surface is. `mine`: this rank's part, or
/// its pages.
void RayForwarding::gather_holders(const RaySpace& space, const std::vector<std::vector<SurfaceRange>>& mine) {
  const auto ranks = static_cast<std::size_t>(comm_.size());
  const bool finds_owners = is_shared_out(scene_);
  std::vector<std::vector<SurfaceRange>> owned(ranks * mine.size());
  boxes_.resize(ranks * mine.size());
  for (std::size_t page = 0; page < mine.size(); ++page) {
    std::vector<RayBox> boxes;
    const auto find_boxes = [&] { boxes = enclosing_boxes(scene_, space, mine[page]); };
    agree_on_failure(comm_, [&] { pages_ ? pages_->with(page, find_boxes) : find_boxes(); });
    const auto all_boxes = all_gather_lists(comm_, std::span(std::as_const(boxes)));
    for (std::size_t rank = 0; rank < ranks; ++rank) boxes_[rank * mine.size() + page] = all_boxes[rank];
    if (!finds_owners) continue;
    const auto all_surfaces = all_gather_lists(comm_, std::span(mine[page]));
    for (std::size_t rank = 0; rank < ranks; ++rank) owned[rank * mine.size() + page] = all_surfaces[rank];
  }
  for (const std::vector<RayBox>& boxes : boxes_) bounds_.push_back(enclosing_box(boxes));
  if (finds_owners) owners_ = SurfaceOwners(owned);
}

std::uint32_t RayForwarding::add(const RayScene& part, std::vector<SurfaceRange> surfaces, const RayBuild& build) {
  if (pages_) pages_->add(next_part_, std::move(surfaces), build);
  parts_[next_part_] = &part;
  return next_part_++;
}

void RayForwarding::remove(std::uint32_t part) {
  if (pages_) pages_->remove(part);
  parts_.erase(part);
}

std::uint64_t RayForwarding::occluded(std::uint32_t part, const RayBatch& rays, std::span<std::uint8_t> blocked) {
  Query query{.kind = {.part = part, .ask = Ask::Shadow}, .purpose = rays.purpose, .rays = &rays, .blocked = blocked};
  const std::uint64_t invalid = parts_.at(part)->occluded_local(rays, blocked);
  route(query);
  wait_for_answers(query);
  return invalid;
}

std::uint64_t RayForwarding::closest(std::uint32_t part, const RayBatch& rays, std::span<Passed> passed,
                                     std::span<std::uint32_t> surfaces) {
  const auto has_passed = static_cast<std::uint16_t>(passed.empty() ? 0 : 1);
  Query query{
      .kind = {.part = part, .has_passed = has_passed}, .purpose = rays.purpose, .rays = &rays, .passed = passed};
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
    fetch_triangles(std::span(&id, 1), 0);
  }
}

void RayForwarding::fetch_triangles(std::span<const std::uint32_t> ids, std::uint16_t generation) {
  if (owners_.is_empty()) return;
  std::vector<std::uint32_t> missing(ids.begin(), ids.end());
  std::ranges::sort(missing);
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  std::erase_if(missing, [&](std::uint32_t id) { return id == kNoSurface || is_here(id) || triangles_.find(id); });
  if (missing.empty()) return;
  Query query{.kind = {.ask = Ask::Triangles}, .purpose = {RayKind::Triangles, generation}, .surfaces = missing};
  query.records.resize(missing.size());
  query.to.resize(boxes_.size());
  for (std::uint32_t i = 0; i < missing.size(); ++i) {
    query.to[owners_.holder_of(missing[i])].push_back(i);
  }
  wait_for_answers(query);
  for (std::size_t i = 0; i < missing.size(); ++i) {
    const Instance& instance = scene_.instances[locate_surface(scene_, missing[i]).instance];
    triangles_.add(missing[i], mesh_of(query.records[i], scene_.mesh_of(instance).material));
  }
}

/// Finds the holders that rays are sent to once their local hits are known.
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
    for (std::size_t holder = 0; holder < boxes_.size(); ++holder) {
      const auto meets = [&](const RayBox& box) { return line.meets(box); };
      if (!pages_ && static_cast<int>(holder) == comm_.rank()) continue;
      if (routing_ == Routing::ToAll || (meets(bounds_[holder]) && std::ranges::any_of(boxes_[holder], meets))) {
        query.to[holder].push_back(i);
      }
    }
  }
}

void RayForwarding::count(const Query& query) {
  const auto kind = static_cast<std::size_t>(query.purpose.kind);
  counts_.asked.at(kind) += query.size();
  for (const auto& rays : query.to) counts_.hops.at(kind) += rays.size();
}

/// Waits until the other ranks have answered.
void RayForwarding::wait_for_answers(Query& query) {
  std::unique_lock lock(mutex_);
  HPR_CHECK(run_ != nullptr);
  count(query);
  if (std::ranges::all_of(query.to, [](const auto& rays) { return rays.empty(); })) return;
  if (failed_) throw lost();
  waiting_.push_back(&query);
  run_->release_core();
  rest();
  query.wait.may_go_on.wait(lock, [&] { return query.wait.has_core; });
  if (!query.is_answered) throw lost();
}

/// The threads that wait for answers go on, as there are cores for them. Without answers no further call begins.
void RayForwarding::release(bool answered) {
  const std::lock_guard lock(mutex_);
  running_ += static_cast<int>(waiting_.size());
  ++round_;
  if (!answered) {
    failed_ = true;
    run_->all.drop();
  }
  for (Query* query : std::exchange(waiting_, {})) {
    query->is_answered = answered;
    run_->queue(query->wait);
  }
}

/// This thread rests from now on, until another one counts it as running again.
void RayForwarding::rest() {
  if (--running_ == 0) all_waiting_.notify_one();
}

void RayForwarding::call_helpers(Run& run, std::size_t wanted) {
  const std::size_t count = std::min(wanted, run.idle);
  run.idle -= count;
  run.called += count;
  running_ += static_cast<int>(count);
  for (std::size_t i = 0; i < count; ++i) run.may_go_on.notify_one();
}

/// Makes call `i`, the next one of `calls`.
void RayForwarding::call(Run& run, Calls& calls, std::size_t i, std::unique_lock<std::mutex>& lock) {
  calls.next = i + 1;
  const bool is_large = &calls == &run.all;
  if (is_large) ++run.under_way;
  lock.unlock();
  std::exception_ptr failure;
  try {
    calls.body(i);
  } catch (...) {
    failure = std::current_exception();
  }
  lock.lock();
  if (is_large) --run.under_way;
  if (failure) {
    if (!calls.failure) calls.failure = failure;
    calls.drop();
  }
  if (--calls.left > 0 || !calls.is_waited_for) return;
  ++running_;
  calls.are_done.notify_one();
}

/// What one of the threads does.
void RayForwarding::work(Run& run) {
  std::unique_lock lock(mutex_);
  run.take_core(kBegins, lock);
  while (true) {
    if (Calls* const calls = run.next_calls()) {
      if (calls == &run.all && run.has_begun_calls()) {
        run.release_core();
        run.take_core(kBegins, lock);
        continue;
      }
      call(run, *calls, calls->next, lock);
      continue;
    }
    run.release_core();
    ++run.idle;
    rest();
    run.may_go_on.wait(lock, [&] { return run.called > 0 || run.is_over; });
    if (run.is_over) return;
    --run.called;
    run.take_core(0, lock);
  }
}

void RayForwarding::for_each_within(std::size_t count, const std::function<void(std::size_t)>& body) {
  if (count == 0) return;
  Calls calls(count, body);
  std::unique_lock lock(mutex_);
  HPR_CHECK(run_ != nullptr);
  Run& run = *run_;
  run.within.push_back(&calls);
  call_helpers(run, count - 1);
  while (calls.next < calls.count) call(run, calls, calls.next, lock);
  std::erase(run.within, &calls);
  if (calls.left > 0) {
    calls.is_waited_for = true;
    run.release_core();
    rest();
    calls.are_done.wait(lock, [&] { return calls.left == 0; });
    run.take_core(kEnds, lock);
  }
  if (calls.failure) std::rethrow_exception(calls.failure);
}

/// Rounds until all ranks are done, or one of them has failed.
RayForwarding::State RayForwarding::run_rounds(const Run& run) {
  State all = State::Working;
  while (all == State::Working) {
    std::unique_lock lock(mutex_);
    all_waiting_.wait(lock, [&] { return running_ == 0; });
    const State mine = run.all.failure ? State::Failed : waiting_.empty() ? State::Done : State::Working;
    sort_waiting();
    lock.unlock();
    all = round(mine, run.threads);
    release(all == State::Working);
  }
  return all;
}

void RayForwarding::for_each(int threads, std::size_t count, const std::function<void(std::size_t)>& body,
                             CallMemory memory) {
  HPR_CHECK(run_ == nullptr);
  const auto cores = static_cast<std::size_t>(std::max(threads, 1));
  const std::size_t team_size = count > 0 ? cores * kThreadsEach : 0;
  const std::size_t large = cores * kLargeCallsEach;
  Run run(static_cast<int>(cores), count, body, memory == CallMemory::Large ? large : team_size);
  triangles_.set_capacity(team_size * kFetchedTogether);
  run_ = &run;
  failed_ = false;
  running_ = static_cast<int>(team_size);
  State all = State::Failed;
  {
    std::vector<std::jthread> team;
    try {
      for (std::size_t i = 0; i < team_size; ++i) {
        team.emplace_back([this, &run, i, rank = trace::row_of_this_thread().rank] {
          const trace::InRow row({rank, static_cast<int>(i)});
          work(run);
        });
      }
      all = run_rounds(run);
    } catch (...) {
      {
        const std::lock_guard lock(mutex_);
        if (!run.all.failure) run.all.failure = std::current_exception();
      }
      release(false);
    }
    const std::lock_guard lock(mutex_);
    run.is_over = true;
    run.may_go_on.notify_all();
  }
  run_ = nullptr;
  if (run.all.failure) std::rethrow_exception(run.all.failure);
  if (all == State::Failed) throw lost();
}

/// Writes question `i` of a query as it lies in a message.
template <typename Put>
void RayForwarding::put_question(const Query& query, std::uint32_t i, const Put& put) {
  if (query.kind.ask == Ask::Triangles) return put(query.surfaces[i]);
  put(query.rays->ray(i));
  if (query.kind.has_passed != 0) put(query.passed[i]);
}

/// Queries of one form beside each other, and of these later generations first.
void RayForwarding::sort_waiting() {
  std::ranges::stable_sort(waiting_, std::ranges::greater{}, [](const Query* query) {
    return std::tuple(query->kind.ask, query->kind.part, query->kind.has_passed, query->purpose.generation);
  });
  ++counts_.rounds;
  std::uint64_t waiting = 0;
  for (const Query* query : waiting_) {
    waiting += query->size();
    counts_.max_generation = std::max<std::uint64_t>(counts_.max_generation, query->purpose.generation);
  }
  counts_.max_waiting = std::max(counts_.max_waiting, waiting);
}

/// What waits for `rank`, in bulk, whatever it is for.
std::vector<RayForwarding::Bulk> RayForwarding::bulks_to(std::size_t rank) const {
  std::vector<Bulk> bulks;
  for (std::size_t page = 0; page < pages_each(); ++page) add_bulks(rank * pages_each() + page, bulks);
  return bulks;
}

void RayForwarding::add_bulks(std::size_t holder, std::vector<Bulk>& bulks) const {
  const auto page = static_cast<std::uint32_t>(holder % pages_each());
  for (Query* query : waiting_) {
    const auto count = static_cast<std::uint32_t>(query->to[holder].size());
    if (count == 0) continue;
    const auto continues = [&](const Kind& kind) {
      return kind.page == page && kind.ask == query->kind.ask && kind.part == query->kind.part &&
             kind.has_passed == query->kind.has_passed && kind.count + count <= kMaxBulk;
    };
    if (bulks.empty() || !continues(bulks.back().kind)) {
      bulks.push_back({query->kind});
      bulks.back().kind.page = page;
    }
    bulks.back().kind.count += count;
    bulks.back().queries.push_back(query);
  }
}

/// For every rank: how its sender fares, and what goes there.
std::vector<std::vector<std::byte>> RayForwarding::pack(State mine) const {
  std::vector<std::vector<std::byte>> messages(static_cast<std::size_t>(comm_.size()));
  for (std::size_t rank = 0; rank < messages.size(); ++rank) {
    const std::vector<Bulk> bulks = bulks_to(rank);
    std::vector<std::byte>& message = messages[rank];
    std::size_t bytes = sizeof(MessageHeader);
    for (const Bulk& bulk : bulks) bytes += sizeof(Kind) + bulk.kind.count * bytes_of_question(bulk.kind);
    message.resize(bytes);
    std::byte* to = message.data();
    const auto put = [&](const auto& value) {
      std::memcpy(to, &value, sizeof(value));
      to += sizeof(value);
    };
    put(MessageHeader{mine, static_cast<std::uint32_t>(round_)});
    for (const Bulk& bulk : bulks) {
      put(bulk.kind);
      for (const Query* query : bulk.queries) {
        for (const std::uint32_t i : query->to[rank * pages_each() + bulk.kind.page]) put_question(*query, i, put);
      }
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
  answer_all(blocks, threads);
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

/// Page by page, where this rank's part is in some.
void RayForwarding::answer_all(std::span<const QueryBlock> blocks, int threads) {
  if (!pages_) {
    parallel_for(threads, blocks.size(), [&](std::size_t i) {
      const Kind& kind = blocks[i].kind;
      answer(blocks[i], kind.ask == Ask::Triangles ? nullptr : parts_.at(kind.part));
    });
    return;
  }
  for (const std::size_t page : pages_->nearest_first()) {
    std::vector<const QueryBlock*> of_page;
    for (const QueryBlock& block : blocks) {
      if (block.kind.page == page) of_page.push_back(&block);
    }
    if (of_page.empty()) continue;
    pages_->with(page, [&] {
      std::vector<const RayScene*> scenes;
      for (const QueryBlock* block : of_page) {
        const Kind& kind = block->kind;
        scenes.push_back(kind.ask == Ask::Triangles ? nullptr : &pages_->ray_scene(page, kind.part, threads));
      }
      parallel_for(threads, of_page.size(), [&](std::size_t i) { answer(*of_page[i], scenes[i]); });
    });
  }
}

/// `asked`: what rays are to meet; null where none are asked for.
void RayForwarding::answer(const QueryBlock& block, const RayScene* asked) const {
  if (block.kind.ask == Ask::Triangles) return answer_triangles(block);
  const DenormalsAsZero mode;
  const bool is_shadow = block.kind.ask == Ask::Shadow;
  const RayScene& scene = *asked;
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

/// The answer to question `i` of a query, at `index` among those from `from` on.
void RayForwarding::store_answer(const Kind& kind, const std::byte* from, std::size_t index, Query& query,
                                 std::uint32_t i) {
  if (kind.ask == Ask::Triangles) {
    std::memcpy(&query.records[i], from + index * sizeof(TriangleRecord), sizeof(TriangleRecord));
    return;
  }
  if (kind.ask == Ask::Shadow) {
    query.blocked[i] |= std::to_integer<std::uint8_t>(from[index / 8] >> (index % 8) & std::byte{1});
    return;
  }
  Passed met;
  std::memcpy(&met, from + index * sizeof(Passed), sizeof(Passed));
  Passed& best = query.met[i];
  const bool nearer = best.surface == kNoSurface || met.distance < best.distance ||
                      (met.distance == best.distance && met.surface < best.surface);
  if (met.surface != kNoSurface && nearer) best = met;
}

/// Of one rank, in the order its questions were sent.
void RayForwarding::store_answers(std::size_t rank, std::span<const std::byte> answers) const {
  (void)state_in(answers);
  const std::byte* from = answers.data() + sizeof(MessageHeader);
  for (const Bulk& bulk : bulks_to(rank)) {
    HPR_CHECK(from + bytes_of_answers(bulk.kind) <= answers.data() + answers.size());
    std::size_t index = 0;
    for (Query* query : bulk.queries) {
      for (const std::uint32_t i : query->to[rank * pages_each() + bulk.kind.page]) {
        store_answer(bulk.kind, from, index++, *query, i);
      }
    }
    from += bytes_of_answers(bulk.kind);
  }
}

}  // namespace hpr
