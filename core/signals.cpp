#include "core/signals.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>

namespace hpr {
namespace {

// Handlers reach nothing but globals.
std::atomic<int> requested = 0;
std::atomic<int> last = 0;
std::atomic<const char*> announcement = nullptr;  ///< null: there is none, or it was made
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<const char*>::is_always_lock_free);

constexpr const char* kOnTerminal = "\nhpr: ending; Ctrl-C again ends it at once\n";

extern "C" void remember_request(int signal) {
  const int request = static_cast<int>(signal == SIGUSR2 ? Request::Write : Request::Stop);
  if (signal != SIGUSR1 && signal != SIGUSR2) announce_end();
  last.store(signal);
  int before = requested.load();
  while (before < request && !requested.compare_exchange_weak(before, request)) {
  }
}

}  // namespace

void watch_requests() {
  struct sigaction action {};
  action.sa_handler = remember_request;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGUSR1, &action, nullptr);
  ::sigaction(SIGUSR2, &action, nullptr);
}

void watch_interrupts() {
  watch_requests();
  struct sigaction action {};
  action.sa_handler = remember_request;
  action.sa_flags = static_cast<int>(SA_RESTART | static_cast<unsigned>(SA_RESETHAND));
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_IGN) ::sigaction(signal, &action, nullptr);  // nohup's wish stands
  }
}

void announce_ends(bool on_terminal) {
  announcement.store(on_terminal ? kOnTerminal : kOnTerminal + 1);
}

void announce_end() {
  const int error = errno;
  const char* const text = announcement.exchange(nullptr);
  if (text != nullptr) (void)!::write(STDERR_FILENO, text, std::strlen(text));
  errno = error;
}

int last_signal() {
  return last.load();
}

Request take_request() {
  return static_cast<Request>(requested.exchange(0));
}

}  // namespace hpr
