#include "cluster/transport/mpi_communicator.h"

#include <fmt/format.h>
#include <linux/futex.h>
#include <mpi.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <exception>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/job_board.h"
#include "core/job_environment.h"

namespace hpr {
namespace {

/// Throws Error (Lost) with MPI's message when `call`, which returned `code`, failed.
void check_mpi(int code, const char* call) {
  if (code == MPI_SUCCESS) return;
  std::string text(MPI_MAX_ERROR_STRING, '\0');
  int length = 0;
  MPI_Error_string(code, text.data(), &length);
  text.resize(static_cast<std::size_t>(length));
  throw Error(ExitCode::Lost, fmt::format("{}: {}", call, text),
              "see the other ranks' messages; a host or rank may be gone");
}

/// ", in composite" in an error.
std::string in_phase() {
  const std::string_view phase = current_phase();
  return phase.empty() ? "" : fmt::format(", in {}", phase);
}

/// Where Open MPI keeps shared windows. More than it has room for would end in a bus error at the first touch.
constexpr const char* kSharedMemoryFolder = "/dev/shm";

/// Bytes left in kSharedMemoryFolder; the largest number where windows live elsewhere.
std::uint64_t free_shared_memory() {
  struct statvfs there {};
  if (::statvfs(kSharedMemoryFolder, &there) != 0) return std::numeric_limits<std::uint64_t>::max();
  return static_cast<std::uint64_t>(there.f_bavail) * there.f_frsize;
}

/// Collective. Whether the ranks of this host outnumber the cores that the system lets any of them run on.
bool ranks_outnumber_cores(MPI_Comm comm) {
  MPI_Comm host = MPI_COMM_NULL;
  check_mpi(MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &host), "MPI_Comm_split_type");
  int ranks = 0;
  check_mpi(MPI_Comm_size(host, &ranks), "MPI_Comm_size");
  std::array<cpu_set_t, 2> cores{};  // of this rank, of all ranks of the host
  for (cpu_set_t& set : cores) CPU_ZERO(&set);
  const bool is_known = sched_getaffinity(0, sizeof(cpu_set_t), cores.data()) == 0;
  check_mpi(MPI_Allreduce(cores.data(), cores.data() + 1, sizeof(cpu_set_t), MPI_BYTE, MPI_BOR, host), "MPI_Allreduce");
  MPI_Comm_free(&host);
  return is_known && CPU_COUNT(&cores[1]) < ranks;
}

constexpr std::uint64_t kMinTags = 32768;  ///< that any MPI has

constexpr int kPopulateWrite = 23;  ///< MADV_POPULATE_WRITE of Linux 5.14, which older headers lack

/// Whom a rank waits for in a call that needs all ranks of a communicator.
int awaited_in(MPI_Comm comm) {
  int rank = 0;
  int size = 1;
  check_mpi(MPI_Comm_rank(comm, &rank), "MPI_Comm_rank");
  check_mpi(MPI_Comm_size(comm, &size), "MPI_Comm_size");
  return size == 2 ? 1 - rank : kOtherRanks;
}

/// One MPI-3 shared window per host: every rank of the host has a zeroed part of it. Constructing it is collective over
/// `comm`, and whoever reads what another rank was given waits for all ranks to have returned. Throws Error (Limit)
/// when MPI cannot allocate it. A meeting lasts `hang_timeout` at most; `frame`: the one that this rank is in.
class WindowMemory final : public PeerMemory {
 public:
  WindowMemory(MPI_Comm comm, std::size_t bytes, std::chrono::nanoseconds hang_timeout,
               std::shared_ptr<const std::uint64_t> frame)
      : hang_timeout_(hang_timeout), frame_(std::move(frame)), awaited_(awaited_in(comm)) {
    const WaitReport wait(awaited_);
    check_mpi(MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &host_), "MPI_Comm_split_type");
    check_mpi(MPI_Comm_size(host_, &ranks_here_), "MPI_Comm_size");
    MPI_Info info = MPI_INFO_NULL;
    check_mpi(MPI_Info_create(&info), "MPI_Info_create");
    MPI_Info_set(info, "alloc_shared_noncontig", "true");  // each part starts at a page
    void* memory = nullptr;
    const int code =
        MPI_Win_allocate_shared(static_cast<MPI_Aint>(sizeof(Meeting) + bytes), 1, info, host_, &memory, &window_);
    MPI_Info_free(&info);
    if (code != MPI_SUCCESS) {
      throw Error(ExitCode::Limit, fmt::format("no {} MiB of shared memory for each rank of this host", bytes >> 20U),
                  "enlarge /dev/shm, or choose another strategy than shared-memory");
    }
    check_mpi(MPI_Win_lock_all(MPI_MODE_NOCHECK, window_), "MPI_Win_lock_all");
    const std::span part(static_cast<std::byte*>(memory), sizeof(Meeting) + bytes);
    std::ranges::fill(part, std::byte{0});
    mine_ = part.subspan(sizeof(Meeting));
    find_parts(comm, bytes);
  }
  ~WindowMemory() override {
    // Freeing is collective: after a failure the peers may never come, and the job ends anyway.
    if (std::uncaught_exceptions() != exceptions_at_birth_) return;
    const WaitReport wait(awaited_);
    MPI_Win_unlock_all(window_);
    MPI_Win_free(&window_);
    MPI_Comm_free(&host_);
  }
  WindowMemory(const WindowMemory&) = delete;
  WindowMemory& operator=(const WindowMemory&) = delete;

