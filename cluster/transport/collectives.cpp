#include "cluster/transport/collectives.h"

#include <algorithm>

namespace hpr {

void broadcast(Communicator& comm, std::vector<std::byte>& bytes, int root) {
  const int size = comm.size();
  const int position = (comm.rank() - root + size) % size;  // the root is 0, its highest set bit is a rank's round
  int step = 1;
  while (step <= position) step *= 2;
  if (position > 0) bytes = comm.receive((position - step / 2 + root) % size);
  for (; position + step < size; step *= 2) comm.send(bytes, (position + step + root) % size);
}

void barrier(Communicator& comm) {
  // Dissemination: after round k every rank has heard of 2^k others.
  for (int step = 1; step < comm.size(); step *= 2) {
    comm.send({}, (comm.rank() + step) % comm.size());
    comm.receive(std::span<std::byte>{}, (comm.rank() - step + comm.size()) % comm.size());
  }
}

std::vector<std::vector<std::byte>> gather(Communicator& comm, std::span<const std::byte> bytes, int root) {
  if (comm.rank() != root) {
    comm.send(bytes, root);
    return {};
  }
  std::vector<std::vector<std::byte>> all(static_cast<std::size_t>(comm.size()));
  for (int from = 0; from < comm.size(); ++from) {
    auto& part = all[static_cast<std::size_t>(from)];
    if (from == root) {
      part.assign(bytes.begin(), bytes.end());
    } else {
      part = comm.receive(from);
    }
  }
  return all;
}

namespace {

void append_part(std::vector<std::byte>& message, std::span<const std::byte> part) {
  const std::uint64_t size = part.size();
  const auto head = std::as_bytes(std::span(&size, 1));
  message.insert(message.end(), head.begin(), head.end());
  message.insert(message.end(), part.begin(), part.end());
}

/// Appends the `count` parts of a message to `parts`.
void take_parts(std::span<const std::byte> message, std::size_t count, std::vector<std::vector<std::byte>>& parts) {
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t size = 0;
    HPR_CHECK(message.size() >= sizeof size);
    std::memcpy(&size, message.data(), sizeof size);
    message = message.subspan(sizeof size);
    HPR_CHECK(message.size() >= size);
    parts.emplace_back(message.begin(), message.begin() + static_cast<std::ptrdiff_t>(size));
    message = message.subspan(size);
  }
  HPR_CHECK(message.empty());
}

}  // namespace

std::vector<std::vector<std::byte>> all_gather(Communicator& comm, std::span<const std::byte> bytes) {
  const auto ranks = static_cast<std::size_t>(comm.size());
  const auto rank = static_cast<std::size_t>(comm.rank());
  // Those of this rank, of the next one, and so on, as far as known.
  std::vector<std::vector<std::byte>> known;
  known.reserve(ranks);
  known.emplace_back(bytes.begin(), bytes.end());
  for (std::size_t step = 1; step < ranks; step *= 2) {
    const std::size_t count = std::min(step, ranks - step);
    std::vector<std::byte> message;
    for (std::size_t i = 0; i < count; ++i) append_part(message, known[i]);
    const Outgoing out{static_cast<int>((rank + ranks - step) % ranks), message};
    const int from = static_cast<int>((rank + step) % ranks);
    comm.exchange({&out, 1}, {&from, 1},
                  [&](int /*from*/, std::span<const std::byte> arrived) { take_parts(arrived, count, known); });
  }
  std::rotate(known.begin(), known.end() - static_cast<std::ptrdiff_t>(rank), known.end());
  return known;
}

std::vector<int> hosts_of(Communicator& comm, PeerMemory& memory) {
  int first = 0;
  while (memory.of(first).empty()) ++first;
  return all_gather_value(comm, first);
}

}  // namespace hpr
