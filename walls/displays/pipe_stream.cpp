#include "walls/displays/pipe_stream.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"
#include "core/timing.h"

namespace hpr {
namespace {

/// A pipe that poll() calls writable takes this many bytes at once, even where writing may block.
constexpr std::size_t kNeverBlocks = 4096;

std::string reason(int error) {
  return std::generic_category().message(error);
}

/// A reader that goes away is to show as a failed write; a program that handles the signal itself keeps its handler.
void ignore_broken_pipes() {
  struct sigaction now {};
  if (::sigaction(SIGPIPE, nullptr, &now) == 0 && now.sa_handler == SIG_DFL) std::signal(SIGPIPE, SIG_IGN);
}

/// The attributes and actions of posix_spawn; destroyed on every way out.
struct SpawnPlan {
  SpawnPlan() {
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  posix_spawn_file_actions_t actions{};
  posix_spawnattr_t attributes{};
};

int spawn_shell(const std::string& command, int standard_input, pid_t& child) {
  SpawnPlan plan;
  posix_spawn_file_actions_adddup2(&plan.actions, standard_input, STDIN_FILENO);
  sigset_t defaults;
  sigemptyset(&defaults);
  sigaddset(&defaults, SIGPIPE);  // what this process ignores, its children would too
  posix_spawnattr_setsigdefault(&plan.attributes, &defaults);
  posix_spawnattr_setpgroup(&plan.attributes, 0);
  posix_spawnattr_setflags(&plan.attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::string shell = "sh";
  std::string option = "-c";
  std::string script = command;
  const std::array<char*, 4> arguments{shell.data(), option.data(), script.data(), nullptr};
  return ::posix_spawn(&child, "/bin/sh", &plan.actions, &plan.attributes, arguments.data(), environ);
}

int open_fifo(const std::filesystem::path& path, std::chrono::milliseconds time_limit) {
  const Stopwatch watch;
  while (true) {
    const int file = ::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (file >= 0) return file;
    if (errno != ENXIO && errno != EINTR) {
      throw Error(ExitCode::Io, fmt::format("cannot write to the FIFO '{}': {}", path.string(), reason(errno)),
                  file_error_hint(errno));
    }
    if (watch.ms() > static_cast<double>(time_limit.count())) {
      throw Error(ExitCode::Io, fmt::format("nobody reads the FIFO '{}'", path.string()),
                  "start its reader first, or raise --pipe-timeout");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

constexpr int kBits = 20;
constexpr double kRed = 0.2126;
constexpr double kGreen = 0.7152;
constexpr double kBlue = 0.0722;

/// Weights of red, green and blue in units of 2^-kBits, and what is added before the bits are dropped. Their error
/// over three channels, 255 * 1.5 / 2^20, is 4e-4 levels.
struct Row {
  std::int32_t red;
  std::int32_t green;
  std::int32_t blue;
  std::int32_t offset;

  [[nodiscard]] std::byte of(Rgba8 color) const {
    return static_cast<std::byte>((red * color.r + green * color.g + blue * color.b + offset) >> kBits);
  }
};

constexpr std::int32_t fixed(double value) {
  const double scaled = value * (1 << kBits);
  return static_cast<std::int32_t>(scaled < 0.0 ? scaled - 0.5 : scaled + 0.5);
}

constexpr Row row(double red, double green, double blue, double range, int zero) {
  const double scale = range / 255.0;
  return {fixed(red * scale), fixed(green * scale), fixed(blue * scale), (zero << kBits) + (1 << (kBits - 1))};
}

constexpr Row kLuma = row(kRed, kGreen, kBlue, 219.0, 16);
// (B - Y) / (2 (1 - kBlue)) and (R - Y) / (2 (1 - kRed)): the largest difference becomes one half.
constexpr double kBlueScale = 2.0 * (1.0 - kBlue);
constexpr double kRedScale = 2.0 * (1.0 - kRed);
constexpr Row kChromaBlue = row(-kRed / kBlueScale, -kGreen / kBlueScale, 0.5, 224.0, 128);
constexpr Row kChromaRed = row(0.5, -kGreen / kRedScale, -kBlue / kRedScale, 224.0, 128);

}  // namespace

Sink Sink::to_command(const std::string& command, std::chrono::milliseconds time_limit) {
  ignore_broken_pipes();
  Sink sink(fmt::format("the command '{}'", printable(command)), time_limit);
  std::array<int, 2> ends{-1, -1};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot make a pipe to {}: {}", sink.name_, reason(errno)));
  }
  sink.file_ = ends[1];
  ::fcntl(sink.file_, F_SETFL, O_NONBLOCK);
  const int error = spawn_shell(command, ends[0], sink.child_);
  ::close(ends[0]);
  if (error != 0) {
    sink.child_ = 0;
    throw Error(ExitCode::Io, fmt::format("cannot start {}: {}", sink.name_, reason(error)));
  }
  return sink;
}

Sink Sink::to_file(const std::filesystem::path& path, std::chrono::milliseconds time_limit) {
  ignore_broken_pipes();
  if (path == "-") {
    Sink sink("standard output", time_limit);
    sink.file_ = STDOUT_FILENO;
    sink.owned_ = false;
    return sink;
  }
  Sink sink(fmt::format("'{}'", path.string()), time_limit);
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode)) {
    sink.file_ = open_fifo(path, time_limit);
    return sink;
  }
  sink.file_ = sink.unfinished_.emplace(path).descriptor();
  return sink;
}

Sink::Sink(Sink&& other) noexcept
    : name_(std::move(other.name_)),
      time_limit_(other.time_limit_),
      file_(std::exchange(other.file_, -1)),
      owned_(other.owned_),
      child_(std::exchange(other.child_, 0)),
      unfinished_(std::exchange(other.unfinished_, std::nullopt)) {}

Sink::~Sink() {
  close();
  if (child_ <= 0) return;
  constexpr std::chrono::milliseconds kToEndByItself{1000};
  for (const int signal : {SIGTERM, SIGKILL}) {
    if (wait_for_child(kToEndByItself) >= 0) return;
    ::kill(-child_, signal);
  }
  (void)wait_for_child(kToEndByItself);
}

void Sink::close() {
  if (owned_ && !unfinished_ && file_ >= 0) ::close(file_);
  file_ = -1;
}

void Sink::fail(int error) {
  if (error == EPIPE) {
    throw Error(ExitCode::Io, fmt::format("{} stopped reading frames", name_),
                "see what it said; it ended before the run did");
  }
  throw Error(ExitCode::Io, fmt::format("cannot write to {}: {}", name_, reason(error)), file_error_hint(error));
}

void Sink::wait_until_writable() const {
  const Stopwatch watch;
  while (true) {
    const double left = static_cast<double>(time_limit_.count()) - watch.ms();
    if (left <= 0.0) {
      throw Error(ExitCode::Io,
                  fmt::format("{} read nothing for {:.1f} s", name_, 1e-3 * static_cast<double>(time_limit_.count())),
                  "see why it stands still, or raise --pipe-timeout");
    }
    pollfd waiting{.fd = file_, .events = POLLOUT, .revents = 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(std::min(left, 60'000.0)) + 1);
    if (ready > 0) return;  // writable, or broken, which the write finds
  }
}

void Sink::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    wait_until_writable();
    const ssize_t written = ::write(file_, bytes.data(), owned_ ? bytes.size() : std::min(bytes.size(), kNeverBlocks));
    if (written < 0 && errno != EINTR && errno != EAGAIN) fail(errno);
    if (written > 0) bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

int Sink::wait_for_child(std::chrono::milliseconds limit) {
  const Stopwatch watch;
  while (true) {
    int status = 0;
    const pid_t left = ::waitpid(child_, &status, WNOHANG);
    if (left == child_ || (left < 0 && errno == ECHILD)) {
      child_ = 0;
      return left < 0 ? 0 : status;
    }
    if (watch.ms() > static_cast<double>(limit.count())) return -1;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

void Sink::finish() {
  close();
  if (unfinished_) unfinished_->commit();
  if (child_ <= 0) return;
  const int status = wait_for_child(time_limit_);
  if (status < 0) {
    throw Error(ExitCode::Io, fmt::format("{} does not end though it was given all frames", name_),
                "let it leave at the end of its input, or raise --pipe-timeout");
  }
  if (WIFSIGNALED(status)) {
    throw Error(ExitCode::Io, fmt::format("{} was ended by signal {}", name_, WTERMSIG(status)), "see what it said");
  }
  if (WEXITSTATUS(status) != 0) {
    throw Error(ExitCode::Io, fmt::format("{} left with {}", name_, WEXITSTATUS(status)), "see what it said");
  }
}

std::string y4m_header(Size size, int frames_per_second) {
  return fmt::format("YUV4MPEG2 W{} H{} F{}:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n", size.width, size.height,
                     frames_per_second);
}

void append_y4m_frame(const Image<Rgba8>& image, std::vector<std::byte>& bytes) {
  constexpr std::string_view kStart = "FRAME\n";
  const std::size_t pixels = image.size().area();
  const std::size_t at = bytes.size() + kStart.size();
  bytes.resize(at + 3 * pixels);
  for (std::size_t i = 0; i < kStart.size(); ++i) bytes[at - kStart.size() + i] = static_cast<std::byte>(kStart[i]);
  std::byte* const luma = bytes.data() + at;
  std::byte* const blue = luma + pixels;
  std::byte* const red = blue + pixels;
  const auto colors = image.pixels();
  for (std::size_t i = 0; i < pixels; ++i) {
    luma[i] = kLuma.of(colors[i]);
    blue[i] = kChromaBlue.of(colors[i]);
    red[i] = kChromaRed.of(colors[i]);
  }
}

}  // namespace hpr