  [[nodiscard]] std::span<std::byte> mine() override { return mine_; }
  [[nodiscard]] std::span<std::byte> of(int rank) override { return parts_.at(static_cast<std::size_t>(rank)); }

  void meet() override {
    MPI_Win_sync(window_);
    const std::atomic_ref<std::uint32_t> here(meeting_->here);
    const std::atomic_ref<std::uint32_t> round(meeting_->round);
    const std::uint32_t now = round.load();
    std::atomic_ref(own_->frame).store(*frame_);
    if (here.fetch_add(1) + 1 == static_cast<std::uint32_t>(ranks_here_)) {
      check_frames();
      here.store(0);
      round.store(now + 1);
      futex(FUTEX_WAKE, std::numeric_limits<int>::max(), nullptr);
    } else {
      sleep_past(round, now);
    }
    MPI_Win_sync(window_);
  }

 private:
  /// A barrier's counters, at the start of each part; those of the host's first rank are used.
  struct alignas(64) Meeting {
    std::uint32_t here;
    std::uint32_t round;
    std::uint64_t frame;  ///< in which the part's rank came to its last meeting
  };

  /// For the last rank to come, while the others wait.
  void check_frames() const {
    for (std::size_t rank = 0; rank < parts_.size(); ++rank) {
      if (parts_[rank].data() == nullptr) continue;
      check_frame(rank_, *frame_, static_cast<int>(rank), std::atomic_ref(meeting_of(parts_[rank])->frame).load());
    }
  }
  static Meeting* meeting_of(std::span<std::byte> part) {
    return reinterpret_cast<Meeting*>(part.data() - sizeof(Meeting));
  }

  void sleep_past(const std::atomic_ref<std::uint32_t>& round, std::uint32_t now) {
    const auto deadline = std::chrono::steady_clock::now() + hang_timeout_;
    // Ranks that have a core each come soon; falling asleep and being woken would take longer than that.
    const int spins = static_cast<unsigned>(ranks_here_) <= std::thread::hardware_concurrency() ? 20'000 : 0;
    int tries = 0;
    while (round.load() == now && tries < spins) ++tries;
    const WaitReport wait(awaited_);
    while (round.load() == now) {
      const timespec limit{.tv_sec = 1, .tv_nsec = 0};
      futex(FUTEX_WAIT, static_cast<int>(now), &limit);
      if (std::chrono::steady_clock::now() > deadline) {
        throw Error(ExitCode::Hang, "not all ranks of this host met within the time limit",
                    "a rank stands still; raise --hang-timeout if it only needs longer");
      }
    }
  }
  void futex(int operation, int value, const timespec* limit) {
    ::syscall(SYS_futex, &meeting_->round, operation, value, limit, nullptr, 0);
  }

