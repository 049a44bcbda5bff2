#include "core/hash.h"

#include <fmt/format.h>
#include <xxhash.h>

namespace hpr {

std::uint64_t xxh64(std::span<const std::byte> bytes) {
  return XXH64(bytes.data(), bytes.size(), 0);
}

std::string hex16(std::uint64_t hash) {
  return fmt::format("{:016x}", hash);
}

ContentHash::ContentHash() : state_(XXH64_createState()) {
  XXH64_reset(static_cast<XXH64_state_t*>(state_.get()), 0);
}

void ContentHash::add(std::span<const std::byte> bytes) {
  XXH64_update(static_cast<XXH64_state_t*>(state_.get()), bytes.data(), bytes.size());
}

std::uint64_t ContentHash::value() const {
  return XXH64_digest(static_cast<const XXH64_state_t*>(state_.get()));
}

void ContentHash::Free::operator()(void* state) const {
  XXH64_freeState(static_cast<XXH64_state_t*>(state));
}

}  // namespace hpr
