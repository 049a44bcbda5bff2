#pragma once

#include <span>
#include <vector>

#include "cluster/transport/communicator.h"

namespace hpr::test {

/// An exchange of one message with one rank.
inline std::vector<std::byte> exchange_with(Communicator& comm, std::span<const std::byte> message, int peer) {
  const Outgoing out{peer, message};
  std::vector<std::byte> in;
  comm.exchange({&out, 1}, {&peer, 1},
                [&](int /*from*/, std::span<const std::byte> arrived) { in.assign(arrived.begin(), arrived.end()); });
  return in;
}

}  // namespace hpr::test