  [[nodiscard]] std::byte* part_of(int local) const {
    MPI_Aint size = 0;
    int unit = 0;
    void* start = nullptr;
    check_mpi(MPI_Win_shared_query(window_, local, &size, &unit, &start), "MPI_Win_shared_query");
    return static_cast<std::byte*>(start);
  }

  /// The parts of the ranks of `comm` that are on this host.
  void find_parts(MPI_Comm comm, std::size_t bytes) {
    MPI_Group all = MPI_GROUP_NULL;
    MPI_Group here = MPI_GROUP_NULL;
    check_mpi(MPI_Comm_group(comm, &all), "MPI_Comm_group");
    check_mpi(MPI_Comm_group(host_, &here), "MPI_Comm_group");
    int ranks = 0;
    check_mpi(MPI_Comm_size(comm, &ranks), "MPI_Comm_size");
    check_mpi(MPI_Comm_rank(comm, &rank_), "MPI_Comm_rank");
    for (int rank = 0; rank < ranks; ++rank) {
      int local = MPI_UNDEFINED;
      check_mpi(MPI_Group_translate_ranks(all, 1, &rank, here, &local), "MPI_Group_translate_ranks");
      if (local == MPI_UNDEFINED) {
        parts_.emplace_back();
      } else {
        parts_.emplace_back(part_of(local) + sizeof(Meeting), bytes);
      }
    }
    // Whose tiles a rank merges differs from frame to frame: without this every frame would meet pages it has not
    // mapped yet. Older kernels lack the call and map them one by one.
    for (const std::span<std::byte> part : parts_) {
      if (!part.empty()) (void)::madvise(part.data() - sizeof(Meeting), part.size() + sizeof(Meeting), kPopulateWrite);
    }
    meeting_ = reinterpret_cast<Meeting*>(part_of(0));
    own_ = meeting_of(mine_);
    MPI_Group_free(&here);
    MPI_Group_free(&all);
  }

  std::chrono::nanoseconds hang_timeout_;
  MPI_Comm host_ = MPI_COMM_NULL;
  MPI_Win window_ = MPI_WIN_NULL;
  int ranks_here_ = 1;
  std::span<std::byte> mine_;
  std::vector<std::span<std::byte>> parts_;  ///< per rank
  Meeting* meeting_ = nullptr;
  Meeting* own_ = nullptr;
  int rank_ = 0;
  std::shared_ptr<const std::uint64_t> frame_;
  int awaited_ = kOtherRanks;  ///< in meetings
  int exceptions_at_birth_ = std::uncaught_exceptions();
};

}  // namespace

MpiCommunicator::MpiCommunicator(MPI_Comm parent, std::chrono::nanoseconds hang_timeout, std::size_t part_bytes)
    : MpiCommunicator(
          Owned{},
          [&] {
            MPI_Comm copy = MPI_COMM_NULL;
            check_mpi(MPI_Comm_dup(parent, &copy), "MPI_Comm_dup");
            return copy;
          }(),
          hang_timeout, part_bytes, std::make_shared<std::uint64_t>(0), ranks_outnumber_cores(parent)) {}

MpiCommunicator::MpiCommunicator(Owned /*tag*/, MPI_Comm comm, std::chrono::nanoseconds hang_timeout,
                                 std::size_t part_bytes, std::shared_ptr<std::uint64_t> frame, bool is_crowded)
    : comm_(comm),
      hang_timeout_(std::min(hang_timeout, kMaxWait)),
      part_bytes_(part_bytes),
      frame_(std::move(frame)),
      is_crowded_(is_crowded) {
  HPR_CHECK(part_bytes_ > 0 && part_bytes_ % sizeof(std::uint64_t) == 0 && part_bytes_ <= kMaxPartBytes);
  check_mpi(MPI_Comm_set_errhandler(comm_, MPI_ERRORS_RETURN), "MPI_Comm_set_errhandler");
  check_mpi(MPI_Comm_rank(comm_, &rank_), "MPI_Comm_rank");
  check_mpi(MPI_Comm_size(comm_, &size_), "MPI_Comm_size");
  int* most = nullptr;
  int is_set = 0;
  check_mpi(MPI_Comm_get_attr(MPI_COMM_WORLD, MPI_TAG_UB, static_cast<void*>(&most), &is_set), "MPI_Comm_get_attr");
  tags_ = is_set != 0 ? static_cast<std::uint64_t>(*most) + 1 : kMinTags;
}

