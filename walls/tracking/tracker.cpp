#include "walls/tracking/tracker.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "walls/link/socket.h"
#include "walls/tracking/head_path.h"

namespace hpr {
namespace {

class FileTracker final : public Tracker {
 public:
  explicit FileTracker(HeadPath path) : path_(std::move(path)) {}
  [[nodiscard]] HeadPose sample(double time) override { return path_.at(time); }
  [[nodiscard]] double ends_at() const override { return path_.samples().back().time - path_.samples().front().time; }

 private:
  HeadPath path_;
};

/// A datagram's sender's time and the pose.
struct Report {
  double time = 0.0;
  HeadPose pose;
};

/// "time x y z", or with "heading pitch roll" or "qx qy qz qw" after it.
std::optional<Report> report_of(std::string_view text) {
  std::vector<double> numbers;
  constexpr std::string_view kSpace = " \t\r\n";
  constexpr std::size_t kMaxNumbers = 8;
  while (true) {
    const std::size_t begin = text.find_first_not_of(kSpace);
    if (begin == std::string_view::npos) break;
    text.remove_prefix(begin);
    double value = 0.0;
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const auto used = static_cast<std::size_t>(stop - text.data());
    const bool whole = used == text.size() || kSpace.find(text[used]) != std::string_view::npos;
    if (error != std::errc() || !whole || numbers.size() == kMaxNumbers) return std::nullopt;
    numbers.push_back(value);
    text.remove_prefix(used);
  }
  Report report;
  if (numbers.size() < 4 || !pose_from(std::span(numbers).subspan(1), report.pose)) return std::nullopt;
  report.time = numbers.front();
  return report.time == report.time ? std::optional(report) : std::nullopt;
}

/// A socket that datagrams to this address and port come to; it never blocks. Throws Error (Io).
Socket open_datagrams(const std::string& address, int port) {
  Socket socket(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_port = htons(static_cast<std::uint16_t>(port));
  const bool known = ::inet_pton(AF_INET, address.c_str(), &at.sin_addr) == 1;
  if (!socket || !known || ::bind(socket.descriptor(), reinterpret_cast<const sockaddr*>(&at), sizeof(at)) != 0) {
    const std::string why = known ? std::generic_category().message(errno) : "no numeric address";
    throw Error(ExitCode::Io, fmt::format("cannot listen to a tracker at {}:{}: {}", printable(address), port, why),
                "give an address of this host, 0.0.0.0 for all of them, and a free port");
  }
  return socket;
}

/// The bytes of the next datagram, as far as they fit; none when there is none now.
std::optional<std::size_t> receive(const Socket& socket, std::span<char> bytes) {
  const ssize_t count = ::recv(socket.descriptor(), bytes.data(), bytes.size(), 0);
  if (count < 0) return std::nullopt;
  return static_cast<std::size_t>(count);
}

class UdpTracker final : public Tracker {
 public:
  UdpTracker(const WallTracker& tracker, const HeadPose& rest)
      : tracker_(tracker), rest_(rest), socket_(open_datagrams(tracker.address, tracker.port)), pose_(rest) {}

  [[nodiscard]] HeadPose sample(double time) override {
    // More than a tracker sends in any frame, and an end to what a flood of datagrams can take.
    constexpr int kMaxDatagramsAFrame = 10'000;
    std::array<char, 512> bytes{};
    for (int i = 0; i < kMaxDatagramsAFrame; ++i) {
      const auto count = receive(socket_, bytes);
      if (!count) break;
      const auto report = report_of({bytes.data(), *count});
      if (report) {
        take(*report, time);
      } else if (!warned_) {
        warned_ = true;
        log::warning("a tracker sends what is no pose: {} (it is: time x y z qx qy qz qw; told once)",
                     printable({bytes.data(), *count}));
      }
    }
    const bool lost = time - last_seen_ > 1e-3 * tracker_.lost_after_ms;
    return lost && tracker_.lost_then == WallTracker::Lost::Rest ? rest_ : pose_;
  }

 private:
  /// Datagrams may overtake each other; a sender that starts anew after it was lost may count from 0 again.
  void take(const Report& report, double time) {
    const bool was_lost = time - last_seen_ > 1e-3 * tracker_.lost_after_ms;
    if (newest_ && report.time <= *newest_ && !was_lost) return;
    newest_ = report.time;
    last_seen_ = time;
    pose_ = report.pose;
  }

  WallTracker tracker_;
  HeadPose rest_;
  Socket socket_;
  HeadPose pose_;
  std::optional<double> newest_;
  double last_seen_ = 0.0;
  bool warned_ = false;
};

class RestingHead final : public Tracker {
 public:
  explicit RestingHead(const HeadPose& rest) : rest_(rest) {}
  [[nodiscard]] HeadPose sample(double /*time*/) override { return rest_; }

 private:
  HeadPose rest_;
};

}  // namespace

std::unique_ptr<Tracker> make_tracker(const WallTracker& tracker, const HeadPose& rest) {
  switch (tracker.kind) {
    case WallTracker::Kind::None:
      break;
    case WallTracker::Kind::File:
      return std::make_unique<FileTracker>(load_head_path(tracker.file));
    case WallTracker::Kind::Udp:
      return std::make_unique<UdpTracker>(tracker, rest);
  }
  return std::make_unique<RestingHead>(rest);
}

}  // namespace hpr
