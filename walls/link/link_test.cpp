#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

#include "core/error.h"
#include "walls/config/wall_file.h"
#include "walls/link/display_process.h"
#include "walls/link/receiver.h"
#include "walls/link/sender.h"

namespace hpr {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr const char* kToken = "a shared secret";

/// Keeps what it was told to show.
class KeepingDisplay final : public Display {
 public:
  [[nodiscard]] std::string_view name() const override { return "keeping"; }
  [[nodiscard]] bool recovers() const override { return true; }
  void show(const WallFrame& frame) override {
    if (full_) {
      ++refused_;
      throw Error(ExitCode::Io, "no space", "make some");
    }
    for (const ScreenPicture& picture : frame.screens) {
      const std::lock_guard lock(mutex_);
      shown_.emplace_back(picture.screen, frame.number, picture.image);
    }
  }
  struct Shown {
    std::size_t screen;
    std::uint64_t frame;
    Image<Rgba8> picture;
  };
  [[nodiscard]] std::vector<Shown> shown() const {
    const std::lock_guard lock(mutex_);
    return shown_;
  }
  /// From now on nothing can be shown, or it can again.
  void set_full(bool full) { full_ = full; }
  [[nodiscard]] int refused() const { return refused_; }

 private:
  std::atomic<bool> full_ = false;
  std::atomic<int> refused_ = 0;
  mutable std::mutex mutex_;
  std::vector<Shown> shown_;
};

/// A display process in a thread.
class RunningDisplay {
 public:
  RunningDisplay(const Wall& whole, const std::string& host, ReceiverSettings settings,
                 std::chrono::duration<double> stale_after = Seconds(60.0))
      : part_(wall_of_host(whole, find_host(whole, host))),
        receiver_(std::move(settings)),
        process_(part_, host, display_, receiver_, {{}, stale_after, false}),
        thread_([this](const std::stop_token& stop) { process_.run([&] { return stop.stop_requested(); }); }) {}

  [[nodiscard]] const KeepingDisplay& display() const { return display_; }
  [[nodiscard]] KeepingDisplay& display() { return display_; }
  [[nodiscard]] ReceiverReport report() const { return receiver_.report(); }

 private:
  Wall part_;
  KeepingDisplay display_;
  FrameReceiver receiver_;
  DisplayProcess process_;
  std::jthread thread_;
};

class LinkTest : public testing::Test {
 protected:
  LinkTest() : folder_(std::filesystem::temp_directory_path() / ("hpr_link" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
    std::filesystem::permissions(folder_, std::filesystem::perms::owner_all);
  }
  ~LinkTest() override {
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
  }

  [[nodiscard]] LinkAddress address(const std::string& name) const { return socket_address(folder_ / name); }

  [[nodiscard]] ReceiverSettings receiver(const std::string& host = "localhost") const {
    const WallHost screens = find_host(wall_, host);
    return {.build = "build",
            .host = host,
            .wall_hash = wall_.hash,
            .screens = link_screens(wall_, screens),
            .token = "",
            .listen = {address(host)}};
  }
  [[nodiscard]] SenderSettings sender() const {
    SenderSettings settings;
    settings.build = "build";
    settings.session = ++session_;
    settings.run = "run " + std::to_string(session_);
    settings.busy_limit = Seconds(0.2);
    for (const WallHost& host : wall_hosts(wall_)) settings.addresses.emplace(host.host, address(host.host));
    return settings;
  }
  [[nodiscard]] std::vector<int> owners() const { return std::vector<int>(wall_.screens.size(), 0); }

  /// Colours tell frame, screen and place.
  [[nodiscard]] Image<Rgba8> picture(std::size_t screen, std::uint64_t frame) const {
    Image<Rgba8> image(wall_.screens[screen].pixels);
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) {
        image.at(x, y) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), static_cast<std::uint8_t>(frame),
                          static_cast<std::uint8_t>(screen)};
      }
    }
    return image;
  }
  void show(WallSender& sender, std::uint64_t frame) const {
    std::vector<Image<Rgba8>> images;
    for (std::size_t i = 0; i < wall_.screens.size(); ++i) images.push_back(picture(i, frame));
    std::vector<ScreenPicture> pictures;
    for (std::size_t i = 0; i < images.size(); ++i) pictures.push_back({i, images[i]});
    sender.show({frame, pictures});
  }
  [[nodiscard]] std::string refusal(const SenderSettings& settings) const {
    WallSender sender(wall_, owners(), settings);
    try {
      sender.wait_for_displays(Seconds(0.6));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Lost);
      return error.what();
    }
    return sender.reached_any() ? "accepted" : "unreached";
  }

  Wall wall_ = load_wall("2x1@40x30");

 private:
  std::filesystem::path folder_;
  mutable std::uint64_t session_ = 0;
};

