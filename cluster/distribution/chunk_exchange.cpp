#include "cluster/distribution/chunk_exchange.h"

#include <cstddef>

#include "cluster/transport/collectives.h"
#include "core/error.h"

namespace hpr {
namespace {

/// Seven bits a byte, the lowest first; the high bit says that more follow (LEB128).
void append_number(std::vector<std::byte>& bytes, std::uint32_t number) {
  for (; number >= 0x80U; number >>= 7U) bytes.push_back(static_cast<std::byte>(number | 0x80U));
  bytes.push_back(static_cast<std::byte>(number));
}

class NumberReader {
 public:
  explicit NumberReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  std::uint32_t next() {
    std::uint32_t number = 0;
    for (unsigned shift = 0;; shift += 7) {
      HPR_CHECK(at_ < bytes_.size() && shift < 32);
      const auto byte = std::to_integer<std::uint32_t>(bytes_[at_++]);
      number |= (byte & 0x7fU) << shift;
      if (byte < 0x80U) return number;
    }
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
};

/// Per screen the number of ranges, then for each the chunks left out before it and those in it.
std::vector<std::byte> encode(const ScreenChunks& chunks) {
  std::vector<std::byte> bytes;
  for (const std::vector<ChunkRange>& ranges : chunks) {
    append_number(bytes, static_cast<std::uint32_t>(ranges.size()));
    std::uint32_t end = 0;
    for (const ChunkRange& range : ranges) {
      append_number(bytes, range.first - end);
      append_number(bytes, range.count());
      end = range.last;
    }
  }
  return bytes;
}

void append_decoded(std::span<const std::byte> bytes, ScreenChunks& chunks) {
  NumberReader reader(bytes);
  for (std::vector<ChunkRange>& ranges : chunks) {
    std::uint32_t end = 0;
    for (std::uint32_t left = reader.next(); left > 0; --left) {
      const std::uint32_t first = end + reader.next();
      end = first + reader.next();
      append_range(ranges, {first, end});
    }
  }
}

}  // namespace

ChunkRange part_of_chunks(std::uint32_t chunks, int rank, int ranks) {
  HPR_CHECK(rank >= 0 && rank < ranks);
  const auto before = [&](int others) {
    return static_cast<std::uint32_t>(std::uint64_t{chunks} * static_cast<std::uint64_t>(others) /
                                      static_cast<std::uint64_t>(ranks));
  };
  return {before(rank), before(rank + 1)};
}

ScreenChunks exchange_chunks(Communicator& comm, std::span<const ScreenChunks> found) {
  HPR_CHECK(found.size() == static_cast<std::size_t>(comm.size()));
  std::vector<std::vector<std::byte>> messages;
  messages.reserve(found.size());
  for (const ScreenChunks& chunks : found) messages.push_back(encode(chunks));
  ScreenChunks mine(found.front().size());
  for (const std::vector<std::byte>& message : all_to_all(comm, std::move(messages))) append_decoded(message, mine);
  return mine;
}

}  // namespace hpr
