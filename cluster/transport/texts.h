#pragma once

#include <string>
#include <vector>

#include "cluster/transport/communicator.h"

/// Collectives of texts: every rank of `comm` calls them together.
namespace hpr {

/// That of rank 0, on every rank.
[[nodiscard]] std::string broadcast_text(Communicator& comm, const std::string& text);

/// Each rank's, in order of rank, on every rank.
[[nodiscard]] std::vector<std::string> all_gather_texts(Communicator& comm, const std::string& text);

}  // namespace hpr
