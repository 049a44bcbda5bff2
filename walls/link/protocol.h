#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"

/// What passes between the ranks of a job and the display processes outside it, as bytes.
///
/// Whoever listens greets, whoever connected answers with what it is and what it takes the wall for, and the listener
/// accepts or says why not: three blocks. After them only packets follow. Each has a header with a checksum of its own,
/// so that a damaged payload costs one packet, while a damaged header, whose length cannot be trusted, costs the link.
/// Both ends of a TCP link show that they know the session token without sending it.
namespace hpr {

/// The other end of a link is gone, or sent what it may not send: the link is closed and, by the one who made it, tried
/// again. Not an Error, as it ends no run.
class LinkError : public std::runtime_error {
 public:
  explicit LinkError(const std::string& what, int code = 0) : std::runtime_error(what), code_(code) {}

  /// The system's (errno), where it was the system that failed; else 0.
  [[nodiscard]] int code() const { return code_; }

 private:
  int code_;
};

/// Writes what ByteReader reads: little-endian, packed.
class ByteWriter {
 public:
  void u8(std::uint8_t value) { bytes_.push_back(std::byte{value}); }
  void u32(std::uint32_t value) { number(value, sizeof value); }
  void u64(std::uint64_t value) { number(value, sizeof value); }
  void real(double value) { u64(std::bit_cast<std::uint64_t>(value)); }
  void raw(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  /// Its length and its bytes.
  void text(std::string_view text) {
    u32(static_cast<std::uint32_t>(text.size()));
    raw(std::as_bytes(std::span(text)));
  }
  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }
  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  void number(std::uint64_t value, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) bytes_.push_back(static_cast<std::byte>(value >> (8 * i)));
  }

  std::vector<std::byte> bytes_;
};

/// Reads bytes that came from elsewhere: whatever would reach past their end throws LinkError.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  [[nodiscard]] std::uint8_t u8() { return static_cast<std::uint8_t>(number(1)); }
  [[nodiscard]] std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
  [[nodiscard]] std::uint64_t u64() { return number(8); }
  [[nodiscard]] double real() { return std::bit_cast<double>(u64()); }
  [[nodiscard]] std::span<const std::byte> raw(std::size_t count) {
    if (count > bytes_.size()) throw LinkError("a message ends too early");
    const auto first = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return first;
  }
  /// At most `limit` bytes long.
  [[nodiscard]] std::string text(std::size_t limit) {
    const std::size_t size = u32();
    if (size > limit) throw LinkError("a text is too long");
    const auto bytes = raw(size);
    std::string text(size, '\0');
    if (size > 0) std::memcpy(text.data(), bytes.data(), size);
    return text;
  }
  [[nodiscard]] std::span<const std::byte> rest() const { return bytes_; }
  /// Throws LinkError when bytes are left.
  void finish() const {
    if (!bytes_.empty()) throw LinkError("a message goes on too long");
  }

 private:
  [[nodiscard]] std::uint64_t number(std::size_t count) {
    const auto bytes = raw(count);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value |= std::to_integer<std::uint64_t>(bytes[i]) << (8 * i);
    return value;
  }

  std::span<const std::byte> bytes_;
};

inline constexpr std::size_t kPacketHeaderBytes = 52;
/// Rank 0 pings several times a second: silent for so many seconds, it is dead, or cut off.
inline constexpr double kSilence = 10.0;

using LinkNonce = std::array<std::byte, 16>;
using LinkProof = std::array<std::byte, 32>;

/// A screen as one end of a link knows it.
struct LinkScreen {
  std::string id;
  Size size;  ///< pixels
  bool operator==(const LinkScreen&) const = default;
};

/// What a link is for: the pictures, or the agreement on when they are shown (rank 0 alone).
enum class LinkRole : std::uint8_t { Frames = 0, Swap = 1 };

struct Greeting {
  std::string build;  ///< of the listener
  LinkNonce nonce{};
  bool wants_token = false;
};

