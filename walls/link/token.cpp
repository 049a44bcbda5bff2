#include "walls/link/token.h"

#include <fmt/format.h>
#include <hpr/version.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <cstdlib>

#include "core/bytes.h"
#include "core/error.h"

namespace hpr {

std::string link_build() {
  return fmt::format("hpr {} ({})", kVersion, kCommit);
}

std::string link_token() {
  const char* const token = std::getenv("HPR_TOKEN");  // NOLINT(concurrency-mt-unsafe): nobody writes the environment
  return token == nullptr ? "" : token;
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
