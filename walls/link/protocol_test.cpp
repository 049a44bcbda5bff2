#include "walls/link/protocol.h"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <string>

#include "walls/link/connection.h"

namespace hpr {
namespace {

Hello example_hello() {
  Hello hello;
  hello.build = "hpr 1.2.3 (abc)";
  hello.role = LinkRole::Swap;
  hello.host = "wall01";
  hello.wall_hash = 0x0123456789ABCDEF;
  hello.session = 42;
  hello.run = "secret";
  hello.start = 2;
  hello.rank = 7;
  hello.screens = {{"a", {64, 48}}, {"b", {1, 65536}}};
  hello.nonce.fill(std::byte{3});
  hello.proof.fill(std::byte{4});
  return hello;
}

std::string refusal_of(const std::vector<std::byte>& block) {
  try {
    const auto size = block_bytes(block);
    if (!size || *size != block.size()) return "waits";
    (void)decode_hello(block);
  } catch (const LinkError& error) {
    return error.what();
  }
  return "";
}

/// Two ends of one stream.
std::pair<Connection, Connection> make_ends() {
  std::array<int, 2> ends{};
  EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends.data()), 0);
  return {Connection(Socket(ends[0])), Connection(Socket(ends[1]))};
}

TEST(LinkHandshake, BlocksReadBackAsTheyWereWritten) {
  const Hello hello = example_hello();
  const Hello read = decode_hello(encode(hello));
  EXPECT_EQ(read.build, hello.build);
  EXPECT_EQ(read.role, hello.role);
  EXPECT_EQ(read.host, hello.host);
  EXPECT_EQ(read.wall_hash, hello.wall_hash);
  EXPECT_EQ(read.session, hello.session);
  EXPECT_EQ(read.run, hello.run);
  EXPECT_EQ(read.start, hello.start);
  EXPECT_EQ(read.rank, hello.rank);
  EXPECT_EQ(read.screens, hello.screens);
  EXPECT_EQ(read.nonce, hello.nonce);
  EXPECT_EQ(read.proof, hello.proof);
  const Greeting greeting = decode_greeting(encode(Greeting{"b", hello.nonce, true}));
  EXPECT_EQ(greeting.build, "b");
  EXPECT_EQ(greeting.nonce, hello.nonce);
  EXPECT_TRUE(greeting.wants_token);
  const Reply reply = decode_reply(encode(Reply{false, true, "no", hello.proof}));
  EXPECT_FALSE(reply.accepted);
  EXPECT_TRUE(reply.busy);
  EXPECT_EQ(reply.reason, "no");
  EXPECT_EQ(reply.proof, hello.proof);
}

