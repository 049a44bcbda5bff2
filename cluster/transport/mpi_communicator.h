#pragma once

#include <mpi.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <string>

#include "cluster/transport/communicator.h"
#include "core/bytes.h"
#include "core/peer_memory.h"

namespace hpr {

/// The ranks of an MPI communicator, on a private duplicate so that no other library's messages can match ours.
/// Messages of any size: they travel in parts, as MPI counts are ints.
class MpiCommunicator final : public Communicator {
 public:
  static constexpr std::size_t kMaxPartBytes = std::size_t{1} << 30U;

  /// Collective over `parent`. `part_bytes`: a message as long or longer travels in parts of this size, a multiple of 8
  /// and the same on all ranks; only tests have a reason to change it.
  explicit MpiCommunicator(MPI_Comm parent, std::chrono::nanoseconds hang_timeout = kHangTimeout,
                           std::size_t part_bytes = kMaxPartBytes);
  ~MpiCommunicator() override;
  MpiCommunicator(const MpiCommunicator&) = delete;
  MpiCommunicator& operator=(const MpiCommunicator&) = delete;

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }
  [[nodiscard]] std::string_view transport() const override { return "mpi"; }
  void begin_frame(std::uint64_t frame) override { *frame_ = frame; }
  void send(std::span<const std::byte> message, int to) override;
  void receive(std::span<std::byte> message, int from) override;
  [[nodiscard]] std::vector<std::byte> receive(int from) override;
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override;
  void reduce_max(std::span<std::uint64_t> values, int root) override;
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override;
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override;
  [[nodiscard]] std::chrono::nanoseconds hang_timeout() const override { return hang_timeout_; }

 private:
  /// A message on its way to this rank.
  struct Incoming {
    int from = 0;
    ByteBuffer buffer;
    std::size_t last_part = 0;  ///< bytes of the part under way
    MPI_Request request = MPI_REQUEST_NULL;
  };
  /// Moves a message on as far as it goes without waiting; whether it is whole.
  bool advance(Incoming& incoming);
  struct Owned {};  ///< tag: `comm` becomes ours, no duplicate is made
  MpiCommunicator(Owned, MPI_Comm comm, std::chrono::nanoseconds hang_timeout, std::size_t part_bytes,
                  std::shared_ptr<std::uint64_t> frame, bool is_crowded);

  /// What this rank's messages are tagged with: its frame, in as many numbers as MPI has.
  [[nodiscard]] int tag() const { return static_cast<int>(*frame_ % tags_); }
  /// Throws as check_frame() does when a message with another tag has come.
  void check_tag(int from, int tag);
  /// Collective. Throws on `root` unless all ranks are in one frame.
  void check_frames(int root);

  void start_send(std::span<const std::byte> message, int to, std::vector<MPI_Request>& requests);
  /// Waits for all of `requests`; `doing` stands in the error when the time limit passes.
  void wait(std::vector<MPI_Request>& requests, std::string_view doing, int peer);
  /// Waits for the next part from `from`; its size in bytes and the handle to receive it by.
  std::size_t next_part(int from, MPI_Message& part);
  template <typename Done>
  void poll(Done done, std::string_view doing, int peer);

  MPI_Comm comm_ = MPI_COMM_NULL;
  int rank_ = 0;
  int size_ = 1;
  std::chrono::nanoseconds hang_timeout_;
  int exceptions_at_birth_ = std::uncaught_exceptions();
  std::size_t part_bytes_;
  std::uint64_t tags_ = 1;                       ///< that MPI has
  std::shared_ptr<std::uint64_t> frame_;         ///< one for all communicators of this rank
  bool is_crowded_;                              ///< ranks of this host outnumber the cores they run on
  bool abandoned_ = false;                       ///< a wait was given up with requests under way
  std::vector<std::unique_ptr<Incoming>> idle_;  ///< memory of messages that have come, for the next ones
};

/// The MPI library and its version, e.g. "Open MPI v4.1.4"; may be called at any time, also before MPI_Init.
[[nodiscard]] std::string mpi_version();

}  // namespace hpr
