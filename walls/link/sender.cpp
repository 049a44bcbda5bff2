#include "walls/link/sender.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/log.h"
#include "core/timing.h"

namespace hpr {
namespace {

constexpr double kPingEvery = 0.25;
constexpr double kFirstPingsEvery = 0.01;
constexpr std::uint64_t kFirstPings = 4;
/// No frame follows the last one: it may take a little longer.
constexpr std::chrono::duration<double> kMinEnd{2.0};
/// A Unix socket moves about as much as memory.
constexpr double kSocketBytesPerSecond = 3e9;
constexpr double kMaxPoll_s = 0.25;
/// An order to show a frame reaches everybody before its time comes: round trips differ. Not more than this.
constexpr double kMaxLead_s = 0.02;
constexpr double kLead = 0.0005;

std::vector<std::size_t> display_of_screens(const Wall& wall) {
  std::vector<std::size_t> display_of(wall.screens.size());
  const std::vector<WallHost> hosts = wall_hosts(wall);
  for (std::size_t i = 0; i < hosts.size(); ++i) {
    for (const std::size_t screen : hosts[i].screens) display_of[screen] = i;
  }
  return display_of;
}

double now_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace

WallSender::WallSender(const Wall& wall, std::span<const int> owners, const SenderSettings& settings)
    : wall_(wall),
      settings_(settings),
      codecs_(wall.screens.size()),
      barrier_(display_of_screens(wall), wall_hosts(wall).size(), settings.swap_timeout.count()),
      alarm_(make_alarm()) {
  HPR_CHECK(owners.size() == wall.screens.size());
  for (const WallHost& host : wall_hosts(wall)) {
    if (settings.rank == 0) swaps_.push_back({make_link(host, LinkRole::Swap), host, {}});
    FrameLink frames{make_link(host, LinkRole::Frames), {}, {}, {}};
    CodecSettings codec = settings.codec_settings;
    if (!frames.link.address().tcp) codec.link_bytes_per_second = kSocketBytesPerSecond;
    for (std::size_t i = 0; i < host.screens.size(); ++i) {
      if (owners[host.screens[i]] != settings.rank) continue;
      frames.screens.push_back(host.screens[i]);
      frames.numbers.push_back(static_cast<std::uint32_t>(i));
      codecs_[host.screens[i]] = make_codec(settings.codec, codec);
    }
    frames.sent_anew.resize(frames.screens.size());
    frames.pictures.resize(frames.screens.size());
    frames.whole.resize(frames.screens.size(), true);
    if (!frames.screens.empty()) frames_.push_back(std::move(frames));
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

WallSender::~WallSender() {
  thread_.request_stop();
  raise_alarm(alarm_);
}

ClientLink WallSender::make_link(const WallHost& host, LinkRole role) const {
  const auto named = settings_.addresses.find(host.host);
  LinkAddress address =
      named != settings_.addresses.end() ? named->second : socket_address(display_socket(wall_, host.host));
  Hello hello;
  hello.build = settings_.build;
  hello.role = role;
  hello.host = host.host;
  hello.wall_hash = wall_.hash;
  hello.session = settings_.session;
  hello.run = settings_.run;
  hello.start = settings_.start;
  hello.rank = static_cast<std::uint32_t>(settings_.rank);
  hello.screens = link_screens(wall_, host);
  return {std::move(address), std::move(hello), settings_.token};
}

void WallSender::wait_for_displays(std::chrono::duration<double> limit) {
  std::unique_lock lock(mutex_);
  (void)news_.wait_for(
      lock, limit, [&] { return std::ranges::all_of(swaps_, [](const SwapLink& swap) { return swap.link.up(); }); });
  const auto busy = std::ranges::find_if(swaps_, [](const SwapLink& swap) { return swap.link.busy(); });
  if (busy != swaps_.end()) {
    log::info("the display of host '{}' shows another run; waiting {:.0f} s for its end", busy->host.host,
              settings_.busy_limit.count());
    (void)news_.wait_for(lock, settings_.busy_limit, [&] {
      return std::ranges::none_of(swaps_, [](const SwapLink& swap) { return swap.link.busy(); });
    });
  }
  for (const SwapLink& swap : swaps_) {
    if (swap.link.up() || swap.link.refusal().empty()) continue;
    throw Error(ExitCode::Lost, fmt::format("the display of host '{}' on {} refuses: {}", swap.host.host,
                                            swap.link.address().text, swap.link.refusal()));
  }
}

std::vector<WallSender::ScreenPacket> WallSender::encode_all(const WallFrame& frame) {
  std::vector<ScreenPacket> packets;
  packets.reserve(frame.screens.size());
  costs_.clear();
  restart_broken_streams();
  for (const ScreenPicture& picture : frame.screens) {
    const Stopwatch watch;
    const auto link = std::ranges::find_if(
        frames_, [&](const FrameLink& l) { return std::ranges::find(l.screens, picture.screen) != l.screens.end(); });
    HPR_CHECK(link != frames_.end());
    const auto index =
        static_cast<std::size_t>(std::ranges::find(link->screens, picture.screen) - link->screens.begin());
    PacketHeader header{PacketType::Frame, link->numbers[index], frame.number, now_since_1970(), 0, 0};
    const std::vector<std::byte> encoded = encode(picture.screen, picture.image);
    packets.push_back({picture.screen, std::make_shared<const std::vector<std::byte>>(encode_packet(header, encoded))});
    costs_.push_back({picture.screen, watch.ms(), encoded.size()});
  }
  return packets;
}

void WallSender::post(FrameLink& link, const WallFrame& frame, std::span<const ScreenPacket> packets) {
  link.current.clear();
  for (const std::size_t screen : link.screens) {
    const auto packet = std::ranges::find(packets, screen, &ScreenPacket::screen);
    HPR_CHECK(packet != packets.end());
    link.current.push_back(packet->message);
  }
  if (settings_.codec_settings.deltas) {
    for (std::size_t i = 0; i < link.screens.size(); ++i) {
      link.pictures[i] = std::ranges::find(frame.screens, link.screens[i], &ScreenPicture::screen)->image;
    }
  }
  link.sent = false;
  hand_over(link);
}

void WallSender::show(const WallFrame& frame) {
  const std::vector<ScreenPacket> packets = encode_all(frame);
  std::unique_lock lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
  for (FrameLink& link : frames_) post(link, frame, packets);
  if (swaps_.empty()) {
    raise_alarm(alarm_);
    return;
  }
  barrier_.post(frame.number, link_seconds());
  raise_alarm(alarm_);
  const auto ahead = static_cast<std::uint64_t>(settings_.in_flight);
  if (frame.number < ahead) return;
  const std::uint64_t awaited = frame.number - ahead;
  if (!news_.wait_for(lock, settings_.send_budget, [&] { return barrier_.all_ready(awaited); })) {
    barrier_.give_up(awaited, link_seconds());
  }
}

std::vector<std::byte> WallSender::encode(std::size_t screen, const Image<Rgba8>& picture) {
  std::vector<std::byte> encoded = codecs_[screen]->encode(picture);
  if (encoded.size() <= max_picture_bytes(picture.size())) return encoded;
  // What a codec cannot make smaller goes as it is.
  codecs_[screen]->restart();
  return make_codec("raw", {})->encode(picture);
}

void WallSender::restart_broken_streams() {
  if (!settings_.codec_settings.deltas) return;
  const std::lock_guard lock(mutex_);
  for (FrameLink& link : frames_) {
    for (std::size_t i = 0; i < link.screens.size(); ++i) {
      if (link.whole[i] || !link.sent) codecs_[link.screens[i]]->restart();
      link.whole[i] = false;
    }
  }
}

void WallSender::make_whole(FrameLink& link, std::size_t index) const {
  link.whole[index] = true;
  if (!settings_.codec_settings.deltas || index >= link.current.size()) return;
  PacketHeader header = decode_header(std::span(*link.current[index]).first(kPacketHeaderBytes));
  link.current[index] = std::make_shared<const std::vector<std::byte>>(
      encode_packet(header, make_codec("raw", {})->encode(link.pictures[index])));
}

void WallSender::finish() {
  std::unique_lock lock(mutex_);
  const std::uint64_t newest = barrier_.newest().value_or(0);
  const auto limit = std::max(settings_.send_budget + settings_.swap_timeout, kMinEnd);
  const auto done = [&] {
    return failure_ != nullptr || (all_sent() && (swaps_.empty() || barrier_.all_shown(newest)));
  };
  (void)news_.wait_for(lock, limit, done);
  if (failure_) std::rethrow_exception(failure_);
  degraded_s_ = barrier_.degraded_seconds(link_seconds());
  finishing_ = true;
  for (SwapLink& swap : swaps_) {
    if (swap.link.up()) swap.link.connection().queue(encode_packet({.type = PacketType::Bye}));
  }
  for (FrameLink& link : frames_) {
    if (link.link.up()) link.link.connection().queue(encode_packet({.type = PacketType::Bye}));
  }
  raise_alarm(alarm_);
  (void)news_.wait_for(lock, settings_.send_budget, [&] {
    return all_sent() && std::ranges::all_of(swaps_, [](const SwapLink& swap) {
             return !swap.link.up() || swap.link.connection().idle();
           });
  });
}

SwapOutcome WallSender::outcome(std::uint64_t frame) const {
  const std::lock_guard lock(mutex_);
  return barrier_.outcome(frame);
}

void WallSender::forget_before(std::uint64_t frame) {
  const std::lock_guard lock(mutex_);
  barrier_.forget_before(frame);
}

bool WallSender::reached_any() const {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(swaps_, &SwapLink::ever_up);
}

std::string WallSender::why_unreached() const {
  const std::lock_guard lock(mutex_);
  return swaps_.empty() ? "" : fmt::format("{}: {}", swaps_.front().link.address().text, swaps_.front().link.failure());
}

void WallSender::run(const std::stop_token& stop) {
  try {
    while (!stop.stop_requested()) {
      {
        const std::lock_guard lock(mutex_);
        step(link_seconds());
      }
      news_.notify_all();
      wait_for_news(link_seconds());
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    news_.notify_all();
  }
}

void WallSender::wait_for_news(double now) {
  std::vector<pollfd> watched{{alarm_.descriptor(), POLLIN, 0}};
  double until = now + kMaxPoll_s;
  {
    const std::lock_guard lock(mutex_);
    const auto add = [&](const ClientLink& link) {
      if (const auto one = link.watched()) watched.push_back(*one);
      until = std::min(until, link.next_due());
    };
    for (const FrameLink& link : frames_) add(link.link);
    for (const SwapLink& swap : swaps_) {
      add(swap.link);
      if (swap.link.up()) until = std::min(until, swap.next_ping);
    }
    if (const auto due = barrier_.next_due()) until = std::min(until, *due);
  }
  const double wait_ms = std::ceil(std::clamp(until - now, 0.0, kMaxPoll_s) * 1000.0);
  (void)::poll(watched.data(), watched.size(), static_cast<int>(wait_ms));
  clear_alarm(alarm_);
}

void WallSender::step(double now) {
  for (FrameLink& link : frames_) step_frames(link, now);
  for (std::size_t display = 0; display < swaps_.size(); ++display) step_swap(display, now);
  if (!swaps_.empty()) present(now);
}

void WallSender::step_frames(FrameLink& link, double now) {
  const auto send_again = [&](const Packet& packet) {
    // A damaged picture that is still the latest is sent once more.
    const auto index = std::ranges::find(link.numbers, packet.header.screen) - link.numbers.begin();
    const auto i = static_cast<std::size_t>(index);
    if (packet.header.type != PacketType::Damaged || i >= link.current.size()) return;
    make_whole(link, i);
    const std::uint64_t latest = decode_header(std::span(*link.current[i]).first(kPacketHeaderBytes)).frame;
    if (packet.header.frame != latest || link.sent_anew[i] == latest + 1) return;
    link.sent_anew[i] = latest + 1;
    link.link.connection().queue(link.current[i]);
  };
  // A display that comes back gets the current frame.
  if (link.link.step(now, send_again) == ClientLink::Change::Up) {
    link.sent = link.current.empty();
    for (std::size_t i = 0; i < link.screens.size(); ++i) make_whole(link, i);
  }
  hand_over(link);
}

void WallSender::hand_over(FrameLink& link) const {
  if (!link.link.up() || link.sent) return;
  Connection& connection = link.link.connection();
  // What it cannot take in time is not kept: it goes on with the latest.
  if (connection.unsent() > static_cast<std::size_t>(settings_.in_flight) * link.screens.size()) return;
  for (const LinkMessage& message : link.current) connection.queue(message);
  link.sent = true;
}

void WallSender::step_swap(std::size_t display, double now) {
  SwapLink& swap = swaps_[display];
  const auto take = [&](const Packet& packet) { take_answer(display, packet, now); };
  auto change = swap.link.step(now, take);
  if (change == ClientLink::Change::Up) {
    swap.ever_up = true;
    swap.clock = {};
    swap.pings = 0;
    swap.next_ping = now;
    barrier_.connected(display, now);
    log::debug("display of host '{}' on {} answers", swap.host.host, swap.link.address().text);
    // What it has ready counts only from here on.
    change = swap.link.step(now, take);
  }
  if (change == ClientLink::Change::Down) {
    if (!finishing_) barrier_.gone(display, now);
    log::debug("display of host '{}' on {}: {}", swap.host.host, swap.link.address().text, swap.link.failure());
  }
  if (swap.ever_up && swap.link.refusal() != swap.reported_refusal) {
    swap.reported_refusal = swap.link.refusal();
    if (!swap.reported_refusal.empty())
      log::warning("the display of host '{}' refuses: {}", swap.host.host, swap.reported_refusal);
  }
  if (!swap.link.up() || now < swap.next_ping) return;
  ++swap.pings;
  const double sent = link_seconds();
  swap.ping_sent.at(swap.pings % swap.ping_sent.size()) = sent;
  swap.next_ping = now + (swap.pings <= kFirstPings ? kFirstPingsEvery : kPingEvery);
  swap.link.connection().queue(encode_packet({.type = PacketType::Ping, .frame = swap.pings, .time = sent}));
}

void WallSender::take_answer(std::size_t display, const Packet& packet, double now) {
  SwapLink& swap = swaps_[display];
  const PacketHeader& header = packet.header;
  switch (header.type) {
    case PacketType::Ready:
      if (header.screen >= swap.host.screens.size()) throw LinkError("a screen nobody knows");
      barrier_.ready(swap.host.screens[header.screen], header.frame, now);
      break;
    case PacketType::Presented:
      // Before the first round trip nothing is known of its clock but when its words come.
      barrier_.shown(display, header.frame, swap.clock.known() ? header.time - swap.clock.seconds() : now);
      break;
    case PacketType::NotShown:
      barrier_.not_shown(display, header.frame, now);
      break;
    case PacketType::Pong: {
      if (header.frame > swap.pings || header.frame + swap.ping_sent.size() <= swap.pings) break;  // of no known ping
      ByteReader times(packet.payload);
      const double arrived = times.real();
      const double answered = times.real();
      if (!std::isfinite(arrived) || !std::isfinite(answered)) throw LinkError("a clock out of its mind");
      swap.clock.add(swap.ping_sent.at(header.frame % swap.ping_sent.size()), arrived, answered, link_seconds());
      break;
    }
    default:
      throw LinkError("a packet that is not for this end");
  }
}

void WallSender::present(double now) {
  double lead = 0.0;
  for (const SwapLink& swap : swaps_) {
    if (swap.link.up()) lead = std::max(lead, swap.clock.round_trip());
  }
  const double at = now + std::min(lead + kLead, kMaxLead_s);
  for (const SwapDecision& decision : barrier_.due(now)) {
    SwapLink& swap = swaps_[decision.display];
    if (!swap.link.up()) continue;
    // Zero has passed on any clock.
    const double when = decision.late || !swap.clock.known() ? 0.0 : at + swap.clock.seconds();
    swap.link.connection().queue(encode_packet({.type = PacketType::Present, .frame = decision.frame, .time = when}));
  }
  for (const SwapEvent& event : barrier_.take_events()) report_event(event);
}

void WallSender::report_event(const SwapEvent& event) const {
  if (finishing_) return;
  const WallHost& host = swaps_[event.display].host;
  for (const std::size_t screen : host.screens) {
    const std::string& id = wall_.screens[screen].id;
    if (event.kind == SwapEvent::Kind::Lost) {
      log::warning("screen {} ({}) lost, frame {}; retrying", id, host.host, event.frame);
    } else if (event.kind == SwapEvent::Kind::Stale) {
      log::warning("screen {} ({}) is behind, frame {}", id, host.host, event.frame);
    } else if (event.kind == SwapEvent::Kind::Failed) {
      log::warning("screen {} ({}) cannot be shown, frame {}; the log of its display says why", id, host.host,
                   event.frame);
    } else {
      log::info("screen {} ({}) back, frame {}", id, host.host, event.frame);
    }
  }
}

bool WallSender::all_sent() const {
  return std::ranges::all_of(
      frames_, [](const FrameLink& link) { return !link.link.up() || (link.sent && link.link.connection().idle()); });
}

}  // namespace hpr