bool within(double seconds, const std::function<bool()>& happens) {
  const double until = link_seconds() + seconds;
  while (!happens()) {
    if (link_seconds() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

TEST_F(LinkTest, EveryFrameIsShownAsItWasSent) {
  const RunningDisplay display(wall_, "localhost", receiver());
  SenderSettings settings = sender();
  settings.codec = "zstd";
  settings.send_budget = Seconds(5.0);
  settings.swap_timeout = Seconds(5.0);
  WallSender sender(wall_, owners(), settings);
  sender.wait_for_displays(Seconds(5.0));
  constexpr std::uint64_t kFrames = 20;
  for (std::uint64_t frame = 0; frame < kFrames; ++frame) show(sender, frame);
  sender.finish();
  const auto shown = display.display().shown();
  ASSERT_EQ(shown.size(), 2 * kFrames);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    EXPECT_EQ(shown[i].frame, i / 2);
    EXPECT_EQ(shown[i].picture, picture(shown[i].screen, shown[i].frame));
  }
  for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
    EXPECT_EQ(sender.outcome(frame).screens, std::vector<ScreenState>(2, ScreenState::Fresh)) << frame;
  }
  EXPECT_EQ(sender.degraded_seconds(), 0.0);
  EXPECT_TRUE(within(2.0, [&] { return display.report().ended; }));
}

TEST_F(LinkTest, DisplaysWhoseClocksDifferShowAFrameTogether) {
  wall_.nodes = {{"a", "left", 0, {}}, {"b", "right", 0, {}}};
  wall_.screens[0].node = "a";
  wall_.screens[1].node = "b";
  const RunningDisplay left(wall_, "left", receiver("left"));
  ReceiverSettings ahead = receiver("right");
  ahead.clock = [] { return link_seconds() + 3.0; };
  const RunningDisplay right(wall_, "right", ahead);
  SenderSettings settings = sender();
  settings.send_budget = Seconds(5.0);
  settings.swap_timeout = Seconds(5.0);
  WallSender sender(wall_, owners(), settings);
  sender.wait_for_displays(Seconds(5.0));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // a few pings
  for (std::uint64_t frame = 0; frame < 5; ++frame) show(sender, frame);
  sender.finish();
  const SwapOutcome outcome = sender.outcome(4);
  EXPECT_EQ(outcome.screens, std::vector<ScreenState>(2, ScreenState::Fresh));
  ASSERT_TRUE(outcome.skew_s.has_value());
  EXPECT_LT(*outcome.skew_s, 1.0) << "the clocks are 3 s apart";
}

TEST_F(LinkTest, WhatDoesNotFitIsRefusedInWords) {
  const RunningDisplay display(wall_, "localhost", receiver());
  SenderSettings other = sender();
  other.build = "another build";
  EXPECT_NE(refusal(other).find("install the same build"), std::string::npos);

  EXPECT_EQ(refusal(sender()), "accepted");
  Wall changed = wall_;
  changed.hash ^= 1;
  {
    WallSender with_another_wall(changed, owners(), sender());
    EXPECT_THROW(with_another_wall.wait_for_displays(Seconds(0.6)), Error);
  }
  changed = scale_wall(wall_, 0.5);
  try {
    WallSender smaller(changed, owners(), sender());
    smaller.wait_for_displays(Seconds(0.6));
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("--scale"), std::string::npos) << error.what();
  }
  WallSender first(wall_, owners(), sender());
  first.wait_for_displays(Seconds(2.0));
  EXPECT_NE(refusal(sender()).find("another run"), std::string::npos);
}