void MpiCommunicator::check_tag(int from, int tag) {
  if (tag == this->tag()) return;
  abandoned_ = true;
  // Of the frames that have this tag, the one nearest to this rank's.
  const std::uint64_t behind = (*frame_ % tags_ + tags_ - static_cast<std::uint64_t>(tag)) % tags_;
  const bool is_ahead = behind > tags_ / 2 || behind > *frame_;
  check_frame(rank_, *frame_, from, is_ahead ? *frame_ + (tags_ - behind) : *frame_ - behind);
}

MpiCommunicator::~MpiCommunicator() {
  // After a failed call MPI may still hold buffers that are gone by now; freeing would let it write to them. The job
  // ends anyway.
  if (!abandoned_ && std::uncaught_exceptions() == exceptions_at_birth_) MPI_Comm_free(&comm_);
}

template <typename Done>
void MpiCommunicator::poll(Done done, std::string_view doing, int peer) {
  constexpr std::chrono::milliseconds kWorthTelling{100};
  constexpr unsigned kSpins = 64;
  constexpr unsigned kLooksAwake = 128;
  const auto begin = std::chrono::steady_clock::now();
  bool reported = false;
  for (unsigned tries = 0; !done(); ++tries) {
    // Other threads may want the core: after a short spin each failed look gives it away. A rank that keeps looking
    // still takes half of it where ranks share one, so these sleep.
    if (tries < kSpins) continue;
    if (is_crowded_ && tries >= kLooksAwake) {
      std::this_thread::sleep_for(std::chrono::microseconds{10});
    } else {
      sched_yield();
    }
    if (tries % 256 != 0) continue;
    const auto waited = std::chrono::steady_clock::now() - begin;
    if (!reported && waited > kWorthTelling) {
      report_wait(peer);
      reported = true;
    }
    if (waited <= hang_timeout_) continue;
    abandoned_ = true;
    throw Error(ExitCode::Hang,
                fmt::format("rank {} on {}: still {} rank {} after {:.1f} s{}", rank_, host_name(), doing, peer,
                            std::chrono::duration<double>(hang_timeout_).count(), in_phase()),
                "a rank stands still; raise --hang-timeout if it only needs longer");
  }
  if (reported) report_wait(std::nullopt);
}

void MpiCommunicator::wait(std::vector<MPI_Request>& requests, std::string_view doing, int peer) {
  poll(
      [&] {
        int all = 0;
        check_mpi(MPI_Testall(static_cast<int>(requests.size()), requests.data(), &all, MPI_STATUSES_IGNORE),
                  "MPI_Testall");
        return all != 0;
      },
      doing, peer);
}

void MpiCommunicator::start_send(std::span<const std::byte> message, int to, std::vector<MPI_Request>& requests) {
  while (true) {
    // The last part is the first one shorter than a full one; it may be empty.
    const auto part = message.first(std::min(message.size(), part_bytes_));
    requests.push_back(MPI_REQUEST_NULL);
    check_mpi(MPI_Isend(part.data(), static_cast<int>(part.size()), MPI_BYTE, to, tag(), comm_, &requests.back()),
              "MPI_Isend");
    if (part.size() < part_bytes_) return;
    message = message.subspan(part_bytes_);
  }
}

void MpiCommunicator::send(std::span<const std::byte> message, int to) {
  std::vector<MPI_Request> requests;
  start_send(message, to, requests);
  wait(requests, "sending to", to);
}

std::size_t MpiCommunicator::next_part(int from, MPI_Message& part) {
  MPI_Status status;
  poll(
      [&] {
        int found = 0;
        check_mpi(MPI_Improbe(from, MPI_ANY_TAG, comm_, &found, &part, &status), "MPI_Improbe");
        return found != 0;
      },
      "waiting for a message from", from);
  check_tag(from, status.MPI_TAG);
  int count = 0;
  check_mpi(MPI_Get_count(&status, MPI_BYTE, &count), "MPI_Get_count");
  return static_cast<std::size_t>(count);
}

