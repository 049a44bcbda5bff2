#pragma once

#include <functional>

#include "cluster/transport/communicator.h"
#include "scene/scene.h"

namespace hpr {

/// Collective. Rank 0 calls `load`, the scene's bytes go to all ranks, and all agree on its content hash; every rank
/// returns the same scene. When loading fails, every rank throws rank 0's Error; when a hash differs, all throw Error
/// (BadInput) that names the rank.
[[nodiscard]] Scene distribute_scene(Communicator& comm, const std::function<Scene()>& load);

}  // namespace hpr