TEST(LinkHandshake, AnyFlippedBitIsFound) {
  const std::vector<std::byte> block = encode(example_hello());
  for (std::size_t bit = 0; bit < 8 * block.size(); ++bit) {
    std::vector<std::byte> damaged = block;
    damaged[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_NE(refusal_of(damaged), "") << "bit " << bit;
  }
}

TEST(LinkHandshake, ACutBlockIsWaitedForAndNeverRead) {
  const std::vector<std::byte> block = encode(example_hello());
  for (std::size_t size = 0; size < block.size(); ++size) {
    const std::vector<std::byte> cut(block.begin(), block.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_EQ(refusal_of(cut), "waits") << size;
    EXPECT_THROW((void)decode_hello(cut), LinkError) << size;
  }
}

TEST(LinkHandshake, AnotherProtocolByteOrderOrProgramIsNamed) {
  std::vector<std::byte> block = encode(example_hello());
  std::vector<std::byte> other = block;
  other[12] = std::byte{99};  // the protocol follows eight bytes of magic and four of byte order
  EXPECT_NE(refusal_of(other).find("protocol 99"), std::string::npos);
  other = block;
  std::ranges::reverse(std::span(other).subspan(8, 4));
  EXPECT_NE(refusal_of(other).find("byte order"), std::string::npos);
  const std::string http = "GET / HTTP/1.1\r\n\r\n";
  const auto bytes = std::as_bytes(std::span(http));
  EXPECT_NE(refusal_of({bytes.begin(), bytes.end()}).find("does not speak"), std::string::npos);
  other = block;
  other[19] = std::byte{0x7F};  // the highest byte of the length
  EXPECT_NE(refusal_of(other).find("too long"), std::string::npos);
}

TEST(LinkPackets, AnyFlippedBitOfAHeaderIsFound) {
  const std::vector<std::byte> packet =
      encode_packet({.type = PacketType::Frame, .screen = 3, .frame = 9, .time = 1.5});
  EXPECT_EQ(decode_header(packet).screen, 3U);
  EXPECT_EQ(decode_header(packet).frame, 9U);
  EXPECT_EQ(decode_header(packet).time, 1.5);
  for (std::size_t bit = 0; bit < 8 * kPacketHeaderBytes; ++bit) {
    std::vector<std::byte> damaged = packet;
    damaged[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_THROW((void)decode_header(damaged), LinkError) << "bit " << bit;
  }
}

TEST(LinkPackets, ArriveWholeHoweverTheyAreCutAndSayWhenTheirPayloadIsDamaged) {
  auto [sender, receiver] = make_ends();
  std::vector<std::byte> payload(1000);
  for (std::size_t i = 0; i < payload.size(); ++i) payload[i] = static_cast<std::byte>(i);
  std::vector<std::byte> stream = encode_packet({.type = PacketType::Frame, .frame = 1}, payload);
  std::vector<std::byte> second = encode_packet({.type = PacketType::Frame, .frame = 2}, payload);
  second.back() ^= std::byte{1};
  stream.insert(stream.end(), second.begin(), second.end());
  std::vector<std::uint64_t> frames;
  std::vector<bool> intact;
  for (std::size_t begin = 0; begin < stream.size(); begin += 7) {
    const std::size_t end = std::min(begin + 7, stream.size());
    sender.queue(std::vector<std::byte>(stream.begin() + static_cast<std::ptrdiff_t>(begin),
                                        stream.begin() + static_cast<std::ptrdiff_t>(end)));
    sender.send();
    receiver.receive();
    while (const auto packet = receiver.take_packet([](const PacketHeader&) { return std::size_t{1000}; })) {
      frames.push_back(packet->header.frame);
      intact.push_back(packet->intact);
      EXPECT_EQ(packet->payload.size(), payload.size());
      EXPECT_EQ(std::ranges::equal(packet->payload, payload), packet->intact);
    }
  }
  EXPECT_EQ(frames, (std::vector<std::uint64_t>{1, 2}));
  EXPECT_EQ(intact, (std::vector<bool>{true, false}));
}

TEST(LinkPackets, LongerThanAllowedAreRefusedByTheirHeader) {
  auto [sender, receiver] = make_ends();
  std::vector<std::byte> packet = encode_packet({.type = PacketType::Frame}, std::vector<std::byte>(11));
  packet.resize(kPacketHeaderBytes);  // nothing of the payload has come
  sender.queue(packet);
  sender.send();
  receiver.receive();
  EXPECT_THROW((void)receiver.take_packet([](const PacketHeader&) { return std::size_t{10}; }), LinkError);
  EXPECT_FALSE(receiver.take_packet([](const PacketHeader&) { return std::size_t{11}; }).has_value());
}

TEST(LinkPackets, AClosedEndIsNoticedAfterWhatCameBefore) {
  auto [sender, receiver] = make_ends();
  sender.queue(encode_packet({.type = PacketType::Bye}));
  sender.send();
  { const Connection gone = std::move(sender); }
  receiver.receive();
  EXPECT_TRUE(receiver.take_packet([](const PacketHeader&) { return std::size_t{0}; }).has_value());
  EXPECT_THROW(receiver.receive(), LinkError);
}

TEST(LinkToken, AProofIsOfThisTokenSideAndHandshakeOnly) {
  const Hello hello = example_hello();
  const LinkNonce nonce = make_nonce();
  const LinkProof proof = prove_token("secret", "run", nonce, hello);
  EXPECT_TRUE(same_proof(proof, prove_token("secret", "run", nonce, hello)));
  EXPECT_FALSE(same_proof(proof, prove_token("secrex", "run", nonce, hello)));
  EXPECT_FALSE(same_proof(proof, prove_token("secret", "display", nonce, hello)));
  EXPECT_FALSE(same_proof(proof, prove_token("secret", "run", make_nonce(), hello)));
  Hello other = hello;
  other.session = 43;
  EXPECT_FALSE(same_proof(proof, prove_token("secret", "run", nonce, other)));
}

}  // namespace
}  // namespace hpr