std::vector<std::byte> MpiCommunicator::receive(int from) {
  std::vector<std::byte> message;
  while (true) {
    MPI_Message part = MPI_MESSAGE_NULL;
    const std::size_t size = next_part(from, part);
    message.resize(message.size() + size);
    std::vector<MPI_Request> request{MPI_REQUEST_NULL};
    check_mpi(
        MPI_Imrecv(message.data() + (message.size() - size), static_cast<int>(size), MPI_BYTE, &part, request.data()),
        "MPI_Imrecv");
    wait(request, "receiving from", from);
    if (size < part_bytes_) return message;
  }
}

void MpiCommunicator::receive(std::span<std::byte> message, int from) {
  std::size_t done = 0;
  while (true) {
    MPI_Message part = MPI_MESSAGE_NULL;
    const std::size_t size = next_part(from, part);
    if (size > message.size() - done || (size < part_bytes_ && done + size != message.size())) {
      throw Error(ExitCode::Internal, fmt::format("rank {} expected {} bytes from rank {}, got {}", rank_,
                                                  message.size(), from, done + size));
    }
    std::vector<MPI_Request> request{MPI_REQUEST_NULL};
    check_mpi(MPI_Imrecv(message.data() + done, static_cast<int>(size), MPI_BYTE, &part, request.data()), "MPI_Imrecv");
    wait(request, "receiving from", from);
    done += size;
    if (size < part_bytes_) return;
  }
}

bool MpiCommunicator::advance(Incoming& incoming) {
  while (true) {
    int done = 0;
    if (incoming.request == MPI_REQUEST_NULL) {
      MPI_Message part = MPI_MESSAGE_NULL;
      MPI_Status status;
      check_mpi(MPI_Improbe(incoming.from, MPI_ANY_TAG, comm_, &done, &part, &status), "MPI_Improbe");
      if (done == 0) return false;
      check_tag(incoming.from, status.MPI_TAG);
      int count = 0;
      check_mpi(MPI_Get_count(&status, MPI_BYTE, &count), "MPI_Get_count");
      incoming.last_part = static_cast<std::size_t>(count);
      check_mpi(
          MPI_Imrecv(incoming.buffer.extend(incoming.last_part).data(), count, MPI_BYTE, &part, &incoming.request),
          "MPI_Imrecv");
    }
    check_mpi(MPI_Test(&incoming.request, &done, MPI_STATUS_IGNORE), "MPI_Test");
    if (done == 0) return false;
    if (incoming.last_part < part_bytes_) return true;
  }
}

void MpiCommunicator::exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) {
  std::vector<MPI_Request> sends;
  for (const Outgoing& outgoing : out) {
    start_send(outgoing.message, outgoing.to, sends);
    for (const auto segment : outgoing.segments) start_send(segment, outgoing.to, sends);
  }
  std::vector<std::unique_ptr<Incoming>> waited;
  for (const int rank : from) {
    if (idle_.empty()) idle_.push_back(std::make_unique<Incoming>());
    waited.push_back(std::move(idle_.back()));
    idle_.pop_back();
    waited.back()->from = rank;
    waited.back()->buffer.clear();
  }
  while (!waited.empty()) {
    auto whole = waited.end();
    poll(
        [&] {
          // Every message is moved on before one is handed out, so that the network works while this rank merges.
          for (auto it = waited.begin(); it != waited.end(); ++it) {
            if (advance(**it)) {
              whole = it;
              return true;
            }
          }
          return false;
        },
        "waiting for a message from", waited.front()->from);
    std::unique_ptr<Incoming> message = std::move(*whole);
    waited.erase(whole);
    arrived(message->from, message->buffer.bytes());
    idle_.push_back(std::move(message));
  }
  if (!sends.empty()) wait(sends, "sending to", out.front().to);
}