/// A link of a run whose network was cut: it stands open, and nothing comes through it any more.
class SilentRun {
 public:
  SilentRun(const Wall& wall, const LinkAddress& address, const SenderSettings& settings)
      : link_(address, hello_of(wall, settings), "") {
    EXPECT_TRUE(within(5.0, [&] {
      (void)link_.step(link_seconds(), [](const Packet&) {});
      return link_.up();
    })) << link_.failure();
  }

 private:
  static Hello hello_of(const Wall& wall, const SenderSettings& settings) {
    Hello hello;
    hello.build = settings.build;
    hello.role = LinkRole::Swap;
    hello.host = "localhost";
    hello.wall_hash = wall.hash;
    hello.session = settings.session;
    hello.run = settings.run;
    hello.start = settings.start;
    hello.screens = link_screens(wall, find_host(wall, "localhost"));
    return hello;
  }

  ClientLink link_;
};

TEST_F(LinkTest, ARunThatIsStartedAgainTakesThePlaceOfWhatWasLost) {
  const RunningDisplay display(wall_, "localhost", receiver());
  SenderSettings lost = sender();
  lost.run = "a secret of the run";
  const SilentRun silent(wall_, address("localhost"), lost);
  SenderSettings again = sender();
  again.run = lost.run;
  again.start = 1;
  {
    WallSender sender(wall_, owners(), again);
    const double begin = link_seconds();
    sender.wait_for_displays(Seconds(5.0));
    EXPECT_TRUE(sender.reached_any());
    EXPECT_LT(link_seconds() - begin, 2.0) << "long before the lost one counts as silent";
    // Whoever was only cut off and comes back finds its successor, which it must not put out.
    SenderSettings back = lost;
    back.session = this->sender().session;
    EXPECT_NE(refusal(back).find("later start"), std::string::npos);
    show(sender, 0);
    EXPECT_TRUE(within(2.0, [&] { return display.display().shown().size() == 2; }));
  }
  EXPECT_NE(refusal(lost).find("later start"), std::string::npos) << "also when nothing shows";
}

TEST_F(LinkTest, ARunWaitsForTheEndOfAnotherOneThatMayBeDead) {
  ReceiverSettings settings = receiver();
  settings.silence = 1.5;
  const RunningDisplay display(wall_, "localhost", settings);
  SenderSettings dead = sender();
  dead.run = "one run";
  const SilentRun silent(wall_, address("localhost"), dead);
  SenderSettings other = sender();
  other.run = "another run";
  other.start = 3;
  const double begin = link_seconds();
  EXPECT_NE(refusal(other).find("shows another run"), std::string::npos);
  EXPECT_LT(link_seconds() - begin, 1.4) << "no longer than it is told to";
  other.busy_limit = Seconds(10.0);
  EXPECT_EQ(refusal(other), "accepted");
  EXPECT_LT(link_seconds() - begin, 5.0);
}

TEST_F(LinkTest, TcpTakesTheSameTokenOnBothEnds) {
  const LinkAddress tcp = parse_address("127.0.0.1:" + std::to_string(20000 + ::getpid() % 20000));
  ReceiverSettings settings = receiver();
  settings.listen = {tcp};
  EXPECT_THROW({ const FrameReceiver open_to_all(settings); }, Error);
  settings.token = kToken;
  const RunningDisplay display(wall_, "localhost", settings);
  SenderSettings run = sender();
  run.addresses.insert_or_assign("localhost", tcp);
  EXPECT_NE(refusal(run).find("set HPR_TOKEN"), std::string::npos);
  run.token = "a wrong secret";
  EXPECT_NE(refusal(run).find("token differs"), std::string::npos);
  run.token = kToken;
  EXPECT_EQ(refusal(run), "accepted");
}

