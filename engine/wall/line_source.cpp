#include "engine/wall/line_source.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <vector>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/log.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

constexpr std::size_t kMaxLineBytes = 4096;
constexpr std::size_t kMaxClients = 8;
constexpr int kAnswerMs = 1000;
constexpr int kMaxTurns = 64;
constexpr double kTokenMs = 2000.0;

}  // namespace

LineSource::LineSource(const Options& options) : standard_input_(options.standard_input) {
  if (standard_input_) clients_[STDIN_FILENO].trusted = true;
  if (options.listen.empty()) return;
  listener_.emplace(parse_listen_address(options.listen));
  if (!listener_->tcp()) return;
  token_ = link_token();
  if (token_.empty()) token_ = random_token();
}

void LineSource::accept_client() {
  auto socket = listener_->accept();
  if (!socket) return;
  if (clients_.size() >= kMaxClients) {
    // Who has not shown the token keeps nobody out: the oldest of them makes room.
    const auto wait = [](const auto& client) { return client.second.trusted ? -1.0 : client.second.since.ms(); };
    const auto oldest = std::ranges::max_element(clients_, {}, wait);
    if (oldest->second.trusted) {
      log::warning("a client of the console was turned away: there are too many");
      return;
    }
    clients_.erase(oldest);
  }
  Client& client = clients_[socket->descriptor()];
  client.trusted = token_.empty();
  client.socket = std::move(*socket);
}

void LineSource::drop(int client) {
  clients_.erase(client);
  if (client == STDIN_FILENO) standard_input_ = false;
}

bool LineSource::read_from(int client) {
  std::array<char, kMaxLineBytes> buffer{};
  const ssize_t count = ::read(client, buffer.data(), buffer.size());
  if (count < 0) return errno == EAGAIN || errno == EINTR;
  Client& state = clients_[client];
  if (count == 0) {
    if (client != STDIN_FILENO || state.received.empty()) return false;
    state.received += '\n';  // a last line without its end; the next read ends it
    return true;
  }
  state.received.append(buffer.data(), static_cast<std::size_t>(count));
  return client == STDIN_FILENO || state.received.find('\n') != std::string::npos ||
         state.received.size() <= kMaxLineBytes;
}

std::optional<InputLine> LineSource::take_line() {
  for (auto& [client, state] : clients_) {
    const std::size_t end = state.received.find('\n');
    if (end == std::string::npos) continue;
    InputLine line{client, state.received.substr(0, end), ++state.lines};
    state.received.erase(0, end + 1);
    if (line.text.ends_with('\r')) line.text.pop_back();
    if (state.trusted) return line;
    if (!same_token(line.text, "token " + token_)) {
      log::warning("a client of the console was turned away: it does not know the token");
      drop(client);
    } else {
      state.trusted = true;
      answer(line, "ok\n");
    }
    return take_line();
  }
  return std::nullopt;
}

void LineSource::drop_unauthenticated() {
  std::erase_if(clients_,
                [](const auto& client) { return !client.second.trusted && client.second.since.ms() > kTokenMs; });
}

std::optional<InputLine> LineSource::next(std::chrono::milliseconds timeout) {
  // A new client has often sent a line already: until nothing new arrives.
  int wait = static_cast<int>(timeout.count());
  for (int turn = 0; turn < kMaxTurns; ++turn) {
    if (auto line = take_line()) return line;
    if (!watch(wait)) return std::nullopt;
    wait = 0;
  }
  return std::nullopt;
}

bool LineSource::any_waiting(const std::function<bool(const std::string& line)>& wanted) {
  for (int turn = 0; turn < kMaxTurns && watch(0); ++turn) {
  }
  return std::ranges::any_of(clients_, [&](const auto& client) {
    const std::string& received = client.second.received;
    if (!client.second.trusted) return false;
    std::size_t begin = 0;
    for (std::size_t end = received.find('\n'); end != std::string::npos; end = received.find('\n', begin)) {
      if (wanted(received.substr(begin, end - begin))) return true;
      begin = end + 1;
    }
    return false;
  });
}

bool LineSource::watch(int timeout_ms) {
  drop_unauthenticated();
  std::vector<pollfd> watched;
  for (const auto& [client, state] : clients_) watched.push_back({client, POLLIN, 0});
  if (listener_) watched.push_back({listener_->descriptor(), POLLIN, 0});
  if (::poll(watched.data(), watched.size(), timeout_ms) <= 0) return false;
  for (const pollfd& each : watched) {
    if (each.revents == 0) continue;
    if (listener_ && each.fd == listener_->descriptor()) {
      accept_client();
    } else if (!read_from(each.fd)) {
      drop(each.fd);
    }
  }
  return true;
}

void LineSource::answer(const InputLine& line, const std::string& text) {
  if (line.from == STDIN_FILENO) {
    fmt::print("{}", text);
    std::fflush(stdout);
    return;
  }
  const Stopwatch watch;
  std::string_view left = text;
  while (!left.empty()) {
    const ssize_t sent = ::send(line.from, left.data(), left.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      left.remove_prefix(static_cast<std::size_t>(sent));
      continue;
    }
    pollfd ready{line.from, POLLOUT, 0};
    const int wait = kAnswerMs - static_cast<int>(std::min<double>(watch.ms(), kAnswerMs));
    if ((errno != EAGAIN && errno != EINTR) || ::poll(&ready, 1, wait) <= 0) {
      drop(line.from);
      return;
    }
  }
}

namespace {

constexpr char kLine = '+';
constexpr char kNothing = '-';
constexpr char kEnd = '.';

}  // namespace

PolledInput poll_input(Communicator& comm, LineSource* source, std::chrono::milliseconds timeout,
                       std::optional<InputLine>& from) {
  std::string received_line(1, kNothing);
  if (source != nullptr) {
    from = source->next(timeout);
    if (from) {
      received_line = kLine + from->text;
    } else if (source->ended()) {
      received_line = kEnd;
    }
  }
  received_line = broadcast_text(comm, received_line);
  if (received_line.front() == kLine) return {received_line.substr(1), false};
  return {std::nullopt, received_line.front() == kEnd};
}

}  // namespace hpr
