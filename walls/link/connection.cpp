#include "walls/link/connection.h"

#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <span>
#include <system_error>

#include "core/bytes.h"

namespace hpr {
namespace {

constexpr std::size_t kChunk = std::size_t{256} << 10U;
/// Bytes received in one call at most, so that one link cannot keep the others waiting.
constexpr std::size_t kMaxReceivedBytes = 16 * kChunk;

[[noreturn]] void gone(int code) {
  throw LinkError(std::generic_category().message(code));
}

bool later(int code) {
  return code == EAGAIN || code == EWOULDBLOCK || code == EINTR;
}

}  // namespace

double link_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void ClockOffset::add(double sent, double arrived, double answered, double received) {
  const double round_trip = std::max(0.0, (received - sent) - (answered - arrived));
  samples_.at(count_ % samples_.size()) = {((arrived - sent) + (answered - received)) / 2.0, round_trip};
  ++count_;
}

ClockOffset::Sample ClockOffset::best() const {
  if (count_ == 0) return {};
  return std::ranges::min(std::span(samples_).first(std::min(count_, samples_.size())), {}, &Sample::round_trip);
}

void Connection::send() {
  while (!unsent_.empty()) {
    const std::vector<std::byte>& message = *unsent_.front();
    const ssize_t sent = ::send(socket_.descriptor(), message.data() + sent_of_first_, message.size() - sent_of_first_,
                                MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0) {
      if (later(errno)) return;
      gone(errno);
    }
    sent_of_first_ += static_cast<std::size_t>(sent);
    if (sent_of_first_ < message.size()) continue;
    unsent_.pop_front();
    sent_of_first_ = 0;
  }
}

void Connection::receive() {
  drop_consumed();
  for (std::size_t total = 0; total < kMaxReceivedBytes;) {
    const std::size_t before = in_.size();
    const ssize_t got = ::recv(socket_.descriptor(), in_.extend(kChunk).data(), kChunk, MSG_DONTWAIT);
    in_.shrink(before + (got > 0 ? static_cast<std::size_t>(got) : 0));
    if (got < 0) {
      if (later(errno)) return;
      gone(errno);
    }
    if (got == 0) {
      // What came before the end counts; the next call finds the end again.
      if (total > 0) return;
      throw LinkError("the other end closed the link");
    }
    total += static_cast<std::size_t>(got);
  }
}

std::optional<std::vector<std::byte>> Connection::take_block() {
  const auto begin = arrived();
  const auto size = block_bytes(begin);
  if (!size || begin.size() < *size) return std::nullopt;
  consumed_ += *size;
  return std::vector<std::byte>(begin.begin(), begin.begin() + static_cast<std::ptrdiff_t>(*size));
}

std::optional<Packet> Connection::take_packet(const std::function<std::size_t(const PacketHeader&)>& limit_of) {
  const auto begin = arrived();
  if (begin.size() < kPacketHeaderBytes) return std::nullopt;
  const PacketHeader header = decode_header(begin.first(kPacketHeaderBytes));
  if (header.length > limit_of(header)) throw LinkError("a packet is longer than it may be");
  if (begin.size() - kPacketHeaderBytes < header.length) return std::nullopt;
  const auto payload = begin.subspan(kPacketHeaderBytes, header.length);
  consumed_ += kPacketHeaderBytes + header.length;
  return Packet{header, payload, xxh64(payload) == header.payload_hash};
}

std::span<const std::byte> Connection::arrived() const {
  return in_.bytes().subspan(consumed_);
}

void Connection::drop_consumed() {
  if (consumed_ == 0) return;
  const auto rest = arrived();
  if (!rest.empty()) std::memmove(in_.bytes().data(), rest.data(), rest.size());
  in_.shrink(rest.size());
  consumed_ = 0;
}

}  // namespace hpr
