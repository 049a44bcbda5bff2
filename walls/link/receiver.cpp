#include "walls/link/receiver.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <chrono>

#include "core/bytes.h"
#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

constexpr std::size_t kMaxPeers = 4096 + 64;  ///< ranks, and whoever else tries
constexpr std::size_t kMaxUnknownPeers = 64;
constexpr double kHandshakeLimit = 2.0;
/// Rank 0 asks for moments a few milliseconds ahead. One further off comes from a round trip that measured the clocks
/// badly, and is not waited for.
constexpr double kMaxMoment = 0.05;
constexpr std::size_t kMaxPending = 10;  ///< pictures of one screen: more than may be in flight
constexpr int kPollMs = 250;

}  // namespace

FrameReceiver::FrameReceiver(ReceiverSettings settings) : settings_(std::move(settings)), alarm_(make_alarm()) {
  for (const LinkAddress& address : settings_.listen) {
    if (address.tcp && settings_.token.empty()) {
      throw Error(ExitCode::Usage, fmt::format("listening on {} takes a token", address.text),
                  "set HPR_TOKEN to the same secret here and for wall run");
    }
    listeners_.emplace_back(address);
  }
  for (std::size_t i = 0; i < settings_.screens.size(); ++i) {
    screens_.emplace_back();
    screens_.back().codec = make_codec("raw", {});  // takes what any codec sends
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

FrameReceiver::~FrameReceiver() {
  thread_.request_stop();
  raise_alarm(alarm_);
}

std::optional<Presentation> FrameReceiver::next(double limit) {
  const double until = settings_.clock() + limit;
  std::unique_lock lock(mutex_);
  while (true) {
    if (failure_) std::rethrow_exception(failure_);
    const double now = settings_.clock();
    const double wake = orders_.empty() ? until : std::min(until, orders_.front().second);
    if (!orders_.empty() && now >= orders_.front().second) break;
    if (now >= until) return std::nullopt;
    (void)news_.wait_for(lock, std::chrono::duration<double>(wake - now));
  }
  Presentation presentation{orders_.front().first, orders_.front().second, session_, {}};
  orders_.pop_front();
  for (std::size_t i = 0; i < screens_.size(); ++i) {
    Screen& screen = screens_[i];
    const auto picture = screen.pending.find(presentation.frame);
    if (picture == screen.pending.end()) {
      const bool behind = !screen.report.frame || *screen.report.frame < presentation.frame;
      if (behind && screen.missed != presentation.frame) ++screen.report.late;
      screen.missed = presentation.frame;
    } else {
      presentation.pictures.emplace_back(i, std::move(picture->second.image));
    }
    screen.pending.erase(screen.pending.begin(), screen.pending.upper_bound(presentation.frame));
  }
  showing_ = true;
  return presentation;
}

bool FrameReceiver::shown(const Presentation& presentation) {
  const double at = now();
  const std::lock_guard lock(mutex_);
  showing_ = false;
  if (presentation.session != session_) {
    announce();
    raise_alarm(alarm_);
    return false;
  }
  for (const auto& [screen, image] : presentation.pictures) {
    screens_[screen].report.frame = presentation.frame;
    screens_[screen].report.skew_s = at - presentation.asked;
  }
  if (Peer* const swap = swap_peer()) {
    swap->connection.queue(encode_packet({.type = PacketType::Presented, .frame = presentation.frame, .time = at}));
  }
  announce();
  raise_alarm(alarm_);
  return true;
}

void FrameReceiver::not_shown(const Presentation& presentation) {
  const std::lock_guard lock(mutex_);
  showing_ = false;
  Peer* const swap = presentation.session == session_ ? swap_peer() : nullptr;
  if (swap != nullptr) {
    swap->connection.queue(encode_packet({.type = PacketType::NotShown, .frame = presentation.frame, .time = now()}));
  }
  announce();
  raise_alarm(alarm_);
}

std::vector<std::string> FrameReceiver::addresses() const {
  std::vector<std::string> all;
  for (const Listener& listener : listeners_) all.push_back(listener.address());
  return all;
}

ReceiverReport FrameReceiver::report() const {
  const std::lock_guard lock(mutex_);
  const bool connected = std::ranges::any_of(peers_, [](const auto& peer) { return peer->open; });
  ReceiverReport report{{}, ended_, runs_, connected, !showing_ && orders_.empty()};
  for (const Screen& screen : screens_) report.screens.push_back(screen.report);
  return report;
}

void FrameReceiver::run(const std::stop_token& stop) {
  try {
    while (!stop.stop_requested()) {
      wait_for_news();
      {
        const std::lock_guard lock(mutex_);
        step();
      }
      news_.notify_all();
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    news_.notify_all();
  }
}

void FrameReceiver::wait_for_news() {
  std::vector<pollfd> watched{{alarm_.descriptor(), POLLIN, 0}};
  {
    const std::lock_guard lock(mutex_);
    for (const Listener& listener : listeners_) watched.push_back({listener.descriptor(), POLLIN, 0});
    for (const auto& peer : peers_) {
      const bool writes = !peer->connection.idle();
      watched.push_back(
          {peer->connection.socket().descriptor(), static_cast<short>(writes ? POLLIN | POLLOUT : POLLIN), 0});
    }
  }
  (void)::poll(watched.data(), watched.size(), kPollMs);
  clear_alarm(alarm_);
}

void FrameReceiver::step() {
  for (const Listener& listener : listeners_) accept(listener);
  for (std::size_t i = 0; i < peers_.size();) {
    bool stays = false;
    try {
      stays = step_peer(*peers_[i], settings_.clock());
    } catch (const LinkError& error) {
      log::debug("a link ended: {}", error.what());
    }
    if (stays) {
      ++i;
    } else {
      peers_.erase(peers_.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
}

void FrameReceiver::accept(const Listener& listener) {
  while (auto socket = listener.accept()) {
    if (peers_.size() >= kMaxPeers) continue;
    const auto unknown = [](const auto& peer) { return !peer->open; };
    if (static_cast<std::size_t>(std::ranges::count_if(peers_, unknown)) >= kMaxUnknownPeers) {
      // The one that has waited longest makes room: ranks take milliseconds to say who they are.
      peers_.erase(std::ranges::find_if(peers_, unknown));
    }
    auto peer = std::make_unique<Peer>(Peer{Connection(std::move(*socket)), listener.tcp()});
    peer->nonce = make_nonce();
    peer->since = settings_.clock();
    peer->connection.queue(encode(Greeting{settings_.build, peer->nonce, listener.tcp()}));
    peers_.push_back(std::move(peer));
  }
}

bool FrameReceiver::step_peer(Peer& peer, double now) {
  if (peer.closing) {
    peer.connection.send();
    return !peer.connection.idle() && now - peer.since < kHandshakeLimit;
  }
  peer.connection.receive();
  if (!peer.open) {
    if (now - peer.since > kHandshakeLimit) throw LinkError("no handshake");
    answer(peer);
  }
  if (peer.open) {
    const auto limit = [&](const PacketHeader& header) -> std::size_t {
      if (header.type != PacketType::Frame) return 0;
      if (header.screen >= settings_.screens.size()) throw LinkError("a picture for a screen nobody knows");
      return max_picture_bytes(settings_.screens[header.screen].size);
    };
    while (const auto packet = peer.connection.take_packet(limit)) {
      peer.since = now;
      take(peer, *packet);
    }
    if (peer.hello.role == LinkRole::Swap && now - peer.since > settings_.silence) throw LinkError("rank 0 is silent");
  }
  peer.connection.send();
  return true;
}

void FrameReceiver::answer(Peer& peer) {
  const auto block = peer.connection.take_block();
  if (!block) return;
  const Hello hello = decode_hello(*block);
  std::string reason = objection(peer, hello);
  Reply reply = reason.empty() ? judge_run(hello) : Reply{.reason = std::move(reason)};
  if (!reply.accepted) {
    log::warning("refused rank {} of a run: {}", hello.rank, printable(reply.reason, 400));
    peer.closing = true;
  } else {
    if (session_ != hello.session) begin_session(hello);
    if (peer.tcp) reply.proof = prove_token(settings_.token, "display", peer.nonce, hello);
    peer.hello = hello;
    peer.open = true;
    peer.since = settings_.clock();
    // Ranks may link again between the end of a run and their own.
    if (hello.role == LinkRole::Swap) ended_ = false;
  }
  peer.connection.queue(encode(reply));
  if (peer.open && hello.role == LinkRole::Swap) {
    // Whoever agrees on frames anew learns what is here.
    for (std::size_t i = 0; i < screens_.size(); ++i) {
      for (auto& [number, pending] : screens_[i].pending) pending.announced = false;
      if (!screens_[i].report.frame) continue;
      peer.connection.queue(encode_packet(
          {.type = PacketType::Ready, .screen = static_cast<std::uint32_t>(i), .frame = *screens_[i].report.frame}));
    }
    announce();
  }
}

std::string FrameReceiver::objection(const Peer& peer, const Hello& hello) const {
  // The token first: strangers learn nothing of the wall.
  if (peer.tcp && !same_proof(hello.proof, prove_token(settings_.token, "run", peer.nonce, hello))) {
    return "the token differs: set HPR_TOKEN to the same secret on both";
  }
  if (hello.build != settings_.build) {
    return fmt::format("the display runs {}, the run {}: install the same build on both", settings_.build,
                       printable(hello.build));
  }
  if (hello.host != settings_.host) {
    return fmt::format("this is the display of host '{}', not of '{}'", settings_.host, printable(hello.host));
  }
  if (hello.wall_hash != settings_.wall_hash) {
    return fmt::format("the display has another wall ({}) than the run ({}): give both the same wall file",
                       hex16(settings_.wall_hash), hex16(hello.wall_hash));
  }
  if (hello.screens != settings_.screens) {
    return "the screens have other sizes here: give display and run the same --scale";
  }
  return "";
}

/// A run that was lost and started again takes over at once: its links may stand open for long where the network was
/// cut. Who was lost and comes back finds its successor.
Reply FrameReceiver::judge_run(const Hello& hello) const {
  if (!session_ || hello.session == *session_) return {.accepted = true};
  if (hello.run == run_) {
    if (hello.start > start_) return {.accepted = true};
    return {.reason = "the display shows a later start of this run"};
  }
  const bool busy =
      std::ranges::any_of(peers_, [](const auto& other) { return other->open && other->hello.role == LinkRole::Swap; });
  if (!busy) return {.accepted = true};
  return {.busy = true, .reason = "the display shows another run: wait until that has ended"};
}

void FrameReceiver::begin_session(const Hello& hello) {
  session_ = hello.session;
  run_ = hello.run;
  start_ = hello.start;
  ended_ = false;
  for (const auto& other : peers_) {
    if (other->open) other->closing = true;  // left over from the run before
  }
  orders_.clear();
  for (Screen& screen : screens_) {
    screen.pending.clear();
    screen.codec->restart();
    screen.report = {};
    screen.missed.reset();
  }
  log::info("a run begins to show on host '{}'", settings_.host);
}

void FrameReceiver::take(Peer& peer, const Packet& packet) {
  const PacketHeader& header = packet.header;
  const bool swap = peer.hello.role == LinkRole::Swap;
  if (header.type == PacketType::Frame && !swap) {
    take_picture(peer, packet);
  } else if (header.type == PacketType::Present && swap) {
    const double now = settings_.clock();
    const bool moment = header.time < now + kMaxMoment && header.time > now - settings_.silence;
    orders_.emplace_back(header.frame, moment ? header.time : now);
    if (orders_.size() > kMaxPending) orders_.pop_front();
  } else if (header.type == PacketType::Ping && swap) {
    ByteWriter times;
    const double now = settings_.clock();
    times.real(now);
    times.real(now);
    peer.connection.queue(encode_packet({.type = PacketType::Pong, .frame = header.frame}, times.bytes()));
  } else if (header.type == PacketType::Bye) {
    if (!swap) return;
    ended_ = true;
    ++runs_;
    show_rest();
  } else {
    throw LinkError("a packet that is not for this end");
  }
}

/// Nobody will ask for what has not been shown yet, and the last frame is what stays.
void FrameReceiver::show_rest() {
  std::optional<std::uint64_t> newest;
  for (const Screen& screen : screens_) {
    if (!screen.pending.empty()) newest = std::max(newest.value_or(0), screen.pending.rbegin()->first);
  }
  if (newest) orders_.emplace_back(*newest, now());
}

void FrameReceiver::take_picture(Peer& peer, const Packet& packet) {
  const PacketHeader& header = packet.header;
  Screen& screen = screens_.at(header.screen);
  if (screen.report.frame && header.frame <= *screen.report.frame) return;  // sent again, and shown already
  Image<Rgba8> image(settings_.screens[header.screen].size);
  try {
    if (!packet.intact) throw Error(ExitCode::BadInput, "the packet arrived damaged");
    screen.codec->decode(packet.payload, image);
  } catch (const Error& error) {
    ++screen.report.dropped;
    log::debug("screen {}, frame {}: {}", settings_.screens[header.screen].id, header.frame, error.what());
    peer.connection.queue(encode_packet({.type = PacketType::Damaged, .screen = header.screen, .frame = header.frame}));
    return;
  }
  screen.report.arrived = settings_.clock();
  screen.pending.insert_or_assign(header.frame, Pending{std::move(image), false});
  if (screen.pending.size() > kMaxPending) screen.pending.erase(screen.pending.begin());
  announce();
  if (ended_) show_rest();
}

/// Ready is what could be shown at once: nothing else is about to be.
void FrameReceiver::announce() {
  Peer* const swap = swap_peer();
  if (swap == nullptr || showing_ || !orders_.empty()) return;
  for (std::size_t i = 0; i < screens_.size(); ++i) {
    for (auto& [number, pending] : screens_[i].pending) {
      if (std::exchange(pending.announced, true)) continue;
      swap->connection.queue(
          encode_packet({.type = PacketType::Ready, .screen = static_cast<std::uint32_t>(i), .frame = number}));
    }
  }
}

FrameReceiver::Peer* FrameReceiver::swap_peer() {
  const auto peer = std::ranges::find_if(peers_, [&](const auto& one) {
    return one->open && !one->closing && one->hello.role == LinkRole::Swap && one->hello.session == session_;
  });
  return peer == peers_.end() ? nullptr : peer->get();
}

}  // namespace hpr
