#include "cluster/collectives.h"

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

std::vector<std::vector<std::byte>> all_gather(Communicator& comm, std::span<const std::byte> bytes) {
  auto parts = gather(comm, bytes);
  std::vector<std::byte> packed;
  for (const auto& part : parts) {
    const std::uint64_t size = part.size();
    const auto header = std::as_bytes(std::span(&size, 1));
    packed.insert(packed.end(), header.begin(), header.end());
    packed.insert(packed.end(), part.begin(), part.end());
  }
  broadcast(comm, packed);
  if (comm.rank() == 0) return parts;
  for (std::span<const std::byte> rest = packed; !rest.empty();) {
    std::uint64_t size = 0;
    std::memcpy(&size, rest.data(), sizeof size);
    const auto part = rest.subspan(sizeof size, size);
    parts.emplace_back(part.begin(), part.end());
    rest = rest.subspan(sizeof size + size);
  }
  return parts;
}

std::vector<int> hosts_of(Communicator& comm, PeerMemory& memory) {
  int first = 0;
  while (memory.of(first).empty()) ++first;
  return all_gather_value(comm, first);
}

std::vector<std::byte> all_gather_equal(Communicator& comm, std::span<const std::byte> bytes) {
  const auto ranks = static_cast<std::size_t>(comm.size());
  const auto rank = static_cast<std::size_t>(comm.rank());
  const std::size_t each = bytes.size();
  // Those of this rank, of the next one, and so on, as far as known.
  std::vector<std::byte> known(bytes.begin(), bytes.end());
  known.reserve(ranks * each);
  for (std::size_t step = 1; step < ranks; step *= 2) {
    const std::size_t blocks = std::min(step, ranks - step);
    const Outgoing out{static_cast<int>((rank + ranks - step) % ranks), std::span(known).first(blocks * each)};
    const int from = static_cast<int>((rank + step) % ranks);
    std::vector<std::byte> more;
    comm.exchange({&out, 1}, {&from, 1}, [&](int /*from*/, std::span<const std::byte> message) {
      HPR_CHECK(message.size() == blocks * each);
      more.assign(message.begin(), message.end());
    });
    known.insert(known.end(), more.begin(), more.end());
  }
  std::ranges::rotate(known, known.end() - static_cast<std::ptrdiff_t>(rank * each));
  return known;
}

}  // namespace hpr
