#include "app/launch/passed_signals.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace hpr {
namespace {

/// Seconds after which signals are passed on though no start was heard of.
constexpr unsigned kLongestStart = 30;

std::atomic<pid_t> launched = 0;
std::atomic<bool> stops = false;  ///< Interrupts::Stop
std::atomic<int> interrupt = 0;
std::atomic<bool> ending = false;   ///< PassedSignals::ends
std::atomic<int> early = 0;         ///< a signal that came before there was anybody to pass it to
std::atomic<bool> started = false;  ///< the ranks; before, mpiexec loses requests, or ranks die of them

bool is_request(int signal) {
  return signal == SIGUSR1 || signal == SIGUSR2;
}

/// Of two signals that wait, the one that asks for more stays.
int weight_of(int signal) {
  return signal == 0 ? 0 : signal == SIGUSR2 ? 1 : signal == SIGUSR1 ? 2 : 3;
}

void pass_on_early() {
  const int signal = early.exchange(0);
  const pid_t to = launched.load();
  if (signal == 0) return;
  if (to > 0 && (started.load() || !is_request(signal))) {
    ::kill(to, signal);
  } else {
    int waiting = 0;  // another may have come meanwhile
    while (weight_of(waiting) < weight_of(signal) && !early.compare_exchange_weak(waiting, signal)) {
    }
  }
}

extern "C" void pass_on(int signal) {
  const int error = errno;
  if (signal == SIGALRM) started.store(true);
  if (signal == SIGINT || signal == SIGTERM || signal == SIGHUP) {
    const bool again = interrupt.exchange(signal) != 0;
    ending.store(again || !stops.load());
    if (stops.load()) {
      signal = again ? SIGTERM : SIGUSR1;
    } else {
      signal = again ? SIGKILL : SIGTERM;
    }
  }
  if (signal != SIGALRM && weight_of(signal) >= weight_of(early.load())) {
    if (early.exchange(signal) == 0 && is_request(signal) && !started.load()) ::alarm(kLongestStart);
  }
  pass_on_early();
  errno = error;
}

}  // namespace

PassedSignals::PassedSignals(const JobOptions& options)
    : count_(options.input == StandardInput::None ? kSignals.size() : 3) {
  launched.store(0);
  early.store(0);
  started.store(false);
  interrupt.store(0);
  ending.store(false);
  stops.store(options.interrupts == Interrupts::Stop);
  struct sigaction action {};
  action.sa_handler = pass_on;
  // One at a time: two that meet in the handler would lose one of them.
  for (const int signal : kSignals) ::sigaddset(&action.sa_mask, signal);
  for (std::size_t i = 0; i < count_; ++i) {
    ::sigaction(kSignals.at(i), nullptr, &before_.at(i));
    // What nohup, or a shell for its background, has us ignore stays ignored, and so do requests nobody here takes.
    if (before_.at(i).sa_handler != SIG_IGN) ::sigaction(kSignals.at(i), &action, nullptr);
  }
}

PassedSignals::~PassedSignals() {
  for (std::size_t i = count_; i-- > 1;) ::sigaction(kSignals.at(i), &before_.at(i), nullptr);
  ::alarm(0);  // no handler sets it any more
  ::sigaction(kSignals.front(), &before_.front(), nullptr);
  if (const int signal = interrupt.load(); signal != 0 && !stops.load()) ::raise(signal);
}

void PassedSignals::to(pid_t child) {
  launched.store(child);
  pass_on_early();
}

void PassedSignals::to_nobody() {
  launched.store(0);
}

void PassedSignals::note_start() {
  started.store(true);
  pass_on_early();
}

bool PassedSignals::ends() {
  return ending.load();
}

int PassedSignals::interrupted_by() {
  return interrupt.load();
}

}  // namespace hpr