struct Hello {
  std::string build;
  LinkRole role = LinkRole::Frames;
  std::string host;  ///< whose screens
  std::uint64_t wall_hash = 0;
  std::uint64_t session = 0;  ///< one start of the job
  std::string run;            ///< a secret of the run, the same for each of its starts
  std::uint32_t start = 0;    ///< how many times the run was started before
  std::uint32_t rank = 0;
  std::vector<LinkScreen> screens;  ///< of the host, in the wall's order
  LinkNonce nonce{};
  LinkProof proof{};  ///< that it knows the token
};

struct Reply {
  bool accepted = false;
  bool busy = false;        ///< refused because another run shows: may be accepted later
  std::string reason = {};  ///< of a refusal, in words for the user
  LinkProof proof{};
};

[[nodiscard]] std::vector<std::byte> encode(const Greeting& greeting);
[[nodiscard]] std::vector<std::byte> encode(const Hello& hello);
[[nodiscard]] std::vector<std::byte> encode(const Reply& reply);

/// The bytes a block takes as soon as `begin`, what has arrived, holds its length; none before. Throws LinkError when
/// this is no block of HPR, or one of another protocol or byte order.
[[nodiscard]] std::optional<std::size_t> block_bytes(std::span<const std::byte> begin);

/// Decode one whole block. All throw LinkError.
[[nodiscard]] Greeting decode_greeting(std::span<const std::byte> block);
[[nodiscard]] Hello decode_hello(std::span<const std::byte> block);
[[nodiscard]] Reply decode_reply(std::span<const std::byte> block);

enum class PacketType : std::uint32_t {
  Frame = 1,      ///< rank -> display: a screen's picture
  Damaged = 2,    ///< display -> rank: that picture arrived damaged
  Ready = 3,      ///< display -> rank 0: that picture can be shown
  Present = 4,    ///< rank 0 -> display: show that frame at `time` of the display's clock
  Presented = 5,  ///< display -> rank 0: it was shown at `time` of the display's clock
  Ping = 6,       ///< rank 0 -> display
  Pong = 7,       ///< display -> rank 0: payload: when the ping came, when this left (display's clock)
  Bye = 8,        ///< rank -> display: the run is over as meant
  NotShown = 9,   ///< display -> rank 0: it could not be shown, and may be later
};

struct PacketHeader {
  PacketType type = PacketType::Ping;
  std::uint32_t screen = 0;  ///< index into Hello::screens
  std::uint64_t frame = 0;   ///< for Ping and Pong: which
  double time = 0.0;         ///< seconds; of a Frame: since 1970, when it was made
  std::uint64_t length = 0;  ///< of the payload, bytes
  std::uint64_t payload_hash = 0;
};

/// The longest payload a screen's picture may have, bytes; longer ones are not even received.
[[nodiscard]] std::size_t max_picture_bytes(Size size);

/// A header and its payload, ready to be sent; fills in length and hash.
[[nodiscard]] std::vector<std::byte> encode_packet(PacketHeader header, std::span<const std::byte> payload = {});

/// `bytes` are kPacketHeaderBytes. Throws LinkError when they are damaged.
[[nodiscard]] PacketHeader decode_header(std::span<const std::byte> bytes);

/// What a display process and a run compare to know that they are of one build.
[[nodiscard]] std::string link_build();

/// The secret that both ends of a TCP link know: HPR_TOKEN; empty where it is not set.
[[nodiscard]] std::string link_token();

/// Random bytes from the system.
[[nodiscard]] LinkNonce make_nonce();

/// A number no other run has.
[[nodiscard]] std::uint64_t make_session();

/// HMAC-SHA256 under the token of who shows it ("run" or "display"), both nonces and what the run says it is.
[[nodiscard]] LinkProof prove_token(const std::string& token, const std::string& who, const LinkNonce& of_display,
                                    const Hello& hello);

/// Takes equally long whatever differs.
[[nodiscard]] bool same_proof(const LinkProof& a, const LinkProof& b);

}  // namespace hpr
