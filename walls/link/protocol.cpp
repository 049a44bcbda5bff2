#include "walls/link/protocol.h"

#include <fmt/format.h>
#include <hpr/version.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "core/bytes.h"
#include "core/error.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

constexpr std::string_view kBlockMagic = "HPRLINK\n";
constexpr std::uint32_t kLinkProtocol = 3;
constexpr std::uint32_t kPacketMagic = 0x4B525048;  // "HPRK"
/// Written as it lies in memory: what comes out as another number comes from a machine of another byte order.
constexpr std::uint32_t kByteOrder = 0x01020304;
constexpr std::size_t kPreambleBytes = 8 + 4 + 4 + 4;
constexpr std::size_t kHashBytes = 8;
constexpr std::size_t kMaxBlockBytes = 1 << 20;
constexpr std::size_t kMaxTextBytes = 1024;

std::vector<std::byte> make_block(const ByteWriter& payload) {
  ByteWriter block;
  block.raw(std::as_bytes(std::span(kBlockMagic)));
  block.raw(std::as_bytes(std::span(&kByteOrder, 1)));
  block.u32(kLinkProtocol);
  block.u32(static_cast<std::uint32_t>(payload.bytes().size()));
  block.raw(payload.bytes());
  block.u64(xxh64(block.bytes()));
  return block.take();
}

/// The body of a whole block whose beginning block_bytes() has judged.
ByteReader open_block(std::span<const std::byte> block) {
  if (block.size() < kPreambleBytes + kHashBytes) throw LinkError("a handshake is too short");
  const auto hashed = block.first(block.size() - kHashBytes);
  if (ByteReader(block.last(kHashBytes)).u64() != xxh64(hashed)) throw LinkError("a handshake arrived damaged");
  return ByteReader(hashed.subspan(kPreambleBytes));
}

template <std::size_t Count>
void read_array(ByteReader& reader, std::array<std::byte, Count>& into) {
  std::ranges::copy(reader.raw(Count), into.begin());
}

bool read_bool(ByteReader& reader) {
  const std::uint8_t value = reader.u8();
  if (value > 1) throw LinkError("a handshake holds nonsense");
  return value == 1;
}

}  // namespace

std::vector<std::byte> encode(const Greeting& greeting) {
  ByteWriter payload;
  payload.text(greeting.build);
  payload.raw(greeting.nonce);
  payload.u8(greeting.wants_token ? 1 : 0);
  return make_block(payload);
}

std::vector<std::byte> encode(const Hello& hello) {
  ByteWriter payload;
  payload.text(hello.build);
  payload.u8(static_cast<std::uint8_t>(hello.role));
  payload.text(hello.host);
  payload.u64(hello.wall_hash);
  payload.u64(hello.session);
  payload.text(hello.run);
  payload.u32(hello.start);
  payload.u32(hello.rank);
  payload.u32(static_cast<std::uint32_t>(hello.screens.size()));
  for (const LinkScreen& screen : hello.screens) {
    payload.text(screen.id);
    payload.u32(static_cast<std::uint32_t>(screen.size.width));
    payload.u32(static_cast<std::uint32_t>(screen.size.height));
  }
  payload.raw(hello.nonce);
  payload.raw(hello.proof);
  return make_block(payload);
}

std::vector<std::byte> encode(const Reply& reply) {
  ByteWriter payload;
  payload.u8(reply.accepted ? 1 : 0);
  payload.u8(reply.busy ? 1 : 0);
  payload.text(reply.reason);
  payload.raw(reply.proof);
  return make_block(payload);
}

std::optional<std::size_t> block_bytes(std::span<const std::byte> begin) {
  const auto magic = std::as_bytes(std::span(kBlockMagic));
  const std::size_t seen = std::min(begin.size(), magic.size());
  if (!std::ranges::equal(begin.first(seen), magic.first(seen))) throw LinkError("the other end does not speak HPR's");
  if (begin.size() < kPreambleBytes) return std::nullopt;
  ByteReader reader(begin.subspan(magic.size()));
  std::uint32_t order = 0;
  std::memcpy(&order, reader.raw(sizeof order).data(), sizeof order);
  if (order != kByteOrder) throw LinkError("the other end's machine has another byte order");
  const std::uint32_t protocol = reader.u32();
  if (protocol != kLinkProtocol) {
    throw LinkError("the other end speaks protocol " + std::to_string(protocol) + " of displays, this is " +
                    std::to_string(kLinkProtocol) + ": install the same hpr on both");
  }
  const std::size_t payload = reader.u32();
  if (payload > kMaxBlockBytes) throw LinkError("a handshake is too long");
  return kPreambleBytes + payload + kHashBytes;
}

Greeting decode_greeting(std::span<const std::byte> block) {
  ByteReader reader = open_block(block);
  Greeting greeting;
  greeting.build = reader.text(kMaxTextBytes);
  read_array(reader, greeting.nonce);
  greeting.wants_token = read_bool(reader);
  reader.finish();
  return greeting;
}

