#include "cluster/transport/window_memory.h"

#include <fmt/format.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <limits>
#include <span>
#include <thread>
#include <vector>

#include "cluster/transport/mpi_error.h"
#include "core/error.h"

namespace hpr {
namespace {

constexpr int kPopulateWrite = 23;  ///< MADV_POPULATE_WRITE of Linux 5.14, which older headers lack

/// One MPI-3 shared window: every rank of the host has a part of it.
class WindowMemory final : public PeerMemory {
 public:
  WindowMemory(MPI_Comm comm, std::size_t bytes, std::chrono::nanoseconds hang_timeout) : hang_timeout_(hang_timeout) {
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
    if (here.fetch_add(1) + 1 == static_cast<std::uint32_t>(ranks_here_)) {
      here.store(0);
      round.store(now + 1);
      futex(FUTEX_WAKE, std::numeric_limits<int>::max(), nullptr);
    } else {
      sleep_past(round, now);
    }
    MPI_Win_sync(window_);
  }

 private:
  /// At the start of each part; that of the host's first rank is used.
  struct alignas(64) Meeting {
    std::uint32_t here;
    std::uint32_t round;
  };

  void sleep_past(const std::atomic_ref<std::uint32_t>& round, std::uint32_t now) {
    const auto deadline = std::chrono::steady_clock::now() + hang_timeout_;
    // Ranks that have a core each come soon; falling asleep and being woken would take longer than that.
    const int spins = static_cast<unsigned>(ranks_here_) <= std::thread::hardware_concurrency() ? 20'000 : 0;
    for (int tries = 0; round.load() == now; ++tries) {
      if (tries < spins) continue;
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
  int exceptions_at_birth_ = std::uncaught_exceptions();
};

}  // namespace

std::uint64_t free_shared_memory() {
  struct statvfs there {};
  if (::statvfs(kSharedMemoryFolder, &there) != 0) return std::numeric_limits<std::uint64_t>::max();
  return static_cast<std::uint64_t>(there.f_bavail) * there.f_frsize;
}

std::shared_ptr<PeerMemory> make_window_memory(MPI_Comm comm, std::size_t bytes,
                                               std::chrono::nanoseconds hang_timeout) {
  return std::make_shared<WindowMemory>(comm, bytes, hang_timeout);
}

}  // namespace hpr
