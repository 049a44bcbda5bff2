#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "walls/codecs/codec.h"
#include "walls/config/wall.h"
#include "walls/displays/display.h"
#include "walls/link/client_link.h"
#include "walls/link/connection.h"
#include "walls/link/hosts.h"
#include "walls/link/protocol.h"
#include "walls/link/swap_barrier.h"

namespace hpr {

/// What displays have to miss for a run to count as failed, the worst first.
enum class MissedPictures : std::uint8_t {
  Never,   ///< nothing counts
  Unseen,  ///< no display was ever there
  Lost,    ///< or a screen had no display for a frame
  Stale,   ///< or a frame came too late for a screen
};

struct SenderSettings {
  std::string build;  ///< of this program; displays of another one refuse
  std::uint64_t session = 0;
  std::string run;                                           ///< see Hello
  std::uint32_t start = 0;                                   ///< see Hello
  std::string token;                                         ///< of TCP links
  std::map<std::string, LinkAddress> addresses;              ///< per host where it is not the socket wall and host name
  int rank = 0;                                              ///< 0 also has the displays agree on when to show
  std::chrono::duration<double> send_budget{0.1};            ///< the longest a frame waits for displays
  std::chrono::duration<double> busy_limit{kSilence + 2.0};  ///< the longest to wait for displays of another run
  std::chrono::duration<double> swap_timeout{0.1};           ///< the longest displays that are ready wait for others
  int in_flight = 1;  ///< frames the job may be ahead of what displays are ready for
  std::string codec = "raw";
  CodecSettings codec_settings;
  MissedPictures fail_on = MissedPictures::Unseen;  ///< what ends a run with Error (Lost)
};

/// Sends the pictures of one rank's screens to the display processes of their hosts, and on rank 0 has all displays of
/// the wall show each frame together. A thread of its own sends, connects and connects again; the job only hands over
/// frames, and waits no longer than the budget.
class WallSender {
 public:
  /// `owners`: per screen the rank. Throws Error (Usage) for an unknown codec or host.
  WallSender(const Wall& wall, std::span<const int> owners, const SenderSettings& settings);
  ~WallSender();
  WallSender(const WallSender&) = delete;
  WallSender& operator=(const WallSender&) = delete;

  /// Rank 0: returns when all displays have answered, or after `limit`; later where one shows another run, which may be
  /// dead without its knowing. Throws Error (Lost) with the words of a display that refuses for good, or that still
  /// shows another run after SenderSettings::busy_limit.
  void wait_for_displays(std::chrono::duration<double> limit);
  /// Hands over a frame: on this rank's screens; numbers ascend. Rank 0 then waits, within the budget, until the
  /// displays are ready for the frame `in_flight` before this one.
  void show(const WallFrame& frame);
  /// What the last frame's screens of this rank took to encode, and their bytes.
  [[nodiscard]] const std::vector<ScreenCost>& costs() const { return costs_; }
  /// Ends the run after its last frame: returns when that is sent, on rank 0 shown, or after two seconds or the budget
  /// and the swap time-out together, whichever is longer.
  void finish();

  /// Rank 0: what became of a frame that was shown and not forgotten; it is final after finish().
  [[nodiscard]] SwapOutcome outcome(std::uint64_t frame) const;
  /// Rank 0: nobody will ask for the outcome of frames before this one.
  void forget_before(std::uint64_t frame);
  [[nodiscard]] double degraded_seconds() const { return degraded_s_; }
  /// Whether any display ever answered; and if none did, why the first did not.
  [[nodiscard]] bool reached_any() const;
  [[nodiscard]] std::string why_unreached() const;

 private:
  /// The link that takes this rank's pictures to a host.
  struct FrameLink {
    ClientLink link;
    std::vector<std::size_t> screens;        ///< of the wall, of this rank
    std::vector<std::uint32_t> numbers;      ///< their numbers among the host's screens
    std::vector<LinkMessage> current;        ///< the latest frame's, one per screen
    bool sent = true;                        ///< `current` was handed to the connection
    std::vector<std::uint64_t> sent_anew{};  ///< per screen the frame last sent a second time, plus one
    std::vector<Image<Rgba8>> pictures{};    ///< with deltas, of `current`: to be sent whole where it builds on nothing
    std::vector<bool> whole{};               ///< with deltas, per screen: what comes next may build on nothing
  };
  /// What a screen's picture is sent as.
  struct ScreenPacket {
    std::size_t screen = 0;
    LinkMessage message;
  };
  /// Rank 0's agreement with a display.
  struct SwapLink {
    ClientLink link;
    WallHost host;
    ClockOffset clock;
    std::uint64_t pings = 0;
    std::array<double, 16> ping_sent{};  ///< of the last few, by number
    double next_ping = 0.0;
    bool ever_up = false;
    std::string reported_refusal{};
  };

  [[nodiscard]] ClientLink make_link(const WallHost& host, LinkRole role) const;
  void run(const std::stop_token& stop);
  void wait_for_news(double now);
  void step(double now);
  /// Begins streams anew, with deltas, whose display may not have seen their last picture.
  void restart_broken_streams();
  [[nodiscard]] std::vector<std::byte> encode(std::size_t screen, const Image<Rgba8>& picture);
  [[nodiscard]] std::vector<ScreenPacket> encode_all(const WallFrame& frame);
  void post(FrameLink& link, const WallFrame& frame, std::span<const ScreenPacket> packets);
  /// Replaces, with deltas, `current` of this screen by the whole picture, in place of what builds on an earlier
  /// picture.
  void make_whole(FrameLink& link, std::size_t index) const;
  /// Queues the latest frame unless the connection still has its hands full.
  void hand_over(FrameLink& link) const;
  void step_frames(FrameLink& link, double now);
  void step_swap(std::size_t display, double now);
  void take_answer(std::size_t display, const Packet& packet, double now);
  void present(double now);
  void report_event(const SwapEvent& event) const;
  [[nodiscard]] bool all_sent() const;

  const Wall& wall_;
  SenderSettings settings_;
  std::vector<ScreenCost> costs_;
  std::vector<std::unique_ptr<Codec>> codecs_;  ///< per screen; none where another rank owns it
  mutable std::mutex mutex_;                    ///< of all below
  std::condition_variable news_;
  std::vector<FrameLink> frames_;
  std::vector<SwapLink> swaps_;  ///< one per display on rank 0
  SwapBarrier barrier_;
  double degraded_s_ = 0.0;
  bool finishing_ = false;
  std::exception_ptr failure_;  ///< that ended its thread
  Socket alarm_;
  std::jthread thread_;
};

}  // namespace hpr
