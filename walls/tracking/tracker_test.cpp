#include "walls/tracking/tracker.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <glm/geometric.hpp>
#include <thread>

#include "core/error.h"
#include "core/file.h"
#include "walls/tracking/head_path.h"

namespace hpr {
namespace {

constexpr std::string_view kCsv =
    "# a walk\n"
    "time,x,y,z,qx,qy,qz,qw\n"
    "10.0, 0,1.7,0, 0,0,0,1\n"
    "\n"
    "12.0, 1,1.7,0.5, 0,2,0,0\r\n";

TEST(HeadPaths, AreReadFromCsvJsonLinesAndToml) {
  const HeadPath csv = parse_head_path(kCsv, HeadPathFormat::Csv, "w.csv");
  const HeadPath json = parse_head_path(
      "{\"time\": 10, \"position\": [0, 1.7, 0]}\n"
      "{\"time\": 12, \"position\": [1, 1.7, 0.5], \"orientation\": [0, 2, 0, 0], \"note\": \"x\"}\n",
      HeadPathFormat::JsonLines, "w.json");
  const HeadPath toml = parse_head_path(
      "poses = [{ time = 10, position = [0, 1.7, 0] },\n"
      "  { time = 12.0, position = [1, 1.7, 0.5], heading_pitch_roll = [180, 0, 0] }]\n",
      HeadPathFormat::Toml, "w.toml");
  for (const HeadPath& path : {csv, json, toml}) {
    ASSERT_EQ(path.samples().size(), 2U);
    EXPECT_EQ(path.samples()[1].time, 12.0);
    EXPECT_LT(glm::distance(path.samples()[1].pose.position, {1.0, 1.7, 0.5}), 1e-15);
    EXPECT_NEAR(std::abs(path.samples()[1].pose.orientation.y), 1.0, 1e-12);
    EXPECT_NEAR(glm::length(path.samples()[1].pose.orientation), 1.0, 1e-12);
  }
}

TEST(HeadPaths, GoStraightAndTurnEvenlyBetweenSamplesAndHoldAtTheEnds) {
  const HeadPath path = parse_head_path("0,0,1,0,0,0,0\n2,4,1,0,90,0,0\n3,4,1,2,90,0,0\n", HeadPathFormat::Csv, "w");
  EXPECT_LT(glm::distance(path.at(0.5).position, {1.0, 1.0, 0.0}), 1e-12);
  EXPECT_LT(glm::distance(path.at(2.5).position, {4.0, 1.0, 1.0}), 1e-12);
  const glm::dvec3 right = path.at(1.0).orientation * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_LT(glm::distance(right, {std::sqrt(0.5), 0.0, -std::sqrt(0.5)}), 1e-12);
  EXPECT_EQ(path.at(-1.0), path.samples().front().pose);
  EXPECT_EQ(path.at(99.0), path.samples().back().pose);
  EXPECT_EQ(path.at(2.0), path.samples()[1].pose);
}

TEST(HeadPaths, HeadingTurnsLeftPitchUpAndRollTheHeadToItsLeft) {
  const auto turned = [](double heading, double pitch, double roll, const glm::dvec3& v) {
    return orientation_of(heading, pitch, roll) * v;
  };
  const glm::dvec3 ahead(0.0, 0.0, -1.0);
  EXPECT_LT(glm::distance(turned(90.0, 0.0, 0.0, ahead), {-1.0, 0.0, 0.0}), 1e-12);
  EXPECT_LT(glm::distance(turned(0.0, 90.0, 0.0, ahead), {0.0, 1.0, 0.0}), 1e-12);
  EXPECT_LT(glm::distance(turned(0.0, 0.0, 90.0, {1.0, 0.0, 0.0}), {0.0, 1.0, 0.0}), 1e-12);
  // The heading last, seen from outside: it turns the pitched head.
  EXPECT_LT(glm::distance(turned(90.0, 90.0, 0.0, {0.0, 1.0, 0.0}), {1.0, 0.0, 0.0}), 1e-12);
}

TEST(HeadPaths, WhatIsWrongIsNamedWithItsLine) {
  struct Bad {
    HeadPathFormat format;
    const char* text;
    const char* what;
  };
  const Bad bads[] = {
      {HeadPathFormat::Csv, "0,0,1,0\n1,0,1\n", "w:2: no pose of a head"},
      {HeadPathFormat::Csv, "0,0,1,0\n1,0,1,0,5\n", "w:2: no pose of a head"},
      {HeadPathFormat::Csv, "0,0,1,0\n0,0,1,0\n", "w:2: time 0 comes after 0"},
      {HeadPathFormat::Csv, "0,0,nan,0\n", "w:1: no pose of a head"},
      {HeadPathFormat::Csv, "0,0,1e300,0\n", "w:1: no pose of a head"},
      {HeadPathFormat::Csv, "0,0,1,0,0,0,0,0\n", "w:1: no pose of a head"},
      {HeadPathFormat::Csv, "inf,0,1,0\n", "w:1: no pose of a head"},
      {HeadPathFormat::Csv, "0,0,1,0x\n", "w:1: no pose of a head"},
      {HeadPathFormat::Csv, "# nothing\n", "w: a head's path without poses"},
      {HeadPathFormat::JsonLines, "{\"time\": 0, \"position\": [0, 1]}\n", "w:1: no pose of a head"},
      {HeadPathFormat::JsonLines, "{\"time\": 0, \"position\": [0, 1, \"a\"]}\n", "w:1: no pose of a head"},
      {HeadPathFormat::JsonLines, "{\"time\": 0, \"position\": [0, 1, 2]\n", "w:1: no pose of a head"},
      {HeadPathFormat::JsonLines,
       "{\"time\": 0, \"position\": [0, 1, 2], \"orientation\": [0,0,0,1], \"heading_pitch_roll\": [0,0,0]}\n",
       "w:1: no pose of a head"},
      {HeadPathFormat::Toml, "poses = 3\n", "w:1: 'poses' is no array of poses"},
      {HeadPathFormat::Toml, "poses = [\n{ time = 0, position = [0, 1, 2] },\n{ time = 1 }]\n",
       "w:3: no pose of a head"},
      {HeadPathFormat::Toml, "poses = [", "w:1: "},
  };
  for (const Bad& bad : bads) {
    try {
      static_cast<void>(parse_head_path(bad.text, bad.format, "w"));
      ADD_FAILURE() << bad.text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput);
      EXPECT_EQ(std::string(error.what()).substr(0, std::string(bad.what).size()), bad.what);
    }
  }
}

TEST(FileTracker, AnswersFromItsRecording) {
  const auto file = std::filesystem::temp_directory_path() / ("hpr_walk" + std::to_string(::getpid()) + ".csv");
  write_file_atomically(file, kCsv);
  WallTracker tracker;
  tracker.kind = WallTracker::Kind::File;
  tracker.file = file.string();
  const auto made = make_tracker(tracker, {});
  EXPECT_LT(glm::distance(made->sample(1.0).position, {0.5, 1.7, 0.25}), 1e-12);
  std::filesystem::remove(file);
  EXPECT_THROW(static_cast<void>(make_tracker(tracker, {})), Error);
  tracker.file = "walk.txt";
  EXPECT_THROW(static_cast<void>(make_tracker(tracker, {})), Error);
}

/// Sends to a port of this host; chooses one that is free.
class Sender {
 public:
  Sender() : handle_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    // A port nobody has: the kernel's choice for a socket that is closed again.
    const int other = ::socket(AF_INET, SOCK_DGRAM, 0);
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(to_);
    EXPECT_EQ(::bind(other, reinterpret_cast<const sockaddr*>(&to_), size), 0);
    EXPECT_EQ(::getsockname(other, reinterpret_cast<sockaddr*>(&to_), &size), 0);
    ::close(other);
  }
  ~Sender() { ::close(handle_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  [[nodiscard]] int port() const { return ntohs(to_.sin_port); }
  void send(const std::string& text) const {
    EXPECT_EQ(::sendto(handle_, text.data(), text.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof(to_)),
              static_cast<ssize_t>(text.size()));
  }

 private:
  int handle_;
  sockaddr_in to_{};
};

WallTracker listening_at(int port) {
  WallTracker tracker;
  tracker.kind = WallTracker::Kind::Udp;
  tracker.port = port;
  return tracker;
}

TEST(UdpTracker, TheNewestDatagramWinsAndNonsenseIsPassedOver) {
  const Sender sender;
  const HeadPose rest{{0.0, 1.7, 0.0}};
  const auto tracker = make_tracker(listening_at(sender.port()), rest);
  EXPECT_EQ(tracker->sample(0.0), rest);
  sender.send("1.0 0.1 1.6 0.2 0 0 0 1");
  sender.send("3.0 0.3 1.6 0.2 0 1 0 0\n");
  sender.send("2.0 0.2 1.6 0.2");  // overtaken
  sender.send("9.0 0.9 1.6");
  sender.send("9.0 0.9 1.6 nan");
  sender.send("9.0 0.9 1.6 0.2 0 0 0 1 5");
  sender.send("hello");
  sender.send("");
  const HeadPose pose = tracker->sample(0.1);
  EXPECT_EQ(pose.position, glm::dvec3(0.3, 1.6, 0.2));
  EXPECT_EQ(pose.orientation, glm::dquat(0.0, 0.0, 1.0, 0.0));
}

TEST(UdpTracker, ALostHeadStaysOrGoesToRestAndComesBack) {
  for (const auto then : {WallTracker::Lost::Freeze, WallTracker::Lost::Rest}) {
    const Sender sender;
    const HeadPose rest{{0.0, 1.7, 0.0}};
    WallTracker settings = listening_at(sender.port());
    settings.lost_after_ms = 200;
    settings.lost_then = then;
    const auto tracker = make_tracker(settings, rest);
    sender.send("50.0 1 2 3");
    const HeadPose seen = tracker->sample(1.0);
    EXPECT_EQ(seen.position, glm::dvec3(1.0, 2.0, 3.0));
    EXPECT_EQ(tracker->sample(1.19), seen);
    EXPECT_EQ(tracker->sample(1.21), then == WallTracker::Lost::Freeze ? seen : rest);
    sender.send("0.5 4 5 6");  // started anew
    EXPECT_EQ(tracker->sample(1.3).position, glm::dvec3(4.0, 5.0, 6.0));
  }
}

TEST(UdpTracker, APortThatIsTakenIsAnIoError) {
  const Sender sender;
  const auto first = make_tracker(listening_at(sender.port()), {});
  try {
    static_cast<void>(make_tracker(listening_at(sender.port()), {}));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
  }
  WallTracker nowhere = listening_at(sender.port());
  nowhere.address = "no.such.host";
  EXPECT_THROW(static_cast<void>(make_tracker(nowhere, {})), Error);
}

}  // namespace
}  // namespace hpr
