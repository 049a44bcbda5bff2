#pragma once

#include <span>

#include "engine/wall/wall_driver.h"

namespace hpr {

/// Collective, after the last frame. Rank 0 writes the files; all ranks throw Error (Io) where it cannot.
void write_layers(const WallLayerFiles& files, std::span<const Aov> aovs, WallDriver& driver, Session& session);

}  // namespace hpr
