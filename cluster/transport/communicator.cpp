#include "cluster/transport/communicator.h"

#include <fmt/format.h>

#include "core/error.h"

namespace hpr {

void check_frame(int rank, std::uint64_t frame, int from, std::uint64_t sent_in) {
  if (sent_in == frame) return;
  throw Error(ExitCode::Internal,
              fmt::format("rank {} is in frame {} and met rank {} in frame {}", rank, frame, from, sent_in),
              "a rank left out a frame or did one twice: please report this with the command line");
}

}  // namespace hpr
