#include <cstring>

#include "core/bytes.h"
#include "core/error.h"
#include "tests/fuzz/fuzz.h"
#include "walls/codecs/codec.h"
#include "walls/link/protocol.h"

// What comes to a display's port: handshakes, packets, and the pictures in them.
namespace hpr::fuzz {
namespace {

constexpr Size kPicture{70, 66};  ///< of four tiles
constexpr std::size_t kHash = 8;  ///< bytes

Hello example() {
  Hello hello;
  hello.build = "build";
  hello.host = "host";
  hello.run = "run";
  hello.screens = {{"a", kPicture}, {"b", {1, 2}}};
  return hello;
}

Image<Rgba8> picture(int shade) {
  Image<Rgba8> image(kPicture, {1, 2, 3, 255});
  for (int x = 0; x < kPicture.width; ++x) image.at(x, x % kPicture.height).r = static_cast<std::uint8_t>(shade * x);
  return image;
}

template <typename Read>
bool reads(Read read) {
  try {
    read();
    return true;
  } catch (const LinkError&) {
    return false;
  } catch (const Error& error) {
    if (error.code() == ExitCode::Internal) throw;  // a fault of the program's
    return false;
  }
}

}  // namespace

std::vector<Bytes> seeds() {
  std::vector<Bytes> all{encode(Greeting{"build", {}, true}), encode(example()), encode(Reply{false, true, "no", {}})};
  all.push_back(encode_packet({.type = PacketType::Frame, .screen = 1, .frame = 7}, to_bytes("payload")));
  for (const std::string& name : all_codecs()) {
    for (const bool deltas : {false, true}) {
      const auto codec = make_codec(name, {.error = deltas ? 2 : 0, .deltas = deltas});
      all.push_back(codec->encode(picture(1)));
      if (name == "zstd" && deltas) all.push_back(codec->encode(picture(2)));
    }
  }
  return all;
}

bool run(std::span<const std::byte> input) {
  bool good = reads([&] { (void)decode_greeting(input); });
  good |= reads([&] { (void)decode_hello(input); });
  good |= reads([&] { (void)decode_reply(input); });
  (void)reads([&] { (void)block_bytes(input); });
  if (input.size() >= kPacketHeaderBytes) {
    good |= reads([&] { (void)decode_header(input.first(kPacketHeaderBytes)); });
  }
  const auto codec = make_codec("raw", {});
  Image<Rgba8> decoded(kPicture);
  good |= reads([&] { codec->decode(input, decoded); });
  // Tiles build on a picture that was decoded before.
  static const std::vector<std::byte> first = make_codec("zstd", {.error = 2, .deltas = true})->encode(picture(1));
  const auto later = make_codec("raw", {});
  good |= reads([&] {
    later->decode(first, decoded);
    later->decode(input, decoded);
  });
  return good;
}

/// A block's sum at its end, a packet's in its header, and an encoded picture's.
Bytes repaired(Bytes input) {
  constexpr std::string_view kBlock = "HPRLINK\n";
  constexpr std::string_view kCodec = "HPRC";
  constexpr std::size_t kPreamble = 20;
  constexpr std::size_t kEnvelope = 48;
  const auto starts = [&](std::string_view magic) {
    return input.size() >= magic.size() && std::memcmp(input.data(), magic.data(), magic.size()) == 0;
  };
  const auto put = [&](std::size_t at, std::uint64_t value) { std::memcpy(input.data() + at, &value, sizeof(value)); };
  const std::span<const std::byte> all(input);
  if (starts(kBlock) && input.size() >= kPreamble + kHash) {
    const auto payload = static_cast<std::uint32_t>(input.size() - kPreamble - kHash);
    std::memcpy(input.data() + kPreamble - sizeof(payload), &payload, sizeof(payload));
    put(input.size() - kHash, xxh64(all.first(input.size() - kHash)));
  } else if (starts(kCodec) && input.size() >= kEnvelope) {
    put(kEnvelope - 2 * kHash, input.size() - kEnvelope);
    put(kEnvelope - kHash, 0);
    put(kEnvelope - kHash, xxh64(all));
  } else if (input.size() >= kPacketHeaderBytes) {
    put(kPacketHeaderBytes - kHash, xxh64(all.first(kPacketHeaderBytes - kHash)));
  }
  return input;
}

}  // namespace hpr::fuzz
