#pragma once

#include <functional>

#include "cluster/communicator.h"
#include "scene/scene.h"

namespace hpr {

/// Collective. Rank 0 calls `load`, the scene's bytes go to all ranks, and all agree on its content hash; every rank
/// returns the same scene. When loading fails, every rank throws rank 0's Error; when a hash differs, all throw Error
/// (BadInput) that names the rank.
[[nodiscard]] Scene distribute_scene(Communicator& comm, const std::function<Scene()>& load);

/// Collective. Runs `work` on rank 0 alone and returns its bytes on every rank; an Error it throws is thrown on every
/// rank, so that no rank waits for one that gave up.
[[nodiscard]] std::vector<std::byte> on_root(Communicator& comm, const std::function<std::vector<std::byte>()>& work);

/// Collective. Runs `check` on rank 0 alone; when it fails, every rank throws its Error.
void check_on_root(Communicator& comm, const std::function<void()>& check);

/// Collective. Runs `work` on every rank; when it fails on any, all throw the lowest rank's Error.
void agree_on_failure(Communicator& comm, const std::function<void()>& work);

}  // namespace hpr
