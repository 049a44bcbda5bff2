#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>

#include "core/file.h"
#include "tests/fuzz/fuzz.h"

// Mutates seeds for a while, or runs the files it is given. No coverage guides it, so that the compiler of every other
// program builds it: what it lacks in aim it has in speed, and in checksums that are repaired.
// usage: fuzz_X [--seconds S] [--seed N] [FILE...]
// A crash leaves its input in fuzz-crash.bin; an input that takes more than 10 s, or a process of more than 1 GiB, is
// one.

/// The sanitizers', where they are linked.
// NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): theirs
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*callback)());

namespace hpr::fuzz {
namespace {

constexpr unsigned kMaxSeconds = 10;  ///< of one input
constexpr long kMaxMemoryKib = 1L << 20;
std::span<const std::byte> current;

/// Only async-signal-safe calls.
extern "C" void keep_input() {
  const int file = ::open("fuzz-crash.bin", O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) return;
  (void)!::write(file, current.data(), current.size());
  ::close(file);
}

extern "C" void keep_input_and_end(int signal) {
  keep_input();
  ::raise(signal);  // the handler was taken back as it was called
}

/// The most that this process ever used.
long memory_kib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

bool try_input(std::span<const std::byte> input) {
  current = input;
  ::alarm(kMaxSeconds);
  const bool good = run(input);
  ::alarm(0);
  if (memory_kib() > kMaxMemoryKib) {
    fmt::print("an input took {} MiB\n", memory_kib() / 1024);
    std::abort();
  }
  return good;
}

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {}

  [[nodiscard]] Bytes make(const std::vector<Bytes>& seeds) {
    Bytes input = seeds[below(seeds.size())];
    for (std::size_t i = 1 + below(4) * below(4); i > 0; --i) mutate(input, seeds);
    return below(4) == 0 ? input : repaired(std::move(input));
  }

 private:
  std::size_t below(std::size_t end) { return end == 0 ? 0 : random_() % end; }

  /// Numbers at the borders of what is a length, a count or a level.
  std::uint64_t odd_number() {
    constexpr std::array<std::uint64_t, 18> kOdd{
        0, 1, 2, 7, 16, 64, 100, 127, 128, 255, 256, 32767, 65535, 65536, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, ~0ULL};
    return below(3) == 0 ? random_() : kOdd.at(below(kOdd.size()));
  }

  void mutate(Bytes& input, const std::vector<Bytes>& seeds) {
    constexpr std::size_t kMaxBytes = 1 << 16;
    const std::size_t at = below(input.size() + 1);
    const std::size_t length = std::min(1 + below(below(2) == 0 ? 8 : 200), input.size() - at);
    const auto position = input.begin() + static_cast<std::ptrdiff_t>(at);
    switch (below(8)) {
      case 0:
        if (at < input.size()) *position ^= std::byte{1} << below(8);
        break;
      case 1: {  // a number, of either byte order
        std::uint64_t number = odd_number();
        const std::size_t bytes = std::min<std::size_t>(std::size_t{1} << below(4), input.size() - at);
        if (below(2) == 0) number = __builtin_bswap64(number) >> (8 * (8 - std::max<std::size_t>(bytes, 1)));
        std::memcpy(input.data() + at, &number, bytes);
        break;
      }
      case 2:
        input.erase(position, position + static_cast<std::ptrdiff_t>(length));
        break;
      case 3: {  // a piece twice
        const Bytes piece(position, position + static_cast<std::ptrdiff_t>(length));
        if (input.size() + length <= kMaxBytes) input.insert(position, piece.begin(), piece.end());
        break;
      }
      case 4: {  // a piece of another seed
        const Bytes& other = seeds[below(seeds.size())];
        const std::size_t from = below(other.size());
        const std::size_t count = std::min(1 + below(200), other.size() - from);
        const auto first = other.begin() + static_cast<std::ptrdiff_t>(from);
        if (input.size() + count <= kMaxBytes)
          input.insert(position, first, first + static_cast<std::ptrdiff_t>(count));
        break;
      }
      case 5:
        input.resize(at);
        break;
      case 6:
        for (std::size_t i = 0; i < length; ++i) input[at + i] = static_cast<std::byte>(random_());
        break;
      default: {  // a digit, a bracket, a quote: most of what text formats are made of
        constexpr std::string_view kSigns = "0123456789-.eE+[]{}\"',:=#\n\\ \x7F\xFF";
        if (at < input.size()) *position = static_cast<std::byte>(kSigns[below(kSigns.size())]);
        break;
      }
    }
  }

  std::mt19937_64 random_;
};

int fuzz(double seconds, std::uint64_t seed) {
  const std::vector<Bytes> good = seeds();
  for (std::size_t i = 0; i < good.size(); ++i) {
    if (try_input(good[i])) continue;
    fmt::print("seed {} is refused: mutations of it would not come far\n", i);
    return 1;
  }
  Mutator mutator(seed);
  std::uint64_t runs = 0;
  std::uint64_t accepted = 0;
  const auto begin = std::chrono::steady_clock::now();
  const auto spent = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(); };
  while (spent() < seconds) {
    for (int i = 0; i < 16; ++i, ++runs) {
      const Bytes input = mutator.make(good);
      if (try_input(input)) ++accepted;
    }
  }
  fmt::print("{} inputs in {:.0f} s without a finding, {} of them good; {} MiB at most\n", runs, spent(), accepted,
             memory_kib() / 1024);
  return 0;
}

}  // namespace
}  // namespace hpr::fuzz

int main(int argc, char** argv) {
  double seconds = 60.0;
  std::uint64_t seed = 1;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--seconds" && i + 1 < argc) {
      seconds = std::atof(argv[++i]);
    } else if (word == "--seed" && i + 1 < argc) {
      seed = std::strtoull(argv[++i], nullptr, 10);
    } else {
      files.emplace_back(word);
    }
  }
  if (__sanitizer_set_death_callback != nullptr) {
    __sanitizer_set_death_callback(hpr::fuzz::keep_input);
  } else {
    for (const int number : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL}) {
      struct sigaction action {};
      action.sa_handler = hpr::fuzz::keep_input_and_end;
      action.sa_flags = static_cast<int>(SA_RESETHAND);
      ::sigaction(number, &action, nullptr);
    }
  }
  struct sigaction late {};
  late.sa_handler = hpr::fuzz::keep_input_and_end;
  late.sa_flags = static_cast<int>(SA_RESETHAND);
  ::sigaction(SIGALRM, &late, nullptr);
  if (files.empty()) return hpr::fuzz::fuzz(seconds, seed);
  for (const std::string& name : files) {
    (void)hpr::fuzz::try_input(hpr::read_file(name, std::uint64_t{1} << 30U));
    fmt::print("{}: no finding\n", name);
  }
  return 0;
}
