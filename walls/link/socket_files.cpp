#include "walls/link/socket_files.h"

#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <mutex>
#include <string_view>

namespace hpr {
namespace {

/// Handlers reach nothing but globals. A path is written while it is not set, and by one thread at a time.
struct SocketFile {
  std::atomic<bool> set = false;
  std::array<char, sizeof(sockaddr_un::sun_path) + 1> path{};
};
std::array<SocketFile, 16> files;
std::mutex writing;

extern "C" void remove_and_end(int signal) {
  for (const SocketFile& file : files) {
    if (file.set.load()) ::unlink(file.path.data());
  }
  ::raise(signal);  // waits until this returns, and then finds no handler
}

}  // namespace

void remove_when_ended(const std::string& path) {
  const std::lock_guard lock(writing);
  for (SocketFile& file : files) {
    if (file.set.load() || path.size() >= file.path.size()) continue;
    file.path.fill('\0');
    path.copy(file.path.data(), path.size());
    file.set.store(true);
    break;
  }
  struct sigaction action {};
  action.sa_handler = remove_and_end;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler == SIG_DFL) ::sigaction(signal, &action, nullptr);
  }
}

void forget_removal(const std::string& path) {
  const std::lock_guard lock(writing);
  for (SocketFile& file : files) {
    if (file.set.load() && std::string_view(file.path.data()) == path) file.set.store(false);
  }
}

}  // namespace hpr
