#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"
#include "walls/link/bytes.h"

/// What passes between the ranks of a job and the display processes outside it, as bytes.
///
/// Whoever listens greets, whoever connected answers with what it is and what it takes the wall for, and the listener
/// accepts or says why not: three blocks. After them only packets follow. Each has a header with a checksum of its own,
/// so that a damaged payload costs one packet, while a damaged header, whose length cannot be trusted, costs the link.
namespace hpr {

inline constexpr std::uint32_t kLinkProtocol = 1;
inline constexpr std::size_t kMostBlockBytes = 1 << 20;
inline constexpr std::size_t kPacketHeaderBytes = 52;

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
  std::uint64_t session = 0;  ///< one run of the job
  std::uint32_t rank = 0;
  std::vector<LinkScreen> screens;  ///< of the host, in the wall's order
  LinkNonce nonce{};
  LinkProof proof{};  ///< that it knows the token
};

struct Reply {
  bool accepted = false;
  std::string reason;  ///< of a refusal, in words for the user
  LinkProof proof{};
};

[[nodiscard]] std::vector<std::byte> encode(const Greeting& greeting);
[[nodiscard]] std::vector<std::byte> encode(const Hello& hello);
[[nodiscard]] std::vector<std::byte> encode(const Reply& reply);

/// The bytes a block takes as soon as `begin`, what has arrived, tells; none before. Throws LinkError when this is no
/// block of HPR, or one of another protocol or byte order.
[[nodiscard]] std::optional<std::size_t> block_bytes(std::span<const std::byte> begin);

/// Of one whole block. All throw LinkError.
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
[[nodiscard]] std::size_t longest_picture(Size size);

/// A header and its payload, ready to be sent; fills in length and hash.
[[nodiscard]] std::vector<std::byte> encode_packet(PacketHeader header, std::span<const std::byte> payload = {});

/// `bytes` are kPacketHeaderBytes. Throws LinkError when they are damaged.
[[nodiscard]] PacketHeader decode_header(std::span<const std::byte> bytes);

}  // namespace hpr
