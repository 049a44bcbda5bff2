#include "cluster/transport/collectives.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "core/error.h"

namespace hpr {
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

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void put(std::vector<std::byte>& bytes, const std::string& text) {
  const std::uint64_t size = text.size();
  const auto header = std::as_bytes(std::span(&size, 1));
  bytes.insert(bytes.end(), header.begin(), header.end());
  const auto segment = std::as_bytes(std::span(text));
  bytes.insert(bytes.end(), segment.begin(), segment.end());
}

std::string take_text(std::span<const std::byte>& bytes) {
  std::uint64_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  std::string text(reinterpret_cast<const char*>(bytes.data() + sizeof size), size);
  bytes = bytes.subspan(sizeof size + size);
  return text;
}

/// A failure as bytes: a code (0: none), then three texts.
std::vector<std::byte> pack(const std::optional<Error>& error) {
  std::vector<std::byte> bytes{static_cast<std::byte>(error ? static_cast<int>(error->code()) : 0)};
  if (!error) return bytes;
  put(bytes, error->what());
  put(bytes, error->hint());
  put(bytes, error->line());
  return bytes;
}

void throw_if_packed(std::span<const std::byte> bytes) {
  const auto code = static_cast<ExitCode>(bytes.front());
  if (code == ExitCode::Done) return;
  bytes = bytes.subspan(1);
  const std::string what = take_text(bytes);
  const std::string hint = take_text(bytes);
  throw AgreedError(code, what, hint, take_text(bytes));
}

}  // namespace

std::optional<Error> failure_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error;
  } catch (const std::bad_alloc&) {
    return Error(ExitCode::Limit, "out of memory", "use more ranks or a smaller scene, or raise --limit-mem");
  } catch (const std::exception& error) {
    return Error(ExitCode::Internal, error.what());
  }
  return std::nullopt;
}

void broadcast(Communicator& comm, std::vector<std::byte>& bytes, int root) {
  const int size = comm.size();
  const int position = (comm.rank() - root + size) % size;  // the root is 0, its highest set bit is a rank's round
  int step = 1;
  while (step <= position) step *= 2;
  if (position > 0) bytes = comm.receive((position - step / 2 + root) % size);
  for (; position + step < size; step *= 2) comm.send(bytes, (position + step + root) % size);
}

void barrier(Communicator& comm) {
  // Dissemination: after round k every rank knows that 2^k others arrived.
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

std::vector<std::vector<std::byte>> all_to_all(Communicator& comm, std::vector<std::vector<std::byte>> parts) {
  HPR_CHECK(parts.size() == static_cast<std::size_t>(comm.size()));
  std::vector<std::vector<std::byte>> arrived(parts.size());
  std::vector<Outgoing> out;
  std::vector<int> from;
  for (int rank = 0; rank < comm.size(); ++rank) {
    if (rank == comm.rank()) continue;
    out.push_back({rank, parts[static_cast<std::size_t>(rank)]});
    from.push_back(rank);
  }
  comm.exchange(out, from, [&](int rank, std::span<const std::byte> message) {
    arrived[static_cast<std::size_t>(rank)].assign(message.begin(), message.end());
  });
  const auto own = static_cast<std::size_t>(comm.rank());
  arrived[own] = std::move(parts[own]);
  return arrived;
}

std::vector<int> hosts_of(Communicator& comm, PeerMemory& memory) {
  int first = 0;
  while (memory.of(first).empty()) ++first;
  return all_gather_value(comm, first);
}

std::string broadcast_text(Communicator& comm, const std::string& text) {
  const auto own = std::as_bytes(std::span(text));
  std::vector<std::byte> bytes(own.begin(), own.end());
  broadcast(comm, bytes);
  return text_of(bytes);
}

std::vector<std::string> all_gather_texts(Communicator& comm, const std::string& text) {
  std::vector<std::string> texts;
  for (const auto& bytes : all_gather(comm, std::as_bytes(std::span(text)))) texts.push_back(text_of(bytes));
  return texts;
}

std::vector<std::byte> on_root(Communicator& comm, const std::function<std::vector<std::byte>()>& work) {
  std::vector<std::byte> result;
  std::vector<std::byte> verdict;
  if (comm.rank() == 0) verdict = pack(failure_of([&] { result = work(); }));
  broadcast(comm, verdict);
  throw_if_packed(verdict);
  broadcast(comm, result);
  return result;
}

void check_on_root(Communicator& comm, const std::function<void()>& check) {
  (void)on_root(comm, [&] {
    check();
    return std::vector<std::byte>{};
  });
}

void agree_on_failure(Communicator& comm, const std::function<void()>& work) {
  for (const auto& verdict : all_gather(comm, pack(failure_of(work)))) throw_if_packed(verdict);
}

}  // namespace hpr
