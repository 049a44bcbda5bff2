#include "cluster/transport/host_memory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <limits>
#include <optional>
#include <utility>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/job_board.h"

namespace hpr {
namespace {

constexpr std::size_t kPage = 4096;

}  // namespace

/// Mapped pages: the first one has what ranks meet by.
class HostMemory::Block {
 public:
  struct Head {
    std::uint64_t token;
    std::uint32_t here;
    std::uint32_t round;
  };

  /// Of a file, or of none (-1). Null where there is no room for it.
  static std::shared_ptr<Block> map(int descriptor, std::size_t bytes) {
    const int flags = MAP_SHARED | MAP_NORESERVE | (descriptor < 0 ? MAP_ANONYMOUS : 0);
    void* const at = ::mmap(nullptr, kPage + bytes, PROT_READ | PROT_WRITE, flags, descriptor, 0);
    return at == MAP_FAILED ? nullptr : std::make_shared<Block>(static_cast<std::byte*>(at), kPage + bytes, descriptor);
  }
  /// In a file in memory that has no name: other processes open it through /proc.
  static std::shared_ptr<Block> make(std::size_t bytes) {
    const int descriptor = ::memfd_create("hpr", MFD_CLOEXEC);
    if (descriptor < 0) return nullptr;
    std::shared_ptr<Block> block;
    if (::ftruncate(descriptor, static_cast<off_t>(kPage + bytes)) == 0) block = map(descriptor, bytes);
    if (!block) ::close(descriptor);
    return block;
  }
  /// That of another process; null where it cannot be reached.
  static std::shared_ptr<Block> join(std::uint64_t process, int descriptor, std::uint64_t token, std::size_t bytes) {
    const int opened = ::open(fmt::format("/proc/{}/fd/{}", process, descriptor).c_str(), O_RDWR | O_CLOEXEC);
    if (opened < 0) return nullptr;
    std::shared_ptr<Block> block;
    // In another namespace the number may be that of another file.
    const off_t size = ::lseek(opened, 0, SEEK_END);
    if (size == static_cast<off_t>(kPage + bytes)) block = map(opened, bytes);
    if (!block) ::close(opened);
    return block && block->head().token == token ? block : nullptr;
  }

  /// Owns both.
  Block(std::byte* at, std::size_t size, int descriptor) : at_(at), size_(size), descriptor_(descriptor) {}
  ~Block() {
    ::munmap(at_, size_);
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  [[nodiscard]] Head& head() const { return *reinterpret_cast<Head*>(at_); }
  [[nodiscard]] std::span<std::byte> bytes() const { return {at_ + kPage, size_ - kPage}; }
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  std::byte* at_;
  std::size_t size_;
  int descriptor_;
};

/// What the first rank of a host tells the others.
struct HostMemory::Invitation {
  std::uint64_t process;
  std::uint64_t token;
  int descriptor;
  const std::shared_ptr<Block>* block;  ///< for ranks of the same process
};

HostMemory::HostMemory(Communicator& comm, std::size_t bytes, std::chrono::nanoseconds time_limit)
    : time_limit_(std::min(time_limit, kMaxWait)) {
  if (comm.size() > 1) block_ = find_block(comm, bytes);
  if (block_) return;
  ranks_ = 1;
  is_first_ = true;
  block_ = Block::map(-1, bytes);
  if (!block_) {
    throw Error(ExitCode::Limit, fmt::format("no addresses for {} MiB of memory", bytes >> 20U),
                "raise the limit of address space (ulimit -v)");
  }
}

HostMemory::~HostMemory() = default;

/// Null on all ranks where it fails on any.
std::shared_ptr<HostMemory::Block> HostMemory::find_block(Communicator& comm, std::size_t bytes) {
  std::shared_ptr<PeerMemory> peers;
  try {
    peers = comm.share(sizeof(Invitation));
  } catch (const Error& error) {
    if (error.code() != ExitCode::Limit) throw;
    return nullptr;  // on all ranks
  }
  int first = comm.size();
  ranks_ = 0;
  for (int rank = comm.size() - 1; rank >= 0; --rank) {
    if (peers->of(rank).empty()) continue;
    first = rank;
    ++ranks_;
  }
  is_first_ = first == comm.rank();
  std::shared_ptr<Block> block;
  const auto here = static_cast<std::uint64_t>(::getpid());
  if (is_first_) {
    block = Block::make(bytes);
    Invitation invitation{here, 0, block ? block->descriptor() : -1, &block};
    fill_random(std::as_writable_bytes(std::span(&invitation.token, 1)));
    if (block) block->head().token = invitation.token;
    std::memcpy(peers->mine().data(), &invitation, sizeof(invitation));
  }
  peers->meet();
  if (!is_first_) {
    Invitation invitation{};
    std::memcpy(&invitation, peers->of(first).data(), sizeof(invitation));
    if (invitation.process == here) {
      block = *invitation.block;
    } else if (invitation.descriptor >= 0) {
      block = Block::join(invitation.process, invitation.descriptor, invitation.token, bytes);
    }
  }
  peers->meet();  // until then the first rank's block stays
  const std::vector<int> found = all_gather_value(comm, block ? 1 : 0);
  return std::ranges::count(found, 0) == 0 ? block : nullptr;
}

std::span<std::byte> HostMemory::bytes() const {
  return block_->bytes();
}

void HostMemory::meet() {
  if (ranks_ == 1) return;
  const std::atomic_ref<std::uint32_t> here(block_->head().here);
  const std::atomic_ref<std::uint32_t> round(block_->head().round);
  const auto futex = [&](int operation, std::uint32_t value, const timespec* limit) {
    ::syscall(SYS_futex, &block_->head().round, operation, value, limit, nullptr, 0);
  };
  const std::uint32_t now = round.load();
  if (here.fetch_add(1) + 1 == static_cast<std::uint32_t>(ranks_)) {
    here.store(0);
    round.store(now + 1);
    futex(FUTEX_WAKE, static_cast<std::uint32_t>(std::numeric_limits<std::int32_t>::max()), nullptr);
    return;
  }
  const auto deadline = std::chrono::steady_clock::now() + time_limit_;
  const WaitReport wait(kOtherRanks);
  while (round.load() == now) {
    const timespec limit{.tv_sec = 0, .tv_nsec = 100'000'000};
    futex(FUTEX_WAIT, now, &limit);
    if (round.load() == now && std::chrono::steady_clock::now() > deadline) {
      throw Error(ExitCode::Hang, "not all ranks of this host met within the time limit",
                  "a rank stands still; raise --hang-timeout if it only needs longer");
    }
  }
}

void HostMemory::release(std::span<std::byte> part) {
  const auto at = reinterpret_cast<std::uintptr_t>(part.data());
  const std::uintptr_t first = (at + kPage - 1) / kPage * kPage;
  const std::uintptr_t last = (at + part.size()) / kPage * kPage;
  if (first < last) ::madvise(part.data() + (first - at), last - first, MADV_REMOVE);
}

}  // namespace hpr
