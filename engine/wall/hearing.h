#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "cluster/transport/communicator.h"
#include "engine/wall/line_source.h"

namespace hpr {

/// What every rank heard.
struct Heard {
  std::optional<std::string> line;
  bool ended = false;  ///< no line can come any more
};

/// Collective. The next line of rank 0's source, which waits at most `longest` for one; null: nothing is said.
/// `from`: on rank 0, where the line came from.
[[nodiscard]] Heard hear_line(Communicator& comm, LineSource* source, std::chrono::milliseconds longest,
                              std::optional<InputLine>& from);

}  // namespace hpr
