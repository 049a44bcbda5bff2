#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/codecs/codec.h"
#include "walls/link/connection.h"
#include "walls/link/protocol.h"

namespace hpr {

struct ReceiverSettings {
  std::string build;  ///< of this program; runs of another one are refused
  std::string host;
  std::uint64_t wall_hash = 0;
  std::vector<LinkScreen> screens;
  std::string token;  ///< of TCP links
  std::vector<LinkAddress> listen;
  std::function<double()> clock = link_seconds;
  double silence = kSilence;  ///< seconds after which rank 0 is no longer waited for
};

/// A frame that is to be shown now: the pictures of it that arrived whole, by screen.
struct Presentation {
  std::uint64_t frame = 0;
  double asked = 0.0;                    ///< when it was to be shown, this process's clock
  std::optional<std::uint64_t> session;  ///< the run's
  std::vector<std::pair<std::size_t, Image<Rgba8>>> pictures;
};

/// What happened to a screen in the run at hand.
struct ScreenReport {
  std::optional<std::uint64_t> frame;  ///< shown last
  std::optional<double> arrived;       ///< when its last whole picture came, this process's clock
  std::uint64_t dropped = 0;           ///< pictures that arrived damaged
  std::uint64_t late = 0;              ///< frames the wall showed without it
  double skew_s = 0.0;                 ///< of the last frame: how long after the moment agreed upon it was shown
};

struct ReceiverReport {
  std::vector<ScreenReport> screens;
  bool ended = false;      ///< the last run said that it is over
  std::uint64_t runs = 0;  ///< that said so
  bool connected = false;  ///< a run is connected
  bool idle = true;        ///< nothing waits to be shown
};

/// A display process's end of its links: listens, accepts one run at a time, keeps of each screen the whole pictures
/// that are to be shown next. A thread of its own receives and decodes; whoever shows calls next() and shown().
class FrameReceiver {
 public:
  /// Throws Error: Usage and Io for addresses it cannot have.
  explicit FrameReceiver(ReceiverSettings settings);
  ~FrameReceiver();
  FrameReceiver(const FrameReceiver&) = delete;
  FrameReceiver& operator=(const FrameReceiver&) = delete;

  /// Waits for a frame's moment, for `limit` seconds at the most. Throws what ended its thread: std::bad_alloc.
  [[nodiscard]] std::optional<Presentation> next(double limit);
  /// The frame next() returned is on the screens. False: it was another run's than the one that shows now.
  bool shown(const Presentation& presentation);
  /// The frame next() returned could not be shown; shown() may be called for it later.
  void not_shown(const Presentation& presentation);
  /// Seconds of the clock all its times are of.
  [[nodiscard]] double now() const { return settings_.clock(); }
  [[nodiscard]] ReceiverReport report() const;
  /// Where it listens, with the ports that were taken.
  [[nodiscard]] std::vector<std::string> addresses() const;

 private:
  struct Peer {
    Connection connection;
    bool tcp = false;
    bool open = false;  ///< the handshake is done
    LinkNonce nonce{};
    Hello hello{};
    double since = 0.0;  ///< the last word from it
    bool closing = false;
  };
  struct Pending {
    Image<Rgba8> image;
    bool announced = false;
  };
  struct Screen {
    std::unique_ptr<Codec> codec;
    std::map<std::uint64_t, Pending> pending;
    std::optional<std::uint64_t> missed;  ///< the frame last counted as late
    ScreenReport report;
  };

  void run(const std::stop_token& stop);
  void wait_for_news();
  void step();
  void accept(const Listener& listener);
  /// False: the peer is done with.
  [[nodiscard]] bool step_peer(Peer& peer, double now);
  void answer(Peer& peer);
  [[nodiscard]] std::string objection(const Peer& peer, const Hello& hello) const;
  /// Why this run cannot take the place of the one that shows, if one does.
  [[nodiscard]] Reply judge_run(const Hello& hello) const;
  void begin_session(const Hello& hello);
  void take(Peer& peer, const Packet& packet);
  void show_rest();
  void take_picture(Peer& peer, const Packet& packet);
  void announce();
  [[nodiscard]] Peer* swap_peer();

  ReceiverSettings settings_;
  std::vector<Listener> listeners_;
  mutable std::mutex mutex_;  ///< of all below
  std::condition_variable news_;
  std::vector<std::unique_ptr<Peer>> peers_;
  std::optional<std::uint64_t> session_;
  std::string run_;  ///< of the session, as its Hello has them
  std::uint32_t start_ = 0;
  std::vector<Screen> screens_;
  std::deque<std::pair<std::uint64_t, double>> orders_;  ///< frame, when
  std::exception_ptr failure_;                           ///< that ended its thread
  bool showing_ = false;
  bool ended_ = false;
  std::uint64_t runs_ = 0;
  Socket alarm_;
  std::jthread thread_;
};

}  // namespace hpr
