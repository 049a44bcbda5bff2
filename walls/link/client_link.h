#pragma once

#include <poll.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "walls/link/connection.h"
#include "walls/link/protocol.h"
#include "walls/link/socket.h"

namespace hpr {

/// The job's end of a link to a display process: connects, shakes hands, and starts again when the other end is gone.
/// Never waits.
class ClientLink {
 public:
  enum class Change : std::uint8_t { None, Up, Down };

  /// `hello` but for its nonce and proof.
  ClientLink(LinkAddress address, Hello hello, std::string token);

  [[nodiscard]] const LinkAddress& address() const { return address_; }
  [[nodiscard]] bool up() const { return state_ == State::Up; }
  /// Why the display will not have us; empty as long as it has not said so.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }
  /// Whether it will not have us because another run shows: it may later.
  [[nodiscard]] bool busy() const { return busy_; }
  /// Why the last attempt failed.
  [[nodiscard]] const std::string& failure() const { return failure_; }

  /// What to poll; none between attempts.
  [[nodiscard]] std::optional<pollfd> watched() const;
  /// When step() is to be called even without news.
  [[nodiscard]] double next_due() const { return due_; }
  /// Goes as far as it can; hands over the packets that have arrived. Throws nothing of its own. Once up it is to be
  /// called again at once: packets may have come along with the news.
  [[nodiscard]] Change step(double now, const std::function<void(const Packet&)>& arrived);

  /// Only when up.
  [[nodiscard]] Connection& connection() { return *connection_; }
  [[nodiscard]] const Connection& connection() const { return *connection_; }

 private:
  enum class State : std::uint8_t { Down, Connecting, AwaitGreeting, AwaitReply, Up };

  /// Goes on connecting; whether the connection stands.
  [[nodiscard]] bool connect(double now);
  [[nodiscard]] Change advance(double now, const std::function<void(const Packet&)>& arrived);
  void answer(const Greeting& greeting);
  void judge(const Reply& reply);
  [[noreturn]] void refuse(const std::string& why);
  void go_down(double now, const std::string& why);

  LinkAddress address_;
  Hello hello_;
  std::string token_;
  State state_ = State::Down;
  std::unique_ptr<Connection> connection_;
  LinkNonce greeted_{};
  double due_ = 0.0;  ///< down: the next attempt; else: the end of the handshake's time
  std::string refusal_;
  bool busy_ = false;
  std::string failure_ = "not tried yet";
};

}  // namespace hpr
