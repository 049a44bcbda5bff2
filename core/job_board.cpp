#include "core/job_board.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string_view>

#include "core/bytes.h"
#include "core/job_environment.h"

namespace hpr {
namespace {

using Text = std::array<char, 64>;

constexpr std::int32_t kNobody = -1;
constexpr std::uint64_t kMagic = 0x3164'7262'7270'6800;

/// Two processes see it. Each field is read for itself: a report may be half an older one.
struct alignas(64) Slot {
  std::uint64_t magic = kMagic;  ///< first
  Text host{};
  Text phase{};
  std::atomic<std::int64_t> frame = -1;
  std::atomic<std::int32_t> awaited = kNobody;
  std::atomic<std::uint64_t> steps = 0;
  std::atomic<std::int64_t> stall_limit_ns = 0;
  std::atomic<std::uint64_t> error = 0;   ///< of the first slot: the hash of the first error that a rank claimed
  std::atomic<std::int32_t> process = 0;  ///< set last; 0: it has not started
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

std::atomic<Slot*> mine = nullptr;
std::atomic<Slot*> first = nullptr;
thread_local bool reports = false;  ///< this thread is its rank's main one
thread_local const char* this_phase = "";

void put(Text& to, std::string_view text) {
  const std::size_t length = std::min(text.size(), to.size() - 1);
  std::memcpy(to.data(), text.data(), length);
  to.at(length) = '\0';
}

std::string text_of(const Text& text) {
  return {text.data(), ::strnlen(text.data(), text.size())};
}

Slot* reported_to() {
  return reports ? mine.load(std::memory_order_relaxed) : nullptr;
}

}  // namespace

std::string describe(int rank, const RankReport& report) {
  std::string text = fmt::format("rank {} on {}: ", rank, report.host);
  text += report.phase.empty() ? "between phases" : report.phase;
  if (report.frame) text += fmt::format(" of frame {}", *report.frame);
  if (report.awaited_rank == kOtherRanks) return text + ", waiting for other ranks";
  if (report.awaited_rank) text += fmt::format(", waiting for rank {}", *report.awaited_rank);
  return text;
}

JobBoard::JobBoard(int ranks) : ranks_(ranks) {
  const std::size_t bytes = static_cast<std::size_t>(ranks) * sizeof(Slot);
  memory_ = ::memfd_create("hpr-job-board", MFD_CLOEXEC);
  if (memory_ < 0 || ::ftruncate(memory_, static_cast<off_t>(bytes)) != 0) return;
  void* const mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory_, 0);
  if (mapped == MAP_FAILED) return;
  slots_ = mapped;
  for (int rank = 0; rank < ranks; ++rank) new (static_cast<Slot*>(slots_) + rank) Slot;
  // On another host that path would lead to somebody else's file.
  address_ = fmt::format("{}:/proc/{}/fd/{}", host_name(), ::getpid(), memory_);
}

JobBoard::~JobBoard() {
  if (slots_ != nullptr) ::munmap(slots_, static_cast<std::size_t>(ranks_) * sizeof(Slot));
  if (memory_ >= 0) ::close(memory_);
}

std::optional<RankReport> JobBoard::read(int rank) const {
  if (slots_ == nullptr) return std::nullopt;
  const Slot& slot = static_cast<const Slot*>(slots_)[rank];
  RankReport report;
  report.process = slot.process.load();
  if (report.process == 0) return std::nullopt;
  report.host = text_of(slot.host);
  report.phase = text_of(slot.phase);
  if (const std::int64_t frame = slot.frame.load(); frame >= 0) report.frame = static_cast<std::uint64_t>(frame);
  if (const int awaited = slot.awaited.load(); awaited != kNobody) report.awaited_rank = awaited;
  report.steps = slot.steps.load();
  report.stall_limit = std::chrono::nanoseconds(slot.stall_limit_ns.load());
  return report;
}

void join_job_board(int rank) {
  const char* const address = std::getenv(JobBoard::kVariable);  // NOLINT(concurrency-mt-unsafe): nobody writes it
  const std::string here = host_name() + ":";
  if (address == nullptr || !std::string_view(address).starts_with(here)) return;
  const int memory = ::open(address + here.size(), O_RDWR | O_CLOEXEC);
  if (memory < 0) return;
  const auto bytes = static_cast<std::size_t>(std::max<off_t>(::lseek(memory, 0, SEEK_END), 0));
  const auto slot = static_cast<std::size_t>(rank);
  // Hosts may have one name, and processes of theirs one number: then it is anything.
  std::uint64_t magic = 0;
  const bool is_board = slot < bytes / sizeof(Slot) && ::fcntl(memory, F_GET_SEALS) >= 0 &&
                        ::pread(memory, &magic, sizeof magic, 0) == sizeof magic && magic == kMagic;
  void* const mapped = is_board ? ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0) : MAP_FAILED;
  ::close(memory);
  if (mapped == MAP_FAILED) return;
  Slot& joined = static_cast<Slot*>(mapped)[slot];  // stays mapped: reports come to the end
  put(joined.host, host_name());
  put(joined.phase, this_phase);
  joined.process.store(::getpid());
  reports = true;
  first.store(static_cast<Slot*>(mapped));
  mine.store(&joined);
}

bool claim_error(std::string_view text) {
  Slot* const board = first.load();
  if (board == nullptr) return true;
  const std::uint64_t hash = xxh64(std::as_bytes(std::span(text)));
  std::uint64_t claimed = 0;
  return board->error.compare_exchange_strong(claimed, hash) || claimed != hash;
}

const char* current_phase() {
  return this_phase;
}

void report_phase(const char* phase) {
  this_phase = phase;
  if (Slot* const slot = reported_to()) put(slot->phase, phase);
}

void report_frame(std::uint64_t frame) {
  if (Slot* const slot = reported_to()) slot->frame.store(static_cast<std::int64_t>(frame));
}

void report_wait(std::optional<int> awaited_rank) {
  if (Slot* const slot = reported_to()) slot->awaited.store(awaited_rank.value_or(kNobody));
}

void report_step() {
  if (Slot* const slot = mine.load(std::memory_order_relaxed)) slot->steps.fetch_add(1, std::memory_order_relaxed);
}

std::chrono::nanoseconds report_stall_limit(std::chrono::nanoseconds limit) {
  Slot* const slot = reported_to();
  return std::chrono::nanoseconds(slot == nullptr ? 0 : slot->stall_limit_ns.exchange(limit.count()));
}

}  // namespace hpr
