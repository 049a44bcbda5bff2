#pragma once

#include <memory>
#include <span>

#include "cluster/transport/communicator.h"
#include "walls/config/wall.h"
#include "walls/link/sender.h"
#include "walls/manifest/manifest.h"

/// The displays of a wall that are processes outside the job.
namespace hpr {

/// Collective. The link of each rank to the displays of its screens (`owners`: per screen the rank); rank 0 has waited
/// a moment for them. Throws Error (Lost) on all ranks where one refuses.
[[nodiscard]] std::unique_ptr<WallSender> connect_displays(Communicator& comm, const Wall& wall,
                                                           std::span<const int> owners, SenderSettings settings);

/// Collective: ends the links of a run whose frames are in `manifest`, and writes down there, on rank 0, what the
/// displays showed of them. Returns whether any display was ever there.
[[nodiscard]] bool end_displays(Communicator& comm, WallSender& sender, RunManifest& manifest);

}  // namespace hpr
