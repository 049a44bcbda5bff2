#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/error.h"

namespace hpr {

/// A line somebody typed or sent, and where the answer goes.
struct InputLine {
  int from = 0;
  std::string text;
};

/// Where the commands of a session come from: standard input, and clients of a socket. One user's alone: a Unix socket
/// only its owner may open, or a TCP port whose clients first send the line `token TOKEN`.
class LineSource {
 public:
  struct Options {
    bool standard_input = false;
    /// A path for a Unix socket, or ADDRESS:PORT (numeric; port 0: a free one) for TCP; empty: no socket.
    std::string listen;
  };

  /// Throws Error: Usage for a malformed address, Io when nothing can listen there.
  explicit LineSource(const Options& options);
  ~LineSource();
  LineSource(const LineSource&) = delete;
  LineSource& operator=(const LineSource&) = delete;

  /// The next line, waiting at most so long for one.
  [[nodiscard]] std::optional<InputLine> next(std::chrono::milliseconds longest);
  /// True once no line can come any more: standard input ended and nobody listens.
  [[nodiscard]] bool ended() const { return !standard_input_ && listener_ < 0 && clients_.empty(); }
  /// Sends `text`, whole lines, where the line came from. A client that does not take it within a second is dropped.
  void answer(const InputLine& line, const std::string& text);

  /// What clients connect to: the path, or ADDRESS:PORT with the port that was taken; empty without a socket.
  [[nodiscard]] const std::string& address() const { return address_; }
  /// What TCP clients send first; empty for a Unix socket.
  [[nodiscard]] const std::string& token() const { return token_; }

 private:
  struct Client {
    std::string received;
    bool trusted = false;
  };

  void listen_on_path(const std::string& path);
  void listen_on_port(const std::string& address);
  void accept_client();
  /// What arrived is kept; false when the client left or sends what is no line.
  [[nodiscard]] bool read_from(int client);
  [[nodiscard]] std::optional<InputLine> take_line();
  void drop(int client);

  bool standard_input_;
  int listener_ = -1;
  std::string address_;
  std::string token_;
  std::filesystem::path socket_file_;
  std::map<int, Client> clients_;  ///< by descriptor; standard input is one
};

}  // namespace hpr
