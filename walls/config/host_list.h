#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// The hosts of a list as Slurm writes them, in its order: "wall0[1-9]", "a[01-03,07],b2", "rack[1-2]n[0-3]" (the last
/// bracket counts fastest). Numbers are as wide as the range's first one, so that [08-10] is 08, 09, 10. Throws Error
/// (Usage) for what is no such list, names a host twice, or has more than kMaxScreens hosts.
[[nodiscard]] std::vector<std::string> parse_host_list(std::string_view text);

}  // namespace hpr