Hello decode_hello(std::span<const std::byte> block) {
  ByteReader reader = open_block(block);
  Hello hello;
  hello.build = reader.text(kMaxTextBytes);
  const std::uint8_t role = reader.u8();
  if (role > static_cast<std::uint8_t>(LinkRole::Swap)) throw LinkError("a handshake names an unknown role");
  hello.role = static_cast<LinkRole>(role);
  hello.host = reader.text(kMaxTextBytes);
  hello.wall_hash = reader.u64();
  hello.session = reader.u64();
  hello.run = reader.text(kMaxTextBytes);
  hello.start = reader.u32();
  hello.rank = reader.u32();
  const std::uint32_t screens = reader.u32();
  if (screens > static_cast<std::uint32_t>(kMaxScreens)) throw LinkError("a handshake names too many screens");
  for (std::uint32_t i = 0; i < screens; ++i) {
    LinkScreen screen;
    screen.id = reader.text(kMaxTextBytes);
    const std::uint32_t width = reader.u32();
    const std::uint32_t height = reader.u32();
    if (std::max(width, height) > static_cast<std::uint32_t>(kMaxScreenSide)) {
      throw LinkError("a handshake names too large a screen");
    }
    screen.size = {static_cast<int>(width), static_cast<int>(height)};
    hello.screens.push_back(std::move(screen));
  }
  read_array(reader, hello.nonce);
  read_array(reader, hello.proof);
  reader.finish();
  return hello;
}

Reply decode_reply(std::span<const std::byte> block) {
  ByteReader reader = open_block(block);
  Reply reply;
  reply.accepted = read_bool(reader);
  reply.busy = read_bool(reader);
  reply.reason = reader.text(kMaxTextBytes);
  read_array(reader, reply.proof);
  reader.finish();
  return reply;
}

std::size_t max_picture_bytes(Size size) {
  // Bytes nothing can compress, a codec's own frame around them, and room.
  constexpr std::size_t kRoom = 65536;
  const std::size_t raw = size.area() * 4;
  return raw + raw / 8 + kRoom;
}

std::vector<std::byte> encode_packet(PacketHeader header, std::span<const std::byte> payload) {
  ByteWriter packet;
  packet.u32(kPacketMagic);
  packet.u32(static_cast<std::uint32_t>(header.type));
  packet.u32(header.screen);
  packet.u64(header.frame);
  packet.real(header.time);
  packet.u64(payload.size());
  packet.u64(xxh64(payload));
  packet.u64(xxh64(packet.bytes()));
  packet.raw(payload);
  return packet.take();
}

PacketHeader decode_header(std::span<const std::byte> bytes) {
  ByteReader hashed(bytes.first(kPacketHeaderBytes - kHashBytes));
  ByteReader hash(bytes.subspan(kPacketHeaderBytes - kHashBytes));
  if (hash.u64() != xxh64(hashed.rest())) throw LinkError("a packet's header arrived damaged");
  if (hashed.u32() != kPacketMagic) throw LinkError("a packet of another kind of program");
  PacketHeader header;
  const std::uint32_t type = hashed.u32();
  if (type < static_cast<std::uint32_t>(PacketType::Frame) || type > static_cast<std::uint32_t>(PacketType::NotShown)) {
    throw LinkError("a packet of an unknown type");
  }
  header.type = static_cast<PacketType>(type);
  header.screen = hashed.u32();
  header.frame = hashed.u64();
  header.time = hashed.real();
  header.length = hashed.u64();
  header.payload_hash = hashed.u64();
  if (!std::isfinite(header.time)) throw LinkError("a packet from no time");
  return header;
}

std::string link_build() {
  return fmt::format("hpr {} ({})", kVersion, kCommit);
}

std::string link_token() {
  const char* const token = std::getenv("HPR_TOKEN");  // NOLINT(concurrency-mt-unsafe): nobody writes the environment
  std::string secret = token == nullptr ? "" : token;
  constexpr std::size_t kMinLength = 8;
  if (!secret.empty() && secret.size() < kMinLength) {
    throw Error(ExitCode::Usage, fmt::format("the secret in HPR_TOKEN has fewer than {} characters", kMinLength),
                "make one that nobody can guess: HPR_TOKEN=$(od -An -N32 -tx1 /dev/urandom | tr -d ' \\n')");
  }
  return secret;
}

LinkNonce make_nonce() {
  LinkNonce nonce{};
  fill_random(std::as_writable_bytes(std::span(nonce)));
  return nonce;
}

std::uint64_t make_session() {
  return ByteReader(make_nonce()).u64();
}

LinkProof prove_token(const std::string& token, const std::string& who, const LinkNonce& of_display,
                      const Hello& hello) {
  Hello without_proof = hello;
  without_proof.proof = {};
  ByteWriter message;
  message.text(who);
  message.raw(of_display);
  message.raw(encode(without_proof));
  LinkProof proof{};
  unsigned int size = 0;
  const auto* const bytes = reinterpret_cast<const unsigned char*>(message.bytes().data());
  const unsigned char* const made = HMAC(EVP_sha256(), token.data(), static_cast<int>(token.size()), bytes,
                                         message.bytes().size(), reinterpret_cast<unsigned char*>(proof.data()), &size);
  HPR_CHECK(made != nullptr && size == proof.size());
  return proof;
}

bool same_proof(const LinkProof& a, const LinkProof& b) {
  return CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace hpr
