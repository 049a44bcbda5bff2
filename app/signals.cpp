#include "app/signals.h"

#include <algorithm>
#include <atomic>
#include <csignal>

namespace hpr {
namespace {

// Handlers reach nothing but globals.
std::atomic<int> requested = 0;
static_assert(std::atomic<int>::is_always_lock_free);

extern "C" void remember_request(int signal) {
  const int request = static_cast<int>(signal == SIGUSR1 ? Request::Stop : Request::Write);
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

Request take_request() {
  return static_cast<Request>(requested.exchange(0));
}

}  // namespace hpr
