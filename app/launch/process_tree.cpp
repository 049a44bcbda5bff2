#include "app/launch/process_tree.h"

#include <unistd.h>

#include <charconv>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace hpr {
namespace {

/// 0: it has gone.
pid_t parent_of(const std::filesystem::path& process) {
  std::ifstream file(process / "stat");
  std::string stat;
  std::getline(file, stat, '\0');  // a name may hold anything but that
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos || name_end + 4 > stat.size()) return 0;
  pid_t parent = 0;
  std::from_chars(stat.data() + name_end + 4, stat.data() + stat.size(), parent);  // after ") S "
  return parent;
}

/// A process before those it started.
std::vector<pid_t> with_descendants(pid_t process) {
  std::vector<std::pair<pid_t, pid_t>> parents;  ///< a process and its parent
  std::error_code error;
  for (std::filesystem::directory_iterator entry("/proc", error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    pid_t number = 0;
    const auto [stop, wrong] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (wrong == std::errc() && stop == name.data() + name.size())
      parents.emplace_back(number, parent_of(entry->path()));
  }
  std::vector<pid_t> found{process};
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const auto& [number, parent] : parents) {
      if (parent == found[i]) found.push_back(number);
    }
  }
  return found;
}

}  // namespace

void kill_with_descendants(pid_t process) {
  ::kill(process, SIGSTOP);  // starts nobody more while they are listed
  const std::vector<pid_t> all = with_descendants(process);
  if (::getpgid(process) == process) ::kill(-process, SIGKILL);
  for (const pid_t one : all) ::kill(one, SIGKILL);
}

}  // namespace hpr
