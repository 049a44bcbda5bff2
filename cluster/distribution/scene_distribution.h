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
/// partition_objects() makes; rank 0 reads one mesh at a time, as LoadedScene::read_mesh does, and sends it in pieces.
/// Where a part is too large for a rank and may be paged (LoadedScene::in_pages), it goes page by page into a file of
/// that rank's host (PartPages), and no triangles of it into the scene: as many pages as make sixteen of them fit.
/// All throw Error (Limit) where a share needs more memory than a rank may take, and Error (Usage) where ranks make no
/// groups of one size. Scene::refined is left to be found.
[[nodiscard]] Scene distribute_scene(Communicator& comm, const std::function<LoadedScene()>& load);

}  // namespace hpr
