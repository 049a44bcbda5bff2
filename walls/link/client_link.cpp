#include "walls/link/client_link.h"

#include <fmt/format.h>

#include <limits>

#include "core/text.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

constexpr double kRetry = 0.25;
constexpr double kHandshakeLimit = 2.0;
constexpr std::size_t kMaxAnswerBytes = 64;  ///< payload of what displays send, bytes

}  // namespace

ClientLink::ClientLink(LinkAddress address, Hello hello, std::string token)
    : address_(std::move(address)), hello_(std::move(hello)), token_(std::move(token)) {}

std::optional<pollfd> ClientLink::watched() const {
  if (!connection_) return std::nullopt;
  const bool writes = state_ == State::Connecting || !connection_->idle();
  return pollfd{connection_->socket().descriptor(), static_cast<short>(writes ? POLLIN | POLLOUT : POLLIN), 0};
}

ClientLink::Change ClientLink::step(double now, const std::function<void(const Packet&)>& arrived) {
  const bool was_up = up();
  try {
    return advance(now, arrived);
  } catch (const LinkError& error) {
    go_down(now, error.what());
    return was_up ? Change::Down : Change::None;
  }
}

bool ClientLink::connect(double now) {
  if (state_ == State::Down) {
    if (now < due_) return false;
    connection_ = std::make_unique<Connection>(start_connecting(address_));
    state_ = State::Connecting;
    due_ = now + kHandshakeLimit;
  }
  if (state_ != State::Up && now >= due_) throw LinkError("no answer");
  if (state_ == State::Connecting) {
    pollfd connecting{connection_->socket().descriptor(), POLLOUT, 0};
    if (::poll(&connecting, 1, 0) <= 0) return false;
    finish_connecting(connection_->socket(), address_.tcp);
    state_ = State::AwaitGreeting;
  }
  return true;
}

ClientLink::Change ClientLink::advance(double now, const std::function<void(const Packet&)>& arrived) {
  if (!connect(now)) return Change::None;
  // What arrived before the other end went counts: it may say why.
  try {
    connection_->receive();
  } catch (const LinkError&) {
    if (state_ == State::Up) throw;
    if (const auto block = connection_->take_block(); block && state_ == State::AwaitReply) judge(decode_reply(*block));
    throw;
  }
  if (state_ == State::AwaitGreeting) {
    if (const auto block = connection_->take_block()) answer(decode_greeting(*block));
  }
  if (state_ == State::AwaitReply) {
    if (const auto block = connection_->take_block()) {
      judge(decode_reply(*block));
      return Change::Up;
    }
  }
  if (state_ == State::Up) {
    const auto limit = [](const PacketHeader&) { return kMaxAnswerBytes; };
    while (const auto packet = connection_->take_packet(limit)) {
      if (!packet->intact) throw LinkError("an answer arrived damaged");
      arrived(*packet);
    }
  }
  connection_->send();
  return Change::None;
}

void ClientLink::answer(const Greeting& greeting) {
  if (greeting.build != hello_.build) {
    refuse(fmt::format("the display runs {}, this is {}: install the same build on both", printable(greeting.build),
                       hello_.build));
  }
  if (address_.tcp && !greeting.wants_token) refuse("the display does not ask for a token");
  if (greeting.wants_token && token_.empty()) refuse("the display asks for a token: set HPR_TOKEN");
  hello_.nonce = make_nonce();
  greeted_ = greeting.nonce;
  hello_.proof = greeting.wants_token ? prove_token(token_, "run", greeted_, hello_) : LinkProof{};
  connection_->queue(encode(hello_));
  state_ = State::AwaitReply;
}

void ClientLink::judge(const Reply& reply) {
  busy_ = !reply.accepted && reply.busy;
  if (!reply.accepted) refuse(printable(reply.reason, 400));
  if (address_.tcp && !same_proof(reply.proof, prove_token(token_, "display", greeted_, hello_))) {
    refuse("the display does not know the token in HPR_TOKEN");
  }
  refusal_.clear();
  failure_.clear();
  state_ = State::Up;
  due_ = std::numeric_limits<double>::infinity();
}

void ClientLink::refuse(const std::string& why) {
  refusal_ = why;
  throw LinkError(why);
}

void ClientLink::go_down(double now, const std::string& why) {
  connection_.reset();
  state_ = State::Down;
  failure_ = why;
  due_ = now + kRetry;
}

}  // namespace hpr
