#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "walls/config/wall.h"
#include "walls/link/protocol.h"

namespace hpr {

/// The screens one display process shows.
struct WallHost {
  std::string host;                  ///< "localhost" for screens that belong to no host or to any
  std::vector<std::size_t> screens;  ///< indices into Wall::screens, ascending, never empty
};

/// In the order of their first screens; hosts without screens are left out.
[[nodiscard]] std::vector<WallHost> wall_hosts(const Wall& wall);

/// The host of this name, or that of the node with this id. Throws Error (Usage) with the choices.
[[nodiscard]] WallHost find_host(const Wall& wall, const std::string& name);

/// The wall with that host's screens only; the hash stays.
[[nodiscard]] Wall wall_of_host(const Wall& wall, const WallHost& host);

/// A host's screens as the ends of a link compare them.
[[nodiscard]] std::vector<LinkScreen> link_screens(const Wall& wall, const WallHost& host);

/// Where this user's runs and displays are reached: hpr/ in $XDG_RUNTIME_DIR, or /tmp/hpr-UID. Only names it.
[[nodiscard]] std::filesystem::path socket_folder();

/// Where the display process of that wall and host listens by default: in socket_folder(). Only names it.
[[nodiscard]] std::filesystem::path display_socket(const Wall& wall, const std::string& host);

}  // namespace hpr
