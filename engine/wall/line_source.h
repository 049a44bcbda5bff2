#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "core/timing.h"
#include "walls/link/socket.h"

namespace hpr {

class Communicator;

/// A line somebody typed or sent, and where the answer goes.
struct InputLine {
  int from = 0;
  std::string text;
  std::size_t number = 0;  ///< of all lines from there, from 1
};

/// Where the commands of a session come from: standard input, and clients of a socket. One user's alone: a Unix socket
/// only its owner may open, or a TCP port whose clients first send the line `token TOKEN`, within two seconds.
class LineSource {
 public:
  struct Options {
    bool standard_input = false;
    std::string listen;  ///< as parse_listen_address() has it; empty: no socket
  };

  /// Throws Error: Usage for a malformed address or one in use, Io when nothing can listen there.
  explicit LineSource(const Options& options);

  /// The next line; waits at most `timeout` for it.
  [[nodiscard]] std::optional<InputLine> next(std::chrono::milliseconds timeout);
  /// Whether `wanted` is true of any line that next() would return now; never waits.
  [[nodiscard]] bool any_waiting(const std::function<bool(const std::string& line)>& wanted);
  /// True once no line can come any more: standard input ended and nobody listens.
  [[nodiscard]] bool ended() const { return !standard_input_ && !listener_ && clients_.empty(); }
  /// Sends `text`, whole lines, where the line came from. A client that does not take it within a second is dropped.
  void answer(const InputLine& line, const std::string& text);

  /// What clients connect to: the path, or ADDRESS:PORT with the port that was taken; empty without a socket.
  [[nodiscard]] std::string address() const { return listener_ ? listener_->address() : ""; }
  /// What TCP clients send first: HPR_TOKEN, or made up where that is not set; empty for a Unix socket.
  [[nodiscard]] const std::string& token() const { return token_; }

 private:
  struct Client {
    Socket socket;    ///< none of standard input
    Stopwatch since;  ///< it connected
    std::string received;
    bool trusted = false;
    std::size_t lines = 0;
  };

  void accept_client();
  /// Appends what arrived to the client's buffer; false when the client left or sends what is no line.
  [[nodiscard]] bool read_from(int client);
  [[nodiscard]] std::optional<InputLine> take_line();
  /// Reads what arrives within that time; false: nothing did.
  bool watch(int timeout_ms);
  void drop(int client);
  void drop_unauthenticated();

  bool standard_input_;
  std::optional<Listener> listener_;
  std::string token_;
  std::map<int, Client> clients_;  ///< by descriptor; standard input is one
};

/// A line of input as every rank has it.
struct PolledInput {
  std::optional<std::string> line;
  bool ended = false;  ///< no line can come any more
};

/// Collective. The next line of rank 0's source, which waits at most `timeout` for one; no line where none came.
/// `from`: on rank 0, where the line came from.
[[nodiscard]] PolledInput poll_input(Communicator& comm, LineSource* source, std::chrono::milliseconds timeout,
                                     std::optional<InputLine>& from);

}  // namespace hpr
