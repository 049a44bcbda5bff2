#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "cluster/transport/communicator.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"

namespace hpr::test {

/// `size` bytes that name the rank that wrote them.
inline std::vector<std::byte> message_of(int rank, std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(i * 31 + static_cast<std::size_t>(rank) * 7);
  return bytes;
}

/// An exchange of one message with one rank.
inline std::vector<std::byte> exchange_with(Communicator& comm, std::span<const std::byte> message, int peer) {
  const Outgoing out{peer, message};
  std::vector<std::byte> in;
  comm.exchange({&out, 1}, {&peer, 1},
                [&](int /*from*/, std::span<const std::byte> arrived) { in.assign(arrived.begin(), arrived.end()); });
  return in;
}

/// Runs `body` on `size` ranks and expects every one of them to throw just this.
inline void expect_error_on_all(int size, ExitCode code, const std::string& what,
                                const std::function<void(Communicator&)>& body) {
  std::atomic<int> thrown = 0;
  run_local_ranks(size, [&](Communicator& comm) {
    try {
      body(comm);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      EXPECT_EQ(error.what(), what);
      ++thrown;
    }
  });
  EXPECT_EQ(thrown, size);
}

}  // namespace hpr::test
