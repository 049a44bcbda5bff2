#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "cluster/transport/communicator.h"

/// Work that may fail on some ranks, done so that all ranks learn of the failure and none waits for another forever.
namespace hpr {

/// Collective. Runs `work` on rank 0 alone and returns its bytes on every rank; an Error it throws is thrown on every
/// rank, so that no rank waits for one that gave up.
[[nodiscard]] std::vector<std::byte> on_root(Communicator& comm, const std::function<std::vector<std::byte>()>& work);

/// Collective. Runs `check` on rank 0 alone; when it fails, every rank throws its Error.
void check_on_root(Communicator& comm, const std::function<void()>& check);

/// Collective. Runs `work` on every rank; when it fails on any, all throw the lowest rank's Error.
void agree_on_failure(Communicator& comm, const std::function<void()>& work);

}  // namespace hpr