void MpiCommunicator::check_frames(int root) {
  const std::array<std::uint64_t, 2> mine{*frame_, ~*frame_};
  std::array<std::uint64_t, 2> most{};
  std::vector<MPI_Request> request{MPI_REQUEST_NULL};
  check_mpi(MPI_Ireduce(mine.data(), most.data(), 2, MPI_UINT64_T, MPI_MAX, root, comm_, request.data()),
            "MPI_Ireduce");
  wait(request, "reducing to", root);
  if (rank_ != root || (most[0] == *frame_ && ~most[1] == *frame_)) return;
  throw Error(ExitCode::Internal,
              fmt::format("rank {} is in frame {} and reduces with ranks in frames {} to {}", rank_, *frame_, ~most[1],
                          most[0]),
              "a rank left out a frame or did one twice: please report this with the command line");
}

void MpiCommunicator::reduce_max(std::span<std::uint64_t> values, int root) {
  check_frames(root);
  const std::size_t most = part_bytes_ / sizeof(std::uint64_t);
  std::vector<std::uint64_t> result(rank_ == root ? std::min(values.size(), most) : 0);
  while (!values.empty()) {
    const auto part = values.first(std::min(values.size(), most));
    std::vector<MPI_Request> request{MPI_REQUEST_NULL};
    check_mpi(MPI_Ireduce(part.data(), result.data(), static_cast<int>(part.size()), MPI_UINT64_T, MPI_MAX, root, comm_,
                          request.data()),
              "MPI_Ireduce");
    wait(request, "reducing to", root);
    if (rank_ == root) std::copy_n(result.begin(), part.size(), part.begin());
    values = values.subspan(part.size());
  }
}

std::unique_ptr<Communicator> MpiCommunicator::subset(std::span<const int> members) {
  MPI_Group all = MPI_GROUP_NULL;
  MPI_Group some = MPI_GROUP_NULL;
  MPI_Comm comm = MPI_COMM_NULL;
  check_mpi(MPI_Comm_group(comm_, &all), "MPI_Comm_group");
  check_mpi(MPI_Group_incl(all, static_cast<int>(members.size()), members.data(), &some), "MPI_Group_incl");
  {
    const WaitReport wait(members.size() == 2 ? members[members[0] == rank_ ? 1 : 0] : kOtherRanks);
    check_mpi(MPI_Comm_create_group(comm_, some, members.front(), &comm), "MPI_Comm_create_group");
  }
  MPI_Group_free(&some);
  MPI_Group_free(&all);
  return std::unique_ptr<Communicator>(
      new MpiCommunicator(Owned{}, comm, hang_timeout_, part_bytes_, frame_, is_crowded_));
}

std::shared_ptr<PeerMemory> MpiCommunicator::share(std::size_t bytes) {
  // Every rank of the host will take as much; all ranks must decide alike, so the tightest host decides.
  constexpr std::uint64_t kBookkeeping = std::uint64_t{1} << 20U;
  const std::vector<std::uint64_t> room = all_gather_value(*this, free_shared_memory());
  const std::uint64_t least = std::ranges::min(room);
  const std::uint64_t needed = (bytes + kBookkeeping) * static_cast<std::uint64_t>(size_);
  if (needed > least) {
    throw Error(ExitCode::Limit,
                fmt::format("{} ranks need {} MiB of shared memory, {} has {} MiB left", size_, needed >> 20U,
                            kSharedMemoryFolder, least >> 20U),
                "enlarge /dev/shm (docker run --shm-size), or choose another strategy than shared-memory");
  }
  auto memory = std::make_shared<WindowMemory>(comm_, bytes, hang_timeout_, frame_);
  barrier(*this);  // every part is zero before any rank writes to one
  return memory;
}

std::string mpi_version() {
  std::string text(MPI_MAX_LIBRARY_VERSION_STRING, '\0');
  int length = 0;
  check_mpi(MPI_Get_library_version(text.data(), &length), "MPI_Get_library_version");
  text.resize(static_cast<std::size_t>(length));
  // What follows the first comma or line break says who built it, where and when.
  return text.substr(0, text.find_first_of(",\n"));
}

}  // namespace hpr
