#pragma once

#include <functional>

#include "cluster/transport/communicator.h"
#include "scene/load_scene.h"
#include "scene/scene.h"

namespace hpr {

/// Collective. Rank 0 calls `load`, the scene's bytes go to all ranks, and all agree on its content hash; every rank
/// returns the same scene. When loading fails, every rank throws rank 0's Error; when a hash differs, all throw Error
/// (BadInput) that names the rank.
///
/// Of a scene for ranks that hold parts (LoadedScene::in_parts) rank r gets part r modulo their number, of those that
/// partition_objects() makes; rank 0 has one whole mesh at a time. All throw Error (Limit) where a share needs more
/// memory than a rank may take, and Error (Usage) where ranks make no groups of one size. Scene::refined is left to be
/// found.
[[nodiscard]] Scene distribute_scene(Communicator& comm, const std::function<LoadedScene()>& load);

}  // namespace hpr
