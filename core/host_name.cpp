#include "core/host_name.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>

namespace hpr {

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::string said_by(int rank) {
  return rank == 0 ? "" : fmt::format("rank {} on {}: ", rank, host_name());
}

}  // namespace hpr