/// Whoever connects and says nothing.
Socket idle_connection(const LinkAddress& address) {
  while (true) {
    try {
      return start_connecting(address);
    } catch (const LinkError&) {  // the queue of those who wait is full
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
}

TEST_F(LinkTest, IdleConnectionsKeepNobodyOut) {
  const RunningDisplay display(wall_, "localhost", receiver());
  std::vector<Socket> idle;
  for (int i = 0; i < 100; ++i) idle.push_back(idle_connection(address("localhost")));
  const double begin = link_seconds();
  EXPECT_EQ(refusal(sender()), "accepted");
  EXPECT_LT(link_seconds() - begin, 1.0) << "before the idle ones have had their time";
}

TEST(LinkToken, AShortSecretIsNone) {
  const char* const before = std::getenv("HPR_TOKEN");
  const std::string kept = before == nullptr ? "" : before;
  for (const auto& [secret, good] : {std::pair("1234567", false), std::pair("12345678", true), std::pair("", true)}) {
    ASSERT_EQ(::setenv("HPR_TOKEN", secret, 1), 0);
    if (good) {
      EXPECT_EQ(link_token(), secret);
    } else {
      EXPECT_THROW((void)link_token(), Error);
    }
  }
  before == nullptr ? ::unsetenv("HPR_TOKEN") : ::setenv("HPR_TOKEN", kept.c_str(), 1);
}

TEST_F(LinkTest, AMissingDisplayHoldsNoFrameUp) {
  WallSender sender(wall_, owners(), this->sender());
  sender.wait_for_displays(Seconds(0.05));
  const double begin = link_seconds();
  for (std::uint64_t frame = 0; frame < 5; ++frame) show(sender, frame);
  EXPECT_LT(link_seconds() - begin, 0.5);
  sender.finish();
  EXPECT_FALSE(sender.reached_any());
  EXPECT_FALSE(sender.why_unreached().empty());
  EXPECT_EQ(sender.outcome(4).screens, std::vector<ScreenState>(2, ScreenState::Lost));
}

TEST_F(LinkTest, WithDeltasOnlyWhatChangedIsSentAndAllIsShown) {
  wall_ = load_wall("2x1@160x120");
  auto display = std::make_unique<RunningDisplay>(wall_, "localhost", receiver());
  SenderSettings settings = sender();
  settings.codec_settings.deltas = true;
  settings.send_budget = Seconds(5.0);
  settings.swap_timeout = Seconds(5.0);
  WallSender sender(wall_, owners(), settings);
  sender.wait_for_displays(Seconds(5.0));
  std::vector<Image<Rgba8>> images{picture(0, 7), picture(1, 7)};
  const std::vector<ScreenPicture> pictures{{0, images[0]}, {1, images[1]}};
  for (std::uint64_t frame = 0; frame < 4; ++frame) {
    images[1].at(150, 110).r = static_cast<std::uint8_t>(frame);  // in one tile of six
    sender.show({frame, pictures});
    ASSERT_TRUE(within(5.0, [&] { return display->display().shown().size() == 2 * (frame + 1); }));
    for (std::size_t i = 0; i < 2; ++i) {
      const auto shown = display->display().shown()[2 * frame + i];
      EXPECT_EQ(shown.picture, images[shown.screen]);
      EXPECT_EQ(sender.costs()[i].bytes<160 * 120, frame> 0) << sender.costs()[i].bytes;
    }
  }
  // Its last picture built on earlier ones.
  display.reset();
  display = std::make_unique<RunningDisplay>(wall_, "localhost", receiver());
  ASSERT_TRUE(within(1.0, [&] { return display->display().shown().size() == 2; })) << "without another frame";
  for (const auto& shown : display->display().shown()) EXPECT_EQ(shown.picture, images[shown.screen]);
  sender.show({4, pictures});
  ASSERT_TRUE(within(1.0, [&] { return display->display().shown().size() == 4; }));
  EXPECT_EQ(display->report().screens[1].dropped, 0U);
}

TEST_F(LinkTest, ADisplayThatComesBackShowsTheCurrentFrame) {
  auto display = std::make_unique<RunningDisplay>(wall_, "localhost", receiver());
  SenderSettings settings = sender();
  settings.send_budget = Seconds(2.0);
  WallSender sender(wall_, owners(), settings);
  sender.wait_for_displays(Seconds(2.0));
  show(sender, 0);
  ASSERT_TRUE(within(2.0, [&] { return display->display().shown().size() == 2; }));
  display.reset();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  show(sender, 1);
  show(sender, 2);
  display = std::make_unique<RunningDisplay>(wall_, "localhost", receiver());
  ASSERT_TRUE(within(1.0, [&] { return display->display().shown().size() == 2; })) << "without another frame";
  EXPECT_EQ(display->display().shown()[0].frame, 2U);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  show(sender, 3);
  ASSERT_TRUE(within(2.0, [&] { return display->display().shown().size() == 4; }));
  sender.finish();
  EXPECT_EQ(sender.outcome(0).screens, std::vector<ScreenState>(2, ScreenState::Fresh));
  EXPECT_EQ(sender.outcome(1).screens, std::vector<ScreenState>(2, ScreenState::Lost));
  EXPECT_EQ(sender.outcome(2).screens, std::vector<ScreenState>(2, ScreenState::Fresh)) << "shown when it came back";
  EXPECT_EQ(sender.outcome(3).screens, std::vector<ScreenState>(2, ScreenState::Fresh));
  EXPECT_GT(sender.degraded_seconds(), 0.05);
}

TEST_F(LinkTest, AFrozenDisplayCostsTheBudgetOnceAndKeepsTheOthersShowing) {
  wall_.nodes = {{"a", "left", 0, {}}, {"b", "right", 0, {}}};
  wall_.screens[0].node = "a";
  wall_.screens[1].node = "b";
  const RunningDisplay left(wall_, "left", receiver("left"));
  const FrameReceiver right(receiver("right"));  // takes pictures in, and nobody shows them
  SenderSettings settings = sender();
  settings.send_budget = Seconds(0.2);
  WallSender sender(wall_, owners(), settings);
  sender.wait_for_displays(Seconds(2.0));
  const double begin = link_seconds();
  constexpr std::uint64_t kFrames = 30;
  for (std::uint64_t frame = 0; frame < kFrames; ++frame) show(sender, frame);
  EXPECT_LT(link_seconds() - begin, 3.0) << "thirty times the budget would be 6 s";
  sender.finish();
  EXPECT_EQ(sender.outcome(kFrames - 1).screens, (std::vector<ScreenState>{ScreenState::Fresh, ScreenState::Stale}));
  EXPECT_EQ(left.display().shown().back().frame, kFrames - 1);
}

TEST_F(LinkTest, AScreenWithoutFramesIsMarkedAndUnmarkedByTheNext) {
  const RunningDisplay display(wall_, "localhost", receiver(), Seconds(0.3));
  WallSender sender(wall_, owners(), this->sender());
  sender.wait_for_displays(Seconds(2.0));
  show(sender, 0);
  // Both screens' pictures, then both with a badge.
  ASSERT_TRUE(within(3.0, [&] { return display.display().shown().size() == 4; }));
  const auto badged = display.display().shown()[2];
  EXPECT_EQ(badged.picture, with_badge(picture(badged.screen, 0), "stale: frame 0"));
  EXPECT_NE(badged.picture, picture(badged.screen, 0));
  show(sender, 1);
  ASSERT_TRUE(within(3.0, [&] { return display.display().shown().size() >= 6; }));
  EXPECT_EQ(display.display().shown()[4].picture, picture(display.display().shown()[4].screen, 1));
}

TEST_F(LinkTest, ADisplayThatCannotShowGoesOnAndShowsTheFrameOnceItCan) {
  RunningDisplay display(wall_, "localhost", receiver());
  WallSender sender(wall_, owners(), this->sender());
  sender.wait_for_displays(Seconds(2.0));
  show(sender, 0);
  ASSERT_TRUE(within(3.0, [&] { return display.display().shown().size() == 2; }));
  display.display().set_full(true);
  show(sender, 1);
  show(sender, 2);
  EXPECT_TRUE(within(5.0, [&] { return display.display().refused() >= 2; }));
  EXPECT_EQ(sender.outcome(1).screens[0], ScreenState::Stale);
  EXPECT_EQ(display.display().shown().size(), 2U);
  display.display().set_full(false);
  // Nothing newer comes.
  ASSERT_TRUE(within(5.0, [&] { return display.display().shown().size() == 4; }));
  EXPECT_EQ(display.display().shown().back().frame, 2U);
  EXPECT_TRUE(within(3.0, [&] { return sender.outcome(2).screens[0] == ScreenState::Fresh; }));
  sender.finish();
  EXPECT_GT(sender.degraded_seconds(), 0.0);
}

TEST_F(LinkTest, ASocketSomebodyListensOnIsNotTakenAndADeadOneIs) {
  const LinkAddress where = address("taken");
  {
    const Listener first(where);
    struct stat found {};
    ASSERT_EQ(::stat(where.text.c_str(), &found), 0);
    EXPECT_EQ(found.st_mode & 0777U, 0600U);
    EXPECT_THROW({ const Listener second(where); }, Error);
  }
  EXPECT_FALSE(std::filesystem::exists(where.text));
  // As a killed process leaves it.
  const Socket dead(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  ASSERT_EQ(::bind(dead.descriptor(), reinterpret_cast<const sockaddr*>(&where.storage), where.length), 0);
  EXPECT_NO_THROW({ const Listener again(where); });
}

TEST_F(LinkTest, SocketsOfDeadProcessesAreRemovedAndNoOthers) {
  const LinkAddress dead = address("dead");
  const LinkAddress young = address("young");
  const LinkAddress busy = address("busy");
  const LinkAddress file = address("file");
  const Listener listener(busy);
  for (const LinkAddress& each : {dead, young}) {
    const Socket socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::bind(socket.descriptor(), reinterpret_cast<const sockaddr*>(&each.storage), each.length), 0);
  }
  std::ofstream(file.text) << "no socket";
  for (const LinkAddress& each : {dead, busy, file}) {
    std::filesystem::last_write_time(each.text,
                                     std::filesystem::file_time_type::clock::now() - std::chrono::minutes(1));
  }
  remove_left_sockets(std::filesystem::path(dead.text).parent_path());
  EXPECT_FALSE(std::filesystem::exists(dead.text));
  EXPECT_TRUE(std::filesystem::exists(young.text));
  EXPECT_TRUE(std::filesystem::exists(busy.text));
  EXPECT_TRUE(std::filesystem::exists(file.text));
}

TEST(WallHosts, ScreensGoToTheirNodesHostsAndTheRestToThisOne) {
  Wall wall = load_wall("3x1@4x4");
  wall.nodes = {{"a", "left", 0, {}}, {"b", "*", 0, {}}};
  wall.screens[0].node = "a";
  wall.screens[2].node = "b";
  const auto hosts = wall_hosts(wall);
  ASSERT_EQ(hosts.size(), 2U);
  EXPECT_EQ(hosts[0].host, "left");
  EXPECT_EQ(hosts[1].host, "localhost");
  EXPECT_EQ(hosts[1].screens, (std::vector<std::size_t>{1, 2}));
  EXPECT_EQ(find_host(wall, "a").host, "left");
  EXPECT_EQ(find_host(wall, "left").host, "left");
  EXPECT_EQ(find_host(wall, "b").host, "localhost");
  EXPECT_EQ(wall_of_host(wall, hosts[1]).screens.size(), 2U);
  EXPECT_EQ(wall_of_host(wall, hosts[1]).elsewhere, std::vector<WallScreen>{wall.screens[0]});
  try {
    (void)find_host(wall, "lefd");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("did you mean 'left'?"), std::string::npos);
  }
  EXPECT_NE(display_socket(wall, "left"), display_socket(wall, "localhost"));
  // A host's name never leads out of the folder.
  EXPECT_EQ(display_socket(wall, "../../x").parent_path(), display_socket(wall, "left").parent_path());
}

}  // namespace
}  // namespace hpr
