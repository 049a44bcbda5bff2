#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/bytes.h"
#include "walls/link/protocol.h"
#include "walls/link/socket.h"

namespace hpr {

/// Seconds of this machine's monotonic clock.
[[nodiscard]] double link_seconds();

/// How far another machine's clock is ahead of this one's, from round trips: NTP's formula (RFC 5905), of the last few
/// the one that was quickest, as what a round trip lost in waiting it may have lost one way.
class ClockOffset {
 public:
  /// A question left at `sent` and its answer was here at `received`, by this clock; by the other one the question came
  /// at `arrived` and the answer left at `answered`.
  void add(double sent, double arrived, double answered, double received);

  [[nodiscard]] bool known() const { return count_ > 0; }
  /// Seconds: the other clock less this one. The error is at most half the round trip.
  [[nodiscard]] double seconds() const { return best().offset; }
  [[nodiscard]] double round_trip() const { return best().round_trip; }

 private:
  struct Sample {
    double offset = 0.0;
    double round_trip = 0.0;
  };
  [[nodiscard]] Sample best() const;

  std::array<Sample, 8> samples_{};
  std::size_t count_ = 0;  ///< ever
};

/// Bytes on their way; shared, as a frame may have to be sent again.
using LinkMessage = std::shared_ptr<const std::vector<std::byte>>;

struct Packet {
  PacketHeader header;
  std::span<const std::byte> payload;  ///< valid until the connection is used again
  bool intact = true;                  ///< false: the payload is not what was sent
};

/// One end of an open link: queues what is to be sent, parses what arrives. Never waits.
class Connection {
 public:
  explicit Connection(Socket socket) : socket_(std::move(socket)) {}

  [[nodiscard]] const Socket& socket() const { return socket_; }

  void queue(LinkMessage message) { unsent_.push_back(std::move(message)); }
  void queue(std::vector<std::byte> message) {
    queue(std::make_shared<const std::vector<std::byte>>(std::move(message)));
  }
  [[nodiscard]] bool idle() const { return unsent_.empty(); }
  /// Messages of which something is still unsent.
  [[nodiscard]] std::size_t unsent() const { return unsent_.size(); }
  /// Hands the system as much as it takes. Throws LinkError when the other end is gone.
  void send();

  /// Takes in what has arrived. Throws LinkError when the other end is gone.
  void receive();
  /// The next block of the handshake once it is whole.
  [[nodiscard]] std::optional<std::vector<std::byte>> take_block();
  /// The next packet once it is whole. `limit_of` says how long a packet's payload may be; longer ones, and damaged
  /// headers, throw LinkError before any memory is spent on them.
  [[nodiscard]] std::optional<Packet> take_packet(const std::function<std::size_t(const PacketHeader&)>& limit_of);

 private:
  [[nodiscard]] std::span<const std::byte> arrived() const;
  void drop_consumed();

  Socket socket_;
  std::deque<LinkMessage> unsent_;
  std::size_t sent_of_first_ = 0;
  ByteBuffer in_;
  std::size_t consumed_ = 0;  ///< of in_
};

}  // namespace hpr
