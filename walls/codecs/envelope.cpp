#include "walls/codecs/envelope.h"

#include <fmt/format.h>

#include <cstring>

#include "core/bytes.h"
#include "core/error.h"
#include "walls/codecs/coder.h"

namespace hpr {
namespace {

std::uint64_t checksum_of(std::span<const std::byte> bytes) {
  ContentHash hash;
  hash.add(bytes.first(offsetof(Envelope, checksum)));
  hash.add(bytes.subspan(sizeof(Envelope)));
  return hash.value();
}

}  // namespace

void throw_damaged(std::string_view what) {
  throw Error(ExitCode::BadInput, fmt::format("an encoded picture is damaged: {}", what), "have the sender restart");
}

void seal(Envelope& envelope, std::vector<std::byte>& bytes) {
  HPR_CHECK(bytes.size() >= sizeof(Envelope));
  envelope.body_bytes = bytes.size() - sizeof(Envelope);
  std::memcpy(bytes.data(), &envelope, sizeof(Envelope));
  envelope.checksum = checksum_of(bytes);
  std::memcpy(bytes.data(), &envelope, sizeof(Envelope));
}

Opened open_envelope(std::span<const std::byte> bytes, Size size) {
  if (bytes.size() < sizeof(Envelope)) throw_damaged(fmt::format("it has only {} bytes", bytes.size()));
  Envelope envelope;
  std::memcpy(&envelope, bytes.data(), sizeof(Envelope));
  const std::span<const std::byte> body = bytes.subspan(sizeof(Envelope));
  if (envelope.magic != Envelope{}.magic) throw_damaged("it does not begin as one");
  if (envelope.version != Envelope{}.version) {
    throw Error(ExitCode::BadInput, fmt::format("an encoded picture is of version {}, not 1", envelope.version),
                "run the same version of hpr on all hosts");
  }
  if (envelope.body_bytes != body.size()) {
    throw_damaged(fmt::format("{} bytes follow, not {}", body.size(), envelope.body_bytes));
  }
  if (envelope.checksum != checksum_of(bytes)) throw_damaged("its checksum differs");
  if (Size{static_cast<int>(envelope.width), static_cast<int>(envelope.height)} != size) {
    throw Error(ExitCode::BadInput,
                fmt::format("an encoded picture is of {}x{} pixels, but {}x{} are expected", envelope.width,
                            envelope.height, size.width, size.height),
                "use the same wall file on both sides");
  }
  if (envelope.coder >= all_coders().size()) throw_damaged("its codec is unknown");
  return {envelope, body};
}

}  // namespace hpr
